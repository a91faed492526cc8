"""Contact forces of bodies at rest balance their weights and the applied forces."""

import mujoco
import numpy as np
import pytest

from pilotfish.environments import TASKS, Workcell, workcell
from pilotfish.environments.baxter.body import OBJECT, ROBOT
from pilotfish.environments.contacts import contact_forces
from pilotfish.geometry import Pose

pytestmark = pytest.mark.usefixtures("unchecked")

GRAVITY = 9.81
CONTACT_TYPES = {
    "robot": f'contype="{ROBOT}" conaffinity="{OBJECT}"',
    "object": f'contype="{OBJECT}" conaffinity="{ROBOT | OBJECT}"',
}
SETTLED = 1e-3  # of a force, after two seconds of rest


def world(*bodies: str) -> str:
    return f"<mujoco><worldbody>{''.join(bodies)}</worldbody></mujoco>"


def block(
    kind: str, name: str, at: tuple[float, float, float], size: str = ".1 .1 .05", inside: str = ""
) -> str:
    """Return a fixed block, or one that moves by the joints inside."""
    place = " ".join(map(str, at))
    geom = f'<geom name="{name}" type="box" size="{size}" {CONTACT_TYPES[kind]}/>'
    return f'<body pos="{place}">{inside}{geom}</body>'


def free(mass: float) -> str:
    return f'<freejoint/><inertial pos="0 0 0" mass="{mass}" diaginertia=".01 .01 .01"/>'


def at_rest(text: str, push: dict[str, float] | None = None) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Simulate two seconds with constant joint forces [N]."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for name, force in (push or {}).items():
        data.qfrc_applied[model.joint(name).dofadr[0]] = force
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    return model, data


@pytest.mark.parametrize("mass", [0.2, 3.0])
@pytest.mark.parametrize("first", ["robot", "object"])
@pytest.mark.parametrize("above", ["robot", "object"])
def test_contact_forces_resting_block_equals_weight(mass: float, first: str, above: str):
    below = "object" if above == "robot" else "robot"
    pair = [block(above, above, (0.0, 0.0, 0.1), ".05 .05 .05", free(mass)), block(below, below, (0, 0, 0))]
    bodies = pair if first == above else pair[::-1]
    model, data = at_rest(world(*bodies))
    assert data.ncon >= 4  # at each corner
    forces = contact_forces(model, data, ("object",))
    weight = pytest.approx(mass * GRAVITY, rel=SETTLED)
    assert forces == {"tool": weight, "object": weight}


def test_contact_forces_several_supports_share_weight():
    posts = [block("object", name, (x, 0.0, 0.0), ".02 .05 .05") for name, x in (("a", -0.2), ("b", 0.2))]
    plank = block("robot", "plank", (0.0, 0.0, 0.06), ".3 .05 .01", free(2.0))
    forces = contact_forces(*at_rest(world(*posts, plank)), ("a", "b"))
    assert forces["tool"] == pytest.approx(2.0 * GRAVITY, rel=SETTLED)
    assert forces["a"] == pytest.approx(GRAVITY, rel=SETTLED)
    assert forces["b"] == pytest.approx(GRAVITY, rel=SETTLED)


@pytest.mark.parametrize(("left", "right"), [(5.0, 5.0), (8.0, 3.0), (0.0, 4.0)])
def test_contact_forces_opposite_pushes_are_subtracted(left: float, right: float):
    slide = '<joint name="{}" type="slide" axis="1 0 0" damping="5"/>'
    objects = [
        block("object", name, (x, 0.0, 0.0), ".05 .05 .05", slide.format(name))
        for name, x in (("left", -0.2), ("right", 0.2))
    ]
    bodies = [objects[0], block("robot", "robot", (0, 0, 0)), objects[1]]
    model, data = at_rest(world(*bodies), {"left": left, "right": -right})
    forces = contact_forces(model, data, ("left", "right"))
    assert forces["tool"] == pytest.approx(abs(left - right), abs=0.01)
    assert forces["left"] == pytest.approx(left, abs=0.01)
    assert forces["right"] == pytest.approx(right, abs=0.01)


def test_contact_forces_between_objects_do_not_act_on_robot():
    bodies = (
        block("object", "shelf", (0.0, 0.0, 0.0)),
        block("object", "cup", (0.0, 0.0, 0.1), ".05 .05 .05", free(0.5)),
        block("robot", "hand", (1.0, 0.0, 0.0)),
    )
    forces = contact_forces(*at_rest(world(*bodies)), ("shelf",))
    assert forces == {"tool": 0.0, "shelf": pytest.approx(0.5 * GRAVITY, rel=SETTLED)}


def test_contact_forces_has_named_geoms_in_order():
    bodies = (
        block("robot", "table", (0.0, 0.0, 0.0), ".3 .3 .05"),
        block("object", "cup", (-0.15, 0.0, 0.1), ".05 .05 .05", free(1.0)),
        block("object", "jug", (0.15, 0.0, 0.1), ".05 .05 .05", free(2.0)),
    )
    model, data = at_rest(world(*bodies))
    assert list(contact_forces(model, data, ())) == ["tool"]
    forces = contact_forces(model, data, ("jug", "cup"))
    assert list(forces) == ["tool", "jug", "cup"]
    expected = np.array([3.0, 2.0, 1.0]) * GRAVITY
    np.testing.assert_allclose(list(forces.values()), expected, rtol=SETTLED)
    with pytest.raises(KeyError, match="mug"):
        contact_forces(model, data, ("mug",))


def test_contact_forces_without_contact_are_zero():
    model = mujoco.MjModel.from_xml_string(
        world(block("robot", "hand", (0, 0, 0)), block("object", "cup", (1, 0, 0)))
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert contact_forces(model, data, ("cup",)) == {"tool": 0.0, "cup": 0.0}


def test_peak_forces_equal_maximum_over_timesteps(monkeypatch: pytest.MonkeyPatch):
    measured: list[float] = []

    def measure(*given: object) -> dict[str, float]:
        forces = contact_forces(*given)  # type: ignore[arg-type]
        measured.append(forces["tool"])
        return forces

    monkeypatch.setattr(workcell, "contact_forces", measure)
    task = TASKS["valve"]
    situation = task.sample_situation(np.random.default_rng(0))
    cell = Workcell(task, situation)
    panel = Pose(situation.valve.position + np.array([0.12, 0.1, 0.0]), cell.arm.tool.quaternion)
    for _ in range(4):
        cell.step_impedance(panel, 0.0, 100)
    assert len(measured) == 401
    assert cell.peak_forces["tool"] == max(measured) > 5.0
    assert cell.peak_forces["tool"] > 1.2 * max(measured[::100])
    assert cell.forces["tool"] == measured[-1]
