"""The documentation names what exists, its programs run, and every page is reachable."""

import importlib
import re
import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import pilotfish as pf
from pilotfish import plots

TOP = Path(__file__).parents[1]
DOCS = TOP / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
PLOT_FUNCTIONS = {
    name
    for name in plots.__all__
    if getattr(getattr(plots, name), "__annotations__", {}).get("return") is Figure
}
WITHOUT_PAGE = {"cli", "kernels.reference"}  # commands have their own reference; oracles of the tests


def read(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def page_name(page: Path) -> str:
    return str(page.relative_to(DOCS))


def find_name(name: str) -> Any:
    """Return what a dotted name is, such as `pf.models.Skill` or `pf.Frame.A`."""
    value: Any = pf
    for part in name.split(".")[1:]:
        if hasattr(value, part):
            value = getattr(value, part)
        elif part in getattr(value, "__annotations__", {}):
            value = value.__annotations__[part]
        else:
            value = importlib.import_module(f"{value.__name__}.{part}")
    return value


def import_extension(name: str) -> Any:
    sys.path.insert(0, str(DOCS / "extensions"))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(DOCS / "extensions"))


def run_program(page: str) -> dict[str, Any]:
    """Run the Python blocks of a page as one program and return its names."""
    names: dict[str, Any] = {}
    exec("\n".join(re.findall(r"```python\n(.*?)```", read(page), re.DOTALL)), names)  # noqa: S102
    return names


# ------------------------------------------------------------------------------------------------ structure


def test_links_between_pages_lead_to_files():
    missing = [
        f"{page_name(page)}: {link}"
        for page in PAGES
        for link in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
        if not (page.parent / link).exists()
    ]
    assert not missing


def test_pages_are_in_a_table_of_contents():
    listed = {
        page_name((page.parent / f"{entry}.md").resolve())
        for page in PAGES
        for block in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
        for entry in re.findall(r"^[a-z][\w/-]*$", block, re.MULTILINE)
    }
    included = set(re.findall(r"^```\{include\} (\w\S+\.md)$", read("study.md"), re.MULTILINE))
    assert {page_name(page) for page in PAGES} == listed | {"index.md"} | included


def test_front_docstring_names_every_public_name():
    assert set(pf.__all__) <= set(re.findall(r"\w+", str(pf.__doc__)))


# ------------------------------------------------------------------------------------------------ glossary


def glossary_rows() -> list[list[str]]:
    rows = re.findall(
        r"^\| ([^`\n]+?) \| (.+?) \| (.*?) ?\| `(pf\.[\w.]+)` \|$", read("glossary.md"), re.MULTILINE
    )
    return [list(row) for row in rows]


def test_glossary_has_sixty_terms_once():
    terms = [term for term, *_ in glossary_rows()]
    assert len(terms) >= 60
    assert len(terms) == len(set(terms))


@pytest.mark.parametrize(("term", "name"), [(row[0], row[3]) for row in glossary_rows()])
def test_glossary_name_in_code_exists(term: str, name: str):
    find_name(name)


def test_glossary_terms_are_used_in_source_or_pages():
    texts = [page.read_text(encoding="utf-8") for page in PAGES if page.name != "glossary.md"]
    texts += [file.read_text(encoding="utf-8") for file in (TOP / "src").rglob("*.py")]
    words = re.sub(r"[\s_-]+", " ", " ".join(texts)).lower()
    unused = [row[0] for row in glossary_rows() if re.sub(r"[\s_-]+", " ", row[0]).lower() not in words]
    assert not unused


def test_glossary_commands_are_those_of_the_command_line():
    from pilotfish.cli.main import cli

    assert set(re.findall(r"^\| `pilotfish ([\w-]+)` \|", read("glossary.md"), re.MULTILINE)) == set(
        cli.commands
    )


@pytest.mark.parametrize(
    "term",
    [
        "TP-HSMM", "TP-GMM", "forward-backward", "Gaussian mixture regression", "exponential map",
        "right-censored",
        "kinesthetic", "LQR", "LQT", "via-point", "impedance", "Viterbi", "responsibilities", "tangent space",
    ],
)  # fmt: skip
def test_term_of_the_field_is_found_in_source_and_pages(term: str):
    source = [file.read_text(encoding="utf-8") for file in (TOP / "src").rglob("*.py")]
    pages = [page.read_text(encoding="utf-8") for page in PAGES]
    assert all(any(term.lower() in text.lower() for text in texts) for texts in (source, pages))


@pytest.mark.parametrize("page", [*PAGES, TOP / "README.md", TOP / "CHANGELOG.md", TOP / "CONTRIBUTING.md"])
def test_names_of_pf_in_a_page_exist(page: Path):
    for name in set(re.findall(r"`(pf(?:\.[A-Za-z_]\w*)+)", page.read_text(encoding="utf-8"))):
        find_name(name)


# ------------------------------------------------------------------------------------------------ reference


def test_reference_has_a_page_per_package():
    public_names = import_extension("public_names")
    source = TOP / "src" / "pilotfish"
    packages = {".".join(file.parent.relative_to(source).parts) for file in source.rglob("__init__.py")}
    packages = {name for name in packages - WITHOUT_PAGE if name and not name.startswith("cli.")}
    packages = {
        name
        for name in packages
        if any(map(public_names.has_docstring, public_names.public_members(name).values()))
    }
    documented = set(
        re.findall(
            r"package-reference:: ([\w.]+)",
            " ".join(read(f"api/{p.name}") for p in (DOCS / "api").glob("*.md")),
        )
    )
    assert documented == set(public_names.PACKAGES)
    assert packages <= documented


def test_reference_documents_every_public_function_and_class_once():
    public_names = import_extension("public_names")
    homes = public_names.home_packages().values()
    assert len(set(homes)) == len(list(homes))
    documented = set(public_names.documented_names().values())
    assert {f"pilotfish.models.{name}" for name in ("adapt", "learn", "Skill")} <= documented


def test_docstring_markup_characters_are_escaped():
    convert = import_extension("docstrings").to_restructured_text
    assert convert(["Cost |x|^2 and a_ * b."]) == [r"Cost \|x\|^2 and a\_ \* b."]


def test_docstring_indented_equation_becomes_literal_block():
    convert = import_extension("docstrings").to_restructured_text
    assert convert(["Let", "", "    x* = |A| b", "", "for b."]) == [
        "Let",
        "",
        "",
        "::",
        "",
        "    x* = |A| b",
        "",
        "for b.",
    ]


def test_docstring_sections_keep_their_indentation():
    convert = import_extension("docstrings").to_restructured_text
    lines = ["Args:", "    x: Value *", "        of a point.", "", "Example:", "    >>> f(*x)"]
    assert convert(lines) == [
        "Args:",
        r"    x: Value \*",
        "        of a point.",
        "",
        "Example:",
        "    >>> f(*x)",
    ]


def test_docstring_public_name_in_backticks_becomes_link():
    convert = import_extension("docstrings").to_restructured_text
    assert convert(["See `adapt` and `x[0]`."]) == [
        "See :py:obj:`adapt <pilotfish.models.adapt>` and ``x[0]``."
    ]


# ------------------------------------------------------------------------------------------------ pages


def test_thesis_map_names_are_public():
    names = set(re.findall(r"`([a-z]+(?:\.[a-z_]+)*\.[A-Za-z_]+)`", read("thesis-map.md")))
    assert len(names) >= 50
    documented = import_extension("public_names").documented_names()
    assert sorted(names - documented.keys()) == []


def test_pictures_page_has_a_section_per_plot():
    assert set(re.findall(r"^### `(\w+)\(", read("pictures.md"), re.MULTILINE)) == PLOT_FUNCTIONS


@pytest.mark.slow  # draws fourteen figures with annotation checks: 14 CPU seconds
def test_pictures_page_program_saves_one_file_per_plot(data_folder, tmp_path, monkeypatch):
    (block,) = re.findall(r"```python\n(.*?)```", read("pictures.md"), re.DOTALL)
    program = tmp_path / "pictures.py"
    program.write_text(block, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(program))
    assert {path.stem.replace("-", "_") for path in tmp_path.glob("*.png")} == PLOT_FUNCTIONS


def test_index_program_reproduces_valve(data_folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = run_program("index.md")
    assert np.linalg.norm(names["reproduction"].motion.x[-1, :3] - names["test"].x[-1, :3]) < 0.15  # m
    assert (tmp_path / "valve.png").exists()


@pytest.mark.slow  # selects among many models: 8 CPU seconds
def test_choosing_a_model_program_selects_structure_and_frames(data_folder, unchecked):
    names = run_program("choosing-a-model.md")
    assert names["selection"].best.candidate == pf.models.Candidate(frames="relevance")
    assert names["selection"].fits == 12
    assert names["frame_relevance"].distractors == ()
    assert names["frame_relevance"].values.shape == (2, 7)
    assert all(len(d.frames) == 2 for d in names["selected"])


def test_durations_program_gains_the_likelihood_that_the_page_states(data_folder):
    names = run_program("durations.md")
    demonstrations = names["demonstrations"]
    exact, counted = (
        pf.models.log_likelihood(skill, demonstrations).sum()
        for skill in (names["fit"].skill, names["counted"])
    )
    assert 14.0 < exact - counted < 16.0
    durations = names["durations"]
    assert np.exp(durations.log_table(durations.max_duration(1e-8))).sum(axis=0) == pytest.approx(1.0)


def test_orientations_program_gives_unit_quaternions(data_folder):
    names = run_program("orientations.md")
    skill, x = names["fit"].skill, names["x"]
    assert skill.width == 13
    assert skill.covariances[0].dense.shape == (7, 12, 12)
    assert x.shape == (200, 13)
    np.testing.assert_allclose(np.linalg.norm(x[:, 3:7], axis=1), 1.0, rtol=1e-12)


def test_regression_program_passes_the_via_point(data_folder):
    names = run_program("regression-and-via-points.md")
    x = names["motion"].x
    assert np.linalg.norm(x[40, :3] - [0.44, -0.95, 0.31]) < 1e-3
    assert names["prediction"].means.shape == (200, 13)


def test_physics_program_records_and_steps_an_environment():
    names = run_program("physics.md")
    assert len(names["recording"].demonstration.x) == 12  # one second, ten rows each, and the settling
    assert not names["info"]["success"]
