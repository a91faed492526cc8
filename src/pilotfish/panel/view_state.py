"""State of the page: the situation, time and what is drawn; each event is a function to the next state.

Events arrive from the browser at any rate. Each replaces the state at once, and the computation takes the
state that it finds when it is free (`LatestState`). Poses of a drag in between are dropped, never queued.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Condition

from pilotfish.demonstrations import Frame
from pilotfish.geometry import Pose
from pilotfish.panel.content import ViewContent
from pilotfish.panel.frame_motions import move_frame


@dataclass(frozen=True, slots=True, eq=False)
class ViewState:
    """State of the page.

    Attributes:
        situation: Index of the situation that it began with.
        frames: Frames now.
        placements: Number of times that frames were set by something else than a handle in the scene.
        time: Time of the motion [s].
        is_playing: Whether time advances.
        deviations: Standard deviations of the drawn ellipsoids; 0 for none.
    """

    situation: int
    frames: tuple[Frame, ...]
    placements: int = 0
    time: float = 0.0
    is_playing: bool = False
    deviations: float = 1.0


def first_state(content: ViewContent) -> ViewState:
    """Return the state at the beginning: the first situation, at time zero."""
    return ViewState(0, content.situations[0].frames)


def choose_situation(state: ViewState, content: ViewContent, situation: int) -> ViewState:
    """Put all frames where they are in a situation; the present one is a reset."""
    return replace(
        state,
        situation=situation,
        frames=content.situations[situation].frames,
        placements=state.placements + 1,
    )


def drag_frame(
    state: ViewState, content: ViewContent, index: int, target: Pose, *, by_handle: bool
) -> ViewState:
    """Move a frame to a pose.

    Args:
        state: State before.
        content: Content of the page.
        index: Index of the frame.
        target: Its new pose.
        by_handle: Whether its handle in the scene is there already.
    """
    # Always from the frame of the situation, so that rounding errors of a long drag do not add up.
    moved = move_frame(content.situations[state.situation].frames[index], content.layout, target)
    frames = (*state.frames[:index], moved, *state.frames[index + 1 :])
    return replace(state, frames=frames, placements=state.placements + (not by_handle))


def advance(state: ViewState, seconds: float, duration: float) -> ViewState:
    """Return the state after some time; at the end of the motion it starts again."""
    if not state.is_playing:
        return state
    time = state.time + seconds
    return replace(state, time=time if time <= duration else 0.0)


class LatestState:
    """Newest state, which any thread may replace and one thread waits for."""

    def __init__(self, state: ViewState) -> None:
        self._state, self._condition = state, Condition()

    def update(self, change: Callable[[ViewState], ViewState]) -> None:
        """Replace the state by a function of it.

        Args:
            change: Function from the present state to the next; it should be fast.
        """
        with self._condition:
            self._state = change(self._state)
            self._condition.notify()

    def get(self) -> ViewState:
        """Return the newest state."""
        with self._condition:
            return self._state

    def wait(self, known: ViewState | None, timeout: float) -> ViewState:
        """Return the newest state, at once if it is not the known one, and else after a change.

        Args:
            known: State that the caller has.
            timeout: Longest time to wait for a change [s].
        """
        with self._condition:
            self._condition.wait_for(lambda: self._state is not known, timeout)
            return self._state
