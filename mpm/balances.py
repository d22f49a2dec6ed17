"""Whether a run may call its numbers done: every balance of species, sites and elements within LIMIT."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm.diagnostics import Totals, element_balances, site_balance, species_balances
from mpm.errors import BalanceError

if TYPE_CHECKING:
    from mpm.case import Case

LIMIT = 1e-6
"""Relative to the largest term of a balance: solvers leave 1e-9 and less, so more than this is a fault, not their tolerance."""


def worst_balance(case: Case, totals: Totals) -> tuple[str, float]:
    """Name and relative error of the worst of all balances (`mpm.diagnostics`); one that is not a number is worse than any."""
    errors = {name: entry["balance_error"] for name, entry in species_balances(case, totals).items()}
    errors["sites"] = site_balance(case, totals)
    errors |= {f"element {name}": error for name, error in element_balances(case, totals).items()}
    return max(errors.items(), key=lambda item: item[1] if item[1] == item[1] else float("inf"))


def require_balance(case: Case, totals: Totals) -> None:
    """Raise BalanceError unless every balance is within LIMIT."""
    name, error = worst_balance(case, totals)
    if not error <= LIMIT:
        raise BalanceError(
            f"balance of {name}: off by {error:.3g} of its largest term, more than {LIMIT:g}: the numbers of this run cannot be trusted"
        )
