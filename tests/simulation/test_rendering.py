"""What draws is chosen where nothing else says so, and what is missing is named with its remedy."""

import pytest

from pilotfish.simulation.rendering import headless_backend

MESA, BOTH, NOTHING = {"OSMesa"}, {"OSMesa", "EGL"}, set[str]()


def finding(names: set[str]):
    return lambda name: f"lib{name}.so" if name in names else None


@pytest.mark.parametrize(
    ("variables", "there", "chosen"),
    [
        ({}, BOTH, "osmesa"),
        ({}, MESA, "osmesa"),
        ({}, {"EGL"}, "egl"),
        ({}, NOTHING, None),
        ({"MUJOCO_GL": "glfw"}, BOTH, None),
        ({"MUJOCO_GL": ""}, BOTH, "osmesa"),
        ({"DISPLAY": ":0"}, BOTH, None),
        ({"WAYLAND_DISPLAY": "wayland-0"}, BOTH, None),
        ({"DISPLAY": ""}, {"EGL"}, "egl"),
    ],
)
def test_what_draws_is_chosen_where_nobody_chose(
    variables: dict[str, str], there: set[str], chosen: str | None
):
    """Without a screen and without MUJOCO_GL it is OSMesa, else EGL, else left to MuJoCo."""
    assert headless_backend(variables, finding(there)) == chosen
