"""Forces of contacts are those that rest asks for: weights, pushes, and sums with their directions."""

import mujoco
import numpy as np
import pytest

from pilotfish.environments import TASKS, Workcell, workcell
from pilotfish.environments.baxter import OBJECT, ROBOT
from pilotfish.environments.contacts import contact_forces, elementwise_max
from pilotfish.geometry import Pose

pytestmark = pytest.mark.usefixtures("unchecked")

GRAVITY = 9.81
KIND = {
    "robot": f'contype="{ROBOT}" conaffinity="{OBJECT}"',
    "thing": f'contype="{OBJECT}" conaffinity="{ROBOT | OBJECT}"',
}
SETTLED = 1e-3  # of a force, after two seconds of rest


def world(*bodies: str) -> str:
    return f"<mujoco><worldbody>{''.join(bodies)}</worldbody></mujoco>"


def block(
    kind: str, name: str, at: tuple[float, float, float], size: str = ".1 .1 .05", inside: str = ""
) -> str:
    """A block that stands still, or moves by the joints inside."""
    place = " ".join(map(str, at))
    return f'<body pos="{place}">{inside}<geom name="{name}" type="box" size="{size}" {KIND[kind]}/></body>'


def free(mass: float) -> str:
    return f'<freejoint/><inertial pos="0 0 0" mass="{mass}" diaginertia=".01 .01 .01"/>'


def at_rest(text: str, push: dict[str, float] | None = None) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The world two seconds later, its joints pushed by so much [N] all the time."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for name, force in (push or {}).items():
        data.qfrc_applied[model.joint(name).dofadr[0]] = force
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    return model, data


@pytest.mark.parametrize("mass", [0.2, 3.0])
@pytest.mark.parametrize("first", ["robot", "thing"])
@pytest.mark.parametrize("above", ["robot", "thing"])
def test_what_lies_on_the_robot_or_it_lies_on_pushes_by_a_weight(mass: float, first: str, above: str):
    """A block on a block: the robot feels the weight of the upper one, be it the robot or a thing, whichever
    of the two the physics names first.
    """
    below = "thing" if above == "robot" else "robot"
    pair = [block(above, above, (0.0, 0.0, 0.1), ".05 .05 .05", free(mass)), block(below, below, (0, 0, 0))]
    bodies = pair if first == above else pair[::-1]
    model, data = at_rest(world(*bodies))
    assert data.ncon >= 4  # at each corner
    forces = contact_forces(model, data, ("thing",))
    weight = pytest.approx(mass * GRAVITY, rel=SETTLED)
    assert forces == {"tool": weight, "thing": weight}


def test_a_body_on_several_supports_pushes_by_its_weight():
    """A robot's plank across two posts: each post carries a half, all contacts together the whole."""
    posts = [block("thing", name, (x, 0.0, 0.0), ".02 .05 .05") for name, x in (("a", -0.2), ("b", 0.2))]
    plank = block("robot", "plank", (0.0, 0.0, 0.06), ".3 .05 .01", free(2.0))
    forces = contact_forces(*at_rest(world(*posts, plank)), ("a", "b"))
    assert forces["tool"] == pytest.approx(2.0 * GRAVITY, rel=SETTLED)
    assert forces["a"] == pytest.approx(GRAVITY, rel=SETTLED)
    assert forces["b"] == pytest.approx(GRAVITY, rel=SETTLED)


@pytest.mark.parametrize(("left", "right"), [(5.0, 5.0), (8.0, 3.0), (0.0, 4.0)])
def test_pushes_from_two_sides_are_subtracted(left: float, right: float):
    """A robot's block, fixed, is pushed from either side: it feels the difference, each thing its own."""
    slide = '<joint name="{}" type="slide" axis="1 0 0" damping="5"/>'
    things = [
        block("thing", name, (x, 0.0, 0.0), ".05 .05 .05", slide.format(name))
        for name, x in (("left", -0.2), ("right", 0.2))
    ]
    bodies = [things[0], block("robot", "robot", (0, 0, 0)), things[1]]
    model, data = at_rest(world(*bodies), {"left": left, "right": -right})
    forces = contact_forces(model, data, ("left", "right"))
    assert forces["tool"] == pytest.approx(abs(left - right), abs=0.01)
    assert forces["left"] == pytest.approx(left, abs=0.01)
    assert forces["right"] == pytest.approx(right, abs=0.01)


def test_things_that_touch_each_other_do_not_push_the_robot():
    """A thing on a thing presses on it, and the robot, which hangs beside, feels nothing."""
    bodies = (
        block("thing", "shelf", (0.0, 0.0, 0.0)),
        block("thing", "cup", (0.0, 0.0, 0.1), ".05 .05 .05", free(0.5)),
        block("robot", "hand", (1.0, 0.0, 0.0)),
    )
    forces = contact_forces(*at_rest(world(*bodies)), ("shelf",))
    assert forces == {"tool": 0.0, "shelf": pytest.approx(0.5 * GRAVITY, rel=SETTLED)}


def test_only_what_is_named_is_felt():
    """Whatever touches, the answer has the tool and the fragile things in order; a wrong name is told."""
    bodies = (
        block("robot", "table", (0.0, 0.0, 0.0), ".3 .3 .05"),
        block("thing", "cup", (-0.15, 0.0, 0.1), ".05 .05 .05", free(1.0)),
        block("thing", "jug", (0.15, 0.0, 0.1), ".05 .05 .05", free(2.0)),
    )
    model, data = at_rest(world(*bodies))
    assert list(contact_forces(model, data, ())) == ["tool"]
    forces = contact_forces(model, data, ("jug", "cup"))
    assert list(forces) == ["tool", "jug", "cup"]
    expected = np.array([3.0, 2.0, 1.0]) * GRAVITY
    np.testing.assert_allclose(list(forces.values()), expected, rtol=SETTLED)
    with pytest.raises(KeyError, match="mug"):
        contact_forces(model, data, ("mug",))


def test_nothing_that_touches_is_no_force():
    """In the air everything is zero."""
    model = mujoco.MjModel.from_xml_string(
        world(block("robot", "hand", (0, 0, 0)), block("thing", "cup", (1, 0, 0)))
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert contact_forces(model, data, ("cup",)) == {"tool": 0.0, "cup": 0.0}


def test_of_two_measurements_the_larger_is_kept_thing_by_thing():
    """Each name has the larger of its two values, and the first keeps its own."""
    a, b = {"tool": 3.0, "cup": 0.0}, {"tool": 1.0, "cup": 2.0}
    assert elementwise_max(a, b) == elementwise_max(b, a) == {"tool": 3.0, "cup": 2.0}
    assert a == {"tool": 3.0, "cup": 0.0}


def test_a_peak_is_the_largest_force_of_every_tick(monkeypatch: pytest.MonkeyPatch):
    """A blow of a few milliseconds, in the middle of a period, is not missed."""
    felt: list[float] = []

    def feel(*given: object) -> dict[str, float]:
        forces = contact_forces(*given)  # type: ignore[arg-type]
        felt.append(forces["tool"])
        return forces

    monkeypatch.setattr(workcell, "contact_forces", feel)
    task = TASKS["valve"]
    where = task.sample_situation(np.random.default_rng(0))
    cell = Workcell(task, where)
    panel = Pose(where.valve.position + np.array([0.12, 0.1, 0.0]), cell.arm.tool.quaternion)
    for _ in range(4):
        cell.step_impedance(panel, 0.0, 100)
    assert len(felt) == 401
    assert cell.peak_forces["tool"] == max(felt) > 5.0
    assert cell.peak_forces["tool"] > 1.2 * max(felt[::100])
    assert cell.forces["tool"] == felt[-1]
