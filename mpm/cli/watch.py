"""Following a run from outside: what its log, its table and its lock tell, while another process computes it."""

from __future__ import annotations

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING

from mpm.case.case import load_case
from mpm.cli.nextsteps import print_end
from mpm.errors import ConvergenceError, Interrupted
from mpm.files import locked
from mpm.output.directory import FAILED, RunDirectory
from mpm.output.following import look
from mpm.report.tables import print_summary
from mpm.screen import lines_of, print_steps, say

if TYPE_CHECKING:
    from rich.console import Console

LIVE, PIPED = 0.5, 5.0
"""Seconds between two looks, on a terminal and elsewhere."""


def watch_run(path: Path, once: bool, console: Console) -> None:
    """Follow the run in `path` to its end and say how it ended. `once`: say how it is now, and no more.

    Raises ConvergenceError when the run has failed, Interrupted when it was stopped.
    """
    if locked(RunDirectory(path).log):
        if once:
            for line in look(path).text():
                say(console, line)
            return
        try:
            _follow(path, console)
        except KeyboardInterrupt:
            say(console, f"no longer watching; the run in {path} goes on")
            return
    else:
        say(console, f"no run is at work in {path}")
    _tell_end(path, console)


def _follow(path: Path, console: Console) -> None:
    """Until the run has ended: lines that renew themselves on a terminal, a line when there is something new elsewhere."""
    from rich.live import Live
    from rich.text import Text

    log = RunDirectory(path).log
    if not console.is_terminal:
        last = ""
        while locked(log):
            now = look(path)
            if now.line != last:
                console.print("; ".join(now.text()), soft_wrap=True)
                last = now.line
            _wait(log, PIPED)
        return
    with Live(console=console, transient=True, auto_refresh=False) as live:
        while locked(log):
            lines = [part for line in look(path).text() for part in lines_of(line, console.width - 1)]
            live.update(Text("\n".join(lines)), refresh=True)
            _wait(log, LIVE)


def _wait(log: Path, seconds: float) -> None:
    """`seconds`, or less when the run ends."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and locked(log):
        time.sleep(min(0.2, seconds))


def _tell_end(path: Path, console: Console) -> None:
    """How the last run ended, its numbers, and what to type next. Raises ConvergenceError or Interrupted as that run did."""
    case, summary = load_case(path / "case.toml"), RunDirectory(path).read_summary()
    last, name = look(path).line, shlex.quote(str(path))
    if summary is not None and summary.get("status") == "done":
        say(console, f"{path}: the run is done")
        print_end(case, summary, path, console, (path / "report.html").exists())
        return
    if summary is not None:
        print_summary(summary, console)
        console.print()
    pictures = [(f"mpm plot {name}", "pictures of what there is")] if look(path).numbers else []
    print_steps([(f"mpm resume {name}", "go on"), *pictures], console)
    status = "failed" if last.startswith(FAILED) else (summary or {}).get("status")
    last = last.removeprefix(FAILED)
    if status is None:
        raise Interrupted(f"{path}: the run was ended from outside; the last word of its log: {last}")
    if status == "failed":
        raise ConvergenceError(f"{path}: the run has failed: {last}")
    raise Interrupted(f"{path}: the run was interrupted: {last}")
