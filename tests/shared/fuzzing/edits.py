"""Seeded edits that make a tree of JSON values hostile.

Every edit is a function `(value, rng) -> (edited value, what was done)`. It does not change its argument.
"""

import json
import re
from collections.abc import Callable
from random import Random
from typing import Any

Edit = Callable[[Any, Random], tuple[Any, str]]


class Token:
    """Text that is written to JSON or TOML without quotes, such as 1e999."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return f"Token({short_text(self.text)})"


NUMBERS: tuple[Any, ...] = (
    *(0, -1, 1, 2, 3, 7, 100, 10**5, 10**6, 2**31 - 1, 2**31, 2**53, 2**63, 2**64, 10**10, 10**400),
    *(-0.0, 0.5, 1.0, 2.0, -1.5, 1e-8, 1e-154, 5e-324, 1e-300, 1e16, 1e50, 1e99, 1e101, 1e154, 1e200, 1e308),
    *(-1e308, float("nan"), float("inf"), float("-inf"), Token("1e999"), Token("1" + "0" * 5000)),
)
TEXTS = (
    *("", " ", "a", "world", "x", "0", "nan", "1e5", "é", "ﬁ", "\ud800", "\udcff", "\x1b[2J", "a\nb", "\x00"),
    *(
        "\u202e",
        "\u2028",
        "%s{0}",
        "../x.csv",
        "/dev/zero",
        ".",
        "con.csv",
        "x" * 201,
        "x" * 3000,
        " a ",
        "\t",
    ),
)
BIG = ("x" * 10**5, [0] * 10**5, [[0.0] * 300] * 300, ["é" * 9] * 10**4, 10**4000)
STRUCTURES: tuple[Any, ...] = (
    *(None, True, False, [], {}, [[]], [0], [1.0, 2.0], ["a"], {"a": 1}, [None], [[1, 2], [3]], [{}]),
    *(
        Token("[" * 50 + "]" * 50),
        Token("[" * 5000 + "]" * 5000),
        Token("{"),
        Token("1979-05-27"),
        Token("0x7f"),
    ),
)


def short_text(value: object, most: int = 80) -> str:
    """Return repr(value) without its middle if it is long."""
    try:
        text = repr(value) if not isinstance(value, str | list) or len(value) < 10**4 else ""
    except ValueError:  # an integer with too many digits
        text = ""
    text = text or f"<{type(value).__name__} of size {len(value) if hasattr(value, '__len__') else '?'}>"
    return text if len(text) <= most else f"{text[: most // 2]}...{text[-most // 2 :]} ({len(text)})"


def edit_tree(tree: Any, rng: Random) -> tuple[Any, str]:
    """Edit one place of a tree of dicts, lists and plain values."""

    def descend(node: Any, place: str) -> tuple[Any, str]:
        if isinstance(node, dict) and node and rng.random() < 0.88:
            key = rng.choice(list(node))
            child, said = descend(node[key], f"{place}.{key}")
            return {**node, key: child}, said
        if isinstance(node, list) and node and rng.random() < 0.88:
            n = rng.randrange(len(node))
            child, said = descend(node[n], f"{place}[{n}]")
            return [*node[:n], child, *node[n + 1 :]], said
        changed, said = _change_node(node, rng, tree)
        return changed, f"{place or 'all'}: {said}"

    return descend(tree, "")


def _change_node(node: Any, rng: Random, tree: Any) -> tuple[Any, str]:
    if isinstance(node, dict) and rng.random() < 0.75:
        return _change_table(node, rng, tree)
    if isinstance(node, list) and rng.random() < 0.75:
        return _change_list(node, rng, tree)
    kind = rng.random()
    if isinstance(node, int | float) and not isinstance(node, bool) and kind < 0.7:
        value = _change_number(node, rng) if kind < 0.3 else rng.choice(NUMBERS)
    elif isinstance(node, str) and kind < 0.6:
        value = _change_text(node, rng) if kind < 0.2 else rng.choice(TEXTS)
    elif kind > 0.99:
        value = rng.choice(BIG)
    elif kind > 0.92:
        value = _piece(tree, rng)
    else:
        value = rng.choice((*NUMBERS, *TEXTS, *STRUCTURES))
    return value, f"{short_text(node)} -> {short_text(value)}"


def _change_number(number: Any, rng: Random) -> Any:
    steps = (
        *(lambda n: n + 1, lambda n: n - 1, lambda n: -n, lambda n: n * 10, lambda n: n * 1.0001, str),
        *(lambda n: n * 1e6, lambda n: n / 1e9, lambda n: n * 1e30, lambda n: [n], bool),
    )
    try:
        return rng.choice(steps)(number)
    except (OverflowError, ValueError):  # an integer beyond float64, or beyond what Python prints
        return -1


def _change_text(text: str, rng: Random) -> str:
    at = rng.randint(0, len(text))
    return rng.choice((text[:at], text + text, text.upper(), text[:at] + rng.choice(TEXTS) + text[at:]))


def _change_table(node: dict[str, Any], rng: Random, tree: Any) -> tuple[Any, str]:
    key = rng.choice(list(node)) if node else ""
    match rng.randrange(4):
        case 0:
            return {k: v for k, v in node.items() if k != key}, f"without {key!r}"
        case 1:
            name = _change_text(key, rng)
            return {
                (name if k == key else k): v for k, v in node.items()
            }, f"{key!r} named {short_text(name)}"
        case 2:
            name, value = rng.choice(TEXTS), _piece(tree, rng)
            return {**node, name: value}, f"with {short_text(name)} = {short_text(value)}"
        case _:
            other = rng.choice(list(node)) if node else ""
            return {**node, key: node.get(other), other: node.get(key)}, f"{key!r} and {other!r} exchanged"


def _change_list(node: list[Any], rng: Random, tree: Any) -> tuple[Any, str]:
    n = rng.randint(0, len(node))
    match rng.randrange(5):
        case 0:
            return node[:n], f"cut to {n} items"
        case 1:
            return node + node[n:] + node[:1], "items repeated"
        case 2:
            return node[::-1], "reversed"
        case 3:
            value = _piece(tree, rng)
            return [*node[:n], value, *node[n:]], f"with {short_text(value)} at {n}"
        case _:
            times = rng.choice((0, 2, 100, 10**4 // (len(node) or 1)))
            return node * times, f"{times} times"


def _piece(tree: Any, rng: Random) -> Any:
    """Return a random part of the tree."""
    while isinstance(tree, dict | list) and tree and rng.random() < 0.8:
        tree = rng.choice(list(tree.values()) if isinstance(tree, dict) else tree)
    return tree


def json_text(tree: Any) -> str:
    """Return the tree as JSON, in ASCII; NaN and tokens are written as they are."""
    tokens: list[str] = []

    def token(value: Any) -> str:
        tokens.append(value.text)
        return f"@@{len(tokens) - 1}@@"

    text = json.dumps(_printable_integers(tree), default=token)
    return re.sub(r'"@@(\d+)@@"', lambda found: tokens[int(found[1])], text) if tokens else text


def toml_text(tree: Any) -> str:
    """Return the tree as TOML, every value on one line."""
    if not isinstance(tree, dict):
        return f"all = {_toml(tree)}\n"
    return "".join(f"{json.dumps(key)} = {_toml(value)}\n" for key, value in tree.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return json_text(value)


def _printable_integers(tree: Any) -> Any:
    """Replace a tree by a token if it has an integer of more digits than Python prints."""
    try:
        json.dumps(tree, default=str)
    except ValueError:
        return Token("1" + "0" * 5000)
    return tree
