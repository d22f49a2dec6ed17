"""What people read on a terminal, in a pipe or in a log: whole numbers, names as they were written, in whatever encoding.

Everything printed goes through here: text is no markup, tables that do not fit become lists, characters that the terminal does not
have are spelled out instead of ending the program.
"""

from __future__ import annotations

import io
import sys
from typing import TYPE_CHECKING

from mpm.errors import printable

if TYPE_CHECKING:
    from rich.console import Console

UNLIMITED = 100_000
"""Width of what is no terminal: a pipe and a file have no edge that a number could be cut at."""


def spell_out() -> None:
    r"""Let standard output and error write `\u2026` for a character that their encoding lacks (Latin-1, C locale, surrogates)."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def screen(stderr: bool = False) -> Console:
    """A console that prints text as it is: brackets are no markup, `:smile:` is no picture, numbers are not coloured."""
    from rich.console import Console

    console = Console(stderr=stderr, markup=False, emoji=False, highlight=False)
    if not console.is_terminal:
        console.width = UNLIMITED
    return console


def spinner(console: Console) -> str:
    """Name of a spinner that the terminal can show."""
    return "dots" if console.encoding.startswith("utf") else "line"


class Listing:
    """Rows under column headings, printed as a table, or where that is wider than the terminal as a list of `heading value`."""

    def __init__(self, *headings: str):
        self.headings = headings
        self.rows: list[tuple[str, ...]] = []

    def add_row(self, *cells: str | None) -> None:
        """Cells from the left; missing ones stay empty."""
        self.rows.append(tuple(printable(cell or "") for cell in cells))

    def print(self, console: Console) -> None:
        """Every cell whole: no number is cut or broken at the edge of a terminal."""
        from rich.measure import Measurement
        from rich.table import Table

        table = Table(*self.headings)
        for row in self.rows:
            table.add_row(*row)
        wanted = Measurement.get(console, console.options.update(max_width=UNLIMITED), table).maximum
        if wanted <= console.width:
            console.print(table)
            return
        for row in self.rows:
            name, *values = row
            pairs = zip(self.headings[1:], values, strict=False)
            console.print(f"{self.headings[0]} {name}: " + ", ".join(f"{key} {v}" for key, v in pairs if v))
