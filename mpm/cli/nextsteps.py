"""What to type next: said when a run is done, and when it has stopped before its end."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from mpm.advice.checks import check_case
from mpm.errors import ConvergenceError, Interrupted
from mpm.report.tables import print_summary
from mpm.report.verdict import verdict
from mpm.screen import print_steps, say

if TYPE_CHECKING:
    from mpm.case.case import Case


def print_end(case: Case, summary: dict[str, Any], directory: Path, console: Console, reported: bool) -> None:
    """What a finished run says: its numbers, what `mpm check` warns of, and what to type next; `reported`: its page is being written."""
    console.print()
    say(console, verdict(case, summary), hang=0, style="bold")
    print_summary(summary, console, check_case(case)["warnings"])
    print_next_steps(directory, summary, console, reported)


def print_next_steps(directory: Path, summary: dict[str, Any], console: Console, reported: bool) -> None:
    """Name the commands that show a finished run and, where it has an end, the one that takes it further."""
    name = shlex.quote(str(directory))
    steps = [(f"mpm plot {name}", "pictures, into its plots/")]
    if not reported:
        steps.insert(0, (f"mpm report {name}", "one page with everything, for a browser"))
    if summary.get("fidelity") != "steady":
        later = f"{2.0 * summary['simulated_seconds']:g} s"
        steps.append((f"mpm resume {name} --end '{later}'", "on to a later time"))
    console.print()
    say(console, f"Results: {directory}")
    print_steps(steps, console)


@contextmanager
def how_to_go_on(directory: Path) -> Iterator[None]:
    """Add to the message of a run that stops early what is kept and which command resumes it."""
    try:
        yield
    except (ConvergenceError, Interrupted) as error:
        if not (directory / "checkpoint.npz").is_file():
            raise
        name = shlex.quote(str(directory))
        kept = f"the run so far is kept: mpm resume {name} goes on, mpm report {name} shows it"
        raise type(error)(f"{error}; {kept}") from error
