"""Following a reference at least cost, as in linear quadratic control: systems, feedback and their motion.
`track` has a finite horizon and `regulate` an infinite one; `track_continuous` and `regulate_continuous` are
the same in continuous time; `solve_batch` is one least-squares problem that also knows how motions spread.
"""

from pilotfish.control.batch import BatchSolution, solve_batch
from pilotfish.control.continuous import regulate_continuous, track_continuous
from pilotfish.control.discrete import regulate, track
from pilotfish.control.feedback import ContinuousFeedback, Feedback, Motion
from pilotfish.control.reference import Reference
from pilotfish.control.systems import (
    ContinuousSystem,
    DiscreteSystem,
    LinearSystem,
    VaryingSystem,
    continuous_double_integrator,
    discretise,
    double_integrator,
)

__all__ = [
    "BatchSolution",
    "ContinuousFeedback",
    "ContinuousSystem",
    "DiscreteSystem",
    "Feedback",
    "LinearSystem",
    "Motion",
    "Reference",
    "VaryingSystem",
    "continuous_double_integrator",
    "discretise",
    "double_integrator",
    "regulate",
    "regulate_continuous",
    "solve_batch",
    "track",
    "track_continuous",
]
