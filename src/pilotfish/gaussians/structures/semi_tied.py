"""Semi-tied covariances: one basis of synergies shared by all states, own variances along it."""

from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import precision_cholesky
from pilotfish.gaussians.structures.dense import MAX_COUNT, Covariances
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number, require_type


@dataclass(frozen=True, slots=True, eq=False)
class SemiTiedCovariances:
    """dense = tying H diag(variances) H^T + (1 - tying) samples,  H being the basis.

    Columns of H are the shared directions. Their scale is the estimate's own; only H diag(variances) H^T
    has a meaning by itself.
    """

    basis: Float[Array, "D D"]
    variances: Float[Array, "K D"]
    tying: float
    dense: Float[Array, "K D D"]

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        return precision_cholesky(self.dense, name)


@dataclass(frozen=True, slots=True)
class SemiTied:
    """All states of a frame share their basis vectors H; tying 1 ties fully, 0 not at all.

    sweeps  passes over the rows of H^-1 in every M-step. Each pass raises the likelihood, so few are enough
            inside expectation-maximisation: the next M-step goes on from the same basis.
    Source: Gales 1999, Semi-tied covariance matrices for hidden Markov models; Tanwani 2018, Algorithm 4.
    """

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
        """D^2 + K D when fully tied; below, every sample covariance has its part: K D (D + 1) / 2."""
        return width * width + states * width if self.tying == 1.0 else states * width * (width + 1) // 2

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """D fewer than parameters when fully tied, since variances make up for the length of vectors."""
        full = states * width * (width + 1) // 2
        return min(width * width + (states - 1) * width, full) if self.tying == 1.0 else full


def _initial_transform(previous: Covariances | None, width: int) -> Float[Array, "D D"]:
    if isinstance(previous, SemiTiedCovariances):
        return np.linalg.solve(previous.basis, np.eye(width))
    return np.eye(width)
