"""Pictures of demonstrations, skills and motions: values in, a matplotlib figure out, one function a picture.
Nothing is shown or saved here; `figure.savefig(path)` does.
"""

from pilotfish.plots.coordinates import tracked_coordinates
from pilotfish.plots.evolution import forward_variable
from pilotfish.plots.gains import gains
from pilotfish.plots.graph import state_graph
from pilotfish.plots.growth import growth
from pilotfish.plots.matrices import basis_vectors, component_correlations
from pilotfish.plots.passing import via_points
from pilotfish.plots.precision import deviations
from pilotfish.plots.relevant import frame_relevance
from pilotfish.plots.replay import reproduction
from pilotfish.plots.seen import demonstrations_seen
from pilotfish.plots.sizes import model_sizes
from pilotfish.plots.style import MOST_STATES, state_colour
from pilotfish.plots.trace import likelihood_trace

__all__ = [
    "MOST_STATES",
    "basis_vectors",
    "component_correlations",
    "demonstrations_seen",
    "deviations",
    "forward_variable",
    "frame_relevance",
    "gains",
    "growth",
    "likelihood_trace",
    "model_sizes",
    "reproduction",
    "state_colour",
    "state_graph",
    "tracked_coordinates",
    "via_points",
]
