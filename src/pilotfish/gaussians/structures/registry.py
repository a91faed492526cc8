"""Covariance structures by name; the command line and the file format are derived from these tables."""

from pilotfish.gaussians.structures.dense import Diagonal, Full, Spherical
from pilotfish.gaussians.structures.emllt import EMLLT
from pilotfish.gaussians.structures.factor_analysers import MFA, MPPCA
from pilotfish.gaussians.structures.hddc import HDDC
from pilotfish.gaussians.structures.mlt import MLT
from pilotfish.gaussians.structures.semi_tied import SemiTied
from pilotfish.gaussians.structures.structure import Covariances, CovarianceStructure

STRUCTURES: dict[str, type[CovarianceStructure]] = {
    structure.name: structure
    for structure in (Full, Diagonal, Spherical, SemiTied, MFA, MPPCA, HDDC, EMLLT, MLT)
}
COVARIANCE_KINDS: dict[str, type[Covariances]] = {
    structure.covariances.kind: structure.covariances for structure in STRUCTURES.values()
}
