"""The same reactor on a mesh of a quarter of the cells, and what its steady state says about the finer one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.reactor.steady_system import SteadySystem

Floats = NDArray[np.float64]
FEWEST = 10_000  # cells from which a coarser mesh saves more steps than it costs
THINNEST = 2  # rows that a layer keeps, if it has them


def coarser(case: Case) -> Case | None:
    """`case` with columns twice as wide and half the rows in every layer; None where that would leave too few."""
    geometry = case.geometry
    if geometry.columns * sum(layer.cells for layer in geometry.layers) < FEWEST:
        return None
    changes: dict[str, object] = {"geometry.cell_width": f"{2.0 * geometry.length / geometry.columns!r} m"}
    for layer in geometry.layers:
        changes[f"geometry.layer.{layer.name}.cells"] = max(-(-layer.cells // 2), min(layer.cells, THINNEST))
    return case.with_(changes)


def prolong(coarse: SteadySystem, fine: SteadySystem) -> None:
    """Start `fine` from the state of `coarse`: every cell takes that of the coarse cell around its centre; collective.

    Exposure, concentration times length along the bed, is thereby kept, and with it the coverage that leaves.
    """
    grid, wide = fine.strip.grid, coarse.strip.grid
    row, column = _around(wide.y, grid.y), _around(wide.x, grid.x)
    shape = (wide.rows, wide.columns)
    whole = coarse.strip.scatter.to_all(coarse.concentration).reshape(-1, *shape)
    own = slice(0, fine.own)
    fine.concentration = whole[:, row[fine.strip.row[own]], column[fine.strip.column[own]]]
    theta = coarse.bed.scatter.to_all(coarse.theta).reshape(coarse.kinds, len(coarse.bed.rows), wide.columns)
    rows = np.searchsorted(coarse.bed.rows, row[fine.bed.rows])
    cells = fine.bed.cells
    fine.theta = theta[:, rows[fine.bed.place], column[fine.strip.column[cells]]]


def _around(edges: Floats, finer: Floats) -> NDArray[np.int64]:
    """Number of the interval between `edges` that holds the middle of each interval between `finer` ones."""
    middle = 0.5 * (finer[1:] + finer[:-1])
    return np.clip(np.searchsorted(edges, middle, side="right") - 1, 0, len(edges) - 2)
