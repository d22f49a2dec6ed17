"""The same reactor on a mesh of a quarter of the cells, and what its steady state says about the finer one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.reactor.steady.system import Iterate, SteadySystem

if TYPE_CHECKING:
    from mpm.case.case import Case

FEWEST = 10_000  # cells from which a coarser mesh saves more steps than it costs
THINNEST = 2  # rows that a layer keeps, if it has them


def coarser(case: Case) -> Case | None:
    """`case` with columns twice as wide and half the rows in every layer; None where that would leave too few."""
    geometry = case.geometry
    if geometry.cells < FEWEST:
        return None
    changes: dict[str, object] = {"geometry.cell_width": f"{2.0 * geometry.length / geometry.columns!r} m"}
    for layer in geometry.layers:
        changes[f"geometry.layer.{layer.name}.cells"] = max(-(-layer.cells // 2), min(layer.cells, THINNEST))
    return case.with_(changes)


def prolonged(coarse: SteadySystem, state: Iterate, fine: SteadySystem) -> Iterate:
    """The `state` of `coarse` on the mesh of `fine`: every cell takes that of the coarse cell around its centre; collective.

    Exposure, concentration times length along the bed, is thereby kept, and with it the coverage that leaves.
    """
    strip, wide = fine.strip, coarse.strip.grid
    row, column = _around(wide.y, strip.grid.y), _around(wide.x, strip.grid.x)
    whole = coarse.strip.scatter.to_all(state.concentration).reshape(-1, wide.rows, wide.columns)
    own = slice(0, strip.owned)
    concentration = whole[:, row[strip.row[own]], column[strip.column[own]]]
    theta = coarse.conveyor.whole(state.theta)
    rows = np.searchsorted(coarse.coverage.rows, row[fine.coverage.rows])
    cells = fine.coverage.cells
    return Iterate(concentration, theta[:, rows[fine.coverage.place], column[strip.column[cells]]])


def _around(edges: Floats, finer: Floats) -> NDArray[np.int64]:
    """Number of the interval between `edges` that holds the middle of each interval between `finer` ones."""
    middle = 0.5 * (finer[1:] + finer[:-1])
    return np.clip(np.searchsorted(edges, middle, side="right") - 1, 0, len(edges) - 2)
