"""Demonstrations from recordings: units, forms of rotation, rates, gaps and labels."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from pilotfish.demonstrations import (
    BuildSettings,
    FrameSource,
    PartSource,
    Quantity,
    Recording,
    Signal,
    build_demonstration,
    frame_from_pose,
    pose_layout,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose

POSE = ("x", "y", "z", "a", "b", "c", "d")
XYZW = (
    PartSource("position", Quantity.POSITION, ("x", "y", "z")),
    PartSource("orientation", Quantity.QUATERNION, ("a", "b", "c", "d"), representation="xyzw"),
)


def position(times: np.ndarray) -> np.ndarray:
    """Return points of an analytic curve [m]; its second derivative is at most 1 m/s^2."""
    return np.column_stack([np.sin(times), np.cos(times), 0.5 * times])


def rotation(times: np.ndarray) -> Rotation:
    return Rotation.from_rotvec(np.column_stack([0.3 * times, np.sin(times), 1.0 + 0.0 * times]))


def uneven_times(rng: np.random.Generator, rows: int = 200) -> np.ndarray:
    return np.cumsum(rng.uniform(1 / 31, 1 / 29, rows))


def signal(values: np.ndarray, columns: tuple[str, ...], times: np.ndarray | None, unit: str = "") -> Signal:
    return Signal("", values, columns, (unit,) * len(columns), times)


def pose_recording(times: np.ndarray) -> Recording:
    values = np.column_stack([position(times), rotation(times).as_quat()])
    return Recording("reach", (signal(values, POSE, times),))


def scalar(values: object, times: object = None, unit: str = "") -> Recording:
    table = np.array(values, dtype=float).reshape(-1, 1)
    own = np.arange(len(table)) * 0.1 if times is None else np.array(times, dtype=float)
    return Recording("log", (signal(table, ("a",), own, unit),))


def scalar_settings(**changes: object) -> BuildSettings:
    return BuildSettings((PartSource("a", Quantity.SCALAR, ("a",)),), **changes)


@pytest.mark.parametrize("moving", [False, True])
def test_short_log_of_an_object_shortens_the_demonstration_only_if_the_object_moves(moving: bool):
    hand = signal(np.arange(20.0).reshape(-1, 1), ("a",), np.arange(20) * 0.1)
    cup = Signal(
        "cup", np.tile([0.1, 0.2, 0.3], (6, 1)), ("x", "y", "z"), ("",) * 3, 0.5 + np.arange(6) * 0.1
    )
    frame = FrameSource("cup", ("cup:x", "cup:y", "cup:z"), moving=moving)
    settings = BuildSettings((PartSource("a", Quantity.SCALAR, ("a",)),), (frame,))
    demo, _ = build_demonstration(Recording("reach", (hand, cup)), settings)
    assert demo.x.ravel() == pytest.approx(np.arange(5.0, 11.0) if moving else np.arange(20.0))


def test_object_recorded_at_another_time_is_refused():
    hand = signal(np.arange(20.0).reshape(-1, 1), ("a",), np.arange(20) * 0.1)
    cup = Signal("cup", np.zeros((6, 3)), ("x", "y", "z"), ("",) * 3, 1.7e9 + np.arange(6) * 0.1)
    settings = BuildSettings(
        (PartSource("a", Quantity.SCALAR, ("a",)),), (FrameSource("cup", ("cup:x", "cup:y", "cup:z")),)
    )
    with pytest.raises(InvalidInput, match="of one clock and unit"):
        build_demonstration(Recording("reach", (hand, cup)), settings)


def test_uneven_timestamps_follow_analytic_curve(rng: np.random.Generator):
    """The error of linear interpolation is at most h^2 / 8 times the second derivative."""
    demo, conversion = build_demonstration(
        pose_recording(uneven_times(rng)), BuildSettings(XYZW, period=1 / 30)
    )
    assert conversion.times is not None
    assert np.abs(np.diff(conversion.times) - 1 / 30).max() < 1e-12
    error = np.abs(demo.x[:, :3] - position(conversion.times)).max()
    assert 0 < error <= (1 / 29) ** 2 / 8
    assert any("resampled to 30 Hz" in line for line in conversion.lines)


def test_orientation_is_slerp_of_scipy(rng: np.random.Generator):
    """Rotations between rows agree with another implementation, whatever the signs in the file."""
    times = uneven_times(rng)
    recording = pose_recording(times)
    values = recording.signals[0].values
    values[:, 3:] *= rng.choice([-1.0, 1.0], len(times))[:, None]
    demo, conversion = build_demonstration(recording, BuildSettings(XYZW, period=0.01))
    expected = Slerp(times, rotation(times))(conversion.times).as_quat(scalar_first=True)
    assert np.abs(np.abs(np.einsum("td,td->t", expected, demo.x[:, 3:])) - 1).max() < 1e-12
    assert (np.einsum("td,td->t", demo.x[1:, 3:], demo.x[:-1, 3:]) > 0.9).all()
    assert any("sign" in line for line in conversion.lines)


def equivalent_recordings() -> dict[str, tuple[Recording, tuple[PartSource, ...]]]:
    """Return one motion in different units and forms of rotation."""
    times = np.arange(50) * 0.04
    p, r = position(times), rotation(times)
    forms = {
        "wxyz": r.as_quat(scalar_first=True, canonical=True),
        "xyzw": r.as_quat(canonical=True),
        "rpy": r.as_euler("xyz"),
        "matrix": r.as_matrix().reshape(-1, 9),
        "rotation vector": r.as_rotvec(),
    }
    cases = {}
    for form, rows in forms.items():
        columns = (*"xyz", *(f"r{n}" for n in range(rows.shape[1])))
        recording = Recording("a", (signal(np.column_stack([p, rows]), columns, times),))
        turn = PartSource("orientation", Quantity.QUATERNION, ("r*",), representation=form)  # type: ignore[arg-type]
        cases[form] = recording, (XYZW[0], turn)
    degrees = Recording(
        "a",
        (
            Signal(
                "",
                np.column_stack([1000 * p, r.as_euler("xyz", degrees=True)]),
                ("x", "y", "z", "roll", "pitch", "yaw"),
                ("mm",) * 3 + ("deg",) * 3,
                times,
            ),
        ),
    )
    turn = PartSource("orientation", Quantity.QUATERNION, ("roll", "pitch", "yaw"), "deg", "rpy")
    cases["mm and degrees"] = degrees, (XYZW[0], turn)
    return cases


@pytest.mark.parametrize("case", equivalent_recordings())
def test_equivalent_units_and_rotations_give_equal_demonstrations(case: str):
    cases = equivalent_recordings()
    expected, _ = build_demonstration(cases["wxyz"][0], BuildSettings(cases["wxyz"][1]))
    demo, _ = build_demonstration(cases[case][0], BuildSettings(cases[case][1]))
    assert demo.layout == expected.layout == pose_layout()
    assert demo.period == expected.period
    assert np.abs(demo.x - expected.x).max() < 1e-12


def test_even_rows_are_not_changed():
    """A recording in SI units at an even rate is returned exactly, also with times since 1970."""
    recording = pose_recording(np.arange(100) / 30)
    demo, conversion = build_demonstration(recording, BuildSettings(XYZW[:1]))
    assert np.array_equal(demo.x, recording.signals[0].values[:, :3])
    assert not conversion.lines
    shifted = replace(recording.signals[0], times=np.round(1.7e9 + np.arange(100) / 30, 6))
    again, _ = build_demonstration(replace(recording, signals=(shifted,)), BuildSettings(XYZW[:1]))
    assert np.array_equal(again.x, demo.x)
    assert again.period == demo.period == 1 / 30


def test_two_rates_are_aligned_over_their_overlap():
    """A 500 Hz arm and a 30 Hz camera that starts later give rows for the time of both."""
    fast, slow = np.arange(2000) / 500, 0.5 + np.arange(90) / 30
    robot = replace(signal(position(fast), ("x", "y", "z"), fast), name="robot")
    camera = replace(signal(position(slow), ("x", "y", "z"), slow, "m"), name="cup")
    settings = BuildSettings(
        (PartSource("position", Quantity.POSITION, ("robot:*",)),),
        (FrameSource("cup", ("cup:x", "cup:y", "cup:z"), moving=True),),
        period=0.02,
    )
    demo, conversion = build_demonstration(Recording("a", (robot, camera)), settings)
    assert conversion.times is not None
    assert conversion.times[0] == 0.5
    assert slow[-1] - 0.02 < conversion.times[-1] <= slow[-1]
    assert np.abs(demo.x - position(conversion.times)).max() < 1e-5
    assert np.abs(demo.frames[0].b - position(conversion.times)).max() < (1 / 30) ** 2 / 8
    assert any("left out" in line for line in conversion.lines)
    still = replace(settings, frames=(replace(settings.frames[0], moving=False),))
    demo, conversion = build_demonstration(Recording("a", (robot, camera)), still)
    expected = frame_from_pose(
        "cup", demo.layout, Pose(position(np.array([0.5]))[0], np.array([1.0, 0, 0, 0]))
    )
    assert np.allclose(demo.frames[0].b, expected.b)
    assert any("the object moves by" in line for line in conversion.lines)


def test_frame_orientation_is_converted():
    """Frames in millimetres and x y z w equal the frame of the pose."""
    turn = Rotation.from_euler("xyz", [0.1, 0.2, 0.3])
    values = np.column_stack(
        [np.full((5, 3), 250.0), np.tile(turn.as_quat(), (5, 1)), np.arange(5), np.ones((5, 2))]
    )
    columns = (*POSE, "px", "py", "pz")
    recording = Recording("a", (signal(values, columns, np.arange(5) * 0.1),))
    part = PartSource("position", Quantity.POSITION, ("px", "py", "pz"))
    frame = FrameSource("cup", ("x", "y", "z"), ("a", "b", "c", "d"), "xyzw", "mm")
    demo, _ = build_demonstration(recording, BuildSettings((part,), (frame,)))
    pose = Pose(np.full(3, 0.25), turn.as_quat(scalar_first=True))
    expected = frame_from_pose("cup", demo.layout, pose)
    assert np.allclose(demo.frames[0].A, expected.A, atol=1e-12)
    assert np.allclose(demo.frames[0].b, expected.b, atol=1e-12)


def test_angle_that_wraps_is_unwrapped():
    angles = np.linspace(-4.0, 9.0, 60)
    wrapped = (angles + np.pi) % (2 * np.pi) - np.pi
    demo, conversion = build_demonstration(scalar(np.degrees(wrapped), unit="deg"), scalar_settings())
    assert np.ptp(demo.x[:, 0] - angles) < 1e-12
    assert any("2 jumps of 2 pi" in line for line in conversion.lines)
    kept, _ = build_demonstration(scalar(wrapped, unit="rad"), scalar_settings(unwrap=()))
    assert np.allclose(kept.x[:, 0], wrapped)


def test_two_valued_column_has_no_ramp():
    demo, _ = build_demonstration(scalar([0.0] * 10 + [100.0] * 10), scalar_settings(period=0.03))
    assert set(demo.x[:, 0]) == {0.0, 100.0}


def test_held_rows_are_thinned():
    """A 50 Hz source in a 500 Hz log gives the period and the values of the source."""
    values = np.repeat(np.sin(np.arange(40) * 0.3), 10)
    demo, conversion = build_demonstration(scalar(values, np.arange(400) / 500), scalar_settings())
    assert demo.period == 1 / 50
    assert np.array_equal(demo.x[:, 0], np.sin(np.arange(40) * 0.3)[: len(demo.x)])
    assert any("held for 10 rows" in line for line in conversion.lines)
    still = np.concatenate([values, np.full(2000, 7.0), values])
    demo, _ = build_demonstration(scalar(still, np.arange(len(still)) / 500), scalar_settings())
    assert demo.period == 1 / 50
    assert np.array_equal(demo.x[:, 0], still[::10][: len(demo.x)])
    rest = np.concatenate([np.sin(np.arange(40)), np.zeros(50), np.cos(np.arange(40))])
    demo, conversion = build_demonstration(scalar(rest, np.arange(130) / 50), scalar_settings())
    assert len(demo.x) == 130
    assert not conversion.lines


def test_labels_follow_nearest_time():
    recording = replace(scalar(np.arange(5.0)), labels={"phase": ("a", "a", "b", "b", "c")})
    _, conversion = build_demonstration(recording, scalar_settings(period=0.04))
    assert conversion.labels["phase"] == ("a", "a", "a", "a", "b", "b", "b", "b", "b", "c", "c")


@pytest.mark.parametrize(
    ("steps", "period"),
    [
        (0.03337, 1 / 30),
        (0.03319, 1 / 30),
        (0.002004, 1 / 500),
        (1 / 256, 1 / 256),
        (0.0625, 1 / 16),
        (0.4, 0.4),
    ],
)
def test_period_is_rounded_to_the_rate_of_the_source(steps: float, period: float):
    demo, _ = build_demonstration(scalar(np.arange(50.0), np.arange(50) * steps), scalar_settings())
    assert demo.period == pytest.approx(period, rel=1e-12)


@pytest.mark.parametrize("has_times", [True, False])
def test_rows_without_values_are_interpolated_and_reported(has_times: bool):
    """A line is interpolated exactly; without times, rows keep those of the period."""
    line = 2.0 * np.arange(30.0)
    line[[4, 5, 11]] = np.nan, np.inf, np.nan
    times = np.arange(30) * 0.1 if has_times else None
    recording = Recording("log", (signal(line.reshape(-1, 1), ("a",), times),), {"phase": ("p",) * 30})
    demo, conversion = build_demonstration(recording, scalar_settings(period=0.1))
    np.testing.assert_allclose(demo.x[:, 0], 2.0 * np.arange(30.0), atol=1e-9)
    assert "3 of 30 rows without values are left out" in conversion.lines[0]
    assert len(conversion.labels["phase"]) == 30


def test_single_rows_that_repeat_a_time_are_left_out_and_many_are_refused():
    """A message that was logged twice is harmless; a clock in whole seconds is not."""
    times = np.arange(30) * 0.1
    times[7] = times[6]
    demo, conversion = build_demonstration(scalar(np.arange(30.0), times), scalar_settings(period=0.1))
    np.testing.assert_allclose(demo.x[:, 0], np.arange(30.0), atol=1e-9)
    assert "1 rows that repeat the time of the row before" in conversion.lines[0]
    with pytest.raises(InvalidInput, match="repeats"):
        build_demonstration(scalar(np.arange(30.0), np.arange(30) // 3), scalar_settings())


def test_rows_missing_for_longer_than_the_limit_are_refused():
    line = np.arange(60.0)
    line[20:40] = np.nan
    with pytest.raises(InvalidInput, match=r"no rows for 2\.1 s after 1\.9 s"):
        build_demonstration(scalar(line), scalar_settings())


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0, 1, 1, 2], "row 2 .*, 1 s, repeats"),
        ([0, 1, 0.5, 2], "row 2 .* is before"),
        ([0, 1, np.nan, 2], "row 2 .* is nan"),
        ([0, 1, np.inf, 2], "row 2 .* is inf"),
        ([0, 0.1, 0.2, 5], r"no rows for 4.8 s after 0.2 s \(row 2.*max_gap"),
        ([0, 1, 2], "times for 4 rows"),
    ],
)
def test_unusable_times_are_refused(times: list[float], message: str):
    with pytest.raises(InvalidInput, match=message):
        build_demonstration(scalar(np.arange(4.0), times), scalar_settings())


def test_gap_within_the_limit_is_interpolated():
    recording = scalar([0, 1, 2, 50], [0, 0.1, 0.2, 5.0])
    demo, _ = build_demonstration(recording, scalar_settings(max_gap=100.0))
    assert np.allclose(np.diff(demo.x[3:, 0]), 1.0)


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    ("recording", "part", "message"),
    [
        (scalar([np.nan, np.nan, np.nan]), {}, "no row has values in all of 'a'"),
        (scalar([0.0]), {}, "one row, expected at least two"),
        (scalar(np.zeros((0, 1))), {}, "no rows"),
        (Recording("none", ()), {}, "no signals"),
        (scalar([0, 1, 2]), {"columns": ("b",)}, "no column is named 'b'"),
        (scalar([0, 1, 2]), {"columns": ("a", "a")}, "twice"),
        (scalar([0, 1, 2]), {"quantity": Quantity.POSITION, "unit": "furlong"}, "which is unknown"),
        (scalar([0, 1, 2]), {"quantity": Quantity.POSITION, "unit": "deg"}, "expected a length"),
        (scalar([0, 1, 2], unit="kg"), {"quantity": Quantity.POSITION}, "'kg', expected a length"),
        (scalar([0, 1, 2], unit="mm"), {"unit": "m"}, "the file states 'mm'"),
        (scalar([0, 1, 2]), {"quantity": "spin"}, "quantity is 'spin'"),
        (scalar([0, 1, 2]), {"quantity": Quantity.QUATERNION}, r"shape \(3, 1\), expected \(T, 4\)"),
        (scalar([0, 1, 2]), {"representation": "zyx"}, "expected one of wxyz"),
    ],
)
def test_unusable_recording_or_part_is_refused(recording: Recording, part: dict[str, object], message: str):
    fields: dict[str, Any] = {"name": "a", "quantity": Quantity.SCALAR, "columns": ("a",), **part}
    with pytest.raises(InvalidInput, match=message):
        build_demonstration(recording, BuildSettings((PartSource(**fields),)))


def test_signals_without_overlap_are_refused():
    first, second = (scalar(np.arange(4.0), np.arange(4) * 0.1 + shift).signals[0] for shift in (0, 9))
    recording = Recording("a", (replace(first, name="one"), replace(second, name="two")))
    parts = tuple(PartSource(name, Quantity.SCALAR, (f"{name}:a",)) for name in ("one", "two"))
    with pytest.raises(InvalidInput, match="less than two rows in common"):
        build_demonstration(recording, BuildSettings(parts))
    with pytest.raises(InvalidInput, match="columns of several signals"):
        build_demonstration(recording, BuildSettings((PartSource("a", Quantity.SCALAR, ("*:a",)),)))
    with pytest.raises(InvalidInput, match="write SIGNAL:COLUMN"):
        build_demonstration(recording, scalar_settings())


def test_rows_without_times_need_a_period():
    recording = Recording("a", (signal(np.arange(4.0)[:, None], ("a",), None),))
    with pytest.raises(InvalidInput, match="pass the period"):
        build_demonstration(recording, scalar_settings())
    demo, _ = build_demonstration(recording, scalar_settings(period=0.5))
    assert (len(demo.x), demo.period) == (4, 0.5)
    stated, _ = build_demonstration(replace(recording, period=0.1), scalar_settings(period=0.05))
    assert len(stated.x) == 7


def test_unknown_unit_of_a_scalar_is_kept():
    demo, _ = build_demonstration(scalar([0, 1, 2], unit="psi"), scalar_settings())
    assert demo.layout.units == ("psi",)


def test_lost_quaternion_is_refused():
    recording = pose_recording(np.arange(10) * 0.1)
    recording.signals[0].values[4, 3:] = 0.0
    with pytest.raises(InvalidInput, match=r"row 4 .* norm 0"):
        build_demonstration(recording, BuildSettings(XYZW))


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    "changes",
    [{"period": 0.0}, {"period": np.nan}, {"parts": ()}, {"max_gap": 0}, {"unwrap": ("b",)}, {"thin": 1}],
)
def test_unusable_settings_are_refused(changes: dict[str, object]):
    with pytest.raises(InvalidInput):
        replace(scalar_settings(), **changes)


def test_still_object_that_jumps_is_reported_and_one_at_the_origin_refused():
    hand = signal(np.arange(20.0).reshape(-1, 1), ("a",), np.arange(20) * 0.1)
    frame = FrameSource("cup", ("cup:x", "cup:y", "cup:z"))
    settings = BuildSettings((PartSource("a", Quantity.SCALAR, ("a",)),), (frame,))
    points = np.tile([0.3, 0.4, 0.0], (20, 1))
    for first in ([0.6, 0.8, 0.0], [0.0, 0.0, 0.0]):
        points[:3] = first
        cup = Signal("cup", points, ("x", "y", "z"), ("",) * 3, np.arange(20) * 0.1)
        recording = Recording("reach", (hand, cup))
        if any(first):
            _, conversion = build_demonstration(recording, settings)
            assert any("jumps by 0.5 m at row 3" in line for line in conversion.lines)
            continue
        with pytest.raises(InvalidInput, match=r"first 3 rows .* remove those rows"):
            build_demonstration(recording, settings)
