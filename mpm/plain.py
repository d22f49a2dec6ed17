"""Values in JSON's own types, for files and reports: what is no finite number is left out."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mpm.errors import MpmError

Lost = Callable[[str, float], None]
"""Told of a number that is not finite, and where it stands; may raise."""


def silent(where: str, number: float) -> None:
    """Nobody is told."""


def plain(value: Any, where: str = "", lost: Lost = silent) -> Any:
    """`value` in JSON's own types: numpy numbers and arrays converted; None and what is not finite left out (a list with it).

    Raises MpmError for what is no number, text, list or table.
    """
    if isinstance(value, Mapping):
        items = {str(key): plain(item, f"{where}: {key}", lost) for key, item in value.items()}
        return {key: item for key, item in items.items() if item is not None}
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), where, lost)
    if isinstance(value, list | tuple):
        found = [plain(item, f"{where}[{index}]", lost) for index, item in enumerate(value)]
        return None if None in found else found
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        lost(where, value)
        return None
    if value is not None and not isinstance(value, bool | int | float | str):
        raise MpmError(f"{where}: {type(value).__name__} is not a number, text, list or table")
    return value


def json_text(value: Any, where: str = "", lost: Lost = silent) -> str:
    """The `plain` value as the text of a JSON file."""
    return json.dumps(plain(value, where, lost), indent=2, allow_nan=False) + "\n"
