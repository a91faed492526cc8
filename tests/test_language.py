"""Documentation and messages are plain: no refused phrase, and sentences of bounded length.

`make lint` refuses single words by codespell with .ci/refused.txt; this file refuses phrases.
"""

import re
from pathlib import Path
from statistics import median

import pytest

TOP = Path(__file__).parents[1]
REFUSED = re.compile(
    r"\b(so many|is no|are no|no more than that|what came of|of its own accord|say so|as they are|as it were|"
    r"that which|those of which|of those that|stands? for (itself|nothing)|goes? on)\b",
    re.IGNORECASE,
)
DOCS = sorted([*(TOP / "docs").rglob("*.md"), TOP / "README.md", TOP / "CONTRIBUTING.md"])
SOURCES = sorted((TOP / "src").rglob("*.py"))
MAX_WORDS, MAX_MEDIAN = 30, 15


def relative_name(file: Path) -> str:
    return str(file.relative_to(TOP))


def sentences(text: str) -> list[str]:
    """Return the sentences of a Markdown text, without code, tables, headings, links and equations."""
    text = re.sub(r"^```.*?^```|\$\$.*?\$\$|<!--.*?-->|^:::.*?$", " ", text, flags=re.S | re.M)
    text = re.sub(r"`[^`]*`|\$[^$\n]*\$", "code", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    paragraphs = [
        paragraph
        for paragraph in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.)\s)", text)
        if not re.match(r"\s*(\||#|---|:::|```)", paragraph)
    ]
    found = [s for p in paragraphs for s in re.split(r"(?<=[.!?:;])\s+", p) if re.search(r"\w", s)]
    return [" ".join(sentence.split()) for sentence in found]


@pytest.mark.parametrize("file", [*DOCS, *SOURCES], ids=relative_name)
def test_text_has_no_refused_phrase(file: Path):
    text = re.sub(r"\s+", " ", file.read_text(encoding="utf-8"))
    found = [text[max(0, m.start() - 30) : m.end() + 30] for m in REFUSED.finditer(text)]
    assert not found


@pytest.mark.parametrize("file", DOCS, ids=relative_name)
def test_documentation_sentence_has_at_most_thirty_words(file: Path):
    assert not [s for s in sentences(file.read_text(encoding="utf-8")) if len(s.split()) > MAX_WORDS]


def test_documentation_median_sentence_is_short():
    lengths = [len(s.split()) for file in DOCS for s in sentences(file.read_text(encoding="utf-8"))]
    assert median(lengths) <= MAX_MEDIAN
