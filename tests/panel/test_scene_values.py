"""Values that the page draws, by independent computations."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration, demonstration, position_layout
from pilotfish.geometry import rotation_matrix
from pilotfish.models import Skill, adapt
from pilotfish.panel import view_content
from pilotfish.panel.colours import (
    DEMONSTRATION,
    MOTION,
    STATE_COLOURS,
    demonstration_colour,
    linear_rgb,
    rgb,
)
from pilotfish.panel.scene_values import (
    FIELD_OF_VIEW,
    Extent,
    extent_of,
    first_camera,
    grid_under,
    path_segments,
    round_length,
    sphere_mesh,
    state_ellipsoids,
    step_at,
    tool_pose,
)
from pilotfish.plots import style

Demonstrations = tuple[Demonstration, ...]


@pytest.mark.parametrize("name", ["reach_skill", "sphere_skill"])
def test_points_of_ellipsoids_have_one_mahalanobis_distance(
    name: str, request: pytest.FixtureRequest, reaches: Demonstrations
):
    """Each point of the drawn surface is at the given number of standard deviations of the position."""
    skill = request.getfixturevalue(name)
    content = view_content((), skill)
    adapted = adapt(skill, content.situations[0].frames)
    ellipsoids = state_ellipsoids(adapted, 2.0, 0.0)
    vertices, _ = sphere_mesh()
    for k in range(adapted.states):
        surface = (vertices * ellipsoids.semi_axes[k]) @ rotation_matrix(ellipsoids.quaternions[k]).T
        covariance = adapted.covariances[k][:3, :3]
        distances = np.sqrt(np.einsum("vi,iv->v", surface, np.linalg.solve(covariance, surface.T)))
        np.testing.assert_allclose(distances, 2.0, rtol=1e-6)
    np.testing.assert_array_equal(ellipsoids.centres, adapted.means[:, :3])


def test_ellipsoids_in_plane_are_discs(stroke_skill: Skill):
    adapted = adapt(stroke_skill, view_content((), stroke_skill).situations[0].frames)
    ellipsoids = state_ellipsoids(adapted, 1.0, 1e-6)
    assert (ellipsoids.semi_axes.min(axis=1) == 1e-6).all()
    product = ellipsoids.semi_axes[:, 1] * ellipsoids.semi_axes[:, 2]
    np.testing.assert_allclose(product**2, np.linalg.det(adapted.covariances[:, :2, :2]))


def test_sphere_mesh_is_closed_and_faces_outward():
    vertices, faces = sphere_mesh()
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1.0)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    volume = np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6.0
    assert 0.9 * 4.0 / 3.0 * np.pi < volume < 4.0 / 3.0 * np.pi


def test_path_keeps_ends_and_is_thinned_out(rng: np.random.Generator):
    layout = position_layout(2)
    x = rng.normal(size=(5000, 2))
    segments = path_segments(layout, x)
    assert segments.shape == (999, 2, 3)
    np.testing.assert_array_equal(segments[[0, -1], [0, 1], :2], x[[0, -1]])
    np.testing.assert_array_equal(segments[1:, 0], segments[:-1, 1])
    assert not segments[..., 2].any()


@pytest.mark.parametrize(("time", "step"), [(0.0, 0), (0.14, 1), (0.16, 2), (9.0, 4)])
def test_step_at_is_nearest(time: float, step: int):
    assert step_at(time, 0.1, 5) == step


def test_tool_pose_is_row_of_motion(reaches: Demonstrations):
    pose = tool_pose(reaches[0].layout, reaches[0].x, 7)
    np.testing.assert_allclose(pose.position, reaches[0].x[7, :3])
    np.testing.assert_allclose(pose.quaternion, reaches[0].x[7, 3:7])


@pytest.mark.parametrize("is_flat", [False, True])
def test_first_camera_has_all_points_in_view(rng: np.random.Generator, is_flat: bool):
    points = rng.normal(size=(200, 3)) * rng.uniform(0.1, 2.0, size=3) * [1.0, 1.0, not is_flat]
    extent = Extent(points.min(axis=0), points.max(axis=0), is_flat)
    camera = first_camera(extent)
    forward = (camera.look_at - camera.position) / np.linalg.norm(camera.look_at - camera.position)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    offsets = points - camera.position
    depths = offsets @ forward
    assert (depths > 0.0).all()
    tangents = np.abs(offsets @ np.stack([right, np.cross(right, forward)], axis=1)) / depths[:, None]
    largest = tangents.max(axis=0) / np.tan(0.5 * FIELD_OF_VIEW)
    assert (largest < [1.0, 0.9]).all()
    assert largest.max() > 0.5  # and not far away


def test_extent_contains_paths_frames_and_states(reaches: Demonstrations, reach_skill: Skill):
    content = view_content(reaches, reach_skill)
    extent = extent_of(content, None)
    cups = np.array([demo.frames[1].b[:3] for demo in reaches])
    assert (extent.lowest <= cups).all()
    assert (cups <= extent.highest).all()
    assert extent.lowest.tolist() == pytest.approx(
        np.min([*(demo.x[:, :3].min(axis=0) for demo in reaches), *cups, np.zeros(3)], axis=0).tolist()
    )


def test_extent_leaves_out_the_world(strokes: Demonstrations):
    """A drawing far from the origin of its columns fills the view."""
    x = strokes[0].x[:, :2] + 100.0
    content = view_content([demonstration(x, 0.1, position_layout(2))])
    assert extent_of(content, None).lowest[:2].min() == pytest.approx(x.min())


def test_extent_of_one_point_has_a_size():
    demo = demonstration(np.ones((3, 3)), 0.1, position_layout(3))
    content = view_content([replace(demo, frames=(replace(demo.frames[0], b=np.ones(3)),))])  # type: ignore[arg-type]
    assert extent_of(content, None).size == pytest.approx(np.sqrt(3.0))


@pytest.mark.parametrize(("length", "expected"), [(0.034, 0.02), (0.05, 0.05), (1.0, 1.0), (790.0, 500.0)])
def test_round_length(length: float, expected: float):
    assert round_length(length) == pytest.approx(expected)


def test_grid_is_under_the_data(rng: np.random.Generator):
    low = rng.normal(size=3)
    grid = grid_under(Extent(low, low + np.array([1.0, 0.3, 0.2]), False))
    assert grid.centre[2] == low[2]
    assert abs(grid.centre[0] - low[0] - 0.5) + 0.5 <= 0.5 * grid.width + grid.cell


def test_colours_are_those_of_plots():
    assert STATE_COLOURS == style.STATE_COLOURS
    assert (MOTION, style.MOTION) == ("#000000", "black")
    assert rgb(DEMONSTRATION)[0] == round(255 * float(style.DEMONSTRATION))
    assert demonstration_colour(2, beside_skill=True) == DEMONSTRATION
    assert demonstration_colour(9, beside_skill=False) == STATE_COLOURS[1]
    assert (linear_rgb("#FFFFFF"), linear_rgb("#000000")) == ((255,) * 3, (0,) * 3)
    assert linear_rgb("#737373") == (44,) * 3  # (115 / 255) is 0.1714 of full light
