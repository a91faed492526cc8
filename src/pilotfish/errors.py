"""Every error that pilotfish raises on purpose: one name for each thing that a caller does differently."""


class SkillError(Exception):
    """Base of every error that this library raises on purpose."""


class InvalidInput(SkillError, ValueError):
    """What was given cannot be used; the message says where, what was expected and the nearest fix."""


class NotPositiveDefinite(SkillError, ArithmeticError):
    """A covariance or weight has no Cholesky factor; more regularisation or more data mends it."""


class UnknownSkill(SkillError):
    """A skill file that this version cannot read: damaged, of another kind, or written by a newer version."""
