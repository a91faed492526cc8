"""A rendering backend is chosen if none is set and no display exists."""

import pytest

from pilotfish.rendering import headless_backend

MESA, BOTH, NOTHING = {"OSMesa"}, {"OSMesa", "EGL"}, set[str]()


def finding(names: set[str]):
    return lambda name: f"lib{name}.so" if name in names else None


@pytest.mark.parametrize(
    ("variables", "libraries", "chosen"),
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
def test_headless_backend_without_display_is_chosen(
    variables: dict[str, str], libraries: set[str], chosen: str | None
):
    assert headless_backend(variables, finding(libraries)) == chosen
