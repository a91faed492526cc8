"""Gaussians and their algebra: densities, products, conditionals, sufficient statistics and regression.

Covariance structures are in `gaussians.structures`.
"""

from pilotfish.gaussians import structures
from pilotfish.gaussians.conditional import ConditionalGaussians, conditional_gaussians, log_input_densities
from pilotfish.gaussians.gaussian import (
    Gaussian,
    affine_transform,
    cholesky,
    condition,
    confidence_radius,
    ellipse,
    in_confidence_region,
    log_density,
    marginal,
    precision_cholesky,
    product,
    sample,
)
from pilotfish.gaussians.moments import Moments, moments, moments_from_sums
from pilotfish.gaussians.regression import (
    GaussianMixture,
    GaussianRegression,
    regress,
    regress_means,
    regress_with_responsibilities,
)
from pilotfish.gaussians.riemannian import (
    RiemannianGaussian,
    riemannian_log_density,
    riemannian_product,
    tangent_gaussian,
)
from pilotfish.gaussians.tangent_moments import TangentMoments, tangent_moments

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
    "confidence_radius",
    "ellipse",
    "in_confidence_region",
    "log_density",
    "log_input_densities",
    "marginal",
    "moments",
    "moments_from_sums",
    "precision_cholesky",
    "product",
    "regress",
    "regress_means",
    "regress_with_responsibilities",
    "riemannian_log_density",
    "riemannian_product",
    "sample",
    "structures",
    "tangent_gaussian",
    "tangent_moments",
]
