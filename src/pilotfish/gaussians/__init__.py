"""Gaussians and their algebra: densities, products, conditionals, sufficient statistics and regression.

Covariance structures are in `gaussians.structures`.
"""

from pilotfish.gaussians import structures
from pilotfish.gaussians.conditional import ConditionalGaussians, conditional_gaussians
from pilotfish.gaussians.gaussian import (
    Gaussian,
    affine_transform,
    cholesky,
    condition,
    log_density,
    marginal,
    precision_cholesky,
    product,
    sample,
)
from pilotfish.gaussians.moments import Moments
from pilotfish.gaussians.regression import (
    GaussianMixture,
    GaussianRegression,
    regress_with_responsibilities,
)
from pilotfish.gaussians.riemannian import (
    RiemannianGaussian,
)
from pilotfish.gaussians.tangent_moments import TangentMoments

__all__ = [
    "ConditionalGaussians",
    "Gaussian",
    "GaussianMixture",
    "GaussianRegression",
    "Moments",
    "RiemannianGaussian",
    "TangentMoments",
    "affine_transform",
    "cholesky",
    "condition",
    "conditional_gaussians",
    "log_density",
    "marginal",
    "precision_cholesky",
    "product",
    "regress_with_responsibilities",
    "sample",
    "structures",
]
