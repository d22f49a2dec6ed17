"""What a run has recorded, gathered from all ranks: the only thing that its reported numbers are functions of.

Amounts are per metre of depth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.case.conventions import conventions_of

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.mesh.grid import Grid
    from mpm.physics.reaction import GasReaction, SurfaceReaction


@dataclass(frozen=True, eq=False)
class HeatTotals:
    """Heat into the strip since the start of a run, counted from the temperature of `[gas]` [J per metre of depth].

    `inlets` (inlets,), `outlets` (outlets,) with the gas (what is drawn back in included), `walls` (walls,) by conduction, `solids` with
    those that enter less those that leave, `heating` electrical, `reaction` given off by reactions; `stored`, `stored_initially` in gas and
    solids. `gas_passed` came in of the gas less what left, `gas`, `gas_initially` are in the strip, at the density of the case [m2].
    """

    inlets: Floats
    outlets: Floats
    walls: Floats
    solids: float
    heating: float
    reaction: float
    stored: float
    stored_initially: float
    gas_passed: float
    gas: float
    gas_initially: float


@dataclass(frozen=True, eq=False)
class Totals:
    """Sums over all ranks since the start of a run [mol/m, m2], by species of the run (`names`).

    `fed` (inlets, species), `out`, `back` (outlets, species), `out_volume`, `back_volume` (outlets,), `stored`, `stored_initially`
    (species,) in the gas; `surface` (reactions, reactive rows, columns) and `gas` (reactions, zones + 1) events, the last by zone number
    (0: none); `reactive_rows` the grid's rows with reactive surface; `slid` the bed's way relative to the reactor [m];
    `sites`, `sites_initially` (site species,) the places that each holds on the solids in the strip, `sites_passed` those that left minus
    those that entered; `heat` of a case with `[energy]`. Events are net, there less back, where a reaction is reversible.
    """

    names: tuple[str, ...]
    fed: Floats
    out: Floats
    back: Floats
    out_volume: Floats
    back_volume: Floats
    stored: Floats
    stored_initially: Floats
    surface: Floats
    gas: Floats
    reactive_rows: NDArray[np.int64]
    slid: float
    sites: Floats
    sites_initially: Floats
    sites_passed: Floats
    heat: HeatTotals | None = None


@dataclass(frozen=True, eq=False)
class State:
    """Numbers of one instant: `theta` (sites, reactive rows, columns) and the CVD rate per zone and at its largest.

    `cvd` is the integral of the rate over each zone's strip (zones + 1,) [mol/m/s], `cvd_max` the largest rate per total volume;
    `concentration` the dosed species by name, (rows, columns) [mol/m3]; `temperature` (rows, columns) [K] of a case with `[energy]`.
    """

    theta: Floats
    reactive_rows: NDArray[np.int64]
    cvd: Floats
    cvd_max: float
    concentration: Mapping[str, Floats]
    temperature: Floats | None = None


@dataclass(frozen=True, eq=False)
class Records:
    """All of that at `time` [s], and what only the summary tells of a run that has ended: from `status` on.

    `before`: the totals at the output before (None: the start). `wall` [s] on the clock; `program` and `versions` that have computed it;
    `flow`: the numbers of the mean flow (`mpm.flow.numbers`); `latest`: the last row of the history.
    """

    case: Case
    grid: Grid
    time: float
    totals: Totals
    state: State
    before: Totals | None = None
    status: str = ""
    ranks: int = 1
    steps: int = 0
    wall: float = 0.0
    program: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    flow: Mapping[str, Any] = field(default_factory=dict)
    latest: Mapping[str, float] = field(default_factory=dict)


def run_itself(records: Records) -> dict[str, Any]:
    """What a summary tells first: how the run has ended, what it was, and what it took."""
    return {
        "status": records.status,
        "title": records.case.title,
        "fidelity": records.case.fidelity,
        "cells": records.grid.cells,
        "ranks": records.ranks,
        "steps": records.steps,
        "simulated_seconds": records.time,
        "wall_seconds": records.wall,
        "revision": records.program,
        "versions": records.versions,
        "conventions": conventions_of(records.case),
    }


def running_surface(case: Case, names: tuple[str, ...]) -> list[SurfaceReaction]:
    """Surface reactions that run with the species of the run, in the mechanism's order."""
    return case.mechanism.running_surface(names)


def running_gas(case: Case, names: tuple[str, ...]) -> list[GasReaction]:
    """Gas reactions that do."""
    return case.mechanism.running_gas(names)
