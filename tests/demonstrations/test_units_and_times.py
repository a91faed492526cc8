"""Units, timestamps and rotations of files, and unusable arguments of the functions that convert them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pilotfish.demonstrations import (
    BuildSettings,
    FrameSource,
    PartSource,
    Quantity,
    Recording,
    Signal,
    build_demonstration,
    is_unit,
    parse_unit,
    suggest_settings,
    time_unit,
)
from pilotfish.demonstrations.rotation_conversion import to_quaternions
from pilotfish.demonstrations.timestamps import held_run, unheld_rows
from pilotfish.errors import InvalidInput

UNUSABLE: tuple[Any, ...] = (
    None, True, 3, -1.0, np.nan, np.inf, "", "a\nb", "\ud800", b"x", [], (), [None], [[1.0], [1.0, 2.0]], {},
    np.zeros((2, 2, 2)), np.array(["a"]), 1 + 2j, 10**400, object(), int,
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "factor", "si"),
    [
        ("m", 1.0, "m"),
        (" mm ", 1e-3, "m"),
        ("MM", 1e-3, "m"),
        ("millimetres", 1e-3, "m"),
        ("Metre", 1.0, "m"),
        ("in", 0.0254, "m"),
        ("deg", np.pi / 180, "rad"),
        ("°", np.pi / 180, "rad"),
        ("", 1.0, "1"),
        ("mm/s", 1e-3, "m/s"),
        ("deg/s", np.pi / 180, "rad/s"),
        ("m/s^2", 1.0, "m/s^2"),
        ("cm/s2", 1e-2, "m/s^2"),
        ("mm/ms", 1.0, "m/s"),
        ("kN", 1e3, "N"),
        ("mN", 1e-3, "N"),
        ("Nm", 1.0, "N m"),
        ("mm^2", 1e-6, "m^2"),
    ],
)
def test_unit_has_factor_and_si_unit(text: str, factor: float, si: str):
    unit = parse_unit(text)
    assert unit.factor == pytest.approx(factor, rel=1e-15)
    assert unit.si == si


@pytest.mark.parametrize(
    "text", ["furlong", "m/", "/s", "m//s", "m^0", "m^12", "mm^", "1/0", "m m", "²", "m/s/x"]
)
def test_unknown_unit_is_refused(text: str):
    assert not is_unit(text)
    with pytest.raises(InvalidInput, match="which is unknown"):
        parse_unit(text)


@pytest.mark.parametrize(
    ("start", "step", "unit"),
    [
        (0, 0.033, "s"),
        (0, 33.3, "ms"),
        (0, 33_333, "us"),
        (0, 33_333_333, "ns"),
        (1.7e9, 1.0, "s"),
        (1.7e12, 1.0, "ms"),
        (1.7e15, 2_000, "us"),
        (1.7e18, 2_000_000, "ns"),
        (5, 0.5, "s"),
    ],
)
def test_time_unit_is_recognised_by_magnitude_and_step(start: float, step: float, unit: str):
    assert time_unit(start + step * np.arange(5)) == unit


def test_held_rows_are_found_with_jitter_and_not_in_rests(rng: np.random.Generator):
    """Runs of 9 to 11 rows are held; a robot that stands still, and noise, are not."""
    runs = rng.integers(9, 12, size=40)
    values = np.repeat(rng.normal(size=(40, 3)), runs, axis=0)
    assert held_run(values) == 10
    kept = unheld_rows(values, 10)
    assert set(np.flatnonzero((np.diff(values, axis=0) != 0).any(axis=1)) + 1) <= set(kept.tolist())
    assert held_run(rng.normal(size=(50, 3))) == 1
    assert held_run(np.repeat(rng.normal(size=(9, 1)), [1, 1, 30, 1, 1, 40, 1, 1, 1], axis=0)) == 1
    assert held_run(np.zeros((50, 2))) == 1


def test_rotations_agree_with_scipy(rng: np.random.Generator):
    """Each form is the rotation that another implementation has, also at gimbal lock."""
    angles = rng.uniform(-np.pi, np.pi, size=(30, 3))
    angles[:3, 1] = np.pi / 2
    rotations = Rotation.from_euler("xyz", angles)
    forms = {
        "rpy": angles,
        "matrix": rotations.as_matrix().reshape(-1, 9),
        "rotation vector": rotations.as_rotvec(),
        "xyzw": rotations.as_quat(),
        "wxyz": -rotations.as_quat(scalar_first=True),
    }
    yaw = to_quaternions(angles[:, 2:], "yaw")
    upright = Rotation.from_rotvec(angles * [0.0, 0.0, 1.0])
    assert (Rotation.from_quat(yaw, scalar_first=True) * upright.inv()).magnitude().max() < 1e-7
    for form, values in forms.items():
        q = to_quaternions(values, form)  # type: ignore[arg-type]
        assert np.abs((Rotation.from_quat(q, scalar_first=True) * rotations.inv()).magnitude()).max() < 1e-7
        assert (np.einsum("td,td->t", q[1:], q[:-1]) >= 0).all()


def test_reflections_are_no_rotations():
    with pytest.raises(InvalidInput, match="orientation: R is not a rotation matrix"):
        to_quaternions(np.diag([1.0, 1.0, -1.0]).reshape(1, 9), "matrix")


def small_calls() -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    part = PartSource("a", Quantity.SCALAR, ("a",))
    signal = Signal("", np.zeros((3, 1)), ("a",), ("",), np.arange(3.0))
    settings = BuildSettings((part,))
    return [
        (
            PartSource,
            {"name": "a", "quantity": "scalar", "columns": ("a",), "unit": "", "representation": "wxyz"},
        ),
        (FrameSource, {"name": "a", "position": ("x",), "orientation": (), "unit": "m", "moving": False}),
        (FrameSource, {"name": "a", "position": ("x",), "representation": "rpy", "angle_unit": "deg"}),
        (BuildSettings, {"parts": (part,), "frames": (), "period": 0.1, "unwrap": (), "thin": True}),
        (BuildSettings, {"parts": (part,), "max_gap": 10.0, "still_distance": 0.1, "still_angle": 0.1}),
        (build_demonstration, {"recording": Recording("a", (signal,)), "settings": settings}),
        (suggest_settings, {"recordings": [Recording("a", (signal,))]}),
        (parse_unit, {"text": "m"}),
        (is_unit, {"text": "m"}),
        (time_unit, {"times": np.arange(3.0) / 10, "unit": "s"}),
    ]


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(("function", "arguments"), small_calls())
def test_unusable_arguments_raise_invalid_input_only(function: Callable[..., Any], arguments: dict[str, Any]):
    function(**arguments)
    messages: list[str] = []
    for name in arguments:
        for value in UNUSABLE:
            try:
                function(**{**arguments, name: value})
            except InvalidInput as error:
                messages.append(str(error))
    assert all(message.isprintable() for message in messages)
    assert messages or function is is_unit


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize("field", ["values", "times"])
def test_unusable_signals_raise_invalid_input_only(field: str):
    settings = BuildSettings((PartSource("a", Quantity.SCALAR, ("a",)),))
    good: dict[str, Any] = {"name": "", "values": np.zeros((3, 1)), "columns": ("a",), "units": ("",)}
    good["times"] = np.arange(3.0)
    for value in UNUSABLE:
        if field == "times" and value is None:
            continue
        with pytest.raises(InvalidInput):
            build_demonstration(Recording("a", (Signal(**{**good, field: value}),)), settings)
