"""Small skills, demonstrations and motions to plot, built without learning."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

from pilotfish.control import Feedback, Motion, double_integrator, track
from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Layout,
    demonstration,
    frame_from_pose,
    pose_layout,
    position_layout,
)
from pilotfish.gaussians.structures import DenseCovariances, Diagonal, Full, SemiTied, SemiTiedCovariances
from pilotfish.geometry import Pose
from pilotfish.models import (
    AdaptedSkill,
    Candidate,
    Convergence,
    Fit,
    FrameRelevance,
    Provenance,
    Score,
    Selection,
    SemiMarkovChain,
    Skill,
)
from pilotfish.models import durations as duration_models
from pilotfish.models.online import (
    SOSC,
    Maintenance,
    OnlineModel,
    observe_stream,
    online_model,
)
from pilotfish.planning import DEFAULT_CANDIDATE, ReproductionScore, ReproductionSelection
from pilotfish.planning.plan import reference_from_states

PERIOD = 0.1  # s
LAYOUT = pose_layout().differentiate()
FRAMES = ("cup before", "cup after")


def random_covariances(rng: np.random.Generator, count: int, width: int) -> np.ndarray:
    """Return symmetric positive definite matrices with deviations of about a tenth."""
    root = rng.normal(scale=0.1 / np.sqrt(width), size=(count, width, width))
    return root @ root.transpose(0, 2, 1) + 1e-4 * np.eye(width)


def left_right_chain(rng: np.random.Generator, states: int) -> SemiMarkovChain:
    """Return a chain in which one state follows the other and the last is final."""
    durations = duration_models.Gaussian(rng.uniform(3.0, 9.0, states), rng.uniform(0.5, 3.0, states))
    return SemiMarkovChain(np.eye(states)[0], np.eye(states, k=1), durations)


def semi_tied(rng: np.random.Generator, states: int, width: int) -> SemiTiedCovariances:
    H, variances = rng.normal(size=(width, width)), rng.uniform(0.001, 0.01, (states, width))
    return SemiTiedCovariances(H, variances, 1.0, np.einsum("id,kd,jd->kij", H, variances, H))


def make_skill(
    rng: np.random.Generator,
    states: int = 4,
    frames: tuple[str, ...] = FRAMES,
    layout: Layout = LAYOUT,
    *,
    semi_tied_skill: bool = False,
) -> Skill:
    """Return a skill with full or semi-tied covariances."""
    width = layout.width
    covariances = [
        semi_tied(rng, states, width)
        if semi_tied_skill
        else DenseCovariances(random_covariances(rng, states, width))
        for _ in frames
    ]
    means = np.cumsum(rng.normal(scale=0.2, size=(len(frames), states, width)), axis=1)
    label = "semi-tied(1)" if semi_tied_skill else "full"
    provenance = Provenance(("a",), 9, "", label, 1.0, 3, True, "pilotfish")
    chain = left_right_chain(rng, states)
    return Skill(chain, means, tuple(covariances), layout, PERIOD, frames, provenance)


def make_frames(rng: np.random.Generator) -> tuple[Frame, ...]:
    quaternions = rng.normal(size=(len(FRAMES), 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    poses = [Pose(rng.normal(scale=0.3, size=3), q) for q in quaternions]
    return tuple(frame_from_pose(name, LAYOUT, pose) for name, pose in zip(FRAMES, poses, strict=True))


def make_demonstrations(rng: np.random.Generator, frames: tuple[Frame, ...]) -> tuple[Demonstration, ...]:
    """Return three smooth random paths of different lengths."""
    demos = []
    for m, steps in enumerate((20, 25, 31)):
        x = np.cumsum(rng.normal(scale=0.03, size=(steps, LAYOUT.width)), axis=0)
        q = np.array([1.0, 0.0, 0.0, 0.0]) + 0.3 * x[:, 3:7]
        x[:, 3:7] = q / np.linalg.norm(q, axis=1, keepdims=True)
        demos.append(demonstration(x, PERIOD, LAYOUT, frames, f"demonstration {m}"))
    return tuple(demos)


def make_selection(rng: np.random.Generator) -> Selection:
    """Return scores of three structures, two duration models and five numbers of states."""
    tried = [
        Candidate(states, structure, dynamics)
        for structure in (Full(), Diagonal(), SemiTied())
        for dynamics in ("semi-markov", "markov")
        for states in range(3, 8)
    ]
    scores = [
        Score(c, c.states, 100 * c.states + n, 5e3, -1e4 + n, rng.normal(20.0 - (c.states - 5) ** 2, 3.0, 4))
        for n, c in enumerate(tried)
    ]
    return Selection(tuple(scores), ((tried[0], "it collapsed"),))


def make_relevance(rng: np.random.Generator, states: int = 4) -> FrameRelevance:
    """Return relevance in which the third frame is a distractor."""
    values = np.vstack([rng.uniform(0.01, 1.0, (2, states)), np.zeros(states)])
    values /= values.max(axis=0)
    return FrameRelevance(values, rng.gamma(0.5, 40.0, (3, states)), (*FRAMES, "distractor"))


def make_online_models(rng: np.random.Generator) -> list[OnlineModel]:
    """Return the states of an online model with five clusters, one of which is deleted."""
    maintenance = Maintenance(discount=0.98, forget_below=0.3)
    model = online_model(
        SOSC(2.0, 0.1, 0.01, 50.0, maintenance=maintenance), position_layout(3), PERIOD, FRAMES
    )
    models = []
    for n in range(30):
        k = 4 if n == 1 else n % 4
        shape = np.array([[1.0, 0.0, 0.0], [0.4, 1.0, 0.0]])[k % 2]
        x = 5.0 * k + shape * rng.normal(size=(20, 3)) + 0.05 * rng.normal(size=(20, 3))
        model, _ = observe_stream(model, np.stack([x, x[:, ::-1]], axis=1))
        models.append(model)
    return models


def make_reproduction_selection(rng: np.random.Generator) -> ReproductionSelection:
    """Return scores of the default, of frames by relevance, and of two structures."""
    candidates = [
        DEFAULT_CANDIDATE,
        Candidate(frames="relevance"),
        *(Candidate(states, structure) for structure in (Full(), SemiTied()) for states in (15, 20, 40)),
    ]
    scores = [
        ReproductionScore(c, c.states or 30, rng.normal(0.5, 0.1, size=5), {"end error": np.zeros(5)})
        for c in candidates
    ]
    return ReproductionSelection(tuple(scores), (), 40)


@dataclass(frozen=True)
class PlotInputs:
    """Arguments of all plots."""

    skill: Skill
    semi_tied_skill: Skill
    frames: tuple[Frame, ...]
    demonstrations: tuple[Demonstration, ...]
    adapted: AdaptedSkill  # the skill in its first frame
    states: np.ndarray  # a plan that visits every state for a while
    feedback: Feedback
    motion: Motion
    fit: Fit
    selection: Selection
    reproduction_selection: ReproductionSelection
    frame_relevance: FrameRelevance
    online_models: list[OnlineModel]


def make_plot_inputs(rng: np.random.Generator) -> PlotInputs:
    skill, frames = make_skill(rng), make_frames(rng)
    demos = make_demonstrations(rng, frames)
    adapted = AdaptedSkill(skill.dynamics, skill.means[0], skill.covariances[0].dense, LAYOUT, PERIOD)
    states = np.repeat(np.arange(skill.states), 6)
    feedback = track(double_integrator(7, PERIOD), reference_from_states(adapted, states, 2e-3), 9.0)
    fit = Fit(skill, skill, Convergence(np.sort(rng.normal(size=8)), True, 8, "converged", ()))
    motion = feedback.rollout(demos[0].x[0])
    semi_tied_skill, chosen = make_skill(rng, semi_tied_skill=True), make_selection(rng)
    frame_relevance = make_relevance(rng)
    online_models = make_online_models(rng)
    return PlotInputs(
        skill,
        semi_tied_skill,
        frames,
        demos,
        adapted,
        states,
        feedback,
        motion,
        fit,
        chosen,
        make_reproduction_selection(rng),
        frame_relevance,
        online_models,
    )


@pytest.fixture
def inputs(rng: np.random.Generator) -> PlotInputs:
    return make_plot_inputs(rng)


@pytest.fixture(scope="module")
def fixed_inputs() -> PlotInputs:
    """Return inputs that several tests share: plots take time."""
    return make_plot_inputs(np.random.default_rng(0))


@pytest.fixture
def make_skill_of_size(rng: np.random.Generator) -> Callable[..., Skill]:
    """Return a function that creates skills of other sizes."""
    return partial(make_skill, rng)


@pytest.fixture(scope="module")
def make_fixed_skill() -> Callable[..., Skill]:
    """Return a function that creates the same skills for every test."""
    return partial(make_skill, np.random.default_rng(0))
