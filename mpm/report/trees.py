"""Nested tables of numbers (summary.json) and flat ones with dotted names (history.csv): from one to the other and back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any


def numbers(tree: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, float]]:
    """The numbers in nested tables by dotted name; entries of lists by their index (`...exit_profile.0`)."""
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from numbers(value, f"{name}.")
        elif isinstance(value, list):
            yield from numbers({str(index): item for index, item in enumerate(value)}, f"{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield name, value


CHOSEN = "conventions."
"""Below it a summary says how its numbers were computed: a choice that is a number, such as `transport.backflow_rows`, is no result."""


def flatten(tree: Mapping[str, object]) -> dict[str, float]:
    """The finite ones of them that are results."""
    return {
        name: value for name, value in numbers(tree) if math.isfinite(value) and not name.startswith(CHOSEN)
    }


def nest(flat: Mapping[str, float]) -> dict[str, Any]:
    """Numbers with dotted names as nested tables."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *path, last = name.split(".")
        branch = tree
        for part in path:
            branch = branch.setdefault(part, {})
        branch[last] = value
    return tree
