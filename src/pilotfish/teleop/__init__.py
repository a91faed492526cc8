"""Operator and robot at two sites: messages, session, and one step of each site as a pure function.

The package has no sockets, clocks or files. `messages` are values; `codec` and `seal` turn them into
datagrams. `step_robot` and `step_operator` are the two sites.
"""

from pilotfish.teleop.virtual_clock import VirtualClock
from pilotfish.teleop.virtual_link import LinkCounters, LinkSettings, VirtualLink, two_way_link

__all__ = [
    "LinkCounters",
    "LinkSettings",
    "VirtualClock",
    "VirtualLink",
    "two_way_link",
]
