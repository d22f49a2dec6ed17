"""What `mpm check` prints: a sketch of the strip, the case and its numbers, then what is to be said of it in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpm.advice.sheet import case_sheet
from mpm.advice.sketch import PAGE, pen_for, sketch
from mpm.case.case import Case
from mpm.case.marks import MARKS, Marked
from mpm.errors import printable
from mpm.screen import print_warnings, say

if TYPE_CHECKING:
    from rich.console import Console


def print_report(case: Case, report: dict[str, Any], console: Console) -> None:
    """Print the case, its numbers, what has no effect and what is questionable."""
    marked = Marked(case)
    say(console, printable(case.title) or "case", style="bold")
    say(console, f"{case.fidelity}{marked.mark('fidelity')}: {_what(case, report)}")
    console.print()
    for line in sketch(case, min(console.width, PAGE), pen_for(console.encoding)):
        console.print(line, soft_wrap=True)
    case_sheet(case, report, marked).print(console)
    _sentences(console, "To know", report["notes"])
    _sentences(console, "Without effect in this case", report["without_effect"])
    if marked.used:
        _sentences(console, "Marks", [MARKS])
    if report["warnings"]:
        console.print()
    print_warnings(console, report["warnings"])


def _sentences(console: Console, heading: str, sentences: list[str]) -> None:
    if sentences:
        console.print()
        say(console, heading, style="bold")
    for sentence in sentences:
        say(console, printable(sentence), 2)


def _what(case: Case, report: dict[str, Any]) -> str:
    """The kind of run in words."""
    if case.fidelity == "steady":
        return "the state that the reactor settles into, as the mean of the vibration cycle"
    how = "every phase of every cycle" if case.fidelity == "resolved" else "the mean of the vibration cycle"
    return f"{how}, 0 s to {case.time.end:g} s in {report['run']['steps']:,} steps"
