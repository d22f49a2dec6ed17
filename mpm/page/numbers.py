"""The numbers of a run as rows of words, value, unit and meaning, and the mass-balance sheet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mpm.report.balances import TERMS
from mpm.report.fieldnames import superscript
from mpm.report.quantities import headed, quantity
from mpm.report.quantity import Quantity
from mpm.report.rounding import natural_scale, without_rounding
from mpm.report.trees import flatten


@dataclass(frozen=True)
class Row:
    """One number: what it is, SI value, and text with unit for people."""

    quantity: Quantity
    value: float
    shown: str

    @property
    def name(self) -> str:
        return self.quantity.name

    @property
    def unit(self) -> str:
        """As people write it, with raised powers."""
        return superscript(self.quantity.unit_shown)


def shown(value: float, digits: int = 4) -> str:
    """A number as people write it: thousands apart, powers of ten only where they are needed."""
    if value == 0.0:
        return "0"
    if float(value).is_integer() and abs(value) < 1e9:
        return f"{value:,.0f}"
    return f"{value:.{digits}g}"


def rounded(what: Quantity, value: float, scale: float) -> str:
    """A value in the unit that people read; what is rounding beside `scale` is 0."""
    return shown(what.of(without_rounding(value, scale)))


def row(name: str, value: float, steady: bool, scale: float = 0.0) -> Row:
    """The row of one dotted name."""
    what = quantity(name, steady)
    return Row(what, value, rounded(what, value, scale))


def groups(summary: Mapping[str, Any]) -> list[tuple[str, list[Row]]]:
    """All numbers of a summary but balances and profiles, under their headings."""
    steady, numbers = summary.get("fidelity") == "steady", flatten(summary)
    return [
        (heading, [row(name, numbers[name], steady, natural_scale(name, numbers)) for name in names])
        for heading, names in headed(numbers)
    ]


@dataclass(frozen=True)
class Account:
    """The balance of one species: its terms as rows and in per cent of what came in (fed + produced), and what is missing."""

    species: str
    rows: Sequence[Row]
    shares: Sequence[str]
    error: float


def accounts(summary: Mapping[str, Any]) -> list[Account]:
    """The sheet, species that never occurred left out."""
    steady = summary.get("fidelity") == "steady"
    numbers = flatten(summary)
    found = []
    for species, entry in summary.get("species", {}).items():
        came = entry.get("fed", 0.0) + entry.get("produced", 0.0)
        largest = max(abs(entry.get(term, 0.0)) for term in TERMS)
        if largest == 0.0:
            continue
        scale = max(largest, natural_scale(f"species.{species}.fed", numbers))
        rows = [row(f"species.{species}.{term}", entry.get(term, 0.0), steady, scale) for term in TERMS]
        whole = came if came > 0.0 else largest
        shares = ["" if r.shown == "0" else f"{100.0 * r.value / whole:.3g}" for r in rows]
        found.append(Account(species, rows, shares, entry.get("balance_error", 0.0)))
    return found


def errors(summary: Mapping[str, Any]) -> list[Row]:
    """Balance errors, the largest first."""
    rows = [row(name, value, False) for name, value in flatten(summary).items() if quantity(name).error]
    return sorted(rows, key=lambda r: -abs(r.value))
