"""Multiple linear transforms (MLT): several semi-tied bases, and every state with the one that suits it."""

from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import precision_cholesky
from pilotfish.gaussians.structures.dense import MAX_COUNT, Covariances
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_count

INITIAL_SWEEPS = 10  # of the one transform that a fit begins with


@dataclass(frozen=True, slots=True, eq=False)
class MultipleTransformCovariances:
    """Sigma_k = H diag(variances[k]) H^T,  H being the basis where row k of membership holds its one."""

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


@dataclass(frozen=True, slots=True)
class MLT:
    """Several semi-tied bases; in every M-step each state takes the one under which it is likeliest.

    Neither the choice nor the sweeps lower the likelihood. Simplified: a state chooses a whole basis, as with
    the classes of Gales 1999, never single vectors out of a pool.
    sweeps  passes over the rows of each inverse basis in every M-step, as in SemiTied
    Source: Goel & Gopinath 2001, Multiple linear transforms.
    """

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
            raise InvalidInput(f"{self.label} has more transforms than the {K} states there are")
        if isinstance(previous, MultipleTransformCovariances) and previous.bases.shape == (
            self.transforms,
            D,
            D,
        ):
            B = np.linalg.inv(previous.bases)
        else:
            B = _initial_transforms(counts, sample_covariances, self.transforms)
        B, choice = _assign_transforms(B, counts, sample_covariances)
        for c in range(self.transforms):
            members = choice == c
            B[c] = kernels.semi_tied_sweeps(sample_covariances[members], counts[members], B[c], self.sweeps)
        return _diagonalise(B, choice, sample_covariances)

    def parameter_count(self, states: int, width: int) -> int:
        """C D^2 + K D; which basis a state has is not counted."""
        return self.transforms * width * width + states * width

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """C D fewer than parameters, since variances make up for the length of vectors; no more than full.

        Too many by what a basis has to spare that fewer than two states use.
        """
        free = self.parameter_count(states, width) - self.transforms * width
        return min(free, states * width * (width + 1) // 2)


def _log_likelihoods(B: Float[Array, "C D D"], S: Float[Array, "K D D"]) -> Float[Array, "K C"]:
    """Twice what each state's datapoints have on average under each transform, constants left out."""
    variances = np.stack([((b @ S) * b).sum(axis=2) for b in B], axis=1)  # (K, C, D)
    with np.errstate(divide="ignore"):
        return np.asarray(2.0 * np.linalg.slogdet(B)[1] - np.log(variances).sum(axis=2))


def _assign_transforms(
    B: Float[Array, "C D D"], counts: Float[Array, " K"], S: Float[Array, "K D D"]
) -> tuple[Float[Array, "C D D"], Int[Array, " K"]]:
    """The likeliest transform of every state. One that no state takes begins anew at the state told worst."""
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
    """What every state loses by its best transform against a covariance of its own."""
    members = -np.linalg.slogdet(S)[1]
    return np.asarray(counts * (members - _log_likelihoods(B, S).max(axis=1)))


def _initial_transforms(
    counts: Float[Array, " K"], S: Float[Array, "K D D"], transforms: int
) -> Float[Array, "C D D"]:
    """One transform for all, then, as often as asked, one more that begins at the state told worst."""
    B = kernels.semi_tied_sweeps(S, counts, np.eye(S.shape[1]), INITIAL_SWEEPS)[None]
    while len(B) < transforms:
        worst = int(_likelihood_losses(B, counts, S).argmax())
        B = np.concatenate([B, _initialise_transform(worst, B, counts, S)[None]])
    return B


def _initialise_transform(
    worst: int, B: Float[Array, "C D D"], counts: Float[Array, " K"], S: Float[Array, "K D D"]
) -> Float[Array, "D D"]:
    """Of the transforms that make this state and one other diagonal, the one that helps all states most.

    Two covariances have one basis in common, their generalised eigenvectors; one alone has many.
    """
    W = precision_cholesky(S[[worst]], "the covariance of state")[0]
    pairs = np.linalg.eigh(W @ S @ W.T)[1].transpose(0, 2, 1) @ W  # (K, D, D), a candidate for each partner
    before = _log_likelihoods(B, S).max(axis=1, keepdims=True)
    after = np.maximum(before, _log_likelihoods(pairs, S))  # (K, candidates)
    return np.asarray(pairs[(counts @ after).argmax()])


def _diagonalise(
    B: Float[Array, "C D D"], choice: Int[Array, " K"], S: Float[Array, "K D D"]
) -> MultipleTransformCovariances:
    rows = B[choice]  # (K, D, D)
    variances = np.einsum("kdi,kij,kdj->kd", rows, S, rows, optimize=True)
    return MultipleTransformCovariances(np.linalg.inv(B), variances, np.eye(len(B))[choice])
