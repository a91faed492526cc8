"""Seeded edits that make a valid value hostile: trees of JSON, arrays, bytes and text.

Every edit is a function `(value, rng) -> (edited value, what was done)`. It does not change its argument.
"""

import json
import re
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np

from pilotfish.types import Array

Edit = Callable[[Any, Random], tuple[Any, str]]


class Token:
    """Text that is written into JSON or TOML as it is, such as 1e999."""

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
    """Return repr(value), its middle left out if it is long."""
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
    """Return some part of the tree."""
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
    """Python refuses to print integers of more than 4300 digits; a nudged one may have them."""
    try:
        json.dumps(tree, default=str)
    except ValueError:
        return Token("1" + "0" * 5000)
    return tree


# ---------------------------------------------------------------------------------------------- arrays

ENTRIES = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    2.0,
    0.5,
    -5.0,
    1e3,
    1e6,
    1e9,
    1e-3,
    1e-9,
    1e-154,
    1e-300,
    5e-324,
    1e16,
    1e50,
)
EXTREMES = (1e99, 1e101, 1e150, 1e155, 1e200, 1e308, -1e308, float("nan"), float("inf"), float("-inf"))
KINDS = ("<f4", ">f8", "<i8", "<c16", "|b1", "<f2", "<u1", "<U3", "<M8[s]", "<i4")


def edit_array(array: Array, rng: Random) -> tuple[Array, str]:
    """Edit entries, shape or kind of an array."""
    array = np.asarray(array)
    return rng.choice((_entries, _entries, _entries, _scaled, _scaled, _row, _shape, _shape, _kind))(
        array, rng
    )


def _entries(array: Array, rng: Random) -> tuple[Array, str]:
    if array.size == 0 or array.dtype.kind not in "fiu":
        return _shape(array, rng)
    value, n = rng.choice(ENTRIES if rng.random() < 0.6 else EXTREMES), rng.randrange(array.size)
    edited = np.array(array, dtype=np.float64)
    if rng.random() < 0.15:
        edited[...] = value
        return edited, f"all = {value}"
    edited.flat[n] = value
    return edited, f"flat[{n}] = {value}"


def _scaled(array: Array, rng: Random) -> tuple[Array, str]:
    if array.dtype.kind not in "fiu":
        return _kind(array, rng)
    factor = rng.choice((-1.0, 0.0, 1e-20, 1e20, 1e-150, 1e150, 1.0000001, *[10.0 ** rng.uniform(-9, 9)] * 7))
    with np.errstate(all="ignore"):
        return array * factor, f"times {factor}"


def _row(array: Array, rng: Random) -> tuple[Array, str]:
    if array.ndim == 0 or len(array) == 0:
        return _shape(array, rng)
    n, m = rng.randrange(len(array)), rng.randrange(len(array))
    edited = array.copy()
    edited[n] = array[m]
    return edited, f"row {n} = row {m}"


def _shape(array: Array, rng: Random) -> tuple[Array, str]:
    flat = array.reshape(-1)
    few = tuple(rng.choice((0, 1, 2, 3)) for _ in range(rng.randrange(5)))
    shapes: tuple[Callable[[], Array], ...] = (
        lambda: array[1:] if array.ndim else array[None],
        lambda: array[..., :-1] if array.ndim else array,
        lambda: array[None],
        lambda: array[..., None],
        lambda: array.T,
        lambda: array[:0] if array.ndim else flat[:0],
        lambda: np.concatenate([array, array]) if array.ndim else array,
        lambda: np.concatenate([array, array], axis=-1) if array.ndim else array,
        lambda: flat,
        lambda: np.resize(array, few) if array.size else np.zeros(few),
        lambda: np.resize(array, (100, 100)) if rng.random() < 0.1 and array.size else array[::-1],
    )
    edited = rng.choice(shapes)() if array.ndim else np.resize(array, few)
    return edited, f"shape {array.shape} -> {edited.shape}"


def _kind(array: Array, rng: Random) -> tuple[Array, str]:
    kind = np.dtype(rng.choice(KINDS))
    with np.errstate(all="ignore"):
        return (array.astype(kind) if array.dtype.kind in "fiub" else array), f"kind {kind}"


# ---------------------------------------------------------------------------------------------- bytes, text


def edit_bytes(data: bytes, rng: Random) -> tuple[bytes, str]:
    """Flip, cut, repeat, exchange or overwrite bytes."""
    n, m = sorted((rng.randint(0, len(data)), rng.randint(0, len(data))))
    m = min(m, n + rng.choice((1, 2, 4, 8, 64, 4096)))
    match rng.randrange(8):
        case 0 | 1 if data:
            flipped = bytearray(data)
            at = rng.randrange(len(data))
            flipped[at] ^= 1 << rng.randrange(8)
            return bytes(flipped), f"bit of byte {at}"
        case 2:
            return data[:n], f"cut at {n}"
        case 3:
            return data[:n] + data[m:], f"without [{n}:{m}]"
        case 4:
            return data[:m] + data[n:m] * rng.choice((1, 1, 50)) + data[m:], f"[{n}:{m}] repeated"
        case 5:
            fill = rng.choice((b"\0", b"\xff", b"9", b"\n", b"[", b" ", b"\x80"))
            return data[:n] + fill * (m - n) + data[m:], f"[{n}:{m}] = {fill!r}"
        case 6:
            return data[:n] + rng.randbytes(m - n) + data[m:], f"[{n}:{m}] at random"
        case _:
            return _number_in_text(data, rng)


def _number_in_text(data: bytes, rng: Random) -> tuple[bytes, str]:
    found = list(re.finditer(rb"-?\d+(\.\d+)?(e[-+]?\d+)?", data[:20_000]))
    if not found:
        return data[::-1], "reversed"
    spot, word = rng.choice(found), rng.choice(WORDS).encode("utf-8", "surrogatepass")
    return data[: spot.start()] + word + data[spot.end() :], f"number at {spot.start()} = {short_text(word)}"


WORDS = (
    *(
        "0",
        "-1",
        "1e308",
        "-1e308",
        "1e999",
        "5e-324",
        "1e-154",
        "nan",
        "inf",
        "-inf",
        "NaN",
        "1_0",
        "",
        " ",
        "x",
    ),
    *(
        "9" * 400,
        "9" * 5000,
        "0x10",
        "1e",
        "+5",
        "٣",
        "１",
        "1e400",
        "true",
        "[]",
        '"',
        ",",
        "1,2",
        "0-0",
        "1e155",
    ),
    *(
        "1e-200",
        "1e100",
        "1e101",
        "\x00",
        "\x1b[2J",
        "é",
        "\ud800",
        "#",
        ";",
        "\r",
        "99999999999999999999",
        "1e16",
    ),
)


def edit_text(marks: tuple[str, ...]) -> Edit:
    """Return an edit of a short text; marks are the signs and words that mean something in it."""

    def edit(text: str, rng: Random) -> tuple[str, str]:
        n, m = sorted((rng.randint(0, len(text)), rng.randint(0, len(text))))
        piece = rng.choice(marks if rng.random() < 0.5 else WORDS)
        numbers = list(re.finditer(r"[-\d.]+", text))
        match rng.randrange(6):
            case 0 | 1 if numbers:
                spot = rng.choice(numbers)
                edited = text[: spot.start()] + piece + text[spot.end() :]
            case 2:
                edited = text[:n] + text[m:]
            case 3:
                edited = text[:n] + (piece * rng.choice((1, 1, 1, 3, 3000)))[:20_000] + text[n:]
            case 4:
                edited = text + text[n:m][:100] * rng.choice((1, 1, 2, 2000))
            case _:
                edited = text[:n] + piece + text[m:]
        return edited[:50_000], f"{short_text(text)} -> {short_text(edited)}"

    return edit
