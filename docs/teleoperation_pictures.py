"""Draw docs/session-states.png: the session state machine, from its table in `pilotfish.teleop`.

    python docs/teleoperation_pictures.py

An arrow stands for all events that lead from one state to another. STOP and DISARM, which lead from every
state to STOPPED and DISARMED, are left out.
"""

from pathlib import Path

import matplotlib.pyplot as plt

from pilotfish.teleop import TRANSITIONS, Event, SessionState

PLACES = {
    SessionState.DISARMED: (0.0, 1.0),
    SessionState.ALIGNING: (1.0, 1.0),
    SessionState.ACTIVE: (2.0, 1.0),
    SessionState.CONTINUING: (2.0, 0.0),
    SessionState.HOLD: (1.0, 0.0),
    SessionState.STOPPED: (0.0, 0.0),
}
SCALE, BEND = (3.6, 2.8), 0.16
EVERYWHERE = (Event.STOP, Event.DISARM)
MOVING, RESTING = "#cfe8cf", "#e8e8e8"


def main() -> None:
    """Draw states and arrows."""
    figure, axes = plt.subplots(figsize=(11.0, 5.2), layout="constrained")
    for state, (x, y) in PLACES.items():
        moves = state in (SessionState.ACTIVE, SessionState.CONTINUING)
        axes.text(
            SCALE[0] * x,
            SCALE[1] * y,
            state.name,
            ha="center",
            va="center",
            fontsize=11,
            bbox={"boxstyle": "round,pad=0.5", "facecolor": MOVING if moves else RESTING},
        )
    for (before, after), events in arrows().items():
        draw_arrow(axes, before, after, events)
    axes.set(xlim=(-1.0, 2 * SCALE[0] + 1.4), ylim=(-0.7, SCALE[1] + 0.8))
    axes.axis("off")
    figure.savefig(Path(__file__).with_name("session-states.png"), dpi=110)


def arrows() -> dict[tuple[SessionState, SessionState], list[Event]]:
    """Return the events that lead from each state to each other state."""
    found: dict[tuple[SessionState, SessionState], list[Event]] = {}
    for event, row in TRANSITIONS.items():
        for before, after in zip(SessionState, row, strict=True):
            if before is not after and event not in EVERYWHERE:
                found.setdefault((before, after), []).append(event)
    return found


def draw_arrow(axes: plt.Axes, before: SessionState, after: SessionState, events: list[Event]) -> None:
    """Draw one arrow with the names of its events."""
    (x0, y0), (x1, y1) = ((SCALE[0] * x, SCALE[1] * y) for x, y in (PLACES[before], PLACES[after]))
    axes.annotate(
        "",
        (x1, y1),
        (x0, y0),
        arrowprops={
            "arrowstyle": "-|>",
            "shrinkA": 46,
            "shrinkB": 42,
            "connectionstyle": f"arc3,rad={BEND}",
            "color": "#404040",
        },
    )
    names = "\n".join(event.name.lower().replace("_", " ") for event in events)
    middle, across = (0.5 * (x0 + x1), 0.5 * (y0 + y1)), (y1 - y0, x0 - x1)
    sides = {True: "left", False: "right"}
    axes.text(
        middle[0] + 0.5 * BEND * across[0],
        middle[1] + 0.5 * BEND * across[1],
        names,
        ha="center" if x0 != x1 else sides[across[0] > 0.0],
        va="center",
        fontsize=7,
        color="#203060",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
    )


if __name__ == "__main__":
    main()
