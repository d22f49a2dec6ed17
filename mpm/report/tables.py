"""What `mpm mesh` and `mpm run` print: the mesh by layers, zones and ports; the numbers of a run, the important ones first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Console

from mpm.case.case import Case
from mpm.mesh.grid import Grid
from mpm.report.balances import TERMS
from mpm.report.quantities import COST, headed, quantity, worst_balance_error
from mpm.report.rounding import shown
from mpm.report.trees import flatten
from mpm.screen import Listing, Sheet, number, print_warnings, say


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


def print_summary(summary: dict[str, Any], console: Console, warnings: Sequence[str] = ()) -> None:
    """Print the figures of a summary that one looks at first, the balances and the warnings of `mpm check` last."""
    steady, numbers = summary.get("fidelity") == "steady", flatten(summary)
    sheet = Sheet(room=22)
    groups = dict(headed(numbers))
    cost = groups.pop(COST, [])
    for heading, names in groups.items():
        sheet.group(heading)
        for name in names:
            sheet.add(quantity(name, steady).label, shown(name, numbers, steady))
    _balances(sheet, summary, numbers, steady)
    sheet.group(COST)
    for name in cost:
        if not (steady and name == "simulated_seconds"):
            sheet.add(quantity(name).label, shown(name, numbers, steady))
    sheet.print(console)
    if warnings:
        console.print()
    print_warnings(console, warnings)


def _balances(sheet: Sheet, summary: dict[str, Any], numbers: dict[str, float], steady: bool) -> None:
    """What became of every species, and how well the books close."""
    sheet.group("Balances" + (" per second" if steady else "") + ", per metre of depth of the reactor")
    for species in summary.get("species", {}):
        terms = [
            f"{term}\u00a0{shown(f'species.{species}.{term}', numbers, steady)}"
            for term in TERMS
            if numbers.get(f"species.{species}.{term}")
        ]
        sheet.add(species, ", ".join(terms) or None)
    worst = worst_balance_error(numbers)
    if worst is not None:
        sheet.add("largest relative error of a balance", f"{numbers[worst]:.1e} ({quantity(worst).label})")
