"""A row: a statement of the thesis, what is expected, and the measurement that decides on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from reproduction.store import Lab

HOLDS, FAILS = "reproduced", "not reproduced"


@dataclass(frozen=True)
class Finding:
    """What a row has measured. `verdict` is computed by `judge` or `under`; `measured` is one line for the table.

    `numbers` keeps everything that the verdict rests on; `why` is the paragraph for a row that does not simply hold.
    """

    verdict: str
    measured: str
    numbers: dict[str, Any]
    why: str = ""


@dataclass(frozen=True)
class Row:
    """`measure(lab)` runs what it needs and returns the finding."""

    id: str
    figure: str
    statement: str
    expected: str
    measure: Callable[[Lab], Finding]


ROWS: dict[str, Row] = {}


def row(
    name: str, figure: str, statement: str, expected: str
) -> Callable[[Callable[[Lab], Finding]], Callable[[Lab], Finding]]:
    """Enter a measurement as row `name`."""

    def enter(measure: Callable[[Lab], Finding]) -> Callable[[Lab], Finding]:
        ROWS[name] = Row(name, figure, statement, expected, measure)
        return measure

    return enter


@dataclass
class Checks:
    """Named conditions of a row, each the outcome of a comparison of measured numbers.

    The row holds when all are true, does not when none is; otherwise it holds only under the conditions named.
    """

    outcomes: dict[str, bool] = field(default_factory=dict)

    def add(self, name: str, outcome: Any) -> bool:
        """Record a comparison."""
        self.outcomes[name] = bool(outcome)
        return bool(outcome)

    @property
    def verdict(self) -> str:
        good = [name for name, outcome in self.outcomes.items() if outcome]
        if not good:
            return FAILS
        if len(good) == len(self.outcomes):
            return HOLDS
        bad = [name for name, outcome in self.outcomes.items() if not outcome]
        return f"reproduced only for: {'; '.join(good)} (not for: {'; '.join(bad)})"
