"""Two runs beside each other: in which keys their cases differ, and in which numbers what they gave does.

Pure functions of cases and summaries; `mpm compare` prints them, the report page of two runs shows them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from mpm.case.keys import values
from mpm.errors import InputError, printable
from mpm.report.quantities import quantity
from mpm.report.quantity import Quantity
from mpm.report.rounding import ROUNDING, natural_scale, without_rounding
from mpm.report.trees import flatten
from mpm.screen import Sheet, say, together

if TYPE_CHECKING:
    from rich.console import Console

    from mpm.case.case import Case
    from mpm.output.results import Run

SAME = 1e-6
"""Relative difference below which two numbers are the same: nobody acts on a part in a million."""
CLOSED = 1e-9
"""The same of two balance errors, absolute."""
_ABOUT_THE_COMPUTER = ("wall_seconds", "ranks")


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

    What tells about the computer (time on the clock, processes), what is there twice, and profiles row by row are left out. `everything`:
    all numbers, whether they differ or not. An amount of a steady state is per second, so that a steady run and one in time share only
    numbers of other kinds.
    """
    one, other = (_numbers(summary) for summary in (first, second))
    found = []
    for name, steady in [*one, *(key for key in other if key not in one)]:
        a, b = one.get((name, steady)), other.get((name, steady))
        if not everything:
            what = quantity(name)
            if name in _ABOUT_THE_COMPUTER or what.again or what.profile:
                continue
            if _same_number(name, a, b, _scale(name, first, second)):
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


def _scale(name: str, *summaries: Mapping[str, Any]) -> float:
    """What a number of several runs is large or small beside (`natural_scale`)."""
    return max(natural_scale(name, flatten(summary)) for summary in summaries)


def _same_number(name: str, one: float | None, other: float | None, scale: float) -> bool:
    if one is None or other is None:
        return False
    floor = CLOSED if quantity(name).error else ROUNDING * scale
    return abs(one - other) <= max(SAME * max(abs(one), abs(other)), floor)


def print_comparison(one: Run, other: Run, everything: bool, console: Console) -> None:
    """Two runs side by side: what was changed, and what came of it. Raises InputError for one that has not ended."""
    for letter, run in (("A", one), ("B", other)):
        if not run.summary:
            raise InputError(
                f"{run.directory.path}: found no summary.json; accepted: a run that has ended (mpm watch shows one at work)"
            )
        title = f" ({printable(run.case.title)})" if run.case.title else ""
        status = "" if run.summary.get("status") == "done" else f", {run.summary.get('status')}"
        say(console, f"{letter}: {run.directory.path}{title}{status}")
    keys = changed_keys(one.case, other.case)
    numbers = changed_numbers(one.summary, other.summary, everything)
    people = [{value.name: value.text for value in values(run.case)} for run in (one, other)]
    sheet = Sheet(room=34)
    sheet.group("Keys that differ, A -> B")
    for change in keys:
        texts = (
            texts.get(change.key, raw)
            for texts, raw in zip(people, (change.first, change.second), strict=True)
        )
        sheet.add(change.key, " -> ".join(together(text or "none") for text in texts))
    sheet.group("Numbers, A -> B" if everything else "Numbers that differ, A -> B")
    for number in numbers:
        sheet.add(
            number.quantity.label, _beside(number, _scale(number.quantity.name, one.summary, other.summary))
        )
    sheet.print(console)
    if not keys:
        say(console, "The cases are the same.")
    if not numbers:
        say(console, "The numbers are the same, to one part in a million.")


def _beside(changed: ChangedNumber, scale: float) -> str:
    """Both values with their unit, 0 for what is rounding beside `scale`, and how much the second is more or less than the first."""
    values = [
        None if value is None else without_rounding(value, scale) for value in (changed.first, changed.second)
    ]
    texts = ["none" if value is None else f"{changed.quantity.of(value):.4g}" for value in values]
    text = together(f"{' -> '.join(texts)} {changed.quantity.unit_shown}".strip())
    relative = replace(changed, first=values[0], second=values[1]).relative
    return text if not relative else f"{text} ({together(_more(relative))})"


def _more(relative: float) -> str:
    """A relative difference in words: `+12 %`, `-3.1 %`, `25 times as much`."""
    return f"{100.0 * relative:+.3g} %" if abs(relative) < 10.0 else f"{1.0 + relative:.3g} times as much"
