"""Seeded edits of bytes and of short texts."""

import re
from random import Random

from fuzzing.edits import Edit, short_text


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
