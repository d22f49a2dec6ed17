"""`history.csv`: a row per output time, appended at a cost that does not grow with their number."""

from __future__ import annotations

import csv
import io
import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mpm.errors import InputError, MpmError
from mpm.files import read_text, write_atomically, write_in_place

Row = dict[str, float]
log = logging.getLogger("mpm")


class History:
    """The table in `path`. `time` [s] comes first, then columns in the order they were first seen.

    A kill can leave the last row unfinished: it has no line end and is not read.
    """

    def __init__(self, path: Path):
        self.path = path
        self.columns: dict[str, None] = {"time": None}
        self.rows: list[Row] = []
        if path.exists():
            self.rows = read_table(path)
            self.columns |= dict.fromkeys(key for row in self.rows for key in row)

    def append(self, row: Mapping[str, float | None]) -> None:
        """Add a row. What could not be computed (None, missing, not finite) leaves its cell empty."""
        kept = {key: float(value) for key, value in row.items() if value is not None}
        for key in [key for key, value in kept.items() if not math.isfinite(value)]:
            log.warning("%s: %s is %g at t = %g s, left empty", self.path.name, key, kept[key], kept["time"])
            del kept[key]
        if "time" not in kept:
            raise MpmError(f"{self.path.name}: a row without time")
        first = not self.rows
        self.rows.append(kept)
        if first or not kept.keys() <= self.columns.keys():
            self.columns |= dict.fromkeys(kept)
            self.rewrite()
        else:
            write_in_place(self.path, self._text([kept]).encode(), self.path.stat().st_size)

    def cut_back(self, rows: int, time: float) -> None:
        """Keep the first `rows`, up to the restart state's `time` [s]. Raises InputError when the table does not hold them."""
        if not self.path.exists():
            return
        found = len(self.rows)
        if found < rows or (rows and self.rows[rows - 1]["time"] > time):
            raise InputError(
                f"{self.path}: found {found} rows; accepted: the {rows} up to t = {time:g} s that the restart state counts"
            )
        del self.rows[rows:]
        self.rewrite()

    def rewrite(self) -> None:
        """Replace the file as a whole; columns that no row has any more are dropped."""
        self.columns = {"time": None} | dict.fromkeys(key for row in self.rows for key in row)
        head = io.StringIO()
        csv.writer(head, lineterminator="\n").writerow(self.columns)
        write_atomically(self.path, head.getvalue() + self._text(self.rows))

    def _text(self, rows: list[Row]) -> str:
        text = io.StringIO()
        writer = csv.DictWriter(text, list(self.columns), restval="", lineterminator="\n")
        writer.writerows({key: repr(value) for key, value in row.items()} for row in rows)
        return text.getvalue()

    def by_column(self) -> dict[str, NDArray[np.float64]]:
        """The columns; NaN where a cell is empty."""
        return columns_of(self.rows)


def columns_of(rows: Sequence[Row]) -> dict[str, NDArray[np.float64]]:
    """Rows as columns, in the order they were first seen; NaN where a row lacks one."""
    columns = dict.fromkeys(key for row in rows for key in row)
    return {key: np.array([row.get(key, math.nan) for row in rows]) for key in columns}


def read_table(path: Path) -> list[Row]:
    """The whole rows of a table, without its empty cells. Raises InputError when a line is not one of mpm's."""
    try:
        lines = read_text(path).splitlines(keepends=True)
    except ValueError as error:
        raise InputError(f"{path}: not a table of mpm ({error})") from error
    if lines and not lines[-1].endswith("\n"):
        lines.pop()
    table = list(csv.reader(lines))
    if not table or table[0][:1] != ["time"]:
        raise InputError(f"{path}: not a history of mpm (it does not begin with the column time)")
    rows = []
    for number, cells in enumerate(table[1:], start=2):
        try:
            row = {key: float(cell) for key, cell in zip(table[0], cells, strict=True) if cell}
        except ValueError:
            row = {}
        if "time" not in row or not all(map(math.isfinite, row.values())):
            shown = ",".join(cells)
            raise InputError(
                f"{path}: line {number}: found {shown[:40]!r}; accepted: {len(table[0])} finite numbers or empty cells, the time first"
            )
        rows.append(row)
    return rows
