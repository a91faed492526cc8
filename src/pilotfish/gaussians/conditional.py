"""Gaussians conditioned on some of their columns, on R^n and on products with S^3.

A Gaussian over (x, y) predicts y from x as N(y | mean_y + slope (x - mean_x), covariance). On a manifold the
differences are logarithmic maps: y = Exp_mean_y(slope Log_mean_x(x)). An orientation, four columns, is either
an input or an output as a whole.
"""

from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import precision_cholesky, split_columns
from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ConditionalGaussians:
    """Conditional densities of K Gaussians: outputs given inputs.

    Attributes:
        input_means: Means of the inputs.
        precision_cholesky: Lower triangular W with W^T W = inverse covariance of the inputs.
        means: Means of the outputs.
        slopes: Derivative of the conditional mean by the input, both as tangent vectors at the means.
        covariances: Conditional covariances, which do not depend on the input.
        input_orientation_starts: First column of each quaternion among the inputs.
        output_orientation_starts: First column of each quaternion among the outputs.
    """

    input_means: Float[Array, "K I"]
    precision_cholesky: Float[Array, "K J J"]
    means: Float[Array, "K O"]
    slopes: Float[Array, "K Q J"]
    covariances: Float[Array, "K Q Q"]
    input_orientation_starts: tuple[int, ...] = ()
    output_orientation_starts: tuple[int, ...] = ()

    def log_input_densities(self, x: Float[Array, "N _"]) -> Float[Array, "N K"]:
        """Return the log-density of each input row under the input marginal of each component.

        Args:
            x: Inputs.

        Raises:
            InvalidInput: If x is not finite, has another width than the inputs, or is so far from every
                component that the density overflows.
        """
        validate_inputs(self, x)
        emissions = kernels.Emissions(
            self.input_means[None],
            self.precision_cholesky[None],
            self.input_orientation_starts,
        )
        with np.errstate(over="ignore", invalid="ignore"):
            log_densities = kernels.log_emissions(np.ascontiguousarray(x, dtype=np.float64)[None], emissions)
        infinite = ~np.isfinite(log_densities.max(axis=1, initial=-np.inf))
        if infinite.any():
            n = int(infinite.argmax())
            raise InvalidInput(
                f"x[{n}] is {x[n].tolist()}, too far from every component for a finite density; give it in "
                "the units of the demonstrations"
            )
        return log_densities


def conditional_gaussians(
    means: Float[Array, "K D"],
    covariances: Float[Array, "K E E"],
    inputs: Int[Array, " I"],
    orientation_starts: tuple[int, ...] = (),
) -> ConditionalGaussians:
    """Return each Gaussian as a map from the input columns to the other columns, in their order.

    Args:
        means: Mean of each component.
        covariances: Covariance of each component, of tangent vectors at its mean.
        inputs: Input columns; negative numbers count from the end.
        orientation_starts: First column of each unit quaternion.

    Raises:
        InvalidInput: If inputs are not columns, leave no output, or hold a part of a quaternion.
        NotPositiveDefinite: If the inputs of a component have a singular covariance.

    Source:
        Bishop 2006, equations 2.81-2.82.
    """
    inputs, outputs = split_columns(inputs, means.shape[1])
    if not len(outputs) or not len(inputs):
        raise InvalidInput(
            f"inputs are columns {inputs.tolist()} of {means.shape[1]}, expected at least one input and one "
            "output"
        )
    rows, input_starts = _tangent_columns(inputs, orientation_starts)
    others, output_starts = _tangent_columns(outputs, orientation_starts)
    W = precision_cholesky(covariances[:, rows[:, None], rows], "the input covariance of component")
    whitened = covariances[:, others[:, None], rows] @ W.transpose(0, 2, 1)  # S_oi W^T, (K, Q, J)
    conditional = covariances[:, others[:, None], others] - whitened @ whitened.transpose(0, 2, 1)
    return ConditionalGaussians(
        means[:, inputs], W, means[:, outputs], whitened @ W, conditional, input_starts, output_starts
    )


def _tangent_columns(
    columns: Int[Array, " I"], orientation_starts: tuple[int, ...]
) -> tuple[Int[Array, " J"], tuple[int, ...]]:
    """Return the tangent columns for columns of points, and where quaternions begin in the latter."""
    start_of_column = {start + n: start for start in orientation_starts for n in range(4)}
    tangent_columns: list[int] = []
    starts: list[int] = []
    index = 0
    while index < len(columns):
        column = int(columns[index])
        start, before = start_of_column.get(column), sum(first < column for first in orientation_starts)
        if start is None:
            tangent_columns.append(column - before)
            index += 1
        elif columns[index : index + 4].tolist() == list(range(start, start + 4)):
            tangent_columns += range(start - before, start - before + 3)
            starts.append(index)
            index += 4
        else:
            raise InvalidInput(
                f"columns {columns.tolist()} hold a part of the orientation in columns {start} to "
                f"{start + 3}, expected all four in their order, or none"
            )
    return np.array(tangent_columns, dtype=np.int64), tuple(starts)


def validate_inputs(conditionals: ConditionalGaussians, x: Float[Array, "N _"]) -> None:
    """Raise InvalidInput unless every row of x holds a finite number for each input."""
    if x.shape[1] != (width := conditionals.input_means.shape[1]):
        raise InvalidInput(f"x has {x.shape[1]} columns, expected {width}: one for each of the inputs")
    if (bad := np.argwhere(~np.isfinite(x))).size:
        n, i = bad[0]
        raise InvalidInput(
            f"x[{n}, {i}] is {x[n, i]}, expected a finite number; leave out the row, or remove the column "
            "from the inputs"
        )
