"""Online learners as a command line names them: penalties, weights and upkeep, and what does not fit."""

from dataclasses import dataclass, fields, replace
from typing import Any

import click

from pilotfish.models import online

LEARNERS: dict[str, type[Any]] = dict(online.LEARNERS)
# What each penalty means, in squared units of the columns but for what is said.
PENALTIES = {
    "cluster": "squared distance at which a datapoint begins a cluster of its own (lambda)",
    "dimension": "variance that one more direction of a subspace must explain (lambda_1)",
    "transition": "price of a nat of surprise at a transition (lambda_2)",
    "new_transition": "price of a transition never taken before (lambda_3)",
    "noise": "variance beside the subspaces, of the skill that is read out (sigma^2)",
    "bandwidth": "squared distance from a mean over which its subspace fades (b_m)",
}
OPTIONAL = {"sosc": ("transition", "new_transition")}  # 0, where they are not given
DEFAULT_DISCOUNT = 0.995  # with --weighting exponential-decay
WEIGHTINGS = ("count", "exponential-decay", "constant")


@dataclass(frozen=True, slots=True)
class LearnerOptions:
    """What the options say of the learner; None is not given."""

    learner: str | None
    cluster: float | None
    dimension: float | None
    transition: float | None
    new_transition: float | None
    noise: float | None
    bandwidth: float | None
    weighting: str | None
    discount: float | None
    forget_below: float | None
    weight: float | None
    merge_distance: float | None
    extra_directions: int | None
    max_clusters: int | None
    batch: int | None

    @property
    def given(self) -> list[str]:
        """The options, as they are typed."""
        return [option_name(field.name) for field in fields(self) if getattr(self, field.name) is not None]

    @property
    def penalties(self) -> dict[str, float]:
        values = {name: getattr(self, name) for name in PENALTIES}
        return {name: value for name, value in values.items() if value is not None}


def option_name(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def build_settings(
    learner_choice: LearnerOptions, estimated: online.SOSC | None = None
) -> online.OnlineSettings:
    """The learner with its penalties: those that are given, else those that were guessed, where they were.

    Raises: click.UsageError, when one is missing or does not go with the learner.
    """
    name = learner_choice.learner or "sosc"
    kind = LEARNERS[name]
    known = [field.name for field in fields(kind) if field.name != "maintenance"]
    if unsupported := [option_name(penalty) for penalty in learner_choice.penalties if penalty not in known]:
        raise click.UsageError(
            f"{unsupported[0]} goes with another --learner, not {name}, which has {_options(known)}"
        )
    penalties = {penalty: getattr(estimated, penalty) for penalty in known} if estimated else {}
    penalties |= learner_choice.penalties
    if missing := [p for p in known if p not in penalties and p not in OPTIONAL.get(name, ())]:
        raise click.UsageError(
            f"{name} needs {_options(missing)}: "
            + "; ".join(f"{option_name(penalty)} is the {PENALTIES[penalty]}" for penalty in missing)
            + "; in squared units of the columns. For recordings --from-batch M guesses them"
        )
    maintenance = estimated.maintenance if estimated else build_maintenance(learner_choice)
    settings: online.OnlineSettings = kind(**penalties, maintenance=maintenance)
    return settings


def build_maintenance(learner_choice: LearnerOptions) -> online.Maintenance:
    """How the past is kept.    Raises: click.UsageError, when options are at odds."""
    chosen = {
        name: value
        for name in ("merge_distance", "extra_directions", "max_clusters", "batch")
        if (value := getattr(learner_choice, name)) is not None
    }
    return replace(online.Maintenance(**chosen), **_weighting(learner_choice))


def _weighting(learner_choice: LearnerOptions) -> dict[str, Any]:
    """Return the arguments of Maintenance that set the weights of clusters."""
    kind = learner_choice.weighting or "count"
    owners = {"discount": "exponential-decay", "forget_below": "exponential-decay", "weight": "constant"}
    values = {name: value for name in owners if (value := getattr(learner_choice, name)) is not None}
    if unsupported := [name for name in values if owners[name] != kind]:
        raise click.UsageError(
            f"{option_name(unsupported[0])} goes with --weighting {owners[unsupported[0]]}, not {kind}"
        )
    if kind == "constant" and not values:
        raise click.UsageError(
            "--weighting constant needs --weight: what every cluster weighs, in datapoints"
        )
    if kind == "constant":
        return {"constant_weight": values["weight"]}
    return {"discount": DEFAULT_DISCOUNT} | values if kind == "exponential-decay" else {}


def _options(names: list[str]) -> str:
    return ", ".join(map(option_name, names))
