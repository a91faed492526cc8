"""Natural order of names: "demo_2" before "demo_10"."""

import re

Key = tuple[tuple[int, int, str], ...]


def natural_key(name: str) -> Key:
    """Return a key that sorts numbers in names by value, for `sorted`.

    Args:
        name: Any text.

    Example:
        >>> from pilotfish.io.natural_order import natural_key
        >>> sorted(["demo_10", "demo_2"], key=natural_key)
        ['demo_2', 'demo_10']
    """
    parts = re.split(r"([0-9]{1,18})", name)
    return tuple((0, int(part), "") if n % 2 else (1, 0, part) for n, part in enumerate(parts))
