"""Configuration of the documentation site. `make docs` builds it into build/docs and needs no network."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

import jaxtyping  # noqa: F401 - before pilotfish, so that annotations state the shapes of arrays

import pilotfish

project = "pilotfish"
author = "the pilotfish authors"
copyright = "2026, the pilotfish authors"  # noqa: A001 - the name that Sphinx reads
version = release = pilotfish.__version__

extensions = [
    "sphinx.ext.autodoc",
    "myst_parser",
    "sphinx_click",
    "sphinx_copybutton",
    "code_links",
    "docstrings",
    "mathml",
    "package_reference",
]
exclude_patterns = ["extensions", "study"]
suppress_warnings = ["misc.highlighting_failure"]  # `csv` is no language of Pygments

html_theme = "furo"
html_title = f"pilotfish {release}"
html_static_path = ["_static"]
html_css_files = ["pilotfish.css"]
html_math_renderer = "mathml"  # browsers draw it: the pages need no script from another server
html_copy_source = False
html_show_sphinx = False
pygments_style, pygments_dark_style = "friendly", "native"

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence", "attrs_block"]
myst_heading_anchors = 3
myst_dmath_double_inline = True

default_role = "py:obj"
smartquotes_action = "De"  # dashes only
python_use_unqualified_type_names = True
maximum_signature_line_length = 90
toc_object_entries_show_parents = "hide"

autodoc_member_order = "groupwise"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True}
autodoc_preserve_defaults = True

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
