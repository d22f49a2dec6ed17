"""summary.json and the rows of history.csv: the numbers people quote, SI units, defined in `mpm.diagnostics` and `mpm.fronts`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.diagnostics import (
    State,
    Totals,
    cvd,
    element_balances,
    flatten,
    nested,
    outlet_fractions,
    site_balance,
    species_balances,
    titration,
    utilisation,
)
from mpm.engineering import inlet_excess
from mpm.flow import boundary_flows, face_flow
from mpm.fronts import backflow, contamination, cvd_totals, film, fronts
from mpm.geometry import Grid
from mpm.parallel import total
from mpm.steadyflow import FlowField
from mpm.versions import versions

if TYPE_CHECKING:
    from mpm.case import Case
    from mpm.reactor import Reactor


def summarise(reactor: Reactor, status: str, wall: float) -> dict[str, Any]:
    """The whole of summary.json on every rank; collective."""
    case, grid = reactor.case, reactor.grid
    totals, state = reactor.totals(), reactor.state()
    excess = {i.name: e for i in case.geometry.inlets if (e := inlet_excess(case, i)) is not None}
    summary: dict[str, Any] = {
        "status": status,
        "title": case.title,
        "fidelity": case.fidelity,
        "cells": grid.cells,
        "ranks": reactor.comm.size,
        "steps": reactor.steps,
        "simulated_seconds": reactor.time,
        "wall_seconds": wall,
        "versions": versions(),
        "species": species_balances(case, totals),
        "sites": {"balance_error": site_balance(case, totals)},
        "elements": {
            name: {"balance_error": error} for name, error in element_balances(case, totals).items()
        },
        "excess_number": {name: e[1] for name, e in excess.items()},
        "dose_ratio": {name: e[2] for name, e in excess.items() if e[2] is not None},
        "titration": titration(case, grid, state),
        "utilisation": utilisation(case, grid, totals),
        "outlets": nested(reactor.numbers, "outlets"),
        "cvd": cvd(case, grid, state) | cvd_totals(case, totals),
        "front": fronts(case, grid, state),
        "contamination": contamination(case, grid, totals, state),
        "film": nested(reactor.numbers, "film") or film(case, grid, totals, None),
    }
    if reactor.flows is not None:
        summary["flow"] = flow_numbers(reactor, reactor.flows.mean())
    return {key: value for key, value in summary.items() if value != {}}


def history_row(
    case: Case, grid: Grid, time: float, totals: Totals, state: State, before: Totals | None
) -> dict[str, float]:
    """One row of history.csv, flat dotted names; outlets and film tell what has passed since the row before."""
    balances = species_balances(case, totals)
    drawn = backflow(case, totals, before)
    tree: dict[str, Any] = {
        "time": time,
        "titration": {
            name: {k: v for k, v in entry.items() if k != "exit_profile"}
            for name, entry in titration(case, grid, state).items()
        },
        "utilisation": utilisation(case, grid, totals),
        "outlets": {
            name: entry | drawn[name] for name, entry in outlet_fractions(case, totals, before).items()
        },
        "cvd": cvd(case, grid, state) | cvd_totals(case, totals),
        "front": fronts(case, grid, state),
        "contamination": contamination(case, grid, totals, state),
        "film": film(case, grid, totals, before),
        "balance": {
            **{name: entry["balance_error"] for name, entry in balances.items()},
            "sites": site_balance(case, totals),
        },
    }
    return flatten(tree)


def flow_numbers(reactor: Reactor, mean: FlowField) -> dict[str, Any]:
    """Cycle means: volume flows through inlets and outlets [m2/s], their mismatch over the inflow, gas velocity in the moving layer
    [m/s], pressure drops [Pa] (mean of the row below the layer minus that above, so that both interfaces are inside)."""
    case, strip, grid = reactor.case, reactor.strip, reactor.grid
    flows = boundary_flows(case, strip, face_flow(strip, mean.velocities))
    inflow = sum(flows[i.name] for i in case.geometry.inlets)
    outflow = -sum(flows[o.name] for o in case.geometry.outlets)
    numbers: dict[str, Any] = {"inflow": inflow, "outflow": outflow}
    if inflow:
        numbers["mass_error"] = abs(inflow - outflow) / abs(inflow)
    own = strip.owned
    bottom, left, right, top = mean.velocities[:, :own]
    row = strip.row[:own]
    pressure = total(strip.comm, np.bincount(row, mean.pressure[:own], grid.rows)) / grid.columns
    moving = case.geometry.moving_layer
    if moving is not None:
        rows = grid.layer_rows(moving.name)
        inside = (row >= rows.start) & (row < rows.stop)
        weights = strip.volume[:own][inside]
        sums = total(
            strip.comm,
            [
                (0.5 * (left + right))[inside] @ weights,
                (0.5 * (bottom + top))[inside] @ weights,
                weights.sum(),
            ],
        )
        numbers["bed_superficial_velocity"] = [float(sums[0] / sums[2]), float(sums[1] / sums[2])]
    for layer in case.geometry.layers:
        rows = grid.layer_rows(layer.name)
        if layer.material is not None and rows.start > 0 and rows.stop < grid.rows:
            name = "bed_pressure_drop" if layer.moving else "frit_pressure_drop"
            numbers.setdefault(name, float(pressure[rows.start - 1] - pressure[rows.stop]))
    return numbers
