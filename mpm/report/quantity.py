"""What one reported number is, and what a section of them is: the two kinds of entry of the table in `mpm.report.quantities`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

from mpm import units

if TYPE_CHECKING:
    from mpm.report.records import Records

RATIO = "1"
"""Unit of a pure number."""


@dataclass(frozen=True)
class Quantity:
    """One kind of number. `name` is a dotted name in which <part> stands for a name of the case; `label` and `meaning` may use the {part}s.

    `unit` is SI (RATIO: a pure number, "": a count); `shown` the unit people read it in. `rate`: in a steady state per second. `error`: how
    far a balance is from closing. `again`: another number says the same (names kept for scripts). `profile`: an entry of a list, which
    history.csv, and screens, leave out.
    """

    name: str
    label: str
    unit: str
    meaning: str
    shown: str = ""
    _: KW_ONLY
    rate: bool = False
    error: bool = False
    again: bool = False
    profile: bool = False

    @property
    def factor(self) -> float:
        """What one unit of `shown` is in `unit`."""
        return units.parse(f"1 {self.shown}", self.unit) if self.shown else 1.0

    @property
    def unit_shown(self) -> str:
        """The unit to print beside `value / factor`; empty for pure numbers and counts."""
        return "" if self.unit == RATIO else self.shown or self.unit

    def of(self, value: float) -> float:
        """`value` [unit] as a number in the unit that is printed."""
        return value / self.factor


@dataclass(frozen=True)
class Section:
    """Numbers that one function gives: of what a run has recorded, a table as it stands in the files.

    `name` is the first part of their dotted names, "" where they stand at the top. `heading` is what screens and the report page print
    above them ("": they have a sheet of their own). `since_output`: they tell what has passed since the row before, so that a summary
    repeats those of the last row.
    """

    name: str
    heading: str
    gives: Callable[[Records], Mapping[str, Any]]
    numbers: tuple[Quantity, ...]
    _: KW_ONLY
    history: bool = True
    summary: bool = True
    since_output: bool = False
