"""Covariance structures: how the covariances of all states are parameterised and shared."""

from pilotfish.gaussians.structures.dense import (
    Covariances,
    CovarianceStructure,
    DenseCovariances,
    Diagonal,
    Full,
    Spherical,
)
from pilotfish.gaussians.structures.emllt import EMLLT, ExpandedPrecisions
from pilotfish.gaussians.structures.factor_analysers import MFA, MPPCA
from pilotfish.gaussians.structures.hddc import HDDC, HDDCExplainedVariance
from pilotfish.gaussians.structures.latent import LatentCovariances
from pilotfish.gaussians.structures.mlt import MLT, MultipleTransformCovariances
from pilotfish.gaussians.structures.semi_tied import SemiTied, SemiTiedCovariances

__all__ = [
    "EMLLT",
    "HDDC",
    "MFA",
    "MLT",
    "MPPCA",
    "CovarianceStructure",
    "Covariances",
    "DenseCovariances",
    "Diagonal",
    "ExpandedPrecisions",
    "Full",
    "HDDCExplainedVariance",
    "LatentCovariances",
    "MultipleTransformCovariances",
    "SemiTied",
    "SemiTiedCovariances",
    "Spherical",
]
