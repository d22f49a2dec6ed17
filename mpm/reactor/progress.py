"""What a run says about itself: its log, and the live line of simulated time, steps per second, time left and worst balance.

Only rank 0 prints.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.status import Status
from rich.text import Text

from mpm.parallel import is_root
from mpm.reactor.clock import Clock
from mpm.reactor.notebook import LiveLine, in_notebook
from mpm.screen import duration, say, screen, spinner

from mpi4py import MPI  # isort: skip  (after the solver's own)

FLOW = "finding the flow of the gas"
"""Said at once wherever it goes: it may take minutes."""


class LogFile(logging.FileHandler):
    """A log that says nothing when the disk is full: the next table does."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Not even a traceback."""

    def close(self) -> None:
        with suppress(OSError):
            super().close()


@contextmanager
def log_file(log: logging.Logger, path: Path | None) -> Iterator[None]:
    """Add the messages of `log` to the file `path`; without one they go nowhere."""
    handler = LogFile(path, encoding="utf-8") if path is not None else logging.NullHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
    log.setLevel(logging.INFO)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
        handler.close()


class Progress:
    """Shows how a run gets on, by its `clock`: a line that renews itself on a terminal and in a notebook, a line every ten seconds
    elsewhere.

    shown: None for where somebody watches.
    """

    def __init__(self, clock: Clock, comm: MPI.Comm, shown: bool | None):
        self.clock = clock
        self.console = screen(stderr=True)
        live = self.console.is_terminal or in_notebook()
        self.shown = is_root(comm) and (live if shown is None else shown)
        self.interval = 0.2 if live else 10.0
        self.status: Status | LiveLine | None = None
        self.first: tuple[float, int] | None = None
        self.printed = time.monotonic()

    def __enter__(self) -> Self:
        if self.shown and in_notebook():
            self.status = LiveLine()
        elif self.shown and self.console.is_terminal:
            self.status = self.console.status("starting", spinner=spinner(self.console))
            self.status.start()
        return self

    @property
    def stays(self) -> bool:
        """Whether the live line is still there at the end."""
        return isinstance(self.status, LiveLine)

    def warn(self, text: str) -> None:
        """A line that stays, for the person who watches."""
        if self.stays:
            print(f"warning: {text}")  # the cell's own output, which wraps
        elif self.shown:
            say(self.console, f"warning: {text}")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.shown:
            self._print(force=True)
        if isinstance(self.status, Status):
            self.status.stop()

    def say(self, text: str) -> None:
        """What is being done before the first step."""
        if not self.shown:
            return
        if self.status is not None:
            self.status.update(Text(text))
        elif time.monotonic() - self.printed > self.interval or text == FLOW:
            self.printed = time.monotonic()
            self.console.print(text)

    def advance(self) -> None:
        """A step has been done."""
        if self.first is None:
            self.first = (time.monotonic(), self.clock.steps)
        if self.shown and time.monotonic() - self.printed > self.interval:
            self._print()

    def _print(self, force: bool = False) -> None:
        self.printed = time.monotonic()
        text = self.line()
        if self.status is not None:
            self.status.update(Text(text))
        if text and not self.stays and (self.status is None or force):
            self.console.print(text)

    def line(self) -> str:
        """One line of numbers; empty before the first step."""
        if self.first is None:
            return ""
        clock = self.clock
        done = clock.steps - self.first[1]
        elapsed = time.monotonic() - self.first[0]
        speed = done / elapsed if elapsed > 0.0 else 0.0
        to_do = clock.all_steps - clock.steps
        remaining = [f"{duration(to_do / speed)} left"] if speed and to_do else ["done"] if not to_do else []
        return ", ".join(
            [
                f"{clock.time:.{2 if clock.time < 1e3 else 1}f} of {clock.end:g} s",
                f"step {clock.steps}",
                f"{speed:.1f} steps/s",
                *remaining,
                f"balances to {clock.worst_balance:.0e}",
            ]
        )
