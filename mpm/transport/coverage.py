"""Coverage of the solids, carried by the solids.

Sites live in material columns. A layer at rest keeps its columns; the moving layer's columns slide over the gas mesh by whole columns
whenever the accumulated distance passes half a column. Nothing is interpolated: no numerical diffusion, sites conserved exactly, and a
position error below one column. Columns that slide out are remembered at either end, because the bed moves back for part of a cycle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.mesh.strip import Strip
from mpm.parallel import Scatter

if TYPE_CHECKING:
    from mpm.case.case import Case

Floats = NDArray[np.float64]


class Bed:
    """Coverages theta (sites, n) in this rank's `cells` with reactive solid.

    `surface` S [1/m], `sites` n_s [mol/m2], `capacity` S n_s V [mol per metre of depth] per cell. `passed` counts, per site species,
    the sites that have left at the right minus those that came in at the left (or the reverse for a negative number) [mol/m];
    zero where the solids are periodic.
    """

    def __init__(self, case: Case, strip: Strip):
        grid = strip.grid
        layers = case.geometry.layers
        names = case.mechanism.site_names
        reactive = [
            row
            for row, i in enumerate(grid.row_layer)
            if layers[i].material and layers[i].material.surface_to_volume > 0.0
        ]
        self.rows = np.asarray(reactive, dtype=np.int64)
        self.columns = grid.columns
        solids = [layers[grid.row_layer[row]].material for row in reactive]
        moving = np.array([layers[grid.row_layer[row]].moving for row in reactive], dtype=bool)
        self.moving_rows = np.flatnonzero(moving)
        self.fresh = np.array([[s.initial_coverage.get(k, 0.0) for s in solids] for k in names]).reshape(
            len(names), -1
        )
        place_of_row = np.full(grid.rows, -1)
        place_of_row[self.rows] = np.arange(len(self.rows))
        self.cells = np.flatnonzero(place_of_row[strip.row[: strip.owned]] >= 0)
        self.place = place_of_row[strip.row[self.cells]]  # index into `rows`
        self.scatter = Scatter(
            strip.comm, self.place * grid.columns + strip.column[self.cells], len(self.rows) * grid.columns
        )
        surface = np.array([s.surface_to_volume for s in solids])
        density = np.array([s.site_density for s in solids])
        self.surface, self.sites = surface[self.place], density[self.place]
        self.row_capacity = surface * density * grid.dy[self.rows] * grid.dx
        self.capacity = self.row_capacity[self.place]
        self.theta = np.ascontiguousarray(self.fresh[:, self.place])
        self.dx, self.periodic = grid.dx, case.geometry.bed_inflow == "periodic"
        self.distance = 0.0  # slid since the start [m]
        self.shifted = 0  # columns already moved
        self.left: list[Floats] = []  # columns (sites, moving rows) beyond the left end, nearest last
        self.right: list[Floats] = []
        self.passed = np.zeros(len(names))

    def whole(self) -> Floats:
        """Coverage on every rank as (sites, rows, columns); collective."""
        return self.scatter.to_all(self.theta).reshape(len(self.theta), len(self.rows), self.columns)

    def advance(self, distance: float) -> int:
        """Slide the bed by `distance` [m] relative to the mesh; returns the number of whole columns it moved. Collective."""
        self.distance += distance
        columns = np.floor(abs(self.distance) / self.dx + 0.5 - TIE)
        target = int(np.copysign(columns, self.distance))
        count = target - self.shifted
        if count and len(self.moving_rows):
            whole = self.whole()
            moving = whole[:, self.moving_rows]
            if self.periodic:
                moving = np.roll(moving, count, axis=2)
            else:
                for _ in range(abs(count)):
                    moving = self._shift(moving, 1 if count > 0 else -1)
            whole[:, self.moving_rows] = moving
            self.theta = self.scatter.to_local(whole.reshape(len(whole), -1))
        self.shifted = target
        return count

    def _shift(self, moving: Floats, direction: int) -> Floats:
        """One column to the right (+1) or left (-1): what leaves is remembered, what enters is remembered or fresh."""
        leaving, entering = (self.right, self.left) if direction > 0 else (self.left, self.right)
        capacity = self.row_capacity[self.moving_rows]
        gone = moving[:, :, -1 if direction > 0 else 0].copy()
        leaving.append(gone)
        new = entering.pop() if entering else self.fresh[:, self.moving_rows]
        self.passed += (gone - new) @ capacity
        shifted = np.roll(moving, direction, axis=2)
        shifted[:, :, 0 if direction > 0 else -1] = new
        del leaving[:-MEMORY]
        return shifted

    def memento(self) -> tuple:
        """The present state, to go back to with `recall`. Coverages are replaced, never changed in place, so this is cheap."""
        return self.theta, self.distance, self.shifted, list(self.left), list(self.right), self.passed.copy()

    def recall(self, memento: tuple) -> None:
        self.theta, self.distance, self.shifted, self.left, self.right, self.passed = memento

    def content(self) -> Floats:
        """Sites of each kind on this rank's solids [mol per metre of depth]."""
        return self.theta @ self.capacity


TIE = 1e-6  # of a column: half a column, reached by rounding from either side, is always not yet enough
MEMORY = 64  # columns remembered beyond each end; the bed swings back by a few at most
