"""The directive `package-reference`: a table of the public names of a package, then the docstring of each."""

import inspect
from typing import Any

from docstrings import format_inline
from docutils import nodes
from docutils.statemachine import StringList
from public_names import home_packages, public_members
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

FOREIGN_BASES = ("object", "BaseException", "Enum", "str", "int", "tuple", "dict", "Generic", "Env")


class PackageReference(SphinxDirective):
    """Document a package; without an argument, list the names of `import pilotfish as pf`."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the table of names and the docstrings."""
        package = self.arguments[0] if self.arguments else ""
        members = public_members(package)
        lines = [*summary_table(package, members), ""]
        if package:
            elsewhere = [n for n, v in members.items() if home_packages().get(id(v)) != (package, n)]
            lines += [f".. automodule:: pilotfish.{package}", "   :imported-members:"]
            lines += [f"   :inherited-members: {', '.join(FOREIGN_BASES)}"]
            lines += [f"   :exclude-members: {', '.join(elsewhere)}"] * bool(elsewhere)
        return self.parse_text_to_nodes(StringList(lines, self.get_source_info()[0]))


def summary_table(package: str, members: dict[str, Any]) -> list[str]:
    """Return a table with a row for each name: a link and the first line, or the value of a constant."""
    lines = [".. list-table::", "   :class: package-names", "   :widths: 34 66", ""]
    for name, value in members.items():
        if id(value) in home_packages():
            target = "pilotfish." + ".".join(home_packages()[id(value)])
            cells = (
                f":py:obj:`{name} <{target}>`",
                format_inline((inspect.getdoc(value) or "").split("\n")[0]),
            )
        else:
            cells = f"``{name}``", f"``{constant_text(value)}``"
        lines += [f"   * - {cells[0]}", f"     - {cells[1]}"]
    return lines


def constant_text(value: Any) -> str:
    """Return what a constant or a union of types is, in one short line."""
    if callable(value):
        return getattr(value, "__name__", "function")
    types = getattr(value, "__args__", ())
    text = " | ".join(t.__name__ for t in types) if types else repr(value)
    if isinstance(value, dict):
        text = ", ".join(getattr(key, "name", str(key)) for key in value)
    return text if len(text) < 120 else type(value).__name__


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("package-reference", PackageReference)
    return {"parallel_read_safe": True}
