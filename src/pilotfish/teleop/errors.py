"""Errors of messages and datagrams."""

from pilotfish.errors import SkillError


class MalformedMessage(SkillError):
    """A message has no bytes, or bytes are not a message; the text names the field and the expectation."""


class Unauthentic(SkillError):
    """A datagram was not sealed with the key of its sender, or was changed on its way."""


class SequenceExhausted(SkillError):
    """A connection has sent as many datagrams as it may; say hello again."""


class UnsuitableSkill(SkillError):
    """A skill can be read, but has other columns or frames than the robot."""
