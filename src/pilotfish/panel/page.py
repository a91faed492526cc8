"""Page in the browser: controls beside the scene, events of both, and one computation at a time.

The functions that viser calls only replace the newest state (`view_state.py`). `Page.refresh` runs in one
thread. It compares that state with what is drawn, computes what differs, and draws it.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import floor, log10
from time import perf_counter, thread_time
from typing import TYPE_CHECKING, Any

from pilotfish.geometry import Pose
from pilotfish.panel import readouts
from pilotfish.panel.content import ViewContent
from pilotfish.panel.frame_motions import frame_pose
from pilotfish.panel.live_reproduction import LiveReproduction, compute_reproduction, reproduction_notes
from pilotfish.panel.scene_drawing import SceneDrawing
from pilotfish.panel.scene_values import extent_of, first_camera, grid_under, round_length
from pilotfish.panel.spatial_columns import position_part
from pilotfish.panel.view_state import (
    LatestState,
    ViewState,
    advance,
    choose_situation,
    drag_frame,
    first_state,
)

if TYPE_CHECKING:
    import viser

PANEL_WIDTH = 400  # pixels
FRAME_PERIOD, IDLE_PERIOD = 0.05, 0.25  # s, between two images while time advances, and else
DEVIATIONS = {"hidden": 0.0, "1 standard deviation": 1.0, "2 standard deviations": 2.0}
RESOLUTION = 1e-3  # of the extent, of numbers that are typed
Event = Any  # of viser


class Page:
    """Page of one content; all browsers that open it see and change the same state."""

    def __init__(self, server: "viser.ViserServer", content: ViewContent) -> None:
        self._server, self._content = server, content
        self._latest = LatestState(first_state(content))
        self._drawn: ViewState | None = None
        self._live: LiveReproduction | None = None
        self._cost = readouts.Cost(0.0, 0.0)
        self._notes_of: tuple[Any, ...] | None = None  # frames whose notes are displayed
        adapted = self._compute(self._latest.get())
        self._compute(self._latest.get())  # without the imports of the first time
        extent = extent_of(content, adapted.adapted if adapted else None)
        grid, camera = grid_under(extent), first_camera(extent)
        server.initial_camera.position = camera.position
        server.initial_camera.look_at = camera.look_at
        server.initial_camera.up = camera.up
        step = round_length(RESOLUTION * extent.size)
        self._step, self._digits = step, max(-floor(log10(step)), 0)
        self._scene = SceneDrawing(server, content, extent, grid)
        self._add_controls(grid.cell)
        self.refresh()

    def run(self, should_stop: Callable[[], object]) -> None:
        """Draw the newest state until a function returns true.

        Args:
            should_stop: Called several times a second.
        """
        last = perf_counter()
        while not should_stop():
            playing = self._latest.get().is_playing
            self._latest.wait(self._drawn, FRAME_PERIOD if playing else IDLE_PERIOD)
            now = perf_counter()
            if self._latest.get().is_playing:
                self._latest.update(partial(advance, seconds=now - last, duration=self._duration()))
            last = now
            self.refresh()
            self._refresh_notes()

    def refresh(self) -> None:
        """Compute and draw what has changed since the last call."""
        state, drawn = self._latest.get(), self._drawn
        if state is drawn:
            return
        has_moved = drawn is None or state.frames is not drawn.frames
        if has_moved and drawn is not None:
            self._compute(state)
        with self._server.atomic():
            if has_moved:
                self._draw_situation(state)
            if drawn is None or has_moved or state.deviations != drawn.deviations:
                self._scene.draw_motion(self._live, state.deviations)
            self._draw_time(state)
        self._drawn = state

    def _compute(self, state: ViewState) -> LiveReproduction | None:
        if self._content.skill is None:
            return None
        clocks = perf_counter, thread_time
        start = [clock() for clock in clocks]
        self._live = compute_reproduction(self._content.skill, state.frames)
        self._cost = readouts.Cost(
            *(1e3 * (clock() - before) for clock, before in zip(clocks, start, strict=True))
        )
        return self._live

    def _duration(self) -> float:
        """Return the time at the end of the motion, or of the longest demonstration without a skill [s]."""
        if self._live and self._live.reproduction:
            motion = self._live.reproduction.motion
            return float(motion.period * (len(motion.x) - 1))
        return max((demo.period * (len(demo.x) - 1) for demo in self._content.demonstrations), default=1.0)

    def _draw_situation(self, state: ViewState) -> None:
        """Draw handles and numbers of the frames, and texts of the computation."""
        poses = [frame_pose(frame, self._content.layout) for frame in state.frames]
        if self._drawn is None or state.placements != self._drawn.placements:
            self._scene.place_handles(poses)
            self._situation.value = self._content.situations[state.situation].name
        for n, (position, turn) in self._inputs.items():
            values = readouts.pose_to_inputs(poses[n], self._digits)
            position.value = values[0][: len(position.value)]
            if isinstance(turn.value, tuple):
                turn.value = values[1]
            else:
                turn.value = values[1][2]
        self._slider.max = self._duration()
        self._computation.content = readouts.computation_html(self._live, self._cost)
        self._notes.content = readouts.notes_html(self._live, None)

    def _refresh_notes(self) -> None:
        """Compute the notes of the motion that is drawn, unless a newer situation waits."""
        state, skill = self._drawn, self._content.skill
        if state is None or state.frames is self._notes_of or state.frames is not self._latest.get().frames:
            return
        notes = reproduction_notes(skill, self._live, state.frames) if skill and self._live else ()
        self._notes.content = readouts.notes_html(self._live, notes)
        self._notes_of = state.frames

    def _draw_time(self, state: ViewState) -> None:
        self._scene.draw_tools(self._live, state.time)
        self._slider.value = min(round(state.time, 2), float(self._slider.max))
        self._play.label = "Pause" if state.is_playing else "Play"
        self._numbers.content = readouts.motion_html(self._content, self._live, state.time)

    def _add_controls(self, cell: float) -> None:
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        gui.add_html(readouts.summary_html(self._content, cell))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Motion"):
            self._add_situation()
            self._add_motion()
        with tabs.add_tab("Display"):
            self._add_visibility()
        for n, handle in self._scene.handles.items():
            handle.on_update(partial(self._on_drag, n))

    def _add_situation(self) -> None:
        gui, names = self._server.gui, [each.name for each in self._content.situations]
        with gui.add_folder("Situation"):
            self._situation: Any = gui.add_dropdown("frames of", names, initial_value=names[0])
            self._situation.on_update(self._on_situation)
            self._inputs = {n: self._add_inputs(n) for n in self._scene.handles}
            reset = gui.add_button("Reset", hint="Put all frames back to where the situation had them.")
            reset.on_click(self._on_reset)
            reset.visible = bool(self._inputs)

    def _add_motion(self) -> None:
        gui = self._server.gui
        with gui.add_folder("Motion"):
            self._slider: Any = gui.add_slider("time [s]", 0.0, self._duration(), 0.01, 0.0)
            self._slider.on_update(self._on_time)
            self._play = gui.add_button("Play")
            self._play.on_click(self._on_play)
            self._numbers = gui.add_html("")
        with gui.add_folder("Computation"):
            self._computation = gui.add_html("")
            self._notes = gui.add_html("")

    def _add_inputs(self, n: int) -> tuple[Any, Any]:
        """Add the numbers of the pose of a frame, which can be typed."""
        gui, frame = self._server.gui, self._content.situations[0].frames[n]
        part, _ = position_part(self._content.layout)
        position, turn = readouts.pose_to_inputs(frame_pose(frame, self._content.layout), self._digits)
        with gui.add_folder(frame.name):
            if part.size == 3:
                inputs: tuple[Any, Any] = (
                    gui.add_vector3(f"x y z [{part.unit}]", position, step=self._step),  # type: ignore[arg-type]
                    gui.add_vector3("turn [deg]", turn, step=1.0, hint="rotation vector"),  # type: ignore[arg-type]
                )
            else:
                inputs = (
                    gui.add_vector2(f"x y [{part.unit}]", position[:2], step=self._step),  # type: ignore[arg-type]
                    gui.add_number("turn [deg]", turn[2], step=1.0),
                )
        for each in inputs:
            each.on_update(partial(self._on_input, n))
        return inputs

    def _add_visibility(self) -> None:
        gui = self._server.gui
        if self._content.skill:
            states = gui.add_dropdown("states", list(DEVIATIONS), initial_value="1 standard deviation")
            states.on_update(self._on_deviations)
        frames = gui.add_checkbox("frames", True)
        frames.on_update(self._on_frames)
        if not self._content.demonstrations:
            return
        with gui.add_folder("Demonstrations"):
            every = gui.add_checkbox("all", True)
            boxes = [
                gui.add_checkbox(demo.name or f"{m}", True)
                for m, demo in enumerate(self._content.demonstrations)
            ]
        every.on_update(partial(self._on_all, boxes))
        for line, box in zip(self._scene.demonstrations, boxes, strict=True):
            box.on_update(partial(self._on_demonstration, line))

    async def _on_drag(self, n: int, event: Event) -> None:
        target = Pose(event.target.position.astype(float), event.target.wxyz.astype(float))
        self._latest.update(lambda s: drag_frame(s, self._content, n, target, by_handle=True))

    async def _on_input(self, n: int, event: Event) -> None:
        if event.client is None:  # set by this program
            return
        position, turn = (each.value for each in self._inputs[n])
        target = readouts.inputs_to_pose(position, turn if isinstance(turn, tuple) else (turn,))
        self._latest.update(lambda s: drag_frame(s, self._content, n, target, by_handle=False))

    async def _on_situation(self, event: Event) -> None:
        if event.client is None:
            return
        index = [each.name for each in self._content.situations].index(event.target.value)
        self._latest.update(lambda s: choose_situation(s, self._content, index))

    async def _on_reset(self, event: Event) -> None:
        self._latest.update(lambda s: choose_situation(s, self._content, s.situation))

    async def _on_play(self, event: Event) -> None:
        self._latest.update(lambda s: replace(s, is_playing=not s.is_playing))

    async def _on_time(self, event: Event) -> None:
        if event.client is not None:
            self._latest.update(lambda s: replace(s, time=float(event.target.value)))

    async def _on_deviations(self, event: Event) -> None:
        self._latest.update(lambda s: replace(s, deviations=DEVIATIONS[event.target.value]))

    async def _on_all(self, boxes: list[Any], event: Event) -> None:
        for box in boxes:
            box.value = event.target.value

    async def _on_demonstration(self, line: Any, event: Event) -> None:
        line.visible = event.target.value
        self._latest.update(replace)  # a new state, so that the tools are drawn again

    async def _on_frames(self, event: Event) -> None:
        for node in self._scene.frames:
            node.visible = event.target.value
