"""The strip as a dolfinx mesh whose topology is truly periodic, with the maps that everything else uses.

Cells and nodes are those of the grid (`mpm mesh` gives the same to gmsh). The right-hand nodes of the last column are the left-hand ones
of the first, so that the mesh closes on itself; every cell then owns its four geometry nodes, which keeps each cell's true coordinates
although the seam's vertices have two places. Every finite element and every facet integral is periodic without constraints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats, Ints
from mpm.mesh.grid import Grid
from mpm.numerics.box import Box, column_owners
from mpm.numerics.fem import dolfinx
from mpm.parallel import Scatter, is_root

import basix.ufl  # isort: skip
import ufl  # isort: skip
from dolfinx.common import IndexMap  # isort: skip
from mpi4py import MPI  # isort: skip

if TYPE_CHECKING:
    from mpm.case.case import Case

BOTTOM, LEFT, RIGHT, TOP = range(4)  # local facet numbers of a quadrilateral with tensor-ordered corners
TAG = 1304  # of the messages in which ranks tell each other which nodes they share; any number that no other exchange has


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces between two cells, seen along the axes: flow from `behind` to `ahead` is positive.

    `behind`, `ahead` (n,) local cells, `vertical_flow` (n,) True where the normal is y.
    """

    behind: Ints
    ahead: Ints
    vertical_flow: NDArray[np.bool_]


class Strip:
    """The distributed mesh of a case.

    `mesh` is the dolfinx mesh; of its cells this rank has `local`, ghosts included, and the first `owned` are its own, in the order of its
    `box`: `mesh_cell` (local,) is the number of each in `mesh`, `cell` (local,) that in `grid`, `row` and `column` its place there,
    `global_cell` its number among those of all ranks; `facets` (local, 4) are its facets as bottom, left, right, top, `faces` those between
    two cells. `scatter` moves own cell values to and from grid order.
    """

    def __init__(self, case: Case, comm: MPI.Comm):
        self.comm = comm
        self.grid = grid = Grid.from_case(case)
        self.box = Box(comm, grid.rows, grid.columns, grid.periodic)
        self.mesh = _periodic_mesh(grid, comm)
        topology = self.mesh.topology
        cells = topology.index_map(2)
        self.owned: int = cells.size_local
        self.local: int = cells.size_local + cells.num_ghosts
        there = topology.original_cell_index.astype(np.int64)
        place = np.empty(grid.columns, dtype=np.int64)
        place[self.box.columns] = np.arange(len(self.box.columns))
        row, column = np.divmod(there[: self.owned], grid.columns)
        order = np.lexsort((row, place[column]))
        self.mesh_cell: Ints = np.concatenate([order, np.arange(self.owned, self.local)])
        self.cell: Ints = there[self.mesh_cell]
        self.row, self.column = np.divmod(self.cell, grid.columns)
        topology.create_connectivity(2, 1)
        topology.create_connectivity(1, 2)
        self.facets: Ints = topology.connectivity(2, 1).array.reshape(-1, 4).astype(np.int64)[self.mesh_cell]
        self.scatter = Scatter(comm, self.cell[: self.owned], grid.cells)
        numbers = self.scatter.to_all(cells.local_range[0] + np.arange(self.owned, dtype=float))
        self.global_cell: Ints = numbers[self.cell].astype(np.int64)
        self.faces = self._faces()
        self._measure()

    def _measure(self) -> None:
        """Every length and volume that others use, local cells: `height`, `volume`, `gas_volume` (the pores'), `porosity`, and the
        `face_length` of `faces` [m, m2 per metre of depth]."""
        grid = self.grid
        self.height = grid.dy[self.row]
        self.volume = self.height * grid.dx
        self.porosity = grid.per_row(lambda solid: solid.porosity, gas=1.0)[self.row]
        self.gas_volume = self.porosity * self.volume
        self.face_length = np.where(self.faces.vertical_flow, grid.dx, self.height[self.faces.behind])

    def _faces(self) -> Faces:
        """Interior faces that touch an own cell."""
        index_map = self.mesh.topology.index_map(1)
        count = index_map.size_local + index_map.num_ghosts
        behind, ahead = np.full(count, -1), np.full(count, -1)
        vertical = np.zeros(count, dtype=bool)
        everyone = np.arange(self.local)
        behind[self.facets[:, RIGHT]] = everyone
        behind[self.facets[:, TOP]] = everyone
        ahead[self.facets[:, LEFT]] = everyone
        ahead[self.facets[:, BOTTOM]] = everyone
        vertical[self.facets[:, TOP]] = True
        vertical[self.facets[:, BOTTOM]] = True
        inner = np.flatnonzero((behind >= 0) & (ahead >= 0))
        mine = inner[(behind[inner] < self.owned) | (ahead[inner] < self.owned)]
        mine = mine[np.lexsort((behind[mine], vertical[mine]))]  # as cells lie in memory
        return Faces(behind[mine], ahead[mine], vertical[mine])

    def wall_cells(self, side: str) -> Ints:
        """Own cells along the bottom or top wall."""
        row = 0 if side == "bottom" else self.grid.rows - 1
        return np.flatnonzero(self.row[: self.owned] == row)

    def wall_facets(self, side: str) -> Ints:
        """The wall facets of `wall_cells(side)`, in the same order."""
        return np.asarray(self.facets[self.wall_cells(side), BOTTOM if side == "bottom" else TOP])

    def end_facets(self) -> Ints:
        """Facets of own cells at the left and right ends; none where the strip is periodic."""
        if self.grid.periodic:
            return np.empty(0, np.int64)
        first = np.flatnonzero(self.column[: self.owned] == 0)
        last = np.flatnonzero(self.column[: self.owned] == self.grid.columns - 1)
        return np.concatenate([self.facets[first, LEFT], self.facets[last, RIGHT]])

    def cell_values(self, values: Floats, name: str) -> dolfinx.fem.Function:
        """A DG0 function with these `values` in the local cells."""
        function = dolfinx.fem.Function(dolfinx.fem.functionspace(self.mesh, ("DG", 0)), name=name)
        self.set_cell_values(function, values)
        return function

    def set_cell_values(self, function: dolfinx.fem.Function, values: Floats) -> None:
        """Give a DG0 function these `values` in the local cells."""
        function.x.array[function.function_space.dofmap.list[self.mesh_cell, 0]] = values

    def values_of(self, function: dolfinx.fem.Function) -> Floats:
        """Values of a DG0 function in the local cells."""
        return np.asarray(function.x.array[function.function_space.dofmap.list[self.mesh_cell, 0]])


def _periodic_mesh(grid: Grid, comm: MPI.Comm) -> dolfinx.mesh.Mesh:
    element = basix.ufl.element("Lagrange", "quadrilateral", 1, shape=(2,))
    if is_root(comm):
        cells, nodes = cell_nodes(grid), node_places(grid)
    else:
        cells, nodes = np.empty((0, 4), np.int64), np.empty((0, 2))
    flat = dolfinx.mesh.create_mesh(comm, cells, element, nodes, _shares(grid))
    topology = flat.topology
    own = topology.index_map(2)
    four = np.arange(4)
    node_map = IndexMap(
        comm,
        4 * own.size_local,
        (4 * own.ghosts[:, None] + four).ravel().astype(np.int64),
        np.repeat(own.owners, 4).astype(np.int32),
        TAG,
    )
    count = own.size_local + own.num_ghosts
    row, column = np.divmod(topology.original_cell_index, grid.columns)
    corners = np.zeros((count, 4, 3))  # lower left, lower right, upper left, upper right
    corners[:, [0, 2], 0] = grid.x[column][:, None]
    corners[:, [1, 3], 0] = grid.x[column + 1][:, None]
    corners[:, [0, 1], 1] = grid.y[row][:, None]
    corners[:, [2, 3], 1] = grid.y[row + 1][:, None]
    first = own.local_range[0]
    identity = 4 * (np.concatenate([np.arange(first, first + own.size_local), own.ghosts])[:, None]) + four
    geometry = dolfinx.mesh.create_geometry(
        node_map,
        np.arange(4 * count, dtype=np.int32).reshape(count, 4),
        flat.geometry.cmaps[0],
        np.ascontiguousarray(corners.reshape(-1, 3)[:, :2]),
        identity.ravel().astype(np.int64),
    )
    cpp = dolfinx.cpp.mesh.Mesh_float64(comm, topology._cpp_object, geometry._cpp_object)
    return dolfinx.mesh.Mesh(cpp, ufl.Mesh(element))


def _shares(grid: Grid) -> Callable[..., Any]:
    """What tells dolfinx on which ranks each cell is: that of its column (`Box`), and as a ghost on those of the columns next to it."""

    def share(_: MPI.Comm, ranks: int, _types: Any, cells: Any) -> Any:
        owners = column_owners(grid.columns, ranks)
        beside = np.stack([owners, np.roll(owners, 1), np.roll(owners, -1)])
        if not grid.periodic:
            beside[1, 0], beside[2, -1] = owners[0], owners[-1]
        there = [np.array(list(dict.fromkeys(column)), dtype=np.int32) for column in beside.T.tolist()]
        given = sum(len(nodes) for nodes in cells) // 4  # all of them or none
        all_cells = [there[column] for column in np.arange(given) % grid.columns]
        starts = np.cumsum([0, *map(len, all_cells)], dtype=np.int32)
        destinations = np.concatenate(all_cells) if all_cells else np.empty(0, np.int32)
        return dolfinx.graph.adjacencylist(destinations, starts)._cpp_object

    return share


def cell_nodes(grid: Grid) -> Ints:
    """The nodes of every cell, in the grid's order: lower left, lower right, upper left, upper right, rows of nodes from the bottom.

    Where the strip is periodic, the right-hand nodes of its last column are the left-hand ones of its first.
    """
    row, column = np.divmod(np.arange(grid.cells), grid.columns)
    per_row = _nodes_per_row(grid)
    left, right = row * per_row + column, row * per_row + (column + 1) % per_row
    return np.column_stack([left, right, left + per_row, right + per_row])


def node_places(grid: Grid) -> Floats:
    """Places (n, 2) [m] of the nodes that `cell_nodes` counts; those of a seam, which has two, at the left-hand end."""
    x, y = np.meshgrid(grid.x[: _nodes_per_row(grid)], grid.y)
    return np.column_stack([x.ravel(), y.ravel()])


def _nodes_per_row(grid: Grid) -> int:
    return grid.columns if grid.periodic else grid.columns + 1
