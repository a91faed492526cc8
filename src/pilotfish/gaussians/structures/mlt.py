"""Multiple linear transforms (MLT): several semi-tied bases, one of which each state uses."""

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
)
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_count, short_repr, shorten_repr

INITIAL_SWEEPS = 10  # of the initial transform


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class MultipleTransformCovariances(Covariances):
    """Covariances Sigma_k = H diag(variances[k]) H^T, where H is the basis of state k.

    Attributes:
        bases: Bases, with directions as columns.
        variances: Variances of each state along the directions of its basis.
        membership: One-hot rows: which basis each state uses.
    """

    kind: ClassVar[str] = "multiple-transforms"
    bases: Float[Array, "C D D"]
    variances: Float[Array, "K D"]
    membership: Float[Array, "K C"]

    @property
    def dense(self) -> Float[Array, "K D D"]:
        H = self.bases[self.membership.argmax(axis=1)]  # (K, D, D)
        dense = (H * self.variances[:, None, :]) @ H.transpose(0, 2, 1)
        return np.asarray(0.5 * (dense + dense.transpose(0, 2, 1)))

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        return precision_cholesky(self.dense, name)

    def validate_parameters(self, name: str) -> None:
        validate_positive(self.variances, "variances")
        ones = self.membership == 1.0
        if ((self.membership != 0.0) != ones).any() or (ones.sum(axis=1) != 1).any():
            raise InvalidInput(
                f"membership is {short_repr(self.membership.tolist())}, expected one 1 in each row, and 0 "
                "elsewhere"
            )


@dataclass(frozen=True, slots=True)
class MLT(CovarianceStructure):
    """Structure with several semi-tied bases; in every M-step each state chooses the most likely one.

    Neither the choice nor the sweeps lower the likelihood.

    Attributes:
        transforms: Number of bases, at most the number of states.
        sweeps: Passes over the rows of each inverse basis in every M-step, as in SemiTied.

    Source:
        Goel & Gopinath 2001, Multiple linear transforms. Simplified: a state chooses a whole basis, as with
        the classes of Gales 1999, not single vectors from a pool.
    """

    name: ClassVar[str] = "mlt"
    covariances: ClassVar[type[Covariances]] = MultipleTransformCovariances
    transforms: int
    sweeps: int = 2

    def __post_init__(self) -> None:
        for name in ("transforms", "sweeps"):
            require_count(getattr(self, name), name, MAX_COUNT, 1)

    @property
    def label(self) -> str:
        return f"MLT({self.transforms})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> MultipleTransformCovariances:
        K, D = sample_covariances.shape[:2]
        if self.transforms > K:
            raise InvalidInput(f"{self.label} has more transforms than states, expected at most {K}")
        shape = (self.transforms, D, D)
        if isinstance(previous, MultipleTransformCovariances) and previous.bases.shape == shape:
            B = np.linalg.inv(previous.bases)
        else:
            B = _initial_transforms(counts, sample_covariances, self.transforms)
        B, choice = _assign_transforms(B, counts, sample_covariances)
        for c in range(self.transforms):
            members = choice == c
            B[c] = kernels.semi_tied_sweeps(sample_covariances[members], counts[members], B[c], self.sweeps)
        return _diagonalise(B, choice, sample_covariances)

    def parameter_count(self, states: int, width: int) -> int:
        """Return C D^2 + K D; the choice of basis of each state is not counted.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        return self.transforms * width * width + states * width

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """Return C D less than the parameters, at most those of full covariances.

        The variances absorb the lengths of the directions. The number is too large if fewer than two states
        use a basis.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        free = self.parameter_count(states, width) - self.transforms * width
        return min(free, states * width * (width + 1) // 2)


def _log_likelihoods(B: Float[Array, "C D D"], S: Float[Array, "K D D"]) -> Float[Array, "K C"]:
    """Return twice the mean log-likelihood of each state under each transform, up to a constant."""
    variances = np.stack([((b @ S) * b).sum(axis=2) for b in B], axis=1)  # (K, C, D)
    with np.errstate(divide="ignore"):
        return np.asarray(2.0 * np.linalg.slogdet(B)[1] - np.log(variances).sum(axis=2))


def _assign_transforms(
    B: Float[Array, "C D D"], counts: Float[Array, " K"], S: Float[Array, "K D D"]
) -> tuple[Float[Array, "C D D"], Int[Array, " K"]]:
    """Return the most likely transform of every state, after re-initialising unused transforms.

    An unused transform is re-initialised from the state that loses most likelihood.
    """
    B = B.copy()
    choice = _log_likelihoods(B, S).argmax(axis=1)
    while len(unused := np.setdiff1d(np.arange(len(B)), choice)):
        shared = np.bincount(choice, minlength=len(B))[choice] > 1
        worst = int(np.where(shared, _likelihood_losses(B, counts, S), -np.inf).argmax())
        B[unused[0]] = _initialise_transform(worst, B, counts, S)
        choice[worst] = unused[0]
    return B, choice


def _likelihood_losses(
    B: Float[Array, "C D D"], counts: Float[Array, " K"], S: Float[Array, "K D D"]
) -> Float[Array, " K"]:
    """Return what each state loses under its best transform compared with a full covariance."""
    full = -np.linalg.slogdet(S)[1]
    return np.asarray(counts * (full - _log_likelihoods(B, S).max(axis=1)))


def _initial_transforms(
    counts: Float[Array, " K"], S: Float[Array, "K D D"], transforms: int
) -> Float[Array, "C D D"]:
    """Return a shared transform, then add one at a time for the state that loses most likelihood."""
    B = kernels.semi_tied_sweeps(S, counts, np.eye(S.shape[1]), INITIAL_SWEEPS)[None]
    while len(B) < transforms:
        worst = int(_likelihood_losses(B, counts, S).argmax())
        B = np.concatenate([B, _initialise_transform(worst, B, counts, S)[None]])
    return B


def _initialise_transform(
    worst: int, B: Float[Array, "C D D"], counts: Float[Array, " K"], S: Float[Array, "K D D"]
) -> Float[Array, "D D"]:
    """Return the transform that diagonalises this state and another, and helps all states most.

    Two covariances have one basis in common, their generalised eigenvectors; one alone has many.
    """
    W = precision_cholesky(S[[worst]], "the covariance of state")[0]
    pairs = np.linalg.eigh(W @ S @ W.T)[1].transpose(0, 2, 1) @ W  # (K, D, D), one candidate per partner
    before = _log_likelihoods(B, S).max(axis=1, keepdims=True)
    after = np.maximum(before, _log_likelihoods(pairs, S))  # (K, candidates)
    return np.asarray(pairs[(counts @ after).argmax()])


def _diagonalise(
    B: Float[Array, "C D D"], choice: Int[Array, " K"], S: Float[Array, "K D D"]
) -> MultipleTransformCovariances:
    rows = B[choice]  # (K, D, D)
    variances = np.einsum("kdi,kij,kdj->kd", rows, S, rows, optimize=True)
    return MultipleTransformCovariances(np.linalg.inv(B), variances, np.eye(len(B))[choice])
