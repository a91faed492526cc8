"""Covariance structures by their names on the command line: full, semi-tied:0.5, mfa:4."""

from dataclasses import MISSING, Field, fields
from typing import Any

import click

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import STRUCTURES, CovarianceStructure
from pilotfish.validation import nearest_name, short_repr


def structure_syntax_list() -> str:
    """Return the syntax of every structure, separated by commas."""
    return ", ".join(_syntax(structure) for structure in STRUCTURES.values())


def _parameter(structure: type[CovarianceStructure]) -> Field[Any] | None:
    """Return the field that the text after the colon sets; None for a structure without parameters."""
    return next(iter(fields(structure)), None)  # type: ignore[arg-type]  # structures are dataclasses


def _syntax(structure: type[CovarianceStructure]) -> str:
    if (parameter := _parameter(structure)) is None:
        return structure.name
    text = f":{parameter.name.upper()}"
    return structure.name + (text if parameter.default is MISSING else f"[{text}]")


def parse_structure(text: str) -> CovarianceStructure:
    """Return the structure for a text such as mfa:4.

    Args:
        text: Name of a structure, with its parameter after a colon.

    Raises:
        InvalidInput: If no structure has this name, or its parameter is missing or outside its range.
    """
    name, colon, value = text.partition(":")
    if name not in STRUCTURES:
        nearest = nearest_name(name, STRUCTURES)
        hint = f"; did you mean {nearest!r}?" if nearest else ""
        raise InvalidInput(
            f"{short_repr(text)} is not a covariance structure, expected one of "
            f"{structure_syntax_list()}{hint}"
        )
    structure = STRUCTURES[name]
    parameter = _parameter(structure)
    required = parameter is not None and parameter.default is MISSING
    expected = f"{short_repr(text)} is not a covariance structure, expected {_syntax(structure)}"
    if (colon and not value) or (value and parameter is None) or (required and not value):
        raise InvalidInput(expected)
    try:
        if not value:
            return structure()
        number = int(value) if value.isdecimal() else float(value)
        return structure(number)  # type: ignore[call-arg]  # the first field
    except ValueError as error:
        reason = f": {error}" if isinstance(error, InvalidInput) else ""
        raise InvalidInput(expected + reason) from None


def structure_text(structure: CovarianceStructure) -> str:
    """Return the text of a structure that `parse_structure` reads.

    Args:
        structure: Covariance structure with at most one parameter, a number.
    """
    if (parameter := _parameter(type(structure))) is None:
        return structure.name
    value = getattr(structure, parameter.name)
    return structure.name if value == parameter.default else f"{structure.name}:{value}"


class StructureType(click.ParamType[CovarianceStructure]):
    """Type of an option that is a covariance structure."""

    name = "structure"

    def convert(
        self, value: str | CovarianceStructure, param: click.Parameter | None, ctx: click.Context | None
    ) -> CovarianceStructure:
        """Parse the text of the option."""
        if isinstance(value, CovarianceStructure):
            return value
        try:
            return parse_structure(value)
        except InvalidInput as error:
            self.fail(str(error), param, ctx)
