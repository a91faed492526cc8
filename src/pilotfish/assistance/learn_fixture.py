"""Learn a virtual fixture from demonstrations: a mixture over pose and phase, in every frame."""

from collections.abc import Sequence

import numpy as np

from pilotfish.assistance.phase import (
    add_phase,
    coordinate_layout,
    logistic_phase,
    path_phase,
    select_columns,
    sphere_layout,
)
from pilotfish.assistance.phase_switches import PhaseSwitch, learn_switch
from pilotfish.assistance.virtual_fixture import VirtualFixture, virtual_fixture
from pilotfish.demonstrations import Demonstration, demonstration, switching_columns
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import CovarianceStructure, Full
from pilotfish.models import EMSettings, TimeBins, learn, part_scales
from pilotfish.types import Array, Float
from pilotfish.validation import require_type, short_repr

PHASES = ("path", "logistic")
MAX_STATES, ROWS_PER_STATE = 15, 5  # default states, and steps of the shortest demonstration for each
MIN_GAIN = 0.5  # nats per datapoint, below which EM stops


def learn_virtual_fixture(
    demonstrations: Sequence[Demonstration],
    *,
    rng: np.random.Generator,
    phase: str = "path",
    states: int | None = None,
    structure: CovarianceStructure = Full(),
) -> VirtualFixture:
    """Learn the path of a task as a function of a phase, with a TP-GMM over pose and phase.

    Derivatives are left out. Two-valued columns, such as the grip, become switches.

    Args:
        demonstrations: At least two recordings of one task, with fixed or moving frames.
        rng: Source of randomness of the fit.
        phase: "path", the share of the path length, or "logistic", a logistic function of the time.
        states: Number of states; None takes 15, or one for every five steps of a short demonstration.
        structure: Covariance structure. Diagonal and spherical ones have no slope over the phase.

    Returns:
        The virtual fixture.

    Raises:
        InvalidInput: If there are fewer than two demonstrations, they disagree, one does not move, or an
            argument is wrong.
        NotPositiveDefinite: If a covariance collapses.

    Source:
        Tanwani 2018, section 6.4; Raiola et al. 2015 for the path length.
    """
    _validate(demonstrations, phase)
    poses = [_keep_coordinates(demo) for demo in demonstrations]
    phases, columns = _phases(poses, phase)
    shortest = min(len(demo.x) for demo in poses)
    default = max(1, min(MAX_STATES, shortest // ROWS_PER_STATE))
    fit = learn(
        [add_phase(demo, s) for demo, s in zip(poses, phases, strict=True)],
        states=default if states is None else states,
        rng=rng,
        dynamics="mixture",
        structure=structure,
        initialisation=TimeBins(),  # the phase orders the states
        settings=EMSettings(min_gain=MIN_GAIN),
    )
    switches: list[PhaseSwitch] = [learn_switch(c, [demo.x[:, c] for demo in poses], phases) for c in columns]
    return virtual_fixture(
        fit.skill,
        shortest * poses[0].period,
        recorded_layout=demonstrations[0].layout,
        switches=switches,
    )


def _validate(demonstrations: Sequence[Demonstration], phase: str) -> None:
    require_type(demonstrations, "demonstrations", Sequence, "pass a list of demonstrations")
    for demo in demonstrations:
        require_type(demo, "a demonstration", Demonstration, "create one with pf.demonstration")
    if len(demonstrations) < 2:
        raise InvalidInput(
            f"{len(demonstrations)} demonstrations are given, expected at least 2: the variation between "
            "them decides which frame counts; record another"
        )
    require_type(phase, "phase", str, f"choose one of {', '.join(map(repr, PHASES))}")
    if phase not in PHASES:
        raise InvalidInput(f"phase is {short_repr(phase)}, expected one of {', '.join(map(repr, PHASES))}")
    if other := next((d for d in demonstrations if d.layout != demonstrations[0].layout), None):
        raise InvalidInput(
            f"demonstration {other.name!r} has other columns than the first, expected the same"
        )


def _keep_coordinates(demo: Demonstration) -> Demonstration:
    """Return a demonstration without its derivatives."""
    columns = np.array(demo.layout.coordinates)
    frames = [select_columns(frame, columns) for frame in demo.frames]
    return demonstration(demo.x[:, columns], demo.period, coordinate_layout(demo.layout), frames, demo.name)


def _phases(demos: Sequence[Demonstration], kind: str) -> tuple[list[Float[Array, " _"]], list[int]]:
    """Return the phase of every step of each demonstration, and the columns that switch."""
    x, layout = np.concatenate([demo.x for demo in demos]), sphere_layout(demos[0].layout)
    names = switching_columns(x, layout)
    columns = [layout.names.index(name) for name in names]
    if kind == "logistic":
        return [logistic_phase(len(demo.x)) for demo in demos], columns
    scales = part_scales(x, np.ones(len(x)), layout, len(demos[0].x) * demos[0].period)
    scales[[name in names for name in layout.tangent.names]] = np.inf
    return [path_phase(demo.x, scales, layout.orientation_starts) for demo in demos], columns
