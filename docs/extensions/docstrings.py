"""Let docstrings be plain text: escape what reStructuredText would read as markup, and link public names.

Docstrings of pilotfish are Google style with single backticks around code, and equations are indented. Sphinx
reads reStructuredText, where `*`, `|` and a trailing `_` are markup and an indented line is a quotation. This
extension turns each docstring into text that looks the same, then lets napoleon parse its sections.
"""

import re
from typing import Any

from public_names import documented_names
from sphinx.application import Sphinx
from sphinx.domains.python import PyObject
from sphinx.ext.napoleon import Config, GoogleDocstring

SECTIONS = ("Args:", "Attributes:", "Returns:", "Yields:", "Raises:", "Example:", "Examples:", "Source:")
GOOGLE_STYLE = Config(napoleon_use_ivar=True, napoleon_custom_sections=["Source"])
LIST_ITEM = re.compile(r"\s*(?:[-*]|\d+\.)\s")
MARKUP = re.compile(r"[\\*|]|_(?!\w)|^\s*[A-Za-z](?=\. )")


def process_docstring(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Rewrite the lines of one docstring in place; a property is documented as a method is."""
    what = "method" if what == "property" else what
    parsed = GoogleDocstring(to_restructured_text(lines), GOOGLE_STYLE, app, what, name, obj, options).lines()
    lines[:] = [shorten_array_types(line) if line.startswith(":vartype") else line for line in parsed]


def to_restructured_text(lines: list[str]) -> list[str]:
    """Return the lines of a docstring as reStructuredText."""
    result: list[str] = []
    in_section = in_list = in_equation = in_doctest = False
    for line in lines:
        indented = line.startswith(" ")
        if line.strip() and not indented:
            in_section, in_equation = line.strip() in SECTIONS, False
            in_list = bool(LIST_ITEM.match(line))
        in_doctest = bool(line.strip()) and (in_doctest or line.strip().startswith(">>>"))
        if line.strip() and indented and not (in_section or in_list or in_equation):
            in_equation = True
            result += ["", "::", ""]
        elif line.strip() and not indented and result and result[-1].startswith(" ") and not in_list:
            result.append("")
        is_code = in_equation or in_doctest or line in SECTIONS
        if result and result[-1] in ("Returns:", "Yields:"):
            line = re.sub(r"(?=\S)", ": ", line, count=1)  # napoleon takes what precedes a colon for a type
        result.append(line if is_code else format_inline(line))
    return result


def format_inline(line: str) -> str:
    """Escape markup outside backticks; turn code in backticks into links to public names or into literals."""
    parts = re.split(r"(`+[^`]+`+)", line)
    parts[::2] = [MARKUP.sub(lambda match: escape(match.group()), part) for part in parts[::2]]
    for n in range(1, len(parts), 2):
        before = "\\ " if parts[n - 1][-1:].isalnum() else ""
        after = "\\ " if parts[n + 1][:1].isalnum() else ""
        parts[n] = f"{before}{format_code(parts[n].strip('`'))}{after}"
    return "".join(parts)


def escape(text: str) -> str:
    """Put a backslash before the last character."""
    return f"{text[:-1]}\\{text[-1]}"


def format_code(code: str) -> str:
    """Return a link to the public name that the code is, or a literal."""
    name = re.sub(r"^(pf|pilotfish)\.|\(\)$", "", code)
    target = documented_names().get(name)
    return f":py:obj:`{code} <{target}>`" if target else f"``{code}``"


def shorten_signature(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, arguments: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Write the array types of a signature as the source has them."""
    return arguments and shorten_array_types(arguments), returns and shorten_array_types(returns)


def shorten_array_types(text: str) -> str:
    """Return Float[Array, ...] for jaxtyping.Float[ndarray, ...]."""
    return text.replace("jaxtyping.", "").replace("ndarray,", "Array,")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.connect("autodoc-process-docstring", process_docstring)
    app.connect("autodoc-process-signature", shorten_signature)
    for field in PyObject.doc_field_types:
        field.label = {"variable": "Attributes"}.get(field.name, field.label)
    app.connect("sphinx-click-process-description", lambda *a: process_click(a[-1]))
    app.connect("sphinx-click-process-options", lambda *a: process_click(a[-1]))
    app.connect("sphinx-click-process-epilog", lambda *a: process_epilog(a[-1]))
    return {"parallel_read_safe": True}


def process_click(lines: list[str]) -> None:
    """Escape the help texts of commands; the lines that sphinx-click itself writes stay."""
    lines[:] = [line if line.lstrip().startswith("..") else format_help(line) for line in lines]


def process_epilog(lines: list[str]) -> None:
    """Turn the example at the end of a help text into a block of code."""
    commands = [line.lstrip("| ") for line in lines if line.lstrip("| ").strip()]
    commands = [f"   {command}" for command in commands if command != "Example:"]
    lines[:] = [".. rubric:: Example", "", ".. code-block:: sh", "", *commands]


def format_help(line: str) -> str:
    """Turn options and code in single backticks into literals."""
    line = re.sub(r"(?<![`:])`([^`]+)`(?!`)", r"``\1``", line)
    return re.sub(r"(?<![\w`-])--[a-z][a-z-]*", r"``\g<0>``", line)
