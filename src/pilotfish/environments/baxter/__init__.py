"""Baxter, the two-armed research robot: kinematic chains, MuJoCo model, tools and visual meshes."""

from pilotfish.environments.baxter.chain import arm_chain, baxter_limits, solve_posture
from pilotfish.environments.baxter.visual_meshes import VisualMesh

__all__ = ["VisualMesh", "arm_chain", "baxter_limits", "solve_posture"]
