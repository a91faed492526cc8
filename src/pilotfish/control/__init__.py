"""Control: linear quadratic tracking (LQT) and regulation (LQR), impedance control, and arm kinematics.

`track` solves LQT over a finite horizon and `lqr` over an infinite one; `track_continuous` and
`lqr_continuous` do so in continuous time. `solve_batch` solves LQT as one least-squares problem and also
gives the covariance of the motion. `impedance_torque` holds the tool of an arm by springs and dampers;
`SerialChain` describes the kinematics of an arm. States, limits and commands of an arm are types of
`pilotfish.kernels`.
"""

from pilotfish.control.batch import solve_batch
from pilotfish.control.continuous import lqr_continuous, track_continuous
from pilotfish.control.discrete import lqr, track
from pilotfish.control.feedback import Feedback, Motion
from pilotfish.control.impedance import arm_limits, impedance, impedance_torque, posture_torque
from pilotfish.control.inverse_kinematics import inverse_kinematics
from pilotfish.control.reference import Reference
from pilotfish.control.serial_chain import SerialChain
from pilotfish.control.systems import (
    ContinuousSystem,
    LinearSystem,
    TimeVaryingSystem,
    continuous_double_integrator,
    discretise,
    double_integrator,
)

__all__ = [
    "ContinuousSystem",
    "Feedback",
    "LinearSystem",
    "Motion",
    "Reference",
    "SerialChain",
    "TimeVaryingSystem",
    "arm_limits",
    "continuous_double_integrator",
    "discretise",
    "double_integrator",
    "impedance",
    "impedance_torque",
    "inverse_kinematics",
    "lqr",
    "lqr_continuous",
    "posture_torque",
    "solve_batch",
    "track",
    "track_continuous",
]
