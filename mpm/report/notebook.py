"""What a notebook shows of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mpm.markup import paragraph, table
from mpm.report.fieldnames import superscript
from mpm.report.quantities import FIRST, first, quantity, worst_balance_error
from mpm.report.rounding import shown
from mpm.report.trees import flatten
from mpm.report.verdict import verdict

if TYPE_CHECKING:
    from mpm.case.case import Case


def result_html(case: Case, summary: Mapping[str, Any], where: str) -> str:
    """The verdict on a run, its first numbers with their units, and how well its books close."""
    if not summary:
        return paragraph(case.title or "run", bold=True) + paragraph(f"not ended yet, in {where}")
    lines = paragraph(case.title or "run", bold=True) + paragraph(verdict(case, summary))
    return lines + table(result_rows(summary)) + (paragraph(f"in {where}") if where else "")


def result_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Labels and values; of profiles nothing."""
    steady, numbers = summary.get("fidelity") == "steady", flatten(summary)
    chosen = [name for place in range(len(FIRST)) for name in numbers if first(name) == place]
    rows = [
        (quantity(name, steady).label, superscript(shown(name, numbers, steady)))
        for name in chosen
        if not quantity(name).profile
    ]
    worst = worst_balance_error(numbers)
    if worst is not None:
        rows.append(
            ("largest relative error of a balance", f"{numbers[worst]:.1e} ({quantity(worst).label})")
        )
    return rows
