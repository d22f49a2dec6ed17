"""The unknowns of the gas flow: velocities without divergence.

The flux through every facet is one number, that of Raviart-Thomas elements of lowest order on quadrilaterals. Fields with div u = 0 and the
prescribed flow through walls and inlets are u = u_p + Z psi: `u_p` is any one of them, psi a stream function on the vertices of the grid
[m2/s], Z its discrete curl, u_x = dpsi/dy and u_y = -dpsi/dx, whose entries are +-1 (Chorin's null-space method; as exact as the grid is,
whatever psi). Gas that is not everywhere equally hot has a mass flux in place of u, counted as a volume flux at the density of `[gas]`.
Along a wall psi is one number, because nothing flows through; vertices within an outlet have their own. What flows up through a whole
periodic strip, from outlets of one side to those of the other, has no psi that is the same after a turn: its amount is an unknown of its
own. The pressure is not an unknown: it follows from the forces that a solution leaves on each facet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import basix.ufl
import numpy as np

from mpm.arrays import Floats, Ints
from mpm.mesh.strip import BOTTOM, LEFT, RIGHT, TOP, Strip
from mpm.numerics.fem import PETSc, dolfinx
from mpm.numerics.sparse import sparse_matrix

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.flow.state import GasState

CLOSED, OPEN = 1, 2  # facet markers: walls and inlets, outlets


class FlowSpace:
    """Fluxes through facets, in vectors of the dolfinx space `fluxes`, and the way between them and velocities along the axes.

    `own` is the number of own fluxes; `dofs` (local cells, 4) those of each cell's bottom, left, right and top; `weights` (local fluxes,)
    the flux per unit velocity along the axes: a facet's length, with the sign of the element's orientation. `facets` are the markers CLOSED
    and OPEN of the boundary, `curl` is Z. `density` (local fluxes,) is that of the gas at the facets over that of the case, None where it
    is 1 everywhere.
    """

    def __init__(self, case: Case, strip: Strip, gas: GasState | None = None):
        self.case, self.strip = case, strip
        element = basix.ufl.element("RTCF", "quadrilateral", 1)
        self.fluxes = dolfinx.fem.functionspace(strip.mesh, element)
        self.own: int = self.fluxes.dofmap.index_map.size_local
        self.dofs: Ints = self.fluxes.dofmap.list[strip.mesh_cell].astype(np.int64)
        ones = dolfinx.fem.Function(self.fluxes)
        ones.interpolate(lambda x: np.ones((2, x.shape[1])))
        self.weights: Floats = ones.x.array
        self.facets = self._markers()
        self.curl = _curl(self, StreamFunction(case, strip))
        self.density = None if gas is None else self._facet_density(gas)

    def _facet_density(self, gas: GasState) -> Floats:
        """Mean of the cells on both sides; through an inlet that of what it blows."""
        there = np.bincount(self.dofs.ravel(), minlength=len(self.weights))
        sums = np.bincount(self.dofs.ravel(), np.repeat(gas.relative, 4), len(self.weights))
        mean = self.function()
        mean.x.array[:] = sums / there
        grid, strip = self.strip.grid, self.strip
        for side, facet in (("bottom", BOTTOM), ("top", TOP)):
            inlets = [inlet for inlet in self.case.geometry.inlets if inlet.side == side]
            volume = sum((grid.overlap(i) * i.velocity for i in inlets), np.zeros(grid.columns))
            mass = sum(
                (grid.overlap(i) * i.velocity * self.case.inlet_density(i) for i in inlets), 0.0 * volume
            )
            cells = strip.wall_cells(side)
            blown = np.flatnonzero(volume[strip.column[cells]] > 0.0)
            columns = strip.column[cells[blown]]
            mean.x.array[self.dofs[cells[blown], facet]] = mass[columns] / volume[columns]
        mean.x.scatter_forward()
        return np.array(mean.x.array)

    def _markers(self) -> dolfinx.mesh.MeshTags:
        """Facets of the boundary marked closed or open."""
        strip, open_facets = self.strip, [np.empty(0, np.int64)]
        for outlet in self.case.geometry.outlets:
            opening = strip.grid.opening(outlet)[strip.column[strip.wall_cells(outlet.side)]]
            open_facets.append(strip.wall_facets(outlet.side)[opening])
        opened = np.concatenate(open_facets)
        boundary = np.concatenate([strip.wall_facets("bottom"), strip.wall_facets("top"), strip.end_facets()])
        closed = np.setdiff1d(boundary, opened)
        facets = np.concatenate([closed, opened])
        values = np.concatenate([np.full(len(closed), CLOSED), np.full(len(opened), OPEN)])
        order = np.argsort(facets)
        return dolfinx.mesh.meshtags(
            strip.mesh, 1, facets[order].astype(np.int32), values[order].astype(np.int32)
        )

    def function(self) -> dolfinx.fem.Function:
        """A field of fluxes, zero."""
        return dolfinx.fem.Function(self.fluxes)

    def along_x(self, per_cell: dolfinx.fem.Function) -> dolfinx.fem.Function:
        """The field that has a cell function's positive values as velocity along x in those cells, and is zero elsewhere."""
        field = self.function()
        cell_values = self.strip.values_of(per_cell)
        inside = np.flatnonzero(cell_values > 0.0)
        for side in (LEFT, RIGHT):
            dofs = self.dofs[inside, side]
            field.x.array[dofs] = self.weights[dofs] * cell_values[inside]
        field.x.scatter_forward()
        return field

    # --- looking at vectors of fluxes ---

    def velocities(self, values: Floats) -> Floats:
        """Velocities along the axes at the bottom, left, right and top facet of every local cell, (4, cells) [m/s], of local fluxes."""
        return np.ascontiguousarray((values[self.dofs] / self.weights[self.dofs]).T)

    def from_velocities(self, velocities: Floats) -> Floats:
        """Inverse of `velocities`: (local fluxes,)."""
        values = np.zeros(len(self.weights))
        values[self.dofs] = velocities.T * self.weights[self.dofs]
        return values

    def fastest(self, values: Floats) -> float:
        """Largest velocity of own fluxes, this rank's [m/s]."""
        return float(np.abs(values[: self.own] / self.weights[: self.own]).max(initial=0.0))

    def pressure(self, forces: Floats) -> Floats:
        """Pressure in every local cell [Pa] from the `forces` on facets that it must balance (local fluxes,); collective.

        Tested with the unit flux through a facet, the pressure's force is p_behind - p_ahead. Outside of outlets p = 0, without one it is 0
        in the first cell. Summed along columns, whose levels follow from the differences between them, mean over the rows.
        """
        strip, grid = self.strip, self.strip.grid
        own = slice(0, strip.owned)
        jump = forces * np.sign(self.weights)  # p_behind - p_ahead
        shape = (grid.rows, grid.columns)
        across = strip.scatter.to_all(jump[self.dofs[own].T]).reshape(4, *shape)
        upwards = np.zeros(shape)
        upwards[1:] = np.cumsum(-across[BOTTOM, 1:], axis=0)
        step = np.mean(-across[LEFT, :, 1:] - np.diff(upwards, axis=1), axis=0)
        whole = upwards + np.concatenate([[0.0], np.cumsum(step)])
        outside = [
            (whole[0, opening] + across[BOTTOM, 0, opening])
            if outlet.side == "bottom"
            else (whole[-1, opening] - across[TOP, -1, opening])
            for outlet in self.case.geometry.outlets
            for opening in [grid.opening(outlet)]
        ]
        level = float(np.mean(np.concatenate(outside))) if outside else whole[0, 0]
        return np.asarray((whole - level).ravel()[strip.cell])


class StreamFunction:
    """Numbers of the unknowns psi on the vertices of the grid, the same on every rank.

    `number` (levels, vertex columns) is the global number of each vertex, -1 where psi = 0; `upwards` that of what flows up through the
    whole strip (see above), None where the vertices say it all. `count` unknowns are this rank's.
    """

    def __init__(self, case: Case, strip: Strip):
        grid, comm = strip.grid, strip.comm
        columns = grid.columns + (0 if grid.periodic else 1)
        self.columns = columns
        group = self._groups(case, strip)
        owners = strip.scatter.to_all(np.full((1, strip.owned), float(comm.rank)))[0].astype(np.int64)
        owners = owners.reshape(grid.rows, grid.columns)
        rows = np.minimum(np.arange(grid.rows + 1), grid.rows - 1)
        owner = owners[rows][:, np.minimum(np.arange(columns), grid.columns - 1)].ravel()
        # the first vertex of each group stands for it; group 0 has psi = 0
        unknowns, first_vertex, inverse = np.unique(group, return_index=True, return_inverse=True)
        free = unknowns > 0
        order = np.lexsort((first_vertex[free], owner[first_vertex[free]]))
        numbers = np.full(len(unknowns), -1)
        numbers[np.flatnonzero(free)[order]] = np.arange(len(order))
        self.number = numbers[inverse].reshape(grid.rows + 1, columns)
        counts = np.bincount(owner[first_vertex[free]], minlength=comm.size)
        self.upwards: int | None = None
        if grid.periodic and len({outlet.side for outlet in case.geometry.outlets}) == 2:
            self.upwards = len(order)
            counts[-1] += 1
        self.count = int(counts[comm.rank])

    def _groups(self, case: Case, strip: Strip) -> Ints:
        """Which vertices share one psi: those of a closed stretch of wall; the first stretch is group 0. (vertices,), level by level."""
        grid = strip.grid
        vertices = np.arange((grid.rows + 1) * self.columns).reshape(grid.rows + 1, self.columns)
        group = vertices.ravel() + 1
        opened = {side: np.zeros(grid.columns, dtype=bool) for side in ("bottom", "top")}
        for outlet in case.geometry.outlets:
            opened[outlet.side] |= grid.opening(outlet)
        bottom, top = vertices[0], vertices[-1]
        if grid.periodic:
            loops = [(bottom, opened["bottom"]), (top, opened["top"])]
        else:
            left, right = vertices[1:-1, 0], vertices[1:-1, -1]
            ends = np.zeros(grid.rows, dtype=bool)
            whole = np.concatenate([bottom, right, top[::-1], left[::-1]])
            loops = [(whole, np.concatenate([opened["bottom"], ends, opened["top"][::-1], ends]))]
        for places, is_open in loops:
            stretch = np.concatenate([[0], np.cumsum(is_open[:-1])])  # of each vertex, counted along the loop
            if not is_open[-1]:
                stretch[stretch == stretch[-1]] = 0
            group[places] = _shared(places, stretch)
        group[group == group[bottom[0]]] = 0
        return np.asarray(group)


def _shared(places: Ints, stretch: Ints) -> Ints:
    """For each vertex the number, from 1, of the first one on its stretch."""
    _, first, inverse = np.unique(stretch, return_index=True, return_inverse=True)
    return np.asarray(places[first][inverse] + 1)


def _curl(space: FlowSpace, psi: StreamFunction) -> PETSc.Mat:
    """Z (fluxes, unknowns psi): the flux through a facet is the difference of psi between its ends."""
    strip = space.strip
    row, column = strip.row, strip.column
    after = (column + 1) % psi.columns
    ends = {  # lower or left end, upper or right end, sign of the flux along the axis
        BOTTOM: ((row, column), (row, after), -1.0),
        TOP: ((row + 1, column), (row + 1, after), -1.0),
        LEFT: ((row, column), (row + 1, column), 1.0),
        RIGHT: ((row, after), (row + 1, after), 1.0),
    }
    start, end = np.zeros((2, len(space.weights)), dtype=np.int64)
    sign = np.zeros(len(space.weights))
    for side, (one, two, direction) in ends.items():
        dofs = space.dofs[:, side]
        start[dofs], end[dofs] = psi.number[one], psi.number[two]
        sign[dofs] = direction * np.sign(space.weights[dofs])
    own = np.arange(space.own)
    first = int(strip.comm.scan(space.own)) - space.own
    differs = start[own] != end[own]  # not along a closed wall
    rows, columns, values = [], [], []
    for numbers, part in ((end[own], 1.0), (start[own], -1.0)):
        chosen = differs & (numbers >= 0)
        rows.append(first + own[chosen])
        columns.append(numbers[chosen])
        values.append(part * sign[own][chosen])
    if psi.upwards is not None:
        path = _way_up(space)[: space.own]
        passed = np.flatnonzero(path)
        rows.append(first + passed)
        columns.append(np.full(len(passed), psi.upwards))
        values.append(path[passed])
    curl = sparse_matrix(strip.comm, space.own, psi.count, (np.concatenate(rows), np.concatenate(columns)))
    curl.setValuesCOO(np.concatenate(values))
    return curl


def _way_up(space: FlowSpace) -> Floats:
    """Fluxes (local fluxes,) of one unit from an outlet at the bottom along the lowest row, then up to an outlet at the top."""
    strip, outlets = space.strip, space.case.geometry.outlets
    start, end = (
        min(int(np.flatnonzero(strip.grid.opening(o))[0]) for o in outlets if o.side == side)
        for side in ("bottom", "top")
    )
    row, column = strip.row, strip.column
    field = np.zeros(len(space.weights))
    field[space.dofs[(row == 0) & (column == start), BOTTOM]] = 1.0
    between = (row == 0) & (min(start, end) <= column) & (column < max(start, end))
    field[space.dofs[between, RIGHT]] = np.sign(end - start)
    field[space.dofs[column == end, TOP]] = 1.0
    return np.asarray(field * np.sign(space.weights))
