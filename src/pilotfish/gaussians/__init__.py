"""Gaussians and their algebra: densities, products, conditionals, sufficient statistics that add exactly,
covariance structures, and regression with mixtures.
"""

from pilotfish.gaussians.emllt import EMLLT, ExpandedPrecisions
from pilotfish.gaussians.factor_analysers import MFA, MPPCA
from pilotfish.gaussians.gaussian import (
    Gaussian,
    cholesky,
    condition,
    confidence_radius,
    ellipse,
    inside,
    log_density,
    marginal,
    product,
    sample,
    transform,
    whiteners,
)
from pilotfish.gaussians.hddc import HDDC, HDDCShare
from pilotfish.gaussians.latent import LatentCovariances, principal_components
from pilotfish.gaussians.mixture import Mixture
from pilotfish.gaussians.mlt import MLT, MultipleTransformCovariances
from pilotfish.gaussians.moments import Moments, moments, moments_about
from pilotfish.gaussians.regression import (
    Conditionals,
    Regression,
    conditionals,
    log_input_densities,
    regress,
    regress_means,
    regress_shared,
)
from pilotfish.gaussians.riemannian import (
    RiemannianGaussian,
    riemannian_log_density,
    riemannian_product,
    seen_at,
)
from pilotfish.gaussians.riemannian_regression import (
    RiemannianConditionals,
    RiemannianRegression,
    riemannian_conditionals,
    riemannian_log_input_densities,
    riemannian_regress_shared,
)
from pilotfish.gaussians.semi_tied import SemiTied, SemiTiedCovariances
from pilotfish.gaussians.structures import (
    Covariances,
    DenseCovariances,
    Diagonal,
    Full,
    Spherical,
    Structure,
    component_correlation,
)
from pilotfish.gaussians.tangent_moments import TangentMoments, tangent_moments

__all__ = [
    "EMLLT",
    "HDDC",
    "MFA",
    "MLT",
    "MPPCA",
    "Conditionals",
    "Covariances",
    "DenseCovariances",
    "Diagonal",
    "ExpandedPrecisions",
    "Full",
    "Gaussian",
    "HDDCShare",
    "LatentCovariances",
    "Mixture",
    "Moments",
    "MultipleTransformCovariances",
    "Regression",
    "RiemannianConditionals",
    "RiemannianGaussian",
    "RiemannianRegression",
    "SemiTied",
    "SemiTiedCovariances",
    "Spherical",
    "Structure",
    "TangentMoments",
    "cholesky",
    "component_correlation",
    "condition",
    "conditionals",
    "confidence_radius",
    "ellipse",
    "inside",
    "log_density",
    "log_input_densities",
    "marginal",
    "moments",
    "moments_about",
    "principal_components",
    "product",
    "regress",
    "regress_means",
    "regress_shared",
    "riemannian_conditionals",
    "riemannian_log_density",
    "riemannian_log_input_densities",
    "riemannian_product",
    "riemannian_regress_shared",
    "sample",
    "seen_at",
    "tangent_moments",
    "transform",
    "whiteners",
]
