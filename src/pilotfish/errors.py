"""Every error that pilotfish raises on purpose: one name for each thing that a caller does differently."""


class SkillError(Exception):
    """Base of every error that this library raises on purpose."""


class InvalidInput(SkillError, ValueError):
    """What was given cannot be used; the message says where, what was expected and the nearest fix."""


class NotPositiveDefinite(SkillError, ArithmeticError):
    """A covariance or weight has no Cholesky factor; more regularisation or more data mends it."""


class UnknownSkill(SkillError):
    """A skill file that this version cannot read: damaged, of another kind, or written by a newer version."""


def require_kind(what: str, value: object, kinds: type | tuple[type, ...], fix: str) -> None:
    """Nothing, when value is of one of the kinds.

    Raises: InvalidInput otherwise, naming the kind given, those expected and the fix.
    """
    if isinstance(value, type) or not isinstance(value, kinds):
        expected = " or ".join(kind.__name__ for kind in (kinds if isinstance(kinds, tuple) else (kinds,)))
        raise InvalidInput(f"{what} is of the kind {type(value).__name__}, expected {expected}; {fix}")
