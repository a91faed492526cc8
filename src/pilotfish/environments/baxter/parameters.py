"""Parameters of Baxter's arms: joint placements and limits, masses and inertias.

Source: the manufacturer's published description (URDF) of the Research Robot. Both arms are the same, mounted
on opposite sides.
"""

Triple = tuple[float, float, float]
HALF_PI = 1.5707963267948966  # rad


# In torso axes: x ahead, z up, the origin .93 m above the floor.
MOUNT = (0.024645, 0.219645, 0.118588)  # m, of the left arm; y changes sign for the right arm
MOUNT_YAW = 0.7854  # rad, of the left arm; the right arm has the negative

# Joints are hinges about the z axis of their own frame, which is placed in the frame of the joint before.
JOINT_NAMES = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")  # without the side
JOINT_ORIGINS = (  # m
    (0.055695, 0.0, 0.011038),
    (0.069, 0.0, 0.27035),
    (0.102, 0.0, 0.0),
    (0.069, 0.0, 0.26242),
    (0.10359, 0.0, 0.0),
    (0.01, 0.0, 0.2707),
    (0.115975, 0.0, 0.0),
)
JOINT_ROTATIONS = (  # roll, pitch and yaw [rad]
    (0.0, 0.0, 0.0),
    (-HALF_PI, 0.0, 0.0),
    (HALF_PI, 0.0, HALF_PI),
    (-HALF_PI, -HALF_PI, 0.0),
    (HALF_PI, 0.0, HALF_PI),
    (-HALF_PI, -HALF_PI, 0.0),
    (HALF_PI, 0.0, HALF_PI),
)
LOWER_LIMITS = (-1.70167993878, -2.147, -3.05417993878, -0.05, -3.059, -HALF_PI, -3.059)  # rad
UPPER_LIMITS = (1.70167993878, 1.047, 3.05417993878, 2.618, 3.059, 2.094, 3.059)  # rad
MAX_VELOCITIES = (1.5, 1.5, 1.5, 1.5, 4.0, 4.0, 4.0)  # rad/s
MAX_TORQUES = (50.0, 50.0, 50.0, 50.0, 15.0, 15.0, 15.0)  # N m

# Mass [kg], centre of mass [m], and inertia xx, yy, zz, xy, xz, yz about that centre [kg m^2].
Inertial = tuple[float, Triple, tuple[float, float, float, float, float, float]]
# Of the link that each joint moves, in the frame of the joint.
INERTIALS: tuple[Inertial, ...] = (
    (
        5.70044,
        (0.01783, 0.00086, 0.19127),
        (0.04709102262, 0.03766976455, 0.03595988478, 0.00012787556, 0.00614870039, 0.00078086899),
    ),
    (
        3.22698,
        (0.06845, 0.00269, -0.00529),
        (0.01175209419, 0.0278859752, 0.02078749298, -0.00030096398, 0.00207675762, -0.00018821993),
    ),
    (
        4.31272,
        (-0.00276, 0.00132, 0.18086),
        (0.02661733557, 0.02844355207, 0.01248008322, 0.00029270634, 0.00392189887, 0.0010838933),
    ),
    (
        2.07206,
        (0.02611, 0.00159, -0.01117),
        (0.00711582686, 0.01318227876, 0.00926852064, 0.00036036173, 0.0007459496, -0.00019663418),
    ),
    (
        2.24665,
        (-0.00168, 0.0046, 0.13952),
        (0.01667742825, 0.01675457264, 0.0037463115, 0.00018403705, 0.00018657629, -0.00064732352),
    ),
    (
        1.60979,
        (0.06041, 0.00697, 0.006),
        (0.00387607152, 0.00700537914, 0.0055275524, -0.00044384784, -0.00021115038, 0.00015348067),
    ),
    (
        0.35093,
        (0.00198, 0.00125, 0.01855),
        (0.00025289155, 0.0002688601, 0.0003074118, 0.00000575311, -0.00000159345, -0.00000519818),
    ),
)
HAND_FROM_WRIST = 0.11355  # m along z of the last joint: the mounting face of tools
HAND: Inertial = (
    0.19125,
    (0.01093, 0.00042, -0.01532),
    (0.00017588, 0.00021166377, 0.00023745397, 0.00000147073, 0.0000243633, 0.00000172689),
)
# Springs at Baxter's second joint carry part of the arm's weight. Their stiffness is not published; this one
# carries about half of the weight of the horizontally extended arm.
SPRING_JOINT, SPRING, SPRING_REST = "s1", 12.0, -2.147  # stiffness [N m/rad], rest position [rad]
COVER_RADIUS = 0.06  # m, of the arm's covers
