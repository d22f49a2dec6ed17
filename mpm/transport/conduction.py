"""Conduction of heat: through the cells of the strip, and to the walls that `[[geometry.wall]]` tells something of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats, Ints
from mpm.mesh.strip import Strip

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.walls import Wall
    from mpm.mesh.grid import Grid


def cell_conductivity(case: Case, strip: Strip, temperature: Floats) -> Floats:
    """k_eff of every local cell [W/m/K] at the `temperature` (local cells,) [K]: of the gas, or of solids and the gas in their pores."""
    result = np.array(case.gas.conductivity_at(temperature), dtype=float)
    layer = strip.grid.row_layer[strip.row]
    for number, solid in enumerate(strip.grid.materials):
        if solid is not None and case.energy is not None:
            inside = layer == number
            result[inside] = case.energy.conductivity_of(solid, result[inside])
    return result


def solid_capacity(grid: Grid) -> Floats:
    """Heat capacity of the solids per total volume, (1 - eps) rho_s c_s, of every row [J/m3/K]."""
    return grid.per_row(
        lambda solid: (1.0 - solid.porosity) * (solid.density or 0.0) * (solid.heat_capacity or 0.0), gas=0.0
    )


@dataclass(frozen=True, eq=False)
class WallContact:
    """A wall and own `cells` beside it: the `length` that it covers of each, `half` [m] from their centres to it."""

    wall: Wall
    cells: Ints
    length: Floats
    half: Floats

    def conductance(self, conductivity: Floats) -> Floats:
        """W/m/K from the cells' centres to the temperature that is given, with k_eff (local cells,) [W/m/K]; none with a given flux."""
        if self.wall.heat_flux is not None:
            return np.zeros(len(self.cells))
        resistance = self.half / conductivity[self.cells]
        if self.wall.heat_transfer_coefficient is not None:
            resistance = resistance + 1.0 / self.wall.heat_transfer_coefficient
        return np.asarray(self.length / resistance)

    @property
    def flow(self) -> Floats:
        """A given heat flow into each cell [W/m]."""
        return self.length * (self.wall.heat_flux or 0.0)

    @property
    def outside(self) -> float:
        """The temperature that is given [K]; of no meaning with a given flux."""
        given = self.wall.temperature if self.wall.temperature is not None else self.wall.ambient
        return 0.0 if given is None else given


def wall_contacts(case: Case, strip: Strip) -> list[WallContact]:
    """All walls of a case with own cells of this rank beside them."""
    return [_contact(wall, strip) for wall in case.geometry.walls]


def _contact(wall: Wall, strip: Strip) -> WallContact:
    grid, own = strip.grid, strip.owned
    if wall.side in ("bottom", "top"):
        cells = strip.wall_cells(wall.side)
        edges, place = grid.x, strip.column[cells]
        half = 0.5 * strip.height[cells]
    else:
        at = 0 if wall.side == "left" else grid.columns - 1
        cells = np.flatnonzero(strip.column[:own] == at)
        edges, place = grid.y - grid.y[0], strip.row[cells]
        half = np.full(len(cells), 0.5 * grid.dx)
    covered = np.clip(np.minimum(edges[1:], wall.end) - np.maximum(edges[:-1], wall.start), 0.0, None)[place]
    there = covered > 0.0
    return WallContact(wall, cells[there], covered[there], half[there])


def cut_faces(case: Case, strip: Strip) -> NDArray[np.bool_]:
    """Faces (faces,) that conduct no heat: the seam of a periodic strip between solids, where these come in fresh at one end.

    The powder that leaves does not touch the powder that enters, nor is the frit one ring; only the gas comes back.
    """
    faces, grid = strip.faces, strip.grid
    solid = strip.porosity < 1.0
    across = ~faces.vertical_flow & (strip.column[faces.behind] == grid.columns - 1)
    fresh = case.geometry.bed_inflow == "fresh" and case.conveying_velocity != 0.0
    return np.asarray(across & solid[faces.behind] & (strip.column[faces.ahead] == 0) & fresh)
