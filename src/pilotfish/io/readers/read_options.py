"""Options of readers: what a file does not say about itself."""

from dataclasses import dataclass

from pilotfish.demonstrations import time_unit
from pilotfish.errors import InvalidInput
from pilotfish.validation import require_printable, short_repr, shorten_repr

SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "blank": " "}


@shorten_repr
@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What a file does not say about itself; each reader uses the options that apply to its format.

    Attributes:
        format: Name of a reader, such as "delimited"; empty to recognise the format.
        time_column: Name of the column or array of times; empty to recognise it.
        time_unit: Unit of the times: s, ms, us or ns; empty for the stated one, or to recognise it.
        separator: "comma", "semicolon", "tab" or "blank"; empty to recognise it.

    Raises:
        InvalidInput: If a field cannot be used.
    """

    format: str = ""
    time_column: str = ""
    time_unit: str = ""
    separator: str = ""

    def __post_init__(self) -> None:
        for name in ("format", "time_column", "time_unit", "separator"):
            require_printable(getattr(self, name), name)
        if self.separator and self.separator not in SEPARATORS:
            known = ", ".join(SEPARATORS)
            raise InvalidInput(f"separator is {short_repr(self.separator)}, expected one of {known}")
        if self.time_unit:
            time_unit((), self.time_unit, "time_unit")
