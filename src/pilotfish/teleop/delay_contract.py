"""Delay contract: the budget of the round trip and its jitter, agreed when an operator takes control.

The age of a command is measured on the robot's clock: the operator names the last report that was displayed,
and the robot knows when it sent that report. With budget B, jitter J and the command period P,

    a command older than B + J is refused,
    the link is lost when no command was accepted for J + 2 P, checked at every step of the robot,
    the round trip is too long when commands in a row that are older than B name LATE_REPORTS reports.

A constant delay, however long, refuses nothing: B covers it. Which modes are allowed depends on B: a person
cannot control a robot directly through a long delay without moving and waiting.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pilotfish.errors import InvalidInput
from pilotfish.teleop.messages import MODES
from pilotfish.validation import require_number, require_type

SECOND = 1_000_000_000  # ns
LATE_REPORTS = 5
MIN_TIME, MAX_TIME = 1e-3, 600.0  # s


def nanoseconds(seconds: float) -> int:
    """Return a time in whole nanoseconds.

    Args:
        seconds: Time [s].
    """
    return round(seconds * SECOND)


def _mode_budgets() -> dict[str, float]:
    return {"direct": 0.5, "shared": 5.0, "autonomous": 60.0, "fixture": 5.0}


@dataclass(frozen=True, slots=True)
class ContractLimits:
    """What a robot site agrees to.

    Attributes:
        max_budget: Longest budget of the round trip [s].
        max_jitter: Largest jitter [s].
        mode_budgets: Longest budget with which each mode is allowed [s].

    Raises:
        InvalidInput: If a time is not from 1 ms to 600 s, or a mode is unknown or missing.
    """

    max_budget: float = 5.0
    max_jitter: float = 2.0
    mode_budgets: Mapping[str, float] = field(default_factory=_mode_budgets)

    def __post_init__(self) -> None:
        require_number(self.max_budget, "max_budget", MIN_TIME, MAX_TIME)
        require_number(self.max_jitter, "max_jitter", MIN_TIME, MAX_TIME)
        require_type(self.mode_budgets, "mode_budgets", Mapping, "pass {mode: seconds}")
        if set(self.mode_budgets) != set(MODES):
            raise InvalidInput(
                f"mode_budgets has {sorted(map(str, self.mode_budgets))}, expected each of {', '.join(MODES)}"
            )
        for mode, budget in self.mode_budgets.items():
            require_number(budget, f"the budget of mode {mode}", 0.0, MAX_TIME)


@dataclass(frozen=True, slots=True)
class DelayContract:
    """Agreed times, in nanoseconds.

    Attributes:
        budget: Budget B of the round trip [ns].
        jitter: Jitter J [ns].
        period: Command period P [ns].
    """

    budget: int
    jitter: int
    period: int

    @property
    def max_age(self) -> int:
        """Age above which a command is refused [ns]."""
        return self.budget + self.jitter

    @property
    def loss_after(self) -> int:
        """Silence after which the link is lost [ns]."""
        return self.jitter + 2 * self.period


def agree(limits: ContractLimits, budget: float, jitter: float, period: int) -> DelayContract | None:
    """Return the contract with a budget and jitter; None if they are beyond what the robot agrees to.

    Args:
        limits: What the robot agrees to.
        budget: Budget that the operator asks for [s].
        jitter: Jitter that the operator asks for [s].
        period: Command period [ns].
    """
    if not (0.0 <= budget <= limits.max_budget and MIN_TIME <= jitter <= limits.max_jitter):
        return None
    return DelayContract(nanoseconds(budget), nanoseconds(jitter), period)


def allows_mode(limits: ContractLimits, contract: DelayContract, mode: str) -> bool:
    """Return whether a mode is allowed with the budget of a contract.

    Args:
        limits: What the robot agrees to.
        contract: Agreed times.
        mode: Mode.
    """
    return contract.budget <= nanoseconds(limits.mode_budgets[mode])
