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
    CovarianceStructure,
    Diagonal,
    Full,
    HDDCExplainedVariance,
    SemiTied,
    Spherical,
)
from pilotfish.validation import nearest_name, short_repr


@dataclass(frozen=True, slots=True)
class StructureSyntax:
    """A structure's name, the number that may follow it after a colon, and how it is made of the two."""

    parameter: str
    required: bool
    make: Callable[[str], CovarianceStructure]


def _hddc(parameter: str) -> CovarianceStructure:
    return HDDC(int(parameter)) if parameter.isdecimal() else HDDCExplainedVariance(float(parameter))


STRUCTURES: dict[str, StructureSyntax] = {
    "full": StructureSyntax("", False, lambda _: Full()),
    "diagonal": StructureSyntax("", False, lambda _: Diagonal()),
    "spherical": StructureSyntax("", False, lambda _: Spherical()),
    "semi-tied": StructureSyntax("TYING", False, lambda parameter: SemiTied(float(parameter or 1.0))),
    "mfa": StructureSyntax("FACTORS", True, lambda parameter: MFA(int(parameter))),
    "mppca": StructureSyntax("COMPONENTS", True, lambda parameter: MPPCA(int(parameter))),
    "hddc": StructureSyntax("COMPONENTS or SHARE", True, _hddc),
    "emllt": StructureSyntax("VECTORS", True, lambda parameter: EMLLT(int(parameter))),
    "mlt": StructureSyntax("TRANSFORMS", True, lambda parameter: MLT(int(parameter))),
}


def structure_syntax_list() -> str:
    """Every name there is, as a person would type it."""
    return ", ".join(_syntax_text(name, syntax) for name, syntax in STRUCTURES.items())


def _syntax_text(name: str, syntax: StructureSyntax) -> str:
    if not syntax.parameter:
        return name
    return f"{name}:{syntax.parameter}" if syntax.required else f"{name}[:{syntax.parameter}]"


def parse_structure(text: str) -> CovarianceStructure:
    """The structure that a name such as mfa:4 stands for.

    Raises: InvalidInput, when there is none of that name or its number cannot be.
    """
    name, colon, parameter = text.partition(":")
    if name not in STRUCTURES:
        nearest = nearest_name(name, STRUCTURES)
        hint = f"; did you mean {nearest!r}?" if nearest else ""
        raise InvalidInput(
            f"no covariance structure is named {short_repr(text)}, there are {structure_syntax_list()}{hint}"
        )
    syntax = STRUCTURES[name]
    if (
        (colon and not parameter)
        or (parameter and not syntax.parameter)
        or (syntax.required and not parameter)
    ):
        raise InvalidInput(
            f"{short_repr(text)} is no covariance structure, expected {_syntax_text(name, syntax)}"
        )
    try:
        return syntax.make(parameter)
    except ValueError as error:
        reason = f": {error}" if isinstance(error, InvalidInput) else ""
        raise InvalidInput(
            f"{short_repr(text)} is no covariance structure, expected {_syntax_text(name, syntax)}{reason}"
        ) from None


class StructureType(click.ParamType[CovarianceStructure]):
    """Text of a command line that names a covariance structure."""

    name = "structure"

    def convert(
        self, value: str | CovarianceStructure, param: click.Parameter | None, ctx: click.Context | None
    ) -> CovarianceStructure:
        if isinstance(value, CovarianceStructure):
            return value
        try:
            return parse_structure(value)
        except InvalidInput as error:
            self.fail(str(error), param, ctx)
