"""dynamax's GaussianHMM: all iterations in one jit, in double precision, on one core.

On several cores XLA spends more CPU time while waiting; on one core it is fastest.
"""

import os
from pathlib import Path

os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # before XLA counts the cores: imports come after

import jax  # type: ignore[import-not-found]  # noqa: E402
import jax.numpy as jnp  # type: ignore[import-not-found]  # noqa: E402
from dynamax.hidden_markov_model import GaussianHMM  # type: ignore[import-not-found]  # noqa: E402
from prepared import Answer, Prepared  # noqa: E402
from problems import Sequences  # noqa: E402

jax.config.update("jax_enable_x64", True)
WEAK = {  # without a prior, a transition that never occurs gives NaN
    "initial_probs_concentration": 1.0 + 1e-9,
    "transition_matrix_concentration": 1.0 + 1e-9,
    "emission_prior_concentration": 1e-10,
    "emission_prior_scale": 1e-10,
}


def remark() -> str:
    return f"jax {jax.__version__}, x64, pinned to one core"


def em(folder: Path) -> Prepared:
    """Prepare EM with the weakest priors, or the default ones if a state has fewer steps than columns."""
    problem = Sequences.load(folder)
    K, (N, D), M = len(problem.initial), problem.x.shape, len(problem.lengths)
    model = GaussianHMM(K, D, **(WEAK if N >= 4 * K * D else {}))
    parameters, properties = model.initialize(
        initial_probs=jnp.asarray(problem.initial),
        transition_matrix=jnp.asarray(problem.transitions),
        emission_means=jnp.asarray(problem.means),
        emission_covariances=jnp.asarray(problem.covariances),
    )
    x = jnp.asarray(problem.x.reshape(M, N // M, D))  # all are of one length
    n = problem.iterations

    def fitted(parameters: object, x: object, n: int) -> object:
        return model.fit_em(parameters, properties, x, num_iters=n, verbose=False)[0]

    fit = jax.jit(fitted, static_argnums=2)
    total = jax.jit(
        lambda parameters, x: jax.vmap(lambda one: model.marginal_log_prob(parameters, one))(x).sum()
    )

    def answer(_: object) -> Answer:
        begin, end = total(parameters, x), total(fit(parameters, x, n - 1), x)
        return Answer(float(end), n, begin=float(begin))

    known: list[Answer] = []  # its compilation takes seconds

    def answer_once(result: object) -> Answer:
        known.append(known[0] if known else answer(result))
        return known[-1]

    return Prepared(lambda: jax.block_until_ready(fit(parameters, x, n)), answer_once)
