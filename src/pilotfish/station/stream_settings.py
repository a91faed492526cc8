"""Online learners as a command line names them: penalties, weights and upkeep, and what does not fit."""

from dataclasses import dataclass, fields, replace
from typing import Any

import click

from pilotfish.models import online

LEARNERS: dict[str, type[Any]] = {
    "sosc": online.SOSC,
    "dp-mppca": online.DPMPPCA,
    "dp-gmm": online.DPGMM,
    "hdp-hsmm": online.HDPHSMM,
}
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
WEIGHTINGS = ("count", "trace", "constant")


@dataclass(frozen=True, slots=True)
class Wanted:
    """What the options say of the learner; None is not given."""

    learner: str | None
    cluster: float | None
    dimension: float | None
    transition: float | None
    new_transition: float | None
    noise: float | None
    bandwidth: float | None
    weights: str | None
    discount: float | None
    forget_below: float | None
    weight: float | None
    merge_distance: float | None
    spare: int | None
    most_clusters: int | None
    batch: int | None

    @property
    def given(self) -> list[str]:
        """The options, as they are typed."""
        return [option(field.name) for field in fields(self) if getattr(self, field.name) is not None]

    @property
    def penalties(self) -> dict[str, float]:
        values = {name: getattr(self, name) for name in PENALTIES}
        return {name: value for name, value in values.items() if value is not None}


def option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def settings_of(wanted: Wanted, guessed: online.SOSC | None = None) -> online.OnlineSettings:
    """The learner with its penalties: those that are given, else those that were guessed, where they were.

    Raises: click.UsageError, when one is missing or does not go with the learner.
    """
    name = wanted.learner or "sosc"
    kind = LEARNERS[name]
    known = [field.name for field in fields(kind) if field.name != "upkeep"]
    if strange := [option(penalty) for penalty in wanted.penalties if penalty not in known]:
        raise click.UsageError(
            f"{strange[0]} goes with another --learner, not {name}, which has {_options(known)}"
        )
    penalties = {penalty: getattr(guessed, penalty) for penalty in known} if guessed else {}
    penalties |= wanted.penalties
    if missing := [p for p in known if p not in penalties and p not in OPTIONAL.get(name, ())]:
        raise click.UsageError(
            f"{name} needs {_options(missing)}: "
            + "; ".join(f"{option(penalty)} is the {PENALTIES[penalty]}" for penalty in missing)
            + "; in squared units of the columns. For recordings --from-batch M guesses them"
        )
    upkeep = guessed.upkeep if guessed else upkeep_of(wanted)
    settings: online.OnlineSettings = kind(**penalties, upkeep=upkeep)
    return settings


def upkeep_of(wanted: Wanted) -> online.Upkeep:
    """How the past is kept.    Raises: click.UsageError, when options are at odds."""
    chosen = {
        name: value
        for name in ("merge_distance", "spare", "most_clusters", "batch")
        if (value := getattr(wanted, name)) is not None
    }
    return replace(online.Upkeep(**chosen), weighting=_weighting(wanted))


def _weighting(wanted: Wanted) -> online.Weighting:
    kind = wanted.weights or "count"
    owners = {"discount": "trace", "forget_below": "trace", "weight": "constant"}
    values = {name: value for name in owners if (value := getattr(wanted, name)) is not None}
    if strange := [name for name in values if owners[name] != kind]:
        raise click.UsageError(f"{option(strange[0])} goes with --weights {owners[strange[0]]}, not {kind}")
    if kind == "constant" and not values:
        raise click.UsageError("--weights constant needs --weight: what every cluster weighs, in datapoints")
    weightings: dict[str, type[Any]] = {
        "count": online.Count,
        "trace": online.Trace,
        "constant": online.Constant,
    }
    weighting: online.Weighting = weightings[kind](**values)
    return weighting


def _options(names: list[str]) -> str:
    return ", ".join(map(option, names))
