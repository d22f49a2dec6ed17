"""Coverage of the solids, carried by the solids.

Sites live in material columns. A layer at rest keeps its columns; the moving layer's columns slide over the gas mesh by whole columns
(`mpm.transport.columns`) whenever the accumulated distance passes half a column.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.mesh.strip import Strip
from mpm.parallel import Scatter
from mpm.transport.columns import Beyond, SlidingColumns

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpm.case.case import Case
    from mpm.case.materials import Material
    from mpm.physics.rate_solvers import Surface

TIE = 1e-6  # of a column: half a column, reached by rounding from either side, is always not yet enough


def initial(site: str) -> Callable[[Material], float]:
    """The coverage of `site` that a material comes in with."""
    return lambda solid: solid.initial_coverage.get(site, 0.0)


@dataclass(frozen=True, eq=False)
class Memento:
    """The coverage and the place of the bed at one instant, to go back to."""

    theta: Floats
    distance: float
    shifted: int
    beyond: Beyond
    passed: Floats


class Coverage:
    """Coverages `theta` (sites, n) of the solids in this rank's `cells`, those with reactive surface; nobody else writes them.

    `rows` are the grid's rows with reactive solids, `place` (n,) the index of each cell's row among them, `moving_rows` those that slide.
    `surface` S [1/m], `area` [m2 per metre of depth] and `sites` n_s [mol/m2] per cell, `fresh` (sites, rows) what solids come in with.
    `distance` [m] is how far the bed has slid, `shifted` by how many columns; `passed` counts, per site species, the sites that have left
    at the right minus those that came in at the left (or the reverse for a negative number) [mol/m]; zero where the solids are periodic.
    """

    def __init__(self, case: Case, strip: Strip):
        grid, names = strip.grid, case.mechanism.site_names
        surface = grid.per_row(lambda solid: solid.surface_to_volume, gas=0.0)
        density = grid.per_row(lambda solid: solid.site_density, gas=0.0)
        self.strip, self.columns = strip, grid.columns
        self.rows = np.flatnonzero(surface > 0.0)
        self.moving_rows = np.flatnonzero(grid.moving[self.rows])
        fresh = [grid.per_row(initial(name), gas=0.0) for name in names]
        self.fresh = np.array(fresh).reshape(len(names), grid.rows)[:, self.rows]
        place_of_row = np.full(grid.rows, -1)
        place_of_row[self.rows] = np.arange(len(self.rows))
        self.cells = np.flatnonzero(place_of_row[strip.row[: strip.owned]] >= 0)
        self.place = place_of_row[strip.row[self.cells]]
        self.scatter = Scatter(
            strip.comm, self.place * grid.columns + strip.column[self.cells], len(self.rows) * grid.columns
        )
        place_of_moving = np.cumsum(grid.moving[self.rows]) - 1
        self._moving = np.flatnonzero(grid.moving[self.rows][self.place])
        self._sliding = Scatter(
            strip.comm,
            place_of_moving[self.place[self._moving]] * grid.columns + strip.column[self.cells[self._moving]],
            len(self.moving_rows) * grid.columns,
        )
        self._row_surface, self._row_sites = surface[self.rows], density[self.rows]
        self.surface, self.sites = self._row_surface[self.place], self._row_sites[self.place]
        self.area = np.asarray(self.surface * strip.volume[self.cells])
        self.periodic = case.geometry.bed_inflow == "periodic"
        self._theta = np.ascontiguousarray(self.fresh[:, self.place])
        self.distance = 0.0
        self.shifted = 0  # columns already moved
        self._columns = SlidingColumns(self.fresh[:, self.moving_rows], self.periodic)
        self.passed = np.zeros(len(names))

    @property
    def theta(self) -> Floats:
        """The coverages; an array that is replaced, never changed in place."""
        return self._theta

    @property
    def capacity(self) -> Floats:
        """Sites of all kinds in each cell, S n_s V [mol per metre of depth]."""
        return np.asarray(self.sites * self.area)

    def content(self) -> Floats:
        """Sites of each kind on this rank's solids [mol per metre of depth]."""
        return self._theta @ self.capacity

    def whole(self) -> Floats:
        """Coverage on every rank as (sites, rows, columns); collective."""
        return self.scatter.to_all(self._theta).reshape(len(self._theta), len(self.rows), self.columns)

    # --- what changes it ---

    def react(self, surface: Surface, concentration: Floats, dt: float) -> None:
        """Follow the gas at its new `concentration` (coupled, n) [mol/m3] over `dt` [s]."""
        self._theta = surface.coverage(concentration, self._theta, dt)

    def become(self, theta: Floats, passed: Floats | None = None) -> None:
        """Take over coverages (sites, n) that were found otherwise, as those of a steady state, and what has `passed` meanwhile."""
        self._theta = np.array(theta)
        if passed is not None:
            self.passed = passed

    def slide(self, distance: float) -> int:
        """Slide the bed by `distance` [m] relative to the mesh; returns the number of whole columns it moved. Collective."""
        self.distance += distance
        columns = np.floor(abs(self.distance) / self.strip.grid.dx + 0.5 - TIE)
        target = int(np.copysign(columns, self.distance))
        count = target - self.shifted
        if count and len(self.moving_rows):
            grid, shape = self.strip.grid, (len(self._theta), len(self.moving_rows), self.columns)
            whole = self._sliding.to_all(self._theta.take(self._moving, axis=1)).reshape(shape)
            moved, exchanged = self._columns.shift(whole, count)
            capacity = (self._row_surface * self._row_sites * grid.dy[self.rows] * grid.dx)[self.moving_rows]
            self.passed = self.passed + exchanged @ capacity
            theta = self._theta.copy()
            theta[:, self._moving] = self._sliding.to_local(moved.reshape(len(moved), self._sliding.size))
            self._theta = theta
        self.shifted = target
        return count

    # --- going back ---

    def memento(self) -> Memento:
        """The present state; cheap, because arrays are replaced and never changed in place."""
        return Memento(self._theta, self.distance, self.shifted, self._columns.memento(), self.passed)

    def recall(self, memento: Memento) -> None:
        """Go back to a state of this run."""
        self._theta, self.distance, self.shifted = memento.theta, memento.distance, memento.shifted
        self.passed = memento.passed
        self._columns.recall(memento.beyond)

    def stored(self) -> dict[str, Any]:
        """Arrays of a restart state, in grid order on rank 0 (None elsewhere for `theta`); collective."""
        return {
            "theta": self.scatter.to_root(self._theta),
            "passed": self.passed,
            **self._columns.stored(),
            "distance": self.distance,
            "shifted": self.shifted,
        }

    def restore(self, stored: dict[str, Any]) -> None:
        """The inverse of `stored`, on every rank."""
        self._theta = self.scatter.to_local(stored["theta"])
        self.passed = stored["passed"]
        self._columns.restore(stored)
        self.distance, self.shifted = float(stored["distance"]), int(stored["shifted"])
