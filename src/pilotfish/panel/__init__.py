"""Web page with demonstrations and a skill in space, where objects are dragged and the motion follows.

`view_content` checks what is displayed, `compute_reproduction` computes the motion for frames, and `serve`
opens the page. What the page draws are values without a browser, in `scene_values.py` and `readouts.py`; only
`page.py` and `server.py` use viser.
"""

from pilotfish.panel.content import Situation, ViewContent, view_content
from pilotfish.panel.frame_motions import frame_pose, move_frame
from pilotfish.panel.live_reproduction import LiveReproduction, compute_reproduction, reproduction_notes
from pilotfish.panel.server import is_loopback, serve

__all__ = [
    "LiveReproduction",
    "Situation",
    "ViewContent",
    "compute_reproduction",
    "frame_pose",
    "is_loopback",
    "move_frame",
    "reproduction_notes",
    "serve",
    "view_content",
]
