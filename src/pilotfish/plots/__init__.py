"""Pictures of demonstrations, skills and motions: values in, a matplotlib figure out, one function a picture.
Nothing is shown or saved here; `figure.savefig(path)` does.
"""

from pilotfish.plots.coordinates import tracked_coordinates
from pilotfish.plots.evolution import forward_variable
from pilotfish.plots.gains import feedback_gains
from pilotfish.plots.graph import state_graph
from pilotfish.plots.growth import online_clusters
from pilotfish.plots.matrices import basis_vectors, covariance_correlations
from pilotfish.plots.passing import via_points
from pilotfish.plots.precision import state_deviations
from pilotfish.plots.relevant import frame_relevance
from pilotfish.plots.replay import reproduction
from pilotfish.plots.seen import demonstrations_in_frames
from pilotfish.plots.sizes import model_selection
from pilotfish.plots.style import MAX_STATES, state_colour
from pilotfish.plots.trace import likelihood_trace

__all__ = [
    "MAX_STATES",
    "basis_vectors",
    "covariance_correlations",
    "demonstrations_in_frames",
    "feedback_gains",
    "forward_variable",
    "frame_relevance",
    "likelihood_trace",
    "model_selection",
    "online_clusters",
    "reproduction",
    "state_colour",
    "state_deviations",
    "state_graph",
    "tracked_coordinates",
    "via_points",
]
