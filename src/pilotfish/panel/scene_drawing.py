"""Scene of the page: nodes of viser that draw the values of `scene_values.py`."""

from typing import TYPE_CHECKING, Any

import numpy as np

from pilotfish.geometry import Pose
from pilotfish.panel.colours import AXIS_COLOURS, MOTION, demonstration_colour, linear_rgb, rgb
from pilotfish.panel.content import ViewContent, is_fixed
from pilotfish.panel.frame_motions import frame_pose
from pilotfish.panel.live_reproduction import LiveReproduction
from pilotfish.panel.scene_values import (
    MIN_THICKNESS,
    Extent,
    Grid,
    path_segments,
    sphere_mesh,
    state_ellipsoids,
    step_at,
    tool_pose,
)
from pilotfish.panel.spatial_columns import AXES, SPACE
from pilotfish.types import Array, Float

if TYPE_CHECKING:
    import viser

HANDLE_SIZE, AXES_LENGTH, TOOL_LENGTH = 0.14, 0.1, 0.07  # relative to the extent
THIN, THICK = 2.0, 4.0  # pixels
LIFT = 0.003  # relative to the extent, of lines above discs in a plane
OPACITY = 0.45
LIGHT = (222, 222, 222)


class SceneDrawing:
    """Nodes of the scene, and how they follow the situation and time."""

    def __init__(self, server: "viser.ViserServer", content: ViewContent, extent: Extent, grid: Grid) -> None:
        self._server, self._content, self._extent = server, content, extent
        self.handles: dict[int, viser.TransformControlsHandle] = {}
        self._states: Any = None
        self._path: Any = None
        self._draw_grid(grid)
        self.demonstrations = [self._draw_demonstration(m) for m in range(len(content.demonstrations))]
        self.frames = [self._draw_frame(n) for n in range(len(content.situations[0].frames))]
        self._tools = self._draw_tools()

    def draw_motion(self, live: LiveReproduction | None, deviations: float) -> None:
        """Draw states and motion of a situation, in place of the previous ones.

        Args:
            live: Computed motion; None without a skill.
            deviations: Standard deviations of the ellipsoids; 0 for none.
        """
        if live is None:
            return
        self._draw_states(live, deviations)
        if self._path:
            self._path.visible = live.reproduction is not None
        if live.reproduction is None:
            return
        points = path_segments(self._content.layout, live.reproduction.motion.x)
        if self._path is None:
            self._path = self._draw_line("/motion", points, rgb(MOTION), THICK)
        else:
            self._path.points = points

    def draw_tools(self, live: LiveReproduction | None, time: float) -> None:
        """Draw the axes of the tool at a time: of the motion, or else of each visible demonstration."""
        layout = self._content.layout
        if self._content.skill is not None:
            motion = live.reproduction.motion if live and live.reproduction else None
            self._tools[0].visible = motion is not None
            if motion is not None:
                step = step_at(time, motion.period, len(motion.x))
                _place(self._tools[0], tool_pose(layout, motion.x, step))
            return
        for demo, line, tool in zip(
            self._content.demonstrations, self.demonstrations, self._tools, strict=True
        ):
            tool.visible = line.visible
            _place(tool, tool_pose(layout, demo.x, step_at(time, demo.period, len(demo.x))))

    def place_handles(self, poses: "list[Pose]") -> None:
        """Put the handles of all frames at poses.

        Args:
            poses: Pose of each frame.
        """
        for n, pose in enumerate(poses):
            _place(self.handles[n] if n in self.handles else self.frames[n], pose)

    def _draw_grid(self, grid: Grid) -> None:
        self._server.scene.world_axes.visible = False
        self._server.scene.add_grid(
            "/grid",
            width=grid.width,
            height=grid.height,
            cell_size=grid.cell,
            section_size=5.0 * grid.cell,
            cell_color=LIGHT,
            section_color=(190, 190, 190),
            position=tuple(grid.centre.tolist()),
        )
        corner = grid.centre - np.array([0.5 * grid.width, 0.5 * grid.height, 0.0])
        node = self._server.scene.add_frame("/world", show_axes=False, position=tuple(corner.tolist()))
        self._draw_axes(node.name, AXES_LENGTH * self._extent.size, letters=True)

    def _draw_demonstration(self, m: int) -> Any:
        demo, beside_skill = self._content.demonstrations[m], self._content.skill is not None
        colour = rgb(demonstration_colour(m, beside_skill=beside_skill))
        segments = path_segments(self._content.layout, demo.x)
        return self._draw_line(f"/demonstrations/{m}", segments, colour, THIN if beside_skill else THICK)

    def _draw_frame(self, n: int) -> Any:
        """Draw a frame: its axes and name, and a handle if a skill follows it."""
        frame, size, flat = self._content.situations[0].frames[n], self._extent.size, self._extent.is_flat
        name, pose = f"/frames/{n}", frame_pose(frame, self._content.layout)
        if self._content.skill is not None and not is_fixed(frame):
            node: Any = self._server.scene.add_transform_controls(
                name,
                scale=HANDLE_SIZE * size,
                line_width=3.0,
                active_axes=(True, True, not flat),
                depth_test=False,
            )
            self.handles[n] = node
        else:
            node = self._server.scene.add_frame(name, show_axes=False)
        if n not in self.handles:  # a handle has axes of its own
            self._draw_axes(name, AXES_LENGTH * size, letters=True)
        self._server.scene.add_label(f"{name}/name", frame.name, anchor="top-center")
        _place(node, pose)
        return node

    def _draw_tools(self) -> list[Any]:
        """Draw the axes of one tool for the motion, or of one for each demonstration."""
        count = 1 if self._content.skill is not None else len(self._content.demonstrations)
        nodes = [self._server.scene.add_frame(f"/tools/{n}", show_axes=False) for n in range(count)]
        for node in nodes:
            self._draw_axes(node.name, TOOL_LENGTH * self._extent.size, letters=False)
        return nodes

    def _draw_states(self, live: LiveReproduction, deviations: float) -> None:
        if self._states:
            self._states.visible = deviations > 0.0 and live.adapted is not None
        if live.adapted is None or not deviations > 0.0:
            return
        values = state_ellipsoids(live.adapted, deviations, MIN_THICKNESS * self._extent.size)
        if self._states is None:
            vertices, faces = sphere_mesh()
            self._states = self._server.scene.add_batched_meshes_simple(
                "/states",
                vertices,
                faces,
                values.quaternions,
                values.centres,
                batched_scales=values.semi_axes,
                batched_colors=values.colours,
                opacity=OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )
            return
        self._states.batched_positions = values.centres
        self._states.batched_wxyzs = values.quaternions
        self._states.batched_scales = values.semi_axes

    def _draw_axes(self, parent: str, length: float, *, letters: bool) -> None:
        """Draw the axes of a node in the colours of the plots."""
        ends = length * np.eye(SPACE)[: 2 if self._extent.is_flat else SPACE]
        colours = np.array(
            [[linear_rgb(AXIS_COLOURS[axis])] * 2 for axis in AXES[: len(ends)]], dtype=np.uint8
        )
        segments = np.stack([np.zeros_like(ends), ends], axis=1)
        self._draw_line(f"{parent}/axes", segments, colours, THICK)
        for axis, end in zip(AXES, 1.1 * ends if letters else (), strict=False):
            self._server.scene.add_label(f"{parent}/{axis}", axis, position=end, anchor="center-center")

    def _draw_line(self, name: str, segments: Float[Array, "S 2 3"], colours: Any, thickness: float) -> Any:
        lift = LIFT * thickness * self._extent.size if self._extent.is_flat else 0.0
        return self._server.scene.add_line_segments(
            name,
            segments,
            colours,
            thickness=thickness,
            thickness_units="screen",
            position=(0.0, 0.0, lift),
        )


def _place(node: Any, pose: Pose) -> None:
    """Set the pose of a node."""
    node.position = pose.position
    node.wxyz = pose.quaternion
