"""Two runs beside each other: in which keys their cases differ, and in which numbers what they gave does.

Pure functions of cases and summaries; `mpm compare` prints them, the report page of two runs shows them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpm.quantities import Quantity, flatten, quantity

if TYPE_CHECKING:
    from mpm.case import Case

SAME = 1e-6
"""Relative difference below which two numbers are the same: nobody acts on a part in a million."""
CLOSED = 1e-9
"""The same of two balance errors, absolute."""
NOTHING = 1e-12
"""Share of the largest number of the same kind below which a number is rounding of 0."""
_ABOUT_THE_COMPUTER = ("wall_seconds", "ranks")
_ERRORS = ("balance_error", "mass_error")


@dataclass(frozen=True)
class ChangedKey:
    """A key of the case file with the value, as written there, that each of the two cases gives it; None where it has none."""

    key: str
    first: str | None
    second: str | None


@dataclass(frozen=True)
class ChangedNumber:
    """A reported number in SI units, None in the run that does not report it; `quantity` has its words and units."""

    quantity: Quantity
    first: float | None
    second: float | None

    @property
    def relative(self) -> float | None:
        """(second - first) / |first|; None where one is missing or the first is 0."""
        if self.first is None or self.second is None or self.first == 0.0:
            return None
        return (self.second - self.first) / abs(self.first)


def changed_keys(first: Case, second: Case) -> list[ChangedKey]:
    """Keys of the resolved cases, dotted as in `--set`, whose values differ by more than rounding; not the titles.

    A value that follows from another key (diffusivities from the pressure, say) is a difference, too.
    """
    one, other = _leaves(first.to_dict()), _leaves(second.to_dict())
    return [
        ChangedKey(key, one.get(key), other.get(key))
        for key in [*one, *(key for key in other if key not in one)]
        if key != "title" and not _same_value(one.get(key), other.get(key))
    ]


def changed_numbers(
    first: Mapping[str, Any], second: Mapping[str, Any], everything: bool = False
) -> list[ChangedNumber]:
    """Numbers of two summaries that differ by more than `SAME`, in the order of the first.

    What tells about the computer (time on the clock, processes) and profiles row by row are left out. `everything`: all numbers, whether
    they differ or not. An amount of a steady state is per second, so that a steady run and one in time share only numbers of other kinds.
    """
    one, other = (_numbers(summary) for summary in (first, second))
    found = []
    for name, steady in [*one, *(key for key in other if key not in one)]:
        a, b = one.get((name, steady)), other.get((name, steady))
        if not everything:
            if name in _ABOUT_THE_COMPUTER or name.rpartition(".")[0].endswith("_profile"):
                continue
            if _same_number(name, a, b, _scale(name, one, other)):
                continue
        found.append(ChangedNumber(quantity(name, steady), a, b))
    return found


def _leaves(table: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """Values as text by dotted key; entries of a list of tables by their names."""
    leaves: dict[str, str] = {}
    for key, value in table.items():
        if isinstance(value, list) and value and all(isinstance(entry, Mapping) for entry in value):
            value = {str(entry["name"]): entry for entry in value}
        if isinstance(value, Mapping):
            leaves |= _leaves(value, f"{prefix}{key}.")
        elif key != "name":
            leaves[f"{prefix}{key}"] = _text(value)
    return leaves


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    return f"{value:g}" if isinstance(value, float) and f"{value:g}" == str(value) else str(value)


def _same_value(one: str | None, other: str | None) -> bool:
    """Whether two values are the same text, or the same number with the same unit but for the last digits."""
    if one is None or other is None or one == other:
        return one == other
    (a, _, unit), (b, _, its_unit) = one.partition(" "), other.partition(" ")
    try:
        return unit == its_unit and math.isclose(float(a), float(b), rel_tol=1e-12)
    except ValueError:
        return False


def _numbers(summary: Mapping[str, Any]) -> dict[tuple[str, bool], float]:
    """Numbers of a summary by name and whether they are amounts per second."""
    steady = summary.get("fidelity") == "steady"
    return {
        (name, steady and quantity(name).rate): value
        for name, value in flatten(summary).items()
        if not name.startswith("versions.")
    }


def _scale(name: str, *runs: Mapping[tuple[str, bool], float]) -> float:
    """The largest number of the same section and unit: what rounding is measured by."""
    section, unit = name.partition(".")[0], quantity(name).unit
    alike = (
        abs(v)
        for run in runs
        for (n, _), v in run.items()
        if n.partition(".")[0] == section and quantity(n).unit == unit
    )
    return max(alike, default=0.0)


def _same_number(name: str, one: float | None, other: float | None, scale: float) -> bool:
    if one is None or other is None:
        return False
    floor = CLOSED if name.endswith(_ERRORS) else NOTHING * scale
    return abs(one - other) <= max(SAME * max(abs(one), abs(other)), floor)
