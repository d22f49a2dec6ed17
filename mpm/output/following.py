"""What the files of a run say while another process computes it: its log, its table and its lock."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from mpm.errors import InputError
from mpm.files import read_text
from mpm.output.directory import RunDirectory
from mpm.output.history import read_table
from mpm.report.quantities import quantity
from mpm.report.rounding import shown
from mpm.screen import duration

SHOWN = ("titration.*.exit_mean", "titration.*.box_mean", "cvd.rate_mean", "temperature.bed_exit")
"""Numbers of the history that one follows a run by."""
_STAMP = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d+ (.*)")


@dataclass(frozen=True)
class Moment:
    """A run at one moment: the last `line` of its log, which is `age` [s] old, and the `numbers` of its latest output."""

    line: str
    age: float
    numbers: Mapping[str, float]

    def text(self) -> list[str]:
        """What a person reads: how far it is, then a number each."""
        ago = f" ({duration(self.age)} ago)" if self.age >= 2.0 else ""
        names = [name for pattern in SHOWN for name in self.numbers if fnmatch(name, pattern)]
        return [
            self.line + ago,
            *(f"{quantity(name).label}: {shown(name, self.numbers, False)}" for name in names),
        ]


def look(path: Path) -> Moment:
    """What the files of a run in `path` say now. Whatever is just being written counts as not there."""
    log = RunDirectory(path).log
    try:
        lines = [match[1] for line in read_text(log).splitlines() if (match := _STAMP.fullmatch(line))]
        age = time.time() - log.stat().st_mtime
    except (OSError, ValueError):
        lines, age = [], 0.0
    try:
        rows = read_table(path / "history.csv")
    except (OSError, InputError):
        rows = []
    told = [line for line in lines if not line.startswith("warning")]
    return Moment(told[-1] if told else "starting", max(age, 0.0), rows[-1] if rows else {})
