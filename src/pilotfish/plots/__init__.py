"""Plots of demonstrations, skills and motions: each function returns a matplotlib figure.

Nothing is displayed or saved; call `figure.savefig(path)`.
"""

from pilotfish.plots.demonstrations_in_frames import demonstrations_in_frames
from pilotfish.plots.ellipses import draw_ellipses
from pilotfish.plots.feedback_gains import feedback_gains
from pilotfish.plots.forward_variable import forward_variable
from pilotfish.plots.frame_relevance import frame_relevance
from pilotfish.plots.likelihood_trace import likelihood_trace
from pilotfish.plots.matrices import basis_vectors, covariance_correlations
from pilotfish.plots.model_selection import model_selection
from pilotfish.plots.online_clusters import online_clusters
from pilotfish.plots.reproduction import reproduction
from pilotfish.plots.reproduction_selection import reproduction_selection
from pilotfish.plots.state_deviations import state_deviations
from pilotfish.plots.state_graph import state_graph
from pilotfish.plots.style import state_colour
from pilotfish.plots.tracked_coordinates import tracked_coordinates
from pilotfish.plots.via_points import via_points

__all__ = [
    "basis_vectors",
    "covariance_correlations",
    "demonstrations_in_frames",
    "draw_ellipses",
    "feedback_gains",
    "forward_variable",
    "frame_relevance",
    "likelihood_trace",
    "model_selection",
    "online_clusters",
    "reproduction",
    "reproduction_selection",
    "state_colour",
    "state_deviations",
    "state_graph",
    "tracked_coordinates",
    "via_points",
]
