"""The values of a case as people read them, with a mark at what nobody typed."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from mpm.case.case import Case
from mpm.case.keys import Value, values
from mpm.screen import Sheet, number, together

if TYPE_CHECKING:
    from rich.console import Console

MARKS = (
    "not typed in the case but taken from (default) the program, (built-in) its materials and mechanisms, (base) the shared geometry, "
    "or (worked out) from other values; mpm explain KEY says more, mpm check CASE --full lists all"
)


class Marked:
    """The values of a case as people read them, marked where nobody typed them."""

    def __init__(self, case: Case, origins: Mapping[str, str] | None = None):
        """`origins`: those noted when a run was started, of which its resolved case no longer tells."""
        found = {value.name: value for value in values(case)}
        self.values = {
            name: replace(v, origin=(origins or {}).get(name, v.origin)) for name, v in found.items()
        }
        self.used = False  # whether any mark has been given

    def text(self, name: str) -> str | None:
        """`3.5 cm/s (default)` of a dotted key; None where the case has no such value."""
        value = self.values.get(name)
        return None if value is None else value_text(value) + self.mark(name)

    def mark(self, name: str) -> str:
        """` (default)`, ` (built-in)`, ` (base)`, ` (worked out)`, or nothing behind what was typed."""
        origin = self.values[name].origin if name in self.values else "typed"
        self.used = self.used or origin != "typed"
        return "" if origin == "typed" else f" {together(f'({origin})')}"


def value_text(value: Value) -> str:
    """A value as people read it; a ratio that has been worked out with six digits."""
    if not value.key.unit and value.origin == "worked out":
        with suppress(ValueError):
            return number(float(value.text), digits=6)
    return together(value.text)


def print_full(case: Case, console: Console) -> None:
    """Print the resolved case: every key of every table, its value with its unit, and where that comes from."""
    sheet = Sheet(room=40)
    table = None
    for value in values(case):
        parts = value.name.rsplit(".", 2 if value.key.name.endswith(">") else 1)
        place, label = ("", parts[0]) if len(parts) == 1 else (parts[0], ".".join(parts[1:]))
        if place != table:
            sheet.group(place or "Case")
            table = place
        if value.text:
            sheet.add(label, f"{value_text(value)} {together(f'({value.origin})')}")
    sheet.print(console)
