"""What `mpm mesh` and `mpm run` print: the mesh by layers, zones and ports; the numbers of a run, the important ones first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console

from mpm.case.case import Case
from mpm.errors import printable
from mpm.mesh.grid import Grid
from mpm.report.quantities import quantity
from mpm.report.trees import flatten
from mpm.screen import Listing, Sheet, number, say

ROUNDING = 1e-12
"""Share of its natural scale below which a number is printed as 0: species, sites and elements balance to about 1e-12, so nothing smaller
is known. docs/output.md names the scales; the files of a run keep all digits."""


def print_mesh(case: Case, console: Console) -> None:
    """Print layers, zones and ports of the mesh with their cells and facets."""
    grid, geometry = Grid.from_case(case), case.geometry
    regions = Listing("region", "from [mm]", "to [mm]", "columns", "rows", "cells")
    for layer in reversed(geometry.layers):
        rows = grid.layer_rows(layer.name)
        low, high = grid.y[rows.start], grid.y[rows.stop]
        cells = f"{grid.columns * layer.cells:,}"
        regions.add_row(
            f"layer {layer.name}", _mm(low), _mm(high), f"{grid.columns}", f"{layer.cells}", cells
        )
    for index, zone in enumerate(geometry.zones, start=1):
        columns = int((grid.zone_of_column == index).sum())
        cells = f"{columns * grid.rows:,}"
        regions.add_row(
            f"zone {zone.name}", _mm(zone.start), _mm(zone.end), f"{columns}", f"{grid.rows}", cells
        )
    ports = Listing("port", "side", "from [mm]", "to [mm]", "facets")
    for kind, port in [*(("inlet", p) for p in geometry.inlets), *(("outlet", p) for p in geometry.outlets)]:
        facets = int((grid.overlap(port) > 0.0).sum())
        ports.add_row(f"{kind} {port.name}", port.side, _mm(port.x0), _mm(port.x1), f"{facets}")
    zero = "top of the moving layer" if geometry.moving_layer is not None else "bottom of the strip"
    heading = f"Layers, from top to bottom (heights count from the {zero}), and zones, from left to right"
    say(console, heading, style="bold")
    regions.print(console)
    say(console, "Ports, from left to right", style="bold")
    ports.print(console)
    say(
        console,
        f"{grid.cells:,} cells: {grid.rows} rows, {grid.columns} columns of {number(grid.dx * 1e3, 'mm')}",
    )


def _mm(value: float) -> str:
    return f"{value * 1e3:.6g}"


_GROUPS = (
    ("Coating", ("titration", "film")),
    ("Precursor use", ("utilisation", "dose_ratio", "excess_number")),
    ("CVD and gas astray", ("cvd", "contamination")),
    ("Gas", ("flow", "outlets")),
    ("Fronts", ("front",)),
)
"""Sections of summary.json in the order in which people ask for them."""
_FIRST = ("exit_mean", "exit_min", "exit_std", "box_mean")
"""Order of the numbers of an inlet's titration."""
TWICE = ("flow.bed_pressure_drop", "flow.frit_pressure_drop")
"""Names kept for scripts; flow.pressure_drop.<layer> says the same."""


def print_summary(summary: dict[str, Any], console: Console, warnings: Sequence[str] = ()) -> None:
    """Print the figures of a summary that one looks at first, the balances and the warnings of `mpm check` last."""
    steady = summary.get("fidelity") == "steady"
    numbers = {name: value for name, value in flatten(summary).items() if ".exit_profile." not in f".{name}."}
    sheet = Sheet(room=22)
    for heading, sections in _GROUPS:
        sheet.group(heading)
        for name in sorted(_of(numbers, sections), key=lambda name: _place(name, sections)):
            if name in TWICE and any(other.startswith("flow.pressure_drop.") for other in numbers):
                continue
            if name != "flow.mass_error":
                sheet.add(quantity(name, steady).label, shown(name, numbers, steady))
    _balances(sheet, summary, numbers, steady)
    _cost(sheet, numbers, steady)
    sheet.print(console)
    if warnings:
        console.print()
    print_warnings(console, warnings)


def print_warnings(console: Console, warnings: Iterable[str]) -> None:
    """One paragraph for each sentence."""
    for sentence in warnings:
        say(console, f"warning: {printable(sentence)}", style="yellow")


def _of(numbers: dict[str, float], sections: Sequence[str]) -> list[str]:
    return [name for name in numbers if name.split(".")[0] in sections]


def _place(name: str, sections: Sequence[str]) -> tuple[int, int]:
    last = name.split(".")[-1]
    return sections.index(name.split(".")[0]), _FIRST.index(last) if last in _FIRST else len(_FIRST)


def shown(name: str, numbers: dict[str, float], steady: bool) -> str:
    """A number of a run as people read it: with its unit, and 0 for what is below rounding."""
    meant, value = quantity(name, steady), numbers[name]
    if abs(value) < ROUNDING * natural_scale(name, numbers):
        value = 0.0
    return number(meant.of(value), meant.unit_shown)


def natural_scale(name: str, numbers: dict[str, float]) -> float:
    """What a number is large or small beside, in its own unit.

    Amounts [mol/m]: the largest feed of a species. Rates per volume: that feed per second, spread over a square metre of strip (none is as
    large). Growth per surface and thickness: 1 umol/m2, 1 nm. Flows, velocities and pressure drops of the gas: the largest of their kind.
    Shares, coverages and mole fractions: 1; shares of a CVD that is itself 0 mean nothing. Lengths: 1 m.
    """
    kind, last = name.split(".")[0], name.split(".")[-1]
    feed = max((value for key, value in numbers.items() if _is_feed(key)), default=0.0)
    if kind == "cvd" and last.startswith("rate"):
        return feed / max(numbers.get("simulated_seconds", 1.0), 1.0)
    if kind == "cvd" and "share_in_zone" in name:
        rate = numbers.get("cvd.rate_mean", 0.0)
        return math.inf if rate <= ROUNDING * natural_scale("cvd.rate_mean", numbers) else 1.0
    if kind in ("species", "film", "cvd"):
        return {"per_area": 1e-6, "thickness": 1e-9}.get(last, feed)
    if kind == "flow":
        unit = quantity(name).unit
        alike = (v for key, v in numbers.items() if key.startswith("flow.") and quantity(key).unit == unit)
        return max(map(abs, alike), default=0.0)
    return 1.0


def _is_feed(name: str) -> bool:
    return name.startswith("species.") and name.endswith(".fed")


def _balances(sheet: Sheet, summary: dict[str, Any], numbers: dict[str, float], steady: bool) -> None:
    """What became of every species, and how well the books close."""
    sheet.group("Balances" + (" per second" if steady else "") + ", per metre of depth of the reactor")
    for species in summary.get("species", {}):
        terms = [
            f"{term}\u00a0{shown(f'species.{species}.{term}', numbers, steady)}"
            for term in ("fed", "produced", "reacted", "left", "stored")
            if numbers.get(f"species.{species}.{term}")
        ]
        sheet.add(species, ", ".join(terms) or None)
    errors = {
        name: value for name, value in numbers.items() if name.endswith(("balance_error", "mass_error"))
    }
    if errors:
        worst = max(errors, key=lambda name: abs(errors[name]))
        sheet.add("largest relative error of a balance", f"{errors[worst]:.1e} ({quantity(worst).label})")


def _cost(sheet: Sheet, numbers: dict[str, float], steady: bool) -> None:
    sheet.group("Cost")
    for name in ("simulated_seconds", "steps", "cells", "ranks", "wall_seconds"):
        if name in numbers and not (steady and name == "simulated_seconds"):
            meant = quantity(name, steady)
            text = f"{numbers[name]:,.0f}" if not meant.unit else number(numbers[name], meant.unit_shown)
            sheet.add(meant.label, text)
