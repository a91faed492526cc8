"""Infinite-horizon LQR of a double integrator towards a Gaussian, with the gain in closed form.

With A = [[I, h I], [0, I]], B = [h^2 / 2 I; h I], the weight Q = blkdiag(Sigma^-1, 0) and R = r I, the
problem splits along the eigenvectors of Sigma. For an eigenvalue q of Sigma^-1, the transfer function from
input to position is G(z) = h^2 / 2 (z + 1) / (z - 1)^2. The closed-loop poles are the roots inside the unit
circle of

    r + q G(z) G(1 / z) = 0.

With s = 2 - z - 1 / z this is s^2 - c s + 4 c = 0, c = q h^4 / (4 r). Each root s gives u = 1 - z from
u = s / 2 + sqrt(s^2 / 4 - s), of the sign for which |1 - u| < 1. Comparing the characteristic polynomial of
A - B K with (z - z_1)(z - z_2) gives

    K_position = u_1 u_2 / h^2,    K_velocity = (2 (u_1 + u_2) - u_1 u_2) / (2 h).

Source: Tanwani 2018, section 6.3.2, which solves the Riccati equation by eigendecomposition.
"""

import numpy as np

from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_period


def lqr_gains(
    weight: Float[Array, "E E"], control_cost: float, period: float
) -> tuple[Float[Array, "E E"], Float[Array, "E E"]]:
    """Return the gains of position and velocity of the infinite-horizon LQR.

    Args:
        weight: Sigma^-1, symmetric positive definite.
        control_cost: r, the cost of squared acceleration.
        period: Time of a step h [s].

    Returns:
        K_position and K_velocity with u = -K_position e - K_velocity v, e the deviation from the mean.

    Raises:
        InvalidInput: If control_cost or period is not positive.
    """
    r, h = require_number(control_cost, "control_cost", 1e-50), require_period(period)
    values, vectors = np.linalg.eigh(weight)
    c = np.maximum(values, 0.0) * h**4 / (4.0 * r)
    first = 0.5 * (c + np.sqrt((c * (c - 16.0)).astype(complex)))
    second = np.divide(4.0 * c, first, out=np.zeros_like(first), where=first != 0.0)
    u, w = _inside(first), _inside(second)
    position, velocity = (u * w).real / h**2, (2.0 * (u + w) - u * w).real / (2.0 * h)
    return (vectors * position) @ vectors.T, (vectors * velocity) @ vectors.T


def _inside(s: Array) -> Array:
    """Return the complex u = 1 - z of each pole z inside the unit circle."""
    root = np.sqrt(0.25 * s * s - s)
    u = 0.5 * s + root
    return np.asarray(np.where(np.abs(1.0 - u) < 1.0, u, 0.5 * s - root))
