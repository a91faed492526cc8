"""Following a reference at least cost, as in linear quadratic control: systems, feedback and their motion.
`track` has a finite horizon and `regulate` an infinite one; `track_continuous` and `regulate_continuous` are
the same in continuous time; `solve_batch` is one least-squares problem that also knows how motions spread.
`impedance_torque` holds an arm's tool by springs and dampers, `SerialChain` is the arm without its masses.
"""

from pilotfish.control.arm_validation import arm_limits, impedance
from pilotfish.control.arms import impedance_torque, posture_torque
from pilotfish.control.batch import BatchSolution, solve_batch
from pilotfish.control.chains import SerialChain, forward_kinematics, jacobian, tool_poses
from pilotfish.control.continuous import lqr_continuous, track_continuous
from pilotfish.control.discrete import lqr, track
from pilotfish.control.feedback import ContinuousFeedback, Feedback, Motion
from pilotfish.control.reach import InverseKinematicsResult, inverse_kinematics
from pilotfish.control.reference import Reference
from pilotfish.control.systems import (
    ContinuousSystem,
    DiscreteSystem,
    LinearSystem,
    TimeVaryingSystem,
    continuous_double_integrator,
    discretise,
    double_integrator,
)
from pilotfish.kernels import ArmCommand, ArmLimits, ArmState, ImpedanceParameters, ToolTarget

__all__ = [
    "ArmCommand",
    "ArmLimits",
    "ArmState",
    "BatchSolution",
    "ContinuousFeedback",
    "ContinuousSystem",
    "DiscreteSystem",
    "Feedback",
    "ImpedanceParameters",
    "InverseKinematicsResult",
    "LinearSystem",
    "Motion",
    "Reference",
    "SerialChain",
    "TimeVaryingSystem",
    "ToolTarget",
    "arm_limits",
    "continuous_double_integrator",
    "discretise",
    "double_integrator",
    "forward_kinematics",
    "impedance",
    "impedance_torque",
    "inverse_kinematics",
    "jacobian",
    "lqr",
    "lqr_continuous",
    "posture_torque",
    "solve_batch",
    "tool_poses",
    "track",
    "track_continuous",
]
