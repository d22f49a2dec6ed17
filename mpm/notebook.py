"""What notebooks show of mpm's objects: small HTML tables without scripts or styles of their own, and the live line of a run.

Every text of a case goes through `escape`: names may hold any printable character.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

from mpm.errors import printable
from mpm.fieldnames import superscript
from mpm.quantities import flatten, quantity
from mpm.screen import HARD_SPACE, Listing, number
from mpm.tables import shown
from mpm.verdict import verdict

if TYPE_CHECKING:
    from mpm.case import Case

LEFT = ' style="text-align: left"'
PART = ' style="text-align: left; padding-left: 2em; font-weight: normal"'
FIRST = ("titration", "utilisation", "dose_ratio", "cvd", "film")
"""Sections of a summary that people look at first."""


def text(words: str) -> str:
    """`words` for HTML, on one line."""
    return escape(" ".join(printable(part) for part in words.split(HARD_SPACE)))


def paragraph(words: str, bold: bool = False) -> str:
    inner = text(words)
    return f"<p>{f'<b>{inner}</b>' if bold else inner}</p>" if words else ""


def table(rows: Iterable[tuple[str, str]], heading: str = "") -> str:
    """Labels and values; nothing for no rows. A label that begins with a hard space is a part of the one above it."""
    lines = [
        f"<tr><th{PART if label.startswith(HARD_SPACE) else LEFT}>{text(label)}</th><td{LEFT}>{text(value)}</td></tr>"
        for label, value in rows
    ]
    if lines and heading:
        lines.insert(0, f'<tr><th colspan="2"{LEFT}>{text(heading)}</th></tr>')
    return f"<table>{''.join(lines)}</table>" if lines else ""


def columns(listing: Listing) -> str:
    """A table with a line of headings."""
    head = "".join(f"<th{LEFT}>{text(heading)}</th>" for heading in listing.headings)
    body = "".join(
        f"<tr>{''.join(f'<td{LEFT}>{text(cell)}</td>' for cell in row)}</tr>" for row in listing.rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def items(sentences: Sequence[str], heading: str) -> str:
    """A list of sentences; nothing for none."""
    if not sentences:
        return ""
    return paragraph(heading, bold=True) + f"<ul>{''.join(f'<li>{text(s)}</li>' for s in sentences)}</ul>"


def case_html(case: Case) -> str:
    """Title and key numbers of a case."""
    return paragraph(case.title or "case", bold=True) + table(case_rows(case))


def case_rows(case: Case) -> list[tuple[str, str]]:
    """What one asks first of a case, each value with its unit."""
    geometry, motion = case.geometry, case.motion
    height = sum(layer.height for layer in geometry.layers)
    ends = "periodic ends" if geometry.periodic else "walls at its ends"
    until = "" if case.fidelity == "steady" else f", 0 s to {number(case.time.end, 's')}"
    rows = [
        ("fidelity", case.fidelity + until),
        ("strip", f"{number(geometry.length * 1e3, 'mm')} long, {number(height * 1e3, 'mm')} high, {ends}"),
    ]
    for layer in reversed(geometry.layers):
        moves = f", moves at {number(case.conveying_velocity * 1e2, 'cm/s')}" if layer.moving else ""
        rows.append(
            (
                f"layer {layer.name}",
                f"{number(layer.height * 1e3, 'mm')}, {layer.material_name or 'gas'}{moves}",
            )
        )
    for inlet in geometry.inlets:
        fed = ", ".join(
            f"mass fraction {number(x)} of {name}" for name, x in inlet.mass_fractions.items() if x
        )
        rows.append(
            (
                f"inlet {inlet.name}",
                f"{number(inlet.velocity * 1e2, 'cm/s')} over {number(inlet.width * 1e3, 'mm')}, {fed or case.gas.carrier}",
            )
        )
    rows += [
        (f"outlet {outlet.name}", f"{number(outlet.width * 1e3, 'mm')} wide") for outlet in geometry.outlets
    ]
    vibration = (
        f"gamma {number(motion.gamma)} at {number(motion.frequency, 'Hz')}" if motion.gamma else "none"
    )
    gas = (
        f"{case.gas.carrier} at {number(case.gas.temperature, 'K')} and {number(case.gas.pressure, 'Pa', 6)}"
    )
    return [*rows, ("vibration", vibration), ("gas", gas)]


def result_html(case: Case, summary: Mapping[str, Any], where: str) -> str:
    """The verdict on a run, its first numbers with their units, and how well its books close."""
    if not summary:
        return paragraph(case.title or "run", bold=True) + paragraph(f"not ended yet, in {where}")
    lines = paragraph(case.title or "run", bold=True) + paragraph(verdict(case, summary))
    return lines + table(result_rows(summary)) + (paragraph(f"in {where}") if where else "")


def result_rows(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Labels and values; of profiles nothing."""
    steady, numbers = summary.get("fidelity") == "steady", flatten(summary)
    chosen = [name for section in FIRST for name in numbers if name.split(".")[0] == section]
    rows = [
        (quantity(name, steady).label, superscript(shown(name, numbers, steady)))
        for name in chosen
        if ".exit_profile." not in name
    ]
    errors = {name: value for name, value in numbers.items() if name.endswith("balance_error")}
    if errors:
        worst = max(errors, key=lambda name: abs(errors[name]))
        rows.append(("largest relative error of a balance", f"{errors[worst]:.1e} ({quantity(worst).label})"))
    return rows


def in_notebook() -> bool:
    """Whether a notebook shows what this process displays: its shell talks to a kernel, not to a terminal."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and hasattr(shell, "kernel")


class LiveLine:
    """A line in the output of a notebook's cell that renews itself."""

    def __init__(self) -> None:
        display = import_module("IPython.display").display
        self.handle = display({"text/plain": "starting"}, raw=True, display_id=True)

    def update(self, line: object) -> None:
        self.handle.update({"text/plain": str(line)}, raw=True)
