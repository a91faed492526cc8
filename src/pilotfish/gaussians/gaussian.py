"""Gaussian density: log-density, products, marginals, conditionals, samples and confidence regions."""

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
    shorten_repr,
)

MAX_SAMPLES, MAX_RADIUS = 10**8, 1e50
LOG_2_PI = float(np.log(2.0 * np.pi))


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Gaussian:
    """Gaussian density on R^D.

    Attributes:
        mean: Mean.
        covariance: Symmetric positive semidefinite covariance.
    """

    mean: Float[Array, " D"]
    covariance: Float[Array, "D D"]

    def in_confidence_region(self, x: Float[Array, "N D"], probability: float) -> Bool[Array, " N"]:
        """Return which rows of x lie in the smallest region with a given probability.

        Args:
            x: Points.
            probability: Probability of the region, between 0 and 1.

        Raises:
            NotPositiveDefinite: If the covariance is singular.
        """
        x = _validate_rows(_validate_gaussian(self), x)
        W = precision_cholesky(self.covariance[None])[0]
        radius = confidence_radius(self.mean.size, probability)
        return np.asarray(np.sum(((x - self.mean) @ W.T) ** 2, axis=1) <= radius**2)

    def ellipse(self, radius: float, points: int = 60) -> Float[Array, "N 2"]:
        """Return points on the closed contour of a planar Gaussian at a Mahalanobis radius.

        Args:
            radius: Mahalanobis radius; 1 gives the 1-sigma ellipse.
            points: Number of points.

        Raises:
            InvalidInput: If it has other than two dimensions or an argument is invalid.
        """
        _validate_gaussian(self)
        require_number(radius, "radius", 0.0, MAX_RADIUS)
        require_count(points, "points", MAX_SAMPLES, minimum=1)
        if self.mean.size != 2:
            raise InvalidInput(f"g has {self.mean.size} dimensions, expected 2; take a marginal first")
        values, vectors = np.linalg.eigh(self.covariance)
        angles = np.linspace(0.0, 2.0 * np.pi, points)
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)  # (N, 2)
        return np.asarray(self.mean + radius * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def cholesky(covariances: Float[Array, "K D D"], name: str = "covariance") -> Float[Array, "K D D"]:
    """Return the lower triangular factors L with L L^T = covariance.

    Args:
        covariances: Covariances.
        name: What they are; the error message begins with it.

    Raises:
        NotPositiveDefinite: If a covariance has no factor; the message gives the index of the first and its
            smallest eigenvalue.
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
            return NotPositiveDefinite(f"{name} {k} has values that are not finite")
        values, vectors = np.linalg.eigh(covariance)
        if values[0] <= 1e-15 * abs(values[-1]):
            column = int(np.abs(vectors[:, 0]).argmax())
            return NotPositiveDefinite(
                f"{name} {k} is not positive definite: eigenvalues are from {values[0]:.3g} to "
                f"{values[-1]:.3g}, the smallest mainly along column {column} (first is 0); "
                "raise the regularisation, drop constant or repeated columns, or give more data"
            )
    return NotPositiveDefinite(
        f"a {name} of {len(covariances)} has no Cholesky factor; raise the regularisation"
    )


def precision_cholesky(covariances: Float[Array, "K D D"], name: str = "covariance") -> Float[Array, "K D D"]:
    """Return the lower triangular matrices W with W^T W = covariance^-1.

    |W (x - mean)| is the Mahalanobis distance of x.

    Args:
        covariances: Covariances.
        name: What they are; the error message begins with it.

    Raises:
        NotPositiveDefinite: As in `cholesky`.
    """
    covariances = _validate_covariances(covariances)
    try:
        return kernels.precision_cholesky(covariances)
    except NotPositiveDefinite:
        raise _not_positive_definite_error(covariances, name) from None


def log_density(g: Gaussian, x: Float[Array, "N D"]) -> Float[Array, " N"]:
    """Return log N(x_n | mean, covariance) for every row of x, without a lower bound.

    Args:
        g: Density.
        x: Points.

    Raises:
        NotPositiveDefinite: If the covariance is singular.
    """
    x = _validate_rows(_validate_gaussian(g), x)
    W = precision_cholesky(g.covariance[None])[0]
    distances = np.sum(((x - g.mean) @ W.T) ** 2, axis=1)
    return np.asarray(-0.5 * distances + np.log(np.diag(W)).sum() - 0.5 * g.mean.size * LOG_2_PI)


def affine_transform(g: Gaussian, A: Float[Array, "E D"], b: Float[Array, " E"]) -> Gaussian:
    """Return the density of A x + b if x has density g.

    Args:
        g: Density of x.
        A: Linear map.
        b: Offset.

    Raises:
        InvalidInput: If shapes do not match.
    """
    _validate_gaussian(g)
    A, b = float_array(A, "A", g.mean.size), float_array(b, "b")
    if A.ndim != 2 or b.shape != A.shape[:1]:
        raise InvalidInput(f"A has shape {A.shape} and b {b.shape}, expected (E, {g.mean.size}) and (E,)")
    return Gaussian(A @ g.mean + b, _symmetrise(A @ g.covariance @ A.T))


def product(gaussians: Sequence[Gaussian]) -> Gaussian:
    """Return the normalised product of densities of the same variable.

    Pairs are multiplied as Sp (Sp + Sq)^-1 Sq, which has no subtraction. Few digits are lost if scales differ
    by many orders of magnitude, and covariances may be singular, if not along the same direction.

    Args:
        gaussians: Densities, at least one.

    Raises:
        NotPositiveDefinite: If two covariances are singular along the same direction.

    Source:
        Tanwani 2018, equations 3.34-3.35, with the inverse that is missing in (3.34).
    """
    require_type(gaussians, "gaussians", (list, tuple), "give a list of them")
    if not gaussians:
        raise InvalidInput("gaussians is empty, expected at least one Gaussian")
    if len({_validate_gaussian(g).mean.size for g in gaussians}) > 1:
        raise InvalidInput("gaussians have different numbers of columns, expected the same")
    result = gaussians[0]
    for factor in gaussians[1:]:
        result = _pair_product(result, factor)
    return result


def _pair_product(p: Gaussian, q: Gaussian) -> Gaussian:
    covariance_sum = p.covariance + q.covariance
    cholesky(covariance_sum[None], "the sum of two covariances, number")
    gain = np.linalg.solve(covariance_sum, p.covariance).T  # Sp (Sp + Sq)^-1, (D, D)
    return Gaussian(p.mean + gain @ (q.mean - p.mean), _symmetrise(gain @ q.covariance))


def marginal(g: Gaussian, columns: Int[Array, " E"]) -> Gaussian:
    """Return the density of some columns of x, in the given order.

    Args:
        g: Density.
        columns: Columns; negative numbers count from the end.

    Raises:
        InvalidInput: If a column does not exist or is given twice.
    """
    _validate_gaussian(g)
    columns = split_columns(columns, g.mean.size)[0]
    return Gaussian(g.mean[columns], g.covariance[np.ix_(columns, columns)])


def condition(g: Gaussian, columns: Int[Array, " E"], value: Float[Array, " E"]) -> Gaussian:
    """Return the density of the other columns of x, in their order, given values of some columns.

    Args:
        g: Density.
        columns: Known columns; negative numbers count from the end.
        value: Their values.

    Raises:
        InvalidInput: If a column does not exist or is given twice, or shapes do not match.
        NotPositiveDefinite: If the known columns have a singular covariance.

    Source:
        Bishop 2006, equations 2.81-2.82.
    """
    _validate_gaussian(g)
    columns, others = split_columns(columns, g.mean.size)
    value = float_array(value, "value", len(columns))
    if value.ndim != 1:
        raise InvalidInput(f"value has shape {value.shape}, expected ({len(columns)},)")
    given_covariance, cross = g.covariance[np.ix_(columns, columns)], g.covariance[np.ix_(columns, others)]
    cholesky(given_covariance[None], "the covariance of the given columns, number")
    slope = np.linalg.solve(given_covariance, cross).T  # S_oc S_cc^-1, (D - E, E)
    covariance = g.covariance[np.ix_(others, others)] - slope @ cross
    return Gaussian(g.mean[others] + slope @ (value - g.mean[columns]), _symmetrise(covariance))


def split_columns(columns: Int[Array, " E"], width: int) -> tuple[Int[Array, " E"], Int[Array, " R"]]:
    """Return the columns counted from the front, and the other columns.

    Args:
        columns: Columns; negative numbers count from the end.
        width: Number of columns.

    Raises:
        InvalidInput: If a column does not exist or is given twice.
    """
    require_type(columns, "columns", np.ndarray, "give np.array([...]) of column numbers")
    if columns.ndim != 1 or columns.dtype.kind not in "iu" or np.ma.is_masked(columns):
        raise InvalidInput(f"columns is {short_repr(columns)}, expected an array of whole numbers")
    from_front = np.where(columns < 0, columns + width, columns)
    if from_front.size and not 0 <= from_front.min() <= from_front.max() < width:
        raise InvalidInput(f"columns is {columns.tolist()}, expected numbers of the {width} columns")
    if len(np.unique(from_front)) < len(from_front):
        raise InvalidInput(f"columns is {columns.tolist()}, expected each column once")
    return from_front, np.setdiff1d(np.arange(width), from_front)


def sample(g: Gaussian, count: int, rng: np.random.Generator) -> Float[Array, "N D"]:
    """Return independent samples; those of a singular covariance lie in its range.

    Args:
        g: Density.
        count: Number of samples.
        rng: Random generator.

    Raises:
        InvalidInput: If an argument is invalid.
    """
    _validate_gaussian(g)
    require_count(count, "count", MAX_SAMPLES)
    require_type(rng, "rng", np.random.Generator, "np.random.default_rng(seed) creates one")
    values, vectors = np.linalg.eigh(g.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))  # (D, D), root root^T = covariance
    return np.asarray(g.mean + rng.standard_normal((count, g.mean.size)) @ root.T)


def confidence_radius(width: int, probability: float) -> float:
    """Return the Mahalanobis radius of the ellipsoid that contains a sample with a given probability.

    For one dimension and 0.683 it is 1; the same radius contains less probability in more dimensions.

    Args:
        width: Number of dimensions.
        probability: Probability, between 0 and 1.

    Raises:
        InvalidInput: If an argument is invalid.
    """
    require_count(width, "width", MAX_SAMPLES, minimum=1)
    require_type(probability, "probability", (float, int), "give a number between 0 and 1")
    if not 0.0 < probability < 1.0:
        raise InvalidInput(f"probability is {probability}, expected a number between 0 and 1, such as 0.95")
    from scipy.special import gammaincinv  # local: importing scipy doubles the import time of pilotfish

    return float(np.sqrt(2.0 * gammaincinv(0.5 * width, probability)))


def _validate_covariances(covariances: object) -> Float[Array, "K D D"]:
    """Return an array of square matrices; numbers may be not finite, which cholesky reports."""
    is_float64 = type(covariances) is np.ndarray and covariances.dtype == np.float64
    array = np.asarray(covariances) if is_float64 else numeric_array(covariances, "covariances")
    if array.ndim != 3 or array.shape[1] != array.shape[2]:
        raise InvalidInput(f"covariances has shape {array.shape}, expected (K, D, D)")
    return array


def _validate_gaussian(g: object) -> Gaussian:
    """Return a Gaussian of finite numbers, or raise InvalidInput."""
    require_type(g, "g", Gaussian, "Gaussian(mean, covariance) creates one")
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
