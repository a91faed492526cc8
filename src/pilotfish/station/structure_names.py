"""Covariance structures by the names that a command line gives them: full, semi-tied:0.5, mfa:4."""

from collections.abc import Callable
from dataclasses import dataclass

import click

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    EMLLT,
    HDDC,
    MFA,
    MLT,
    MPPCA,
    Diagonal,
    Full,
    HDDCShare,
    SemiTied,
    Spherical,
    Structure,
)
from pilotfish.validation import nearest_name, short_repr


@dataclass(frozen=True, slots=True)
class Named:
    """A structure's name, the number that may follow it after a colon, and how it is made of the two."""

    number: str
    needed: bool
    make: Callable[[str], Structure]


def _hddc(number: str) -> Structure:
    return HDDC(int(number)) if number.isdecimal() else HDDCShare(float(number))


STRUCTURES: dict[str, Named] = {
    "full": Named("", False, lambda _: Full()),
    "diagonal": Named("", False, lambda _: Diagonal()),
    "spherical": Named("", False, lambda _: Spherical()),
    "semi-tied": Named("TYING", False, lambda number: SemiTied(float(number or 1.0))),
    "mfa": Named("FACTORS", True, lambda number: MFA(int(number))),
    "mppca": Named("COMPONENTS", True, lambda number: MPPCA(int(number))),
    "hddc": Named("COMPONENTS or SHARE", True, _hddc),
    "emllt": Named("VECTORS", True, lambda number: EMLLT(int(number))),
    "mlt": Named("TRANSFORMS", True, lambda number: MLT(int(number))),
}


def structure_names() -> str:
    """Every name there is, as a person would type it."""
    return ", ".join(_pattern(name, named) for name, named in STRUCTURES.items())


def _pattern(name: str, named: Named) -> str:
    if not named.number:
        return name
    return f"{name}:{named.number}" if named.needed else f"{name}[:{named.number}]"


def structure_named(text: str) -> Structure:
    """The structure that a name such as mfa:4 stands for.

    Raises: InvalidInput, when there is none of that name or its number cannot be.
    """
    name, colon, number = text.partition(":")
    if name not in STRUCTURES:
        near = nearest_name(name, STRUCTURES)
        hint = f"; did you mean {near!r}?" if near else ""
        raise InvalidInput(
            f"no covariance structure is named {short_repr(text)}, there are {structure_names()}{hint}"
        )
    named = STRUCTURES[name]
    if (colon and not number) or (number and not named.number) or (named.needed and not number):
        raise InvalidInput(f"{short_repr(text)} is no covariance structure, expected {_pattern(name, named)}")
    try:
        return named.make(number)
    except ValueError as error:
        reason = f": {error}" if isinstance(error, InvalidInput) else ""
        raise InvalidInput(
            f"{short_repr(text)} is no covariance structure, expected {_pattern(name, named)}{reason}"
        ) from None


class StructureType(click.ParamType[Structure]):
    """Text of a command line that names a covariance structure."""

    name = "structure"

    def convert(
        self, value: str | Structure, param: click.Parameter | None, ctx: click.Context | None
    ) -> Structure:
        if isinstance(value, Structure):
            return value
        try:
            return structure_named(value)
        except InvalidInput as error:
            self.fail(str(error), param, ctx)
