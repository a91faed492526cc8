"""Figures of assistance in teleoperation: 5.9-5.12, 6.1 and 6.6-6.8.

    python reproductions/assistance_figures.py --out figures/

The tasks are simulated, with the screw at rest; the valve is the author's recording. The objects that the
operator sees are displaced by 5 cm in a random horizontal direction; on the valve, the operator sees the
valve of another recording. Positions are drawn in a plane, in metres.

    5.9   the two tasks of chapter 5
    5.10  joint model of a stream: input part in the world, output part in the frame of the object
    5.11  shared and autonomous control with that model
    5.12  its states, transitions and durations, and its forward variable
    6.1   the operator's motion in the observed scene, and the robot's in the actual one
    6.6   virtual fixture: the operator, and the robot on the path
    6.7   target reaching: input and output part, shared and autonomous control
    6.8   valve: input and output parts, left-right model, and the four modes at another angle of the valve

Shared control carries the command from the observed into the actual scene, the default. Autonomous control
takes over from direct control after a third of the operator's motion; on the valve, after a tenth of the rows
of shared control. assistance_models.py has random instants.

Source: Tanwani 2018, sections 5.7.2, 6.1, 6.4 and 6.5.
"""

from pilotfish.rendering import require_mujoco

require_mujoco()  # chooses the backend of figure 5.9 before MuJoCo is imported

from collections.abc import Callable, Mapping, Sequence  # noqa: E402
from functools import cache, partial  # noqa: E402

import assistance as protocol_6_1  # noqa: E402 - the reproduction of table 6.1
import assistance_drawings as draw  # noqa: E402
import numpy as np  # noqa: E402
from joint_models import (  # noqa: E402
    STATES,
    Trial,
    augment,
    learn_batch,
    learn_stream,
    load_demonstrations,
    make_assistant,
    operate,
    task_at_rest,
)
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from protocol import argument_parser, write_figures, write_numbers  # noqa: E402
from virtual_fixture import frames_at  # noqa: E402

import pilotfish as pf  # noqa: E402
from pilotfish import assistance, plots  # noqa: E402
from pilotfish.demonstrations import Demonstration, Frame  # noqa: E402
from pilotfish.environments import SceneRenderer, Workcell  # noqa: E402
from pilotfish.geometry import Pose, log_map  # noqa: E402
from pilotfish.models.online import to_skill  # noqa: E402
from pilotfish.simulation import Link, situation_from_seed  # noqa: E402

TASKS_OF_CHAPTER_5 = ("screwdriver", "carabiner")
SEED, CASE = 0, (0, 0)  # of the demonstrations; seed and number of the situation
LINK = Link(view_distance=0.05)  # m
SWITCH_SHARE = 1.0 / 3.0  # of the operator's motion, after which autonomous control begins
PLANE = (0, 2)  # of trials, and of the output part: the rod lies along x of its frame
WORLD = {"screwdriver": (0, 2), "carabiner": (1, 2), "stab": (0, 2)}  # plane of the input part
VALVE_PLANE, VALVE_STATES, TRAIN = (0, 2), 7, 6
OPERATOR, SCENE = 0, 6  # recordings of the valve: the one observed, 180 degrees, and the actual, 67.5
MODES = ("direct", "carried", "autonomous", "fixture")
SPRINGS = 9
Figures = Mapping[str, Figure]


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--figures", nargs="+", default=list(FIGURES), choices=list(FIGURES))
    arguments = parser.parse_args()
    written = []
    for number in arguments.figures:
        try:
            figures = FIGURES[number]()
        except pf.SkillError as error:
            print(f"figure {number}: left out: {error}")
            continue
        for name, figure in figures.items():
            print(f"figure {number}: {name}", flush=True)
            if arguments.out:
                write_figures(arguments.out, {name: figure})
            written.append(name)
    if arguments.json:
        write_numbers(arguments.json, {"figures": written, "cases": cases()})


@cache
def trial(name: str, mode: str, learner: str) -> Trial:
    """Return the operator's trial in a mode."""
    learn = partial(learn_joint, name, learner)
    assistant = make_assistant(load_demonstrations(name, SEED), learn, literal=False)
    if mode != "autonomous":
        return operate(name, assistant, CASE, mode=mode, link=LINK)
    instant = SWITCH_SHARE * trial(name, "direct", learner).result.duration
    return operate(name, assistant, CASE, mode="direct", link=LINK, switch=instant)


def learn_joint(name: str, learner: str, demonstrations: Sequence[Demonstration]) -> pf.Skill:
    """Return the joint model of augmented demonstrations of a task."""
    if learner == "stream":
        return to_skill(learn_stream(demonstrations, STATES[name]))
    return learn_batch(demonstrations, STATES[name], pf.structures.Full())


@cache
def joint_model(name: str, learner: str) -> pf.Skill:
    """Return the joint model of a task."""
    return learn_joint(name, learner, [augment(d) for d in load_demonstrations(name, SEED)])


def cases() -> list[dict[str, object]]:
    """Return the outcome of every trial that was drawn, from the cache."""
    rows: list[dict[str, object]] = []
    for name, mode, learner in sorted(drawn_trials):
        result = trial(name, mode, learner).result
        row = {"task": name, "mode": mode, "model": learner, "error [m]": result.outcome.error}
        rows.append({**row, "success": result.outcome.success})
    return rows


drawn_trials: set[tuple[str, str, str]] = set()


def draw_trial(axes: Axes, name: str, mode: str, learner: str) -> None:
    """Draw a trial in a plane of the world."""
    drawn_trials.add((name, mode, learner))
    paths = draw.paths_of(trial(name, mode, learner))
    draw.draw_paths(axes, paths, PLANE, f"{name}, {mode}")
    if name == "carabiner":
        draw.draw_rods(axes, paths, PLANE)


def figure_5_9() -> Figures:
    """Return images of both tasks with the frame of the object."""
    figure = draw.new_figure(9.6, 4.0)
    for axes, name in zip(figure.subplots(1, 2), TASKS_OF_CHAPTER_5, strict=True):
        task = task_at_rest(name)
        cell = Workcell(task, situation_from_seed(task, "test", *CASE))
        with SceneRenderer(cell.model, task.view) as renderer:
            axes.imshow(renderer.render(cell.data, frames=cell.frames()))
        axes.set_title(f"{name}, frame {task.frames[0]!r}", fontsize="medium", loc="left")
        axes.set_axis_off()
    return {"figure_5_9_tasks": figure}


def figure_5_10() -> Figures:
    figure = draw.new_figure(9.6, 8.4)
    for row, name in zip(figure.subplots(2, 2), TASKS_OF_CHAPTER_5, strict=True):
        joint, demonstrations = joint_model(name, "stream"), load_demonstrations(name, SEED)
        draw.draw_input(row[0], joint, demonstrations, WORLD[name])
        draw.draw_output(row[1], joint, demonstrations, PLANE)
        for axes in row:
            axes.set_title(f"{name}: {axes.get_title(loc='left')}", fontsize="medium", loc="left")
    draw.add_legend(figure, [*draw.model_handles(), draw.object_handle()])
    return {"figure_5_10_joint_models": figure}


def figure_5_11() -> Figures:
    figure = draw.new_figure(9.6, 8.8)
    for row, name in zip(figure.subplots(2, 2), TASKS_OF_CHAPTER_5, strict=True):
        for axes, mode in zip(row, ("shared", "autonomous"), strict=True):
            draw_trial(axes, name, mode, "stream")
    draw.add_legend(figure, draw.path_handles())
    return {"figure_5_11_control": figure}


def figure_5_12() -> Figures:
    figures = {}
    for name in TASKS_OF_CHAPTER_5:
        joint = joint_model(name, "stream")
        horizon = max(len(d.x) for d in load_demonstrations(name, SEED))
        figures[f"figure_5_12_states_{name}"] = plots.state_graph(joint)
        figures[f"figure_5_12_forward_{name}"] = plots.forward_variable(joint, horizon=horizon)
    return figures


def figure_6_1() -> Figures:
    figure = draw.new_figure(12.6, 4.8)
    panels = figure.subplots(1, 3)
    for axes, mode in zip(panels, ("direct", "shared", "autonomous"), strict=True):
        draw_trial(axes, "screwdriver", mode, "batch")
    draw.add_legend(figure, draw.path_handles())
    return {"figure_6_1_modes": figure}


def figure_6_6() -> Figures:
    """Return the virtual fixture of the stab task, and the phase over time."""
    demonstrations = load_demonstrations("stab", SEED)
    paths, phases = follow_fixture(demonstrations[:-1], demonstrations[0], demonstrations[-1])
    figure = draw.new_figure(9.6, 4.8)
    left, right = figure.subplots(1, 2)
    draw.draw_paths(left, paths, PLANE, "stab, virtual fixture")
    draw.draw_springs(left, paths, PLANE, SPRINGS)
    right.plot(demonstrations[0].period * np.arange(len(phases)), phases, color=draw.ROBOT)
    right.set(xlabel="time [s]", ylabel="phase s [1]", ylim=(-0.02, 1.02))
    right.set_title("phase of the robot on the path", fontsize="medium", loc="left")
    right.grid(True, color="0.92", linewidth=0.6)
    draw.add_legend(figure, draw.path_handles(autonomous=False, springs=True))
    return {"figure_6_6_fixture": figure}


def figure_6_7() -> Figures:
    figure = draw.new_figure(9.6, 8.8)
    (left, right), below = figure.subplots(2, 2)
    joint, demonstrations = joint_model("stab", "batch"), load_demonstrations("stab", SEED)
    draw.draw_input(left, joint, demonstrations, WORLD["stab"])
    draw.draw_output(right, joint, demonstrations, PLANE)
    for axes, mode in zip(below, ("shared", "autonomous"), strict=True):
        draw_trial(axes, "stab", mode, "batch")
    draw.add_legend(figure, [*draw.model_handles(), *draw.path_handles()])
    return {"figure_6_7_target": figure}


def figure_6_8() -> Figures:
    """Return the joint model of the valve, its states, and the modes at another angle."""
    demonstrations = pf.datasets.valve()
    training = list(demonstrations[:TRAIN])
    joint = learn_batch([augment(d) for d in training], VALVE_STATES, pf.structures.Full())
    models = draw.new_figure(13.2, 4.8)
    panels = models.subplots(1, 1 + len(joint.frame_names))
    draw.draw_input(panels[0], joint, training, VALVE_PLANE)
    for p, axes in enumerate(panels[1:]):
        draw.draw_output(axes, joint, training, VALVE_PLANE, p)
    draw.add_legend(models, [*draw.model_handles(), draw.object_handle()])
    modes = draw.new_figure(9.6, 8.8)
    assistant = protocol_6_1.make_assistant(training, literal=False)
    given, scene = demonstrations[OPERATOR], demonstrations[SCENE]
    for axes, mode in zip(modes.subplots(2, 2).flat, MODES, strict=True):
        if mode == "fixture":
            paths, _ = follow_fixture(training, given, scene)
            draw.draw_springs(axes, paths, VALVE_PLANE, SPRINGS)
        else:
            paths = valve_paths(assistant, mode, given, scene)
        axes.plot(*scene.x[:, list(VALVE_PLANE)].T, color=draw.PERSON, linestyle="--", zorder=1)
        title = {"carried": "shared", "fixture": "virtual fixture"}.get(mode, mode)
        draw.draw_paths(axes, paths, VALVE_PLANE, f"valve, {title}")
    draw.add_legend(modes, [*draw.path_handles(springs=True), draw.person_handle()])
    return {
        "figure_6_8_model": models,
        "figure_6_8_states": plots.state_graph(joint),
        "figure_6_8_modes": modes,
    }


def valve_paths(
    assistant: assistance.Assistant, mode: str, given: Demonstration, scene: Demonstration
) -> draw.Paths:
    """Return the paths with a recording as operator input in the scene of another one."""
    poses = protocol_6_1.run_mode(assistant, mode, given, scene)
    rows = len(given.x)
    switch = int(np.ceil(protocol_6_1.SWITCH * rows)) if mode == "autonomous" else rows
    return draw.Paths(given.x[:, :3], poses[:, :3], poses_of(scene), poses_of(given), switch)


def follow_fixture(
    training: Sequence[Demonstration], given: Demonstration, scene: Demonstration
) -> tuple[draw.Paths, list[float]]:
    """Return paths and phases with a recording as operator input on the fixture in another scene."""
    fixture = assistance.learn_virtual_fixture(training, rng=np.random.default_rng(0))
    x = given.x[:, : fixture.layout.width]
    starts = tuple(columns.start for columns in fixture.layout.unit_quaternions)
    steps = log_map(x[:-1], x[1:], starts) / given.period
    observed, actual = frames_at(given, 0.0), frames_at(scene, 0.0)
    state = assistance.start_fixture(fixture, observed)
    robot, phases = [], []
    for pose, velocity in zip(x, np.vstack([steps[:1], steps]), strict=True):
        state, target = assistance.step_fixture(
            fixture, state, pose, velocity, actual, given.period, observed_frames=observed
        )
        robot.append(target.mean[:3])
        phases.append(state.phase)
    paths = draw.Paths(x[:, :3], np.array(robot), poses_of(scene), poses_of(given), len(x))
    return paths, phases


def poses_of(demonstration: Demonstration) -> dict[str, Pose]:
    """Return the poses of the objects of a recording at its start."""
    frames = [frame if isinstance(frame, Frame) else frame.at(0) for frame in demonstration.frames]
    return {frame.name: Pose(frame.b[:3].copy(), frame.A[3:7, 3].copy()) for frame in frames}


FIGURES: dict[str, Callable[[], Figures]] = {
    "5.9": figure_5_9,
    "5.10": figure_5_10,
    "5.11": figure_5_11,
    "5.12": figure_5_12,
    "6.1": figure_6_1,
    "6.6": figure_6_6,
    "6.7": figure_6_7,
    "6.8": figure_6_8,
}


if __name__ == "__main__":
    main()
