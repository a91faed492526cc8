"""Weighted Gaussians."""

from dataclasses import dataclass

from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class GaussianMixture:
    """K Gaussians and how often each speaks; the weights sum to one."""

    weights: Float[Array, " K"]
    means: Float[Array, "K D"]
    covariances: Float[Array, "K D D"]
