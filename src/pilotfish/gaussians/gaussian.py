"""One normal density and its algebra: affine maps, marginals, conditionals, samples, regions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.types import Array, Bool, Float, Int
from pilotfish.validation import (
    float_array,
    numeric_array,
    require_count,
    require_number,
    require_type,
    short_repr,
)

MAX_SAMPLES, MAX_RADIUS = 10**8, 1e50
LOG_2_PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True, slots=True, eq=False)
class Gaussian:
    """A normal density over R^D. The covariance is symmetric and positive semidefinite."""

    mean: Float[Array, " D"]
    covariance: Float[Array, "D D"]


def cholesky(covariances: Float[Array, "K D D"], name: str = "covariance") -> Float[Array, "K D D"]:
    """Lower factors L with L L^T = covariance.

    Raises: NotPositiveDefinite, naming the first that has none and its smallest eigenvalue.
    """
    covariances = _validate_covariances(covariances)
    try:
        factors = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        raise _not_positive_definite_error(covariances, name) from None
    if not np.isfinite(factors).all():
        raise _not_positive_definite_error(covariances, name)
    return factors


def _not_positive_definite_error(covariances: Float[Array, "K D D"], name: str) -> NotPositiveDefinite:
    for k, covariance in enumerate(covariances):
        if not np.isfinite(covariance).all():
            return NotPositiveDefinite(f"{name} {k} holds values that are not finite")
        values, vectors = np.linalg.eigh(covariance)
        if values[0] <= 1e-15 * abs(values[-1]):
            column = int(np.abs(vectors[:, 0]).argmax())
            return NotPositiveDefinite(
                f"{name} {k} is not positive definite: eigenvalues go from {values[0]:.3g} to "
                f"{values[-1]:.3g}, it is flattest along column {column} (first is 0); "
                "raise the regularisation, drop constant or repeated columns, or give more data"
            )
    return NotPositiveDefinite(
        f"one {name} of {len(covariances)} has no Cholesky factor; raise the regularisation"
    )


def precision_cholesky(covariances: Float[Array, "K D D"], name: str = "covariance") -> Float[Array, "K D D"]:
    """Lower triangular W with W^T W = covariance^-1, so that |W (x - mean)| is the Mahalanobis distance.

    Raises: NotPositiveDefinite, as cholesky does.
    """
    covariances = _validate_covariances(covariances)
    try:
        return kernels.precision_cholesky(covariances)
    except NotPositiveDefinite:
        raise _not_positive_definite_error(covariances, name) from None


def log_density(g: Gaussian, x: Float[Array, "N D"]) -> Float[Array, " N"]:
    """Log N(x_n | mean, covariance) for every row of x: no floor, whatever the scale.

    Raises: NotPositiveDefinite, when the covariance is singular.
    """
    x = _validate_rows(_validate_gaussian(g), x)
    W = precision_cholesky(g.covariance[None])[0]
    distances = np.sum(((x - g.mean) @ W.T) ** 2, axis=1)
    return np.asarray(-0.5 * distances + np.log(np.diag(W)).sum() - 0.5 * g.mean.size * LOG_2_PI)


def affine_transform(g: Gaussian, A: Float[Array, "E D"], b: Float[Array, " E"]) -> Gaussian:
    """The density of A x + b when x has density g."""
    _validate_gaussian(g)
    A, b = float_array(A, "A", g.mean.size), float_array(b, "b")
    if A.ndim != 2 or b.shape != A.shape[:1]:
        raise InvalidInput(f"A has shape {A.shape} and b {b.shape}, expected (E, {g.mean.size}) and (E,)")
    return Gaussian(A @ g.mean + b, _symmetrise(A @ g.covariance @ A.T))


def product(gaussians: Sequence[Gaussian]) -> Gaussian:
    """The normalised product of the densities: every opinion about one x, fused.

    Folded in pairs in the parallel form Sp (Sp + Sq)^-1 Sq, which subtracts nothing: few digits are lost
    when scales differ by many orders, and an opinion may be certain along some directions.
    Raises: NotPositiveDefinite, when two opinions are certain about the same direction.
    Source: Tanwani 2018, equations 3.34-3.35, with the inverse that (3.34) leaves out.
    """
    require_type(gaussians, "gaussians", (list, tuple), "give a list of them")
    if not gaussians:
        raise InvalidInput("a product of no Gaussians was asked for; give at least one")
    if len({_validate_gaussian(g).mean.size for g in gaussians}) > 1:
        raise InvalidInput("the Gaussians have different numbers of columns, expected the same")
    result = gaussians[0]
    for other in gaussians[1:]:
        result = _pair_product(result, other)
    return result


def _pair_product(p: Gaussian, q: Gaussian) -> Gaussian:
    covariance_sum = p.covariance + q.covariance
    cholesky(covariance_sum[None], "the sum of two fused covariances, number")
    gain = np.linalg.solve(covariance_sum, p.covariance).T  # Sp (Sp + Sq)^-1, (D, D)
    return Gaussian(p.mean + gain @ (q.mean - p.mean), _symmetrise(gain @ q.covariance))


def marginal(g: Gaussian, columns: Int[Array, " E"]) -> Gaussian:
    """The density of the chosen columns of x, in the order given."""
    _validate_gaussian(g)
    columns = split_columns(columns, g.mean.size)[0]
    return Gaussian(g.mean[columns], g.covariance[np.ix_(columns, columns)])


def condition(g: Gaussian, columns: Int[Array, " E"], value: Float[Array, " E"]) -> Gaussian:
    """The density of the other columns of x, in their order, once the chosen ones are known to be value.

    Raises: NotPositiveDefinite, when the chosen columns have a singular covariance.
    Source: Bishop 2006, equations 2.81-2.82.
    """
    _validate_gaussian(g)
    columns, rest = split_columns(columns, g.mean.size)
    value = float_array(value, "value", len(columns))
    if value.ndim != 1:
        raise InvalidInput(f"value has shape {value.shape}, expected ({len(columns)},)")
    given_covariance, cross = g.covariance[np.ix_(columns, columns)], g.covariance[np.ix_(columns, rest)]
    cholesky(given_covariance[None], "the covariance of the given columns, number")
    slope = np.linalg.solve(given_covariance, cross).T  # S_rk S_kk^-1, (D - E, E)
    covariance = g.covariance[np.ix_(rest, rest)] - slope @ cross
    return Gaussian(g.mean[rest] + slope @ (value - g.mean[columns]), _symmetrise(covariance))


def split_columns(columns: Int[Array, " E"], width: int) -> tuple[Int[Array, " E"], Int[Array, " R"]]:
    """The same columns counted from the front, and the others.

    Raises: InvalidInput, when one is out of range or given twice.
    """
    require_type(columns, "columns", np.ndarray, "give np.array([...]) of column numbers")
    if columns.ndim != 1 or columns.dtype.kind not in "iu" or np.ma.is_masked(columns):
        raise InvalidInput(f"columns is {short_repr(columns)}, expected an array of whole numbers")
    from_front = np.where(columns < 0, columns + width, columns)
    if from_front.size and not 0 <= from_front.min() <= from_front.max() < width:
        raise InvalidInput(f"columns {columns.tolist()} are not all among the {width} there are")
    if len(np.unique(from_front)) < len(from_front):
        raise InvalidInput(f"columns {columns.tolist()} name one twice")
    return from_front, np.setdiff1d(np.arange(width), from_front)


def sample(g: Gaussian, count: int, rng: np.random.Generator) -> Float[Array, "N D"]:
    """Count independent draws. A singular covariance is allowed: draws then stay on its support."""
    _validate_gaussian(g)
    require_count(count, "count", MAX_SAMPLES)
    require_type(rng, "rng", np.random.Generator, "np.random.default_rng(seed) makes one of a seed")
    values, vectors = np.linalg.eigh(g.covariance)
    spread = vectors * np.sqrt(np.maximum(values, 0.0))  # (D, D), spread spread^T = covariance
    return np.asarray(g.mean + rng.standard_normal((count, g.mean.size)) @ spread.T)


def confidence_radius(width: int, probability: float) -> float:
    """The Mahalanobis radius that holds a draw of a width-dimensional Gaussian with this probability.

    One dimension and .683 give 1; the same ellipsoid holds less in more dimensions.
    """
    require_count(width, "width", MAX_SAMPLES, minimum=1)
    require_type(probability, "probability", (float, int), "give a number between 0 and 1")
    if not 0.0 < probability < 1.0:
        raise InvalidInput(f"probability is {probability}, expected a number between 0 and 1, say .95")
    from scipy.special import gammaincinv  # here, because scipy doubles the time of importing pilotfish

    return float(np.sqrt(2.0 * gammaincinv(0.5 * width, probability)))


def in_confidence_region(g: Gaussian, x: Float[Array, "N D"], probability: float) -> Bool[Array, " N"]:
    """Which rows of x lie in the smallest region that holds a draw of g with this probability."""
    x = _validate_rows(_validate_gaussian(g), x)
    W = precision_cholesky(g.covariance[None])[0]
    radius = confidence_radius(g.mean.size, probability)
    return np.asarray(np.sum(((x - g.mean) @ W.T) ** 2, axis=1) <= radius**2)


def ellipse(g: Gaussian, radius: float, points: int = 60) -> Float[Array, "N 2"]:
    """The closed contour of a planar Gaussian at a Mahalanobis radius (1 is the 1-sigma ellipse)."""
    _validate_gaussian(g)
    require_number(radius, "radius", 0.0, MAX_RADIUS)
    require_count(points, "points", MAX_SAMPLES, minimum=1)
    if g.mean.size != 2:
        raise InvalidInput(
            f"an ellipse needs 2 dimensions, this Gaussian has {g.mean.size}; take a marginal first"
        )
    values, vectors = np.linalg.eigh(g.covariance)
    angles = np.linspace(0.0, 2.0 * np.pi, points)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)  # (N, 2)
    return np.asarray(g.mean + radius * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def _validate_covariances(covariances: object) -> Float[Array, "K D D"]:
    """An array of square matrices, whose numbers may still be not finite: cholesky names the first."""
    same = type(covariances) is np.ndarray and covariances.dtype == np.float64
    array = np.asarray(covariances) if same else numeric_array(covariances, "covariances")
    if array.ndim != 3 or array.shape[1] != array.shape[2]:
        raise InvalidInput(f"covariances has shape {array.shape}, expected (K, D, D)")
    return array


def _validate_gaussian(g: object) -> Gaussian:
    """A Gaussian of finite numbers, or InvalidInput."""
    require_type(g, "g", Gaussian, "Gaussian(mean, covariance) makes one")
    assert isinstance(g, Gaussian)
    mean, covariance = float_array(g.mean, "the mean"), float_array(g.covariance, "the covariance")
    if mean.ndim != 1 or covariance.shape != (len(mean), len(mean)):
        raise InvalidInput(
            f"the mean has shape {mean.shape} and the covariance {covariance.shape}, expected (D,) and (D, D)"
        )
    return g


def _validate_rows(g: Gaussian, x: object) -> Float[Array, "N D"]:
    rows = float_array(x, "x", g.mean.size)
    if rows.ndim != 2:
        raise InvalidInput(f"x has shape {rows.shape}, expected (N, {g.mean.size})")
    return rows


def _symmetrise(covariance: Float[Array, "D D"]) -> Float[Array, "D D"]:
    return np.asarray(0.5 * (covariance + covariance.T))
