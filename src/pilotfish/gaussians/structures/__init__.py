"""Covariance structures: how the covariances of all states are parameterised and shared."""

from pilotfish.gaussians.structures.dense import (
    DenseCovariances,
    Diagonal,
    Full,
    Spherical,
    component_correlation,
)
from pilotfish.gaussians.structures.emllt import EMLLT, ExpandedPrecisions
from pilotfish.gaussians.structures.factor_analysers import MFA, MPPCA
from pilotfish.gaussians.structures.hddc import HDDC
from pilotfish.gaussians.structures.latent import LatentCovariances
from pilotfish.gaussians.structures.mlt import MLT, MultipleTransformCovariances
from pilotfish.gaussians.structures.registry import COVARIANCE_KINDS, STRUCTURES
from pilotfish.gaussians.structures.semi_tied import SemiTied, SemiTiedCovariances
from pilotfish.gaussians.structures.structure import Covariances, CovarianceStructure

__all__ = [
    "COVARIANCE_KINDS",
    "EMLLT",
    "HDDC",
    "MFA",
    "MLT",
    "MPPCA",
    "STRUCTURES",
    "CovarianceStructure",
    "Covariances",
    "DenseCovariances",
    "Diagonal",
    "ExpandedPrecisions",
    "Full",
    "LatentCovariances",
    "MultipleTransformCovariances",
    "SemiTied",
    "SemiTiedCovariances",
    "Spherical",
    "component_correlation",
]
