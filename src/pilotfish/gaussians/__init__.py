"""Gaussians and their algebra: densities, products, conditionals, sufficient statistics that add exactly,
covariance structures, and regression with mixtures.
"""

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
from pilotfish.gaussians.mixture import GaussianMixture
from pilotfish.gaussians.moments import Moments, moments, moments_from_sums
from pilotfish.gaussians.regression import (
    ConditionalGaussians,
    GaussianRegression,
    conditional_gaussians,
    log_input_densities,
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
from pilotfish.gaussians.riemannian_regression import (
    RiemannianConditionalGaussians,
    RiemannianRegression,
    riemannian_conditional_gaussians,
    riemannian_log_input_densities,
    riemannian_regress_with_responsibilities,
)
from pilotfish.gaussians.structures.dense import (
    Covariances,
    CovarianceStructure,
    DenseCovariances,
    Diagonal,
    Full,
    Spherical,
    component_correlation,
)
from pilotfish.gaussians.structures.emllt import EMLLT, ExpandedPrecisions
from pilotfish.gaussians.structures.factor_analysers import MFA, MPPCA
from pilotfish.gaussians.structures.hddc import HDDC, HDDCExplainedVariance
from pilotfish.gaussians.structures.latent import LatentCovariances, principal_components
from pilotfish.gaussians.structures.mlt import MLT, MultipleTransformCovariances
from pilotfish.gaussians.structures.semi_tied import SemiTied, SemiTiedCovariances
from pilotfish.gaussians.tangent_moments import TangentMoments, tangent_moments

__all__ = [
    "EMLLT",
    "HDDC",
    "MFA",
    "MLT",
    "MPPCA",
    "ConditionalGaussians",
    "CovarianceStructure",
    "Covariances",
    "DenseCovariances",
    "Diagonal",
    "ExpandedPrecisions",
    "Full",
    "Gaussian",
    "GaussianMixture",
    "GaussianRegression",
    "HDDCExplainedVariance",
    "LatentCovariances",
    "Moments",
    "MultipleTransformCovariances",
    "RiemannianConditionalGaussians",
    "RiemannianGaussian",
    "RiemannianRegression",
    "SemiTied",
    "SemiTiedCovariances",
    "Spherical",
    "TangentMoments",
    "affine_transform",
    "cholesky",
    "component_correlation",
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
    "principal_components",
    "product",
    "regress",
    "regress_means",
    "regress_with_responsibilities",
    "riemannian_conditional_gaussians",
    "riemannian_log_density",
    "riemannian_log_input_densities",
    "riemannian_product",
    "riemannian_regress_with_responsibilities",
    "sample",
    "tangent_gaussian",
    "tangent_moments",
]
