"""The unknowns of the gas flow: one flux per facet and one pressure per cell, which of them are prescribed, and by what.

Raviart-Thomas of lowest order on quadrilaterals with piecewise constant pressure, as one mixed vector (u, p).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import basix.ufl
import numpy as np
from numpy.typing import NDArray

from mpm.mesh.strip import BOTTOM, LEFT, RIGHT, TOP, Strip
from mpm.numerics.fem import dolfinx

if TYPE_CHECKING:
    from mpm.case.case import Case

Floats = NDArray[np.float64]
CLOSED, OPEN = 1, 2  # facet markers: walls and inlets, outlets


class FlowSpace:
    """Mixed function space on the strip, and the way between its vectors and velocities along the axes.

    `mixed` is the dolfinx space, `own` the number of own unknowns, `fixed` (n,) the local ones that are prescribed; `facets` the markers
    CLOSED and OPEN of the boundary.
    """

    def __init__(self, case: Case, strip: Strip):
        self.case, self.strip = case, strip
        element = basix.ufl.mixed_element(
            [basix.ufl.element("RTCF", "quadrilateral", 1), basix.ufl.element("DQ", "quadrilateral", 0)]
        )
        self.mixed = dolfinx.fem.functionspace(strip.mesh, element)
        self.own: int = self.mixed.dofmap.index_map.size_local
        dofs = self.mixed.dofmap.list
        self._facet_dofs, self._pressure_dofs = dofs[:, :4], dofs[:, 4]
        self._weights = self._facet_weights()
        self.facets, self.fixed = self._markers()
        self.own_fixed = self.fixed[self.fixed < self.own]
        faces = np.unique(self._facet_dofs)
        self._own_faces = faces[faces < self.own]
        self._inflow, self._frame_inflow = self._port_values()

    def _facet_weights(self) -> Floats:
        """Unknown of a facet per unit velocity along the axes (its length, with the sign of the element's orientation)."""
        velocity_space, to_mixed = self.mixed.sub(0).collapse()
        ones = dolfinx.fem.Function(velocity_space)
        ones.interpolate(lambda x: np.ones((2, x.shape[1])))
        index_map = self.mixed.dofmap.index_map
        weights = np.ones(index_map.size_local + index_map.num_ghosts)
        weights[to_mixed] = ones.x.array
        return weights

    def _markers(self) -> tuple[dolfinx.mesh.MeshTags, NDArray[np.int32]]:
        """Facets marked closed or open, and the unknowns that are prescribed."""
        strip, open_facets = self.strip, []
        for outlet in self.case.geometry.outlets:
            cells = strip.wall_cells(outlet.side)
            opening = strip.grid.opening(outlet)[strip.column[cells]]
            open_facets.append(strip.wall_facets(outlet.side)[opening])
        opened = np.concatenate(open_facets) if open_facets else np.empty(0, np.int64)
        boundary = np.concatenate([strip.wall_facets("bottom"), strip.wall_facets("top"), strip.end_facets()])
        closed = np.setdiff1d(boundary, opened)
        facets = np.concatenate([closed, opened])
        values = np.concatenate([np.full(len(closed), CLOSED), np.full(len(opened), OPEN)])
        order = np.argsort(facets)
        tags = dolfinx.mesh.meshtags(
            strip.mesh, 1, facets[order].astype(np.int32), values[order].astype(np.int32)
        )
        is_closed = np.zeros(int(strip.facets.max(initial=-1)) + 1, dtype=bool)
        is_closed[closed] = True
        own = strip.facets[: strip.owned]
        dofs = np.unique(self._facet_dofs[: strip.owned][is_closed[own]])
        return tags, dofs.astype(np.int32)

    def _port_values(self) -> tuple[Floats, Floats]:
        """Prescribed normal velocities (as unknowns): of the inlets at rest, and per unit vertical velocity of the frame.

        Inlets that stay in the lab's frame see the mesh move past: their velocity relative to it is v - V_y.
        """
        steady, per_frame = np.zeros(len(self._weights)), np.zeros(len(self._weights))
        lab = self.case.motion.inlet_frame == "lab"
        for inlet in self.case.geometry.inlets:
            cells = self.strip.wall_cells(inlet.side)
            bottom = inlet.side == "bottom"
            share = self.strip.grid.overlap(inlet)[self.strip.column[cells]] / self.strip.grid.dx
            dofs = self._facet_dofs[cells, BOTTOM if bottom else TOP]
            steady[dofs] += self._weights[dofs] * share * inlet.velocity * (1.0 if bottom else -1.0)
            if lab:
                per_frame[dofs] -= self._weights[dofs] * share
        return steady, per_frame

    def prescribed(self, frame_velocity_y: float) -> Floats:
        """Values of `own_fixed` while the frame moves upwards at `frame_velocity_y` [m/s]."""
        return np.asarray((self._inflow + frame_velocity_y * self._frame_inflow)[: self.own][self.own_fixed])

    def along_x(self, per_cell: dolfinx.fem.Function) -> dolfinx.fem.Function:
        """The mixed vector that has a cell function's positive values as velocity along x in those cells, and is zero elsewhere."""
        vector = dolfinx.fem.Function(self.mixed)
        cell_values = per_cell.x.array[per_cell.function_space.dofmap.list[:, 0]]
        inside = np.flatnonzero(cell_values > 0.0)
        for side in (LEFT, RIGHT):
            dofs = self._facet_dofs[inside, side]
            vector.x.array[dofs] = self._weights[dofs] * cell_values[inside]
        vector.x.scatter_forward()
        return vector

    def velocities(self, values: Floats) -> Floats:
        """Velocities along the axes at the bottom, left, right and top facet of every local cell, (4, cells) [m/s], of a mixed vector."""
        dofs = self._facet_dofs
        return np.ascontiguousarray((values[dofs] / self._weights[dofs]).T)

    def pressure(self, values: Floats) -> Floats:
        """Pressure in every local cell [Pa] of a mixed vector."""
        return np.asarray(values[self._pressure_dofs])

    def fill(self, values: Floats, velocities: Floats, pressure: Floats) -> None:
        """Inverse of `velocities` and `pressure`: write both into the mixed vector `values`."""
        dofs = self._facet_dofs
        values[dofs] = velocities.T * self._weights[dofs]
        values[self._pressure_dofs] = pressure

    def fastest(self, values: Floats) -> float:
        """Largest velocity at an own face of a mixed vector, this rank's [m/s]."""
        faces = self._own_faces
        return float(np.abs(values[faces] / self._weights[faces]).max(initial=0.0))
