"""What the driver shows while points run: a live line on a terminal, a line per finished point elsewhere."""

import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from mpm.errors import printable

WORDS = {
    "done": "done",
    "failed": "failed",
    "bad_input": "bad input",
    "killed": "killed",
    "crashed": "crashed",
}


def clock(seconds: float) -> str:
    """h:mm:ss."""
    whole = round(max(0.0, seconds))
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


class Board:
    """`with Board(...) as board: board.update(...)`. Counts every point of the plan, those of earlier calls too.

    Time left is the mean time of the points finished in this call, times the points to come, over the slots.
    """

    def __init__(
        self, title: str, counts: Counter[str], to_run: int, slots: Callable[[], int], live: bool
    ) -> None:
        self.title = title
        self.counts = counts
        self.left = to_run
        self.slots = slots
        self.live = live
        self.total = sum(counts.values()) + to_run
        self.seconds: list[float] = []
        self._display: Any = None

    def __enter__(self) -> "Board":
        if self.live:
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            from mpm.screen import screen

            columns = (
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                TextColumn("{task.fields[state]}"),
            )
            self._display = Progress(
                *columns, TimeElapsedColumn(), console=screen(stderr=True), refresh_per_second=2
            )
            self._display.start()
            self._task = self._display.add_task(printable(self.title), total=self.total, state="")
            self.refresh()
        return self

    def __exit__(self, *_: object) -> None:
        if self._display is not None:
            self._display.stop()

    def update(self, name: str, *, status: str, error: str, seconds: float) -> None:
        """A point has ended."""
        self.counts[status] += 1
        self.left -= 1
        if seconds > 0:
            self.seconds.append(seconds)
        if self.live:
            self.refresh()
        else:
            finished = self.total - self.left
            took = f" in {seconds:.1f} s" if seconds > 0 else ""
            note = f": {error}" if error else ""
            print(
                f"[{finished}/{self.total}] {name} {status}{took}{printable(note)}; {self.state()}",
                file=sys.stderr,
                flush=True,
            )

    def refresh(self) -> None:
        """Redraw the live line. To be called every second or so: asking for the slots finds out when they are gone."""
        state = self.state()
        if self._display is not None:
            self._display.update(self._task, completed=self.total - self.left, state=state)

    def state(self) -> str:
        """done / running / failed, time left, in words."""
        slots = self.slots()
        parts = [f"{self.counts['done']} done", f"{min(slots, self.left)} running"]
        parts += [
            f"{self.counts[key]} {word}" for key, word in WORDS.items() if key != "done" and self.counts[key]
        ]
        if self.left and self.seconds:
            mean = sum(self.seconds) / len(self.seconds)
            parts.append(f"{clock(mean * max(self.left / max(slots, 1), 1.0))} left")
        return ", ".join(parts)


def say(text: str) -> None:
    """A sentence to the person at the terminal; results never go to standard error."""
    print(f"mpm sweep: {printable(text)}", file=sys.stderr, flush=True)


def now() -> str:
    """The time of day for records, ISO 8601 with offset."""
    return time.strftime("%Y-%m-%dT%H:%M:%S%z")
