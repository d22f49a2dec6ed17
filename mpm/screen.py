"""What people read on a terminal, in a pipe or in a log: whole numbers, names as they were written, in whatever encoding.

Everything printed goes through here: text is no markup, tables are for wide terminals and lists for the others, lines break between
words, characters that the terminal does not have are spelled out instead of ending the program.
"""

from __future__ import annotations

import io
import re
import shlex
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from mpm.errors import printable

if TYPE_CHECKING:
    from rich.console import Console

UNLIMITED = 100_000
"""Width of what is no terminal: a pipe and a file have no edge that a number could be cut at."""
WIDE = 100
"""Columns from which a terminal is shown tables."""
NARROW = 72
"""Columns below which a value follows its label instead of standing in a column."""
HARD_SPACE = "\u00a0"
_MEASURED = re.compile(r"(?<=\d) (?=[A-Za-z%])")


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
    """Rows under column headings such as `height [mm]`: a table on a terminal that is wide enough for it, elsewhere a list.

    In the list every row is `heading value unit` after `heading value unit`, a unit at every number.
    """

    def __init__(self, *headings: str):
        self.headings = headings
        self.rows: list[tuple[str, ...]] = []

    def add_row(self, *cells: str | None) -> None:
        """Cells from the left; missing ones stay empty."""
        self.rows.append(tuple(printable(cell or "") for cell in cells))

    def print(self, console: Console, indent: int = 2) -> None:
        """Every cell whole: no number is cut or broken at the edge of a terminal."""
        from rich.measure import Measurement
        from rich.padding import Padding
        from rich.table import Table

        table = Table(*self.headings)
        for row in self.rows:
            table.add_row(*row)
        framed = Padding(table, (0, 0, 0, indent), expand=False)
        wanted = Measurement.get(console, console.options.update(max_width=UNLIMITED), framed).maximum
        if console.is_terminal and console.width >= WIDE and wanted <= console.width:
            console.print(framed)
            return
        for name, *values in self.rows:
            pairs = zip(self.headings[1:], values, strict=False)
            say(console, f"{name}: " + ", ".join(entry(key, v) for key, v in pairs if v), indent)


def entry(heading: str, value: str) -> str:
    """`height [mm]`, `3` as `height 3 mm`, which stays on one line."""
    name, _, unit = heading.partition(" [")
    return together(f"{name} {value} {unit.removesuffix(']')}".strip())


def together(text: str) -> str:
    """`text` as one word for `say`: a number stays with its unit."""
    return text.replace(" ", HARD_SPACE)


def figure(value: float, unit: str = "", digits: int = 4) -> str:
    """`value` with its unit; powers of ten as `6.92e-8`."""
    text = re.sub(r"e([+-])0*(?=\d)", lambda power: "e" + power[1].replace("+", ""), f"{value:.{digits}g}")
    return f"{text} {unit}".strip()


def number(value: float, unit: str = "", digits: int = 4) -> str:
    """`figure`, kept together on one line."""
    return together(figure(value, unit, digits))


def _clean(text: str) -> str:
    """`text` as `printable` has it, with its hard spaces."""
    return HARD_SPACE.join(printable(part) for part in text.split(HARD_SPACE))


def say(console: Console, text: str, indent: int = 0, hang: int = 4, style: str = "") -> None:
    """Print `text`, on a terminal in lines that break between words and hang by `hang` columns under the first."""
    from rich.text import Text

    for line in lines_of(text, console.width, indent=indent, hang=hang):
        console.print(Text(line, style=style), soft_wrap=True)


def print_warnings(console: Console, warnings: Iterable[str]) -> None:
    """One paragraph for each sentence."""
    for sentence in warnings:
        say(console, f"warning: {printable(sentence)}", style="yellow")


def lines_of(text: str, width: int, *, indent: int = 0, hang: int = 4) -> list[str]:
    """`text` in lines of at most `width` columns, broken between words; a word that is longer has a line of its own.

    A number stays with the word behind it, most often its unit.
    """
    lines = textwrap.wrap(
        _MEASURED.sub(HARD_SPACE, text),
        width,
        initial_indent=" " * indent,
        subsequent_indent=" " * min(indent + hang, max(width - 20, 0)),
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(HARD_SPACE, " ") for line in lines]


def duration(seconds: float) -> str:
    """A time to wait, in the two units that matter: `40 s`, `3 min 20 s`, `2 h 5 min`, `3 d 4 h`."""
    whole = round(seconds)
    for large, small, size, part in (("d", "h", 86400, 3600), ("h", "min", 3600, 60), ("min", "s", 60, 1)):
        if whole >= size:
            rest = whole % size // part
            return f"{whole // size} {large}" + (f" {rest} {small}" if rest else "")
    return f"{whole} s"


def print_steps(steps: Sequence[tuple[str, str]], console: Console) -> None:
    """Commands that can be copied, with what each does behind it as a comment or, where that leaves no room, above it."""
    from rich.text import Text

    say(console, "Next:")
    column = max((len(command) for command, _ in steps if 2 * len(command) < console.width), default=0) + 2
    for command, purpose in steps:
        if len(command) < column:
            say(console, together(f"{command:{column}}") + f"# {purpose}", 2, column)
        else:
            say(console, f"# {purpose}:", 2)
            words = (together(shlex.quote(word)) for word in shlex.split(command))
            lines = lines_of(" ".join(words), console.width - 2, indent=2)
            console.print(Text(" \\\n".join(lines)), soft_wrap=True)


class Sheet:
    """Numbers in groups with plain headings: `label   value`, the values of all groups below each other.

    room: columns that the values need on the right of their labels.
    """

    def __init__(self, room: int) -> None:
        self.room = room
        self.groups: list[tuple[str, list[tuple[str, str] | Listing]]] = []

    def group(self, heading: str) -> None:
        """Begin a group; one that stays empty is not printed."""
        self.groups.append((heading, []))

    def add(self, label: str, value: str | None, part: bool = False) -> None:
        """A row of the last group, below the one before it if it is a `part` of that; None: the number does not exist here."""
        if value is not None:
            self.groups[-1][1].append((2 * HARD_SPACE * part + _clean(label), _clean(value)))

    def list(self, listing: Listing) -> None:
        """Rows of the last group that are a table where there is room for one."""
        self.groups[-1][1].append(listing)

    def print(self, console: Console) -> None:
        """Values stand in a column; where a label leaves no room for it, and on narrow terminals, they follow it."""
        room = min(console.width - self.room, 60)
        rows = [row for _, group in self.groups for row in group if not isinstance(row, Listing)]
        column = max((len(label) for label, _ in rows if len(label) <= room), default=0) + 2
        for heading, group in self.groups:
            if not group:
                continue
            console.print()
            say(console, heading, style="bold")
            for row in group:
                if isinstance(row, Listing):
                    row.print(console)
                    continue
                label, value = row
                crowded = len(value) > console.width - column - 2 and console.width - column < 40
                if not value:
                    say(console, label, 2)
                elif len(label) > column - 2 or console.width < NARROW or crowded:
                    say(console, f"{label}: {value}", 2)
                else:
                    say(console, f"{label:{column}}".replace(" ", HARD_SPACE) + value, 2, column)
