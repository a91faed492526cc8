"""Where a robot from a file stands, and which posture it prefers."""

import numpy as np

from pilotfish.control import SerialChain, inverse_kinematics
from pilotfish.environments.robots.robot import IDENTITY, REACH_TOLERANCE
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.kernels import ArmLimits
from pilotfish.types import Array, Float

# Middle of the objects of the tasks, with a tool of 15 cm above them that points down; torso axes.
WORKSPACE = Pose(np.array([0.68, -0.32, 0.25]), np.array([0.0, 0.0, 1.0, 0.0]))
EXTENSION = 0.62  # of the arm's length, from its second joint to the middle of the objects
BASE_HEIGHT = -0.2  # m
STARTS, MAX_ITERATIONS = 16, 80  # of the search for a posture
MARGIN = 0.3  # rad from a joint limit, beyond which a larger distance counts no more
HEIGHT_WEIGHT = 0.5  # 1/m: preference for high joints, so that the elbow is up and off the objects


def base_before_tasks(chain: SerialChain) -> Pose:
    """Return a base from which the objects of the tasks are in the middle of the reach.

    Args:
        chain: Kinematics of the arm, whose base faces x.
    """
    links = [*chain.positions[2:], chain.last_from_tool.position]
    length = float(sum(np.linalg.norm(link) for link in links))
    x, y, _ = WORKSPACE.position
    return Pose(np.array([x - EXTENSION * length, y, BASE_HEIGHT]), IDENTITY)


def comfortable_posture(chain: SerialChain, limits: ArmLimits, name: str) -> Float[Array, " n"]:
    """Return a posture with the hand over the objects, pointing down, far from limits and singularities.

    Args:
        chain: Kinematics from the world to the hand.
        limits: Limits of the joints.
        name: Name of the robot, for messages.

    Raises:
        InvalidInput: If the hand does not get there.
    """
    starts = np.random.default_rng(0).uniform(
        np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi), (STARTS, len(limits.lower))
    )
    found = [
        inverse_kinematics(chain, WORKSPACE, start, limits, max_iterations=MAX_ITERATIONS) for start in starts
    ]
    reached = [q for q, distance, angle, _ in found if max(distance, angle) <= REACH_TOLERANCE]
    if not reached:
        _, distance, angle, _ = min(found, key=lambda solution: solution[1] + solution[2])
        raise InvalidInput(
            f"{name}: the end effector does not reach {WORKSPACE.position.tolist()} m pointing down; the "
            f"nearest posture is {distance:.3g} m and {angle:.3g} rad away; give another base, or an end "
            "effector whose z axis points away from the arm (at least six joints are needed)"
        )
    return max(reached, key=lambda q: _comfort(chain, limits, q))


def _comfort(chain: SerialChain, limits: ArmLimits, q: Float[Array, " n"]) -> float:
    margin = float(np.minimum(q - limits.lower, limits.upper - q).min())
    singular = float(np.linalg.svd(chain.jacobian(q), compute_uv=False)[-1])
    return singular + 0.5 * min(margin, MARGIN) + HEIGHT_WEIGHT * _mean_height(chain, q)


def _mean_height(chain: SerialChain, q: Float[Array, " n"]) -> float:
    """Return the mean height of the joints [m]."""
    origin = Pose(np.zeros(3), IDENTITY)
    heights = []
    for n in range(1, len(q) + 1):
        part = SerialChain(
            chain.world_from_base, chain.positions[:n], chain.quaternions[:n], chain.axes[:n], origin
        )
        heights.append(part.forward_kinematics(q[:n]).position[2])
    return float(np.mean(heights))
