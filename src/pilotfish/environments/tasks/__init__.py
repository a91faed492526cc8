"""Manipulation tasks, each a value: objects in the workcell, situations, test of success and demonstration.

A new task is one file here and one entry in registry.py. The module `plate` is public for its levels.
"""

from pilotfish.environments.tasks import plate

__all__ = ["plate"]
