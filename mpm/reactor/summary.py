"""summary.json and the rows of history.csv: the numbers people quote, SI units.

They are defined in `mpm.report.coating`, `mpm.report.balances`, `mpm.flow.numbers` and `mpm.report.fronts`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpm.advice.engineering import inlet_excess
from mpm.flow.numbers import flow_numbers
from mpm.mesh.grid import Grid
from mpm.numerics.versions import versions
from mpm.parallel import on_root
from mpm.report.balances import element_balances, site_balance, species_balances
from mpm.report.coating import (
    State,
    Totals,
    cvd,
    flatten,
    nested,
    outlet_fractions,
    titration,
    utilisation,
)
from mpm.report.fronts import backflow, contamination, cvd_totals, film, fronts
from mpm.revision import revision

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.reactor.reactor import Reactor


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
        "revision": on_root(reactor.comm, revision),
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
        summary["flow"] = flow_numbers(case, reactor.strip, reactor.flows.mean())
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
