"""Link names in backticks on Markdown pages to the API reference: `pf.learn`, `AdaptedSkill`.

Only names that are unmistakable are linked: with a dot, an underscore or a capital letter inside.
"""

import re

from docutils import nodes
from public_names import documented_names
from sphinx import addnodes
from sphinx.application import Sphinx

UNMISTAKABLE = re.compile(r"[A-Za-z]\w*[._]\w[\w.]*|[A-Z]\w*[a-z]\w*")


def link_names(app: Sphinx, document: nodes.document) -> None:
    """Turn each literal that is a documented name into a cross-reference."""
    for literal in list(document.findall(nodes.literal)):
        name = re.sub(r"^(pf|pilotfish)\.|\(\)$", "", literal.astext())
        target = documented_names().get(name)
        is_linked = isinstance(literal.parent, nodes.reference | nodes.title | addnodes.pending_xref)
        if target and UNMISTAKABLE.fullmatch(literal.astext().removesuffix("()")) and not is_linked:
            reference = addnodes.pending_xref(
                "", refdomain="py", reftype="obj", reftarget=target, refexplicit=True, refwarn=True
            )
            reference["refdoc"] = app.env.docname
            literal.replace_self(reference)
            reference += literal


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the extension."""
    app.connect("doctree-read", link_names)
    return {"parallel_read_safe": True}
