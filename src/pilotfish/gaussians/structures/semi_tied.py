"""Semi-tied covariances: a basis shared by all states, and variances of each state along it.

Sigma_k = H diag(variances_k) H^T. The columns of H are directions in which the columns of the data vary
together (synergies). B = H^-1 is estimated by the row-wise ascent of Gales in `kernels.semi_tied_sweeps`.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import precision_cholesky
from pilotfish.gaussians.structures.structure import (
    MAX_COUNT,
    Covariances,
    CovarianceStructure,
    validate_positive,
    validate_symmetry,
)
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number, require_type, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class SemiTiedCovariances(Covariances):
    """Covariances dense = tying H diag(variances) H^T + (1 - tying) sample covariance, with H = basis.

    Attributes:
        basis: Shared directions as columns. Their lengths are arbitrary: only H diag(variances) H^T is
            determined by the data.
        variances: Variances of each state along the directions.
        tying: Tying factor, from 0 to 1.
        dense: Symmetric positive definite matrices.
    """

    kind: ClassVar[str] = "semi-tied"
    basis: Float[Array, "D D"]
    variances: Float[Array, "K D"]
    tying: float
    dense: Float[Array, "K D D"]

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        return precision_cholesky(self.dense, name)

    def validate_parameters(self, name: str) -> None:
        validate_symmetry(self.dense, name)
        if not 0.0 <= self.tying <= 1.0:
            raise InvalidInput(f"tying is {self.tying}, expected a number from 0 to 1")
        validate_positive(self.variances, "variances")


@dataclass(frozen=True, slots=True)
class SemiTied(CovarianceStructure):
    """Structure in which all states of a frame share the basis vectors H.

    Attributes:
        tying: Tying factor, from 0 (full covariances) to 1 (fully tied).
        sweeps: Passes over the rows of H^-1 in every M-step. Each pass raises the likelihood and the next
            M-step continues from the same basis, so that few are enough.

    Source:
        Gales 1999, Semi-tied covariance matrices for hidden Markov models; Tanwani 2018, Algorithm 4.
    """

    name: ClassVar[str] = "semi-tied"
    covariances: ClassVar[type[Covariances]] = SemiTiedCovariances
    tying: float = 1.0
    sweeps: int = 2

    def __post_init__(self) -> None:
        require_type(self.tying, "tying", (float, int), "give a number from 0 (free) to 1 (fully tied)")
        if not 0.0 <= require_number(self.tying, "tying") <= 1.0:
            raise InvalidInput(f"tying is {self.tying}, expected a number from 0 (free) to 1 (fully tied)")
        require_count(self.sweeps, "sweeps", MAX_COUNT, 1)

    @property
    def label(self) -> str:
        return f"semi-tied({self.tying:g})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> SemiTiedCovariances:
        B = _initial_transform(previous, sample_covariances.shape[-1])
        B = kernels.semi_tied_sweeps(sample_covariances, counts, B, self.sweeps)
        H = np.linalg.solve(B, np.eye(len(B)))
        variances = np.einsum("di,kij,dj->kd", B, sample_covariances, B, optimize=True)  # diag(B S_i B^T)
        tied = np.einsum("id,kd,jd->kij", H, variances, H, optimize=True)
        dense = self.tying * tied + (1.0 - self.tying) * sample_covariances
        return SemiTiedCovariances(H, variances, self.tying, 0.5 * (dense + dense.transpose(0, 2, 1)))

    def parameter_count(self, states: int, width: int) -> int:
        """Return D^2 + K D if fully tied, else K D (D + 1) / 2: the sample covariances have a part.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        return width * width + states * width if self.tying == 1.0 else states * width * (width + 1) // 2

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """Return D less than the parameters if fully tied: variances absorb the lengths of directions.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        full = states * width * (width + 1) // 2
        return min(width * width + (states - 1) * width, full) if self.tying == 1.0 else full


def _initial_transform(previous: Covariances | None, width: int) -> Float[Array, "D D"]:
    if isinstance(previous, SemiTiedCovariances):
        return np.linalg.solve(previous.basis, np.eye(width))
    return np.eye(width)
