"""Convection of the gas, (rho/eps) u.grad w with w = u/eps the velocity of the gas between the grains, as differences on the grid.

Within a layer that is (rho/eps^2) u.grad u; with `porous.inertia = "superficial"` eps is 1 in all of this, as the thesis prints it. Central
in the jumps between cells. What gas brings along when it passes the face of a layer is its own velocity w, which is the same on both sides
of a moving bed, where u jumps from eps v_s to v_s: with jumps of u the flow would depend on the frame of the observer. Gas that comes in
through a port or outlet carries no tangential velocity. Central differences are safe while u h/nu < 2, which `mpm check` reports.

Tested with the functions v of the Raviart-Thomas elements of lowest order, with c = rho/eps, this is the sum of products

    cells              integral of (c/eps) (u.grad u).v
    faces inside       (u.n) (w_ahead - w_behind) . {c v}            tangential parts, {} the mean of both sides
    walls, where u.n points inwards                 (c/eps) |u.n| u.v

(in gas of different densities c u is the mass flux over eps, what it carries the velocity) of one linear function of the fluxes with
another one: N(u) = T (S u * D u), with three sparse matrices that are made once. Products come in pairs, one for each of the two functions
v along the same pair of sides, with the same S u.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.mesh.strip import BOTTOM, LEFT, RIGHT, TOP
from mpm.numerics.fem import PETSc, dolfinx
from mpm.numerics.sparse import local_matrix

if TYPE_CHECKING:
    from mpm.flow.space import FlowSpace

ALONG = {BOTTOM: (LEFT, RIGHT), TOP: (LEFT, RIGHT), LEFT: (BOTTOM, TOP), RIGHT: (BOTTOM, TOP)}
"""Sides of a cell that the tangential velocity along each of its sides is interpolated between."""
MASS = np.array([[1.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 1.0 / 3.0]])
"""Integral of products of two linear functions over a unit length."""


class Convection:
    """N(u) and its derivative on the fluxes of `space`, for a gas whose flux has this `density` [kg/m3], one value or one per local cell.
    All methods are collective.

    What this rank knows are its own cells and the faces that it owns; `_force` adds up what neighbours know of a flux.
    """

    def __init__(self, space: FlowSpace, density: float | Floats):
        self.space, self._density = space, density
        terms = _Products(space, density)
        local = len(space.weights)
        self._carrier = local_matrix(terms.count // 2, local, *terms.carriers())
        self._carried = local_matrix(terms.count, local, *terms.carried())
        self._tests = local_matrix(local, terms.count, *terms.tests())
        self._inward = terms.walls
        self._field, self._one = self._carrier.createVecs()
        self._other = self._carried.createVecLeft()
        self._product, self._sum = self._tests.createVecs()
        self._force = dolfinx.la.vector(space.fluxes.dofmap.index_map, 1)

    def force(self, values: Floats) -> PETSc.Vec:
        """N of the fluxes `values` (local fluxes,); the same vector at every call."""
        one, other = self._factors(values)
        np.multiply(np.repeat(one, 2), other, out=self._product.array)
        return self._add_up()

    def slopes(self, values: Floats) -> Callable[[Floats], PETSc.Vec]:
        """dN/du at the fluxes `values`: gives it times a change of the fluxes, in the same vector as `force`."""
        one, other = self._factors(values)
        inward, one, other = one[self._inward] > 0.0, np.repeat(one, 2), other.copy()
        carrying = np.empty_like(
            other
        )  # room for one value per product; fresh arrays would cost a third more

        def slope(change: Floats) -> PETSc.Vec:
            one_change, other_change = self._carrier_of(change), self._carried_of(change)
            one_change[self._inward] *= inward
            carrying[::2], carrying[1::2] = one_change, one_change
            product = self._product.array
            np.multiply(carrying, other, out=product)
            product += np.multiply(one, other_change, out=carrying)
            return self._add_up()

        return slope

    def slope_matrix(self, values: Floats) -> tuple[Ints, Ints, Floats]:
        """Rows, columns (global fluxes) and values of the entries of dN/du that this rank knows of."""
        one, other = self._factors(values)
        numbers = self.space.fluxes.dofmap.index_map.local_to_global(np.arange(len(values), dtype=np.int32))
        terms = _Products(self.space, self._density)  # seldom needed, and much to keep
        carrier, carried, tests = terms.carriers(), terms.carried(), terms.tests()
        one_slope = np.ones_like(one)
        one_slope[self._inward] = one[self._inward] > 0.0
        rows, columns, entries = [], [], []
        product = tests[1]
        for (known, dof, share), row, factor in (
            (carrier, product // 2, other * np.repeat(one_slope, 2)),
            (carried, product, np.repeat(one, 2)),
        ):
            starts = np.searchsorted(known, row)
            ends = np.searchsorted(known, row, side="right")
            for k in range(int((ends - starts).max(initial=0))):
                chosen = starts + k < ends
                at = starts[chosen] + k
                rows.append(numbers[tests[0][chosen]])
                columns.append(numbers[dof[at]])
                entries.append(tests[2][chosen] * share[at] * factor[product[chosen]])
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(entries)

    def _factors(self, values: Floats) -> tuple[Floats, Floats]:
        """S u, cut off where gas leaves through a wall, and D u; valid until they are next asked for."""
        one = self._carrier_of(values)
        one[self._inward] = np.maximum(one[self._inward], 0.0)
        return one, self._carried_of(values)

    def _carrier_of(self, values: Floats) -> Floats:
        """S u, one value per pair of products (pairs,)."""
        self._field.array[:] = values
        self._carrier.mult(self._field, self._one)
        return np.asarray(self._one.array)

    def _carried_of(self, values: Floats) -> Floats:
        """D u (products,)."""
        self._field.array[:] = values
        self._carried.mult(self._field, self._other)
        return np.asarray(self._other.array)

    def _add_up(self) -> PETSc.Vec:
        """T times the products, what neighbours know included."""
        self._tests.mult(self._product, self._sum)
        self._force.array[:] = self._sum.array
        self._force.scatter_reverse(dolfinx.la.InsertMode.add)
        return self._force.petsc_vec


class _Products:
    """The products of N, two for each pair of sides along which something is carried, as entries (row, column, value) of S, D and T.

    The `count` products come pair by pair: 4 of every own cell, 2 of every own face inside, 2 of every own wall. `walls` are the last
    pairs.
    """

    def __init__(self, space: FlowSpace, density: float | Floats):
        self.space, strip = space, space.strip
        grid, own = strip.grid, strip.owned
        interstitial = space.case.porous.inertia == "interstitial"
        eps, width = strip.porosity if interstitial else np.ones_like(strip.porosity), grid.dx
        self._eps, self._c = eps, density / eps
        cells = np.arange(own)
        faces = strip.faces
        upwards = faces.vertical_flow
        normal = np.where(upwards, space.dofs[faces.behind, TOP], space.dofs[faces.behind, RIGHT])
        mine = np.flatnonzero(normal < space.own)
        bottom, top = strip.wall_cells("bottom"), strip.wall_cells("top")
        # of each kind: cell behind and ahead of the face, side of the cell behind, length of the face
        self._cells = [
            (cells, (LEFT, RIGHT), strip.height[:own]),
            (cells, (BOTTOM, TOP), np.full(own, width)),
        ]
        self._faces = [
            (faces.behind[side], faces.ahead[side], along, strip.face_length[side], normal[side])
            for side, along in (
                (mine[upwards[mine]], (LEFT, RIGHT)),
                (mine[~upwards[mine]], (BOTTOM, TOP)),
            )
        ]
        self._walls = [(bottom, BOTTOM, 1.0), (top, TOP, -1.0)]
        inside = 4 * own + 2 * len(mine)
        self.count = inside + 2 * (len(bottom) + len(top))
        self.walls = slice(inside // 2, self.count // 2)

    def carriers(self) -> tuple[Ints, Ints, Floats]:
        """S, one row per pair: what carries, the flux through the face (inwards at walls); in cells the difference of the two
        velocities."""
        entries = _Entries(self.space, 1)
        for cells, sides, _ in self._cells:
            entries.add(cells, self.space.dofs[cells, sides[0]], -1.0, velocity=True)
            entries.add(cells, self.space.dofs[cells, sides[1]], 1.0, velocity=True)
            entries.next(len(cells))
        for behind, _, _, _, normal in self._faces:
            entries.add(np.arange(len(behind)), normal, 1.0)
            entries.next(len(behind))
        for cells, side, sign in self._walls:
            entries.add(np.arange(len(cells)), self.space.dofs[cells, side], sign)
            entries.next(len(cells))
        return entries.sorted()

    def carried(self) -> tuple[Ints, Ints, Floats]:
        """D: what is carried, tested with either of the two functions: the velocity at walls, the jump of w at faces; in cells the flux."""
        entries, dofs = _Entries(self.space, 2), self.space.dofs
        for cells, sides, _ in self._cells:
            for pair in (0, 1):
                for k in (0, 1):
                    entries.add(cells, dofs[cells, sides[k]], MASS[pair, k], pair)
            entries.next(len(cells))
        for behind, ahead, sides, _, _ in self._faces:
            place = np.arange(len(behind))
            for pair in (0, 1):
                for k in (0, 1):
                    entries.add(place, dofs[ahead, sides[k]], MASS[pair, k] / self._eps[ahead], pair, True)
                    entries.add(place, dofs[behind, sides[k]], -MASS[pair, k] / self._eps[behind], pair, True)
            entries.next(len(behind))
        for cells, side, _ in self._walls:
            place = np.arange(len(cells))
            for pair in (0, 1):
                for k in (0, 1):
                    entries.add(place, dofs[cells, ALONG[side][k]], MASS[pair, k], pair, True)
            entries.next(len(cells))
        return entries.sorted()

    def tests(self) -> tuple[Ints, Ints, Floats]:
        """T: which fluxes a product acts on, times what is the same for both; rows are fluxes here, columns products, sorted by product."""
        entries, dofs, width = _Entries(self.space, 2), self.space.dofs, self.space.strip.grid.dx
        for cells, sides, across in self._cells:
            for pair in (0, 1):
                entries.add(cells, dofs[cells, sides[pair]], (self._c / self._eps)[cells] * across, pair)
            entries.next(len(cells))
        for behind, ahead, sides, length, _ in self._faces:
            place = np.arange(len(behind))
            for pair in (0, 1):
                for cell in (behind, ahead):
                    entries.add(place, dofs[cell, sides[pair]], 0.5 * self._c[cell] * length, pair)
            entries.next(len(behind))
        for cells, side, _ in self._walls:
            place = np.arange(len(cells))
            for pair in (0, 1):
                entries.add(place, dofs[cells, ALONG[side][pair]], (self._c / self._eps)[cells] * width, pair)
            entries.next(len(cells))
        products, fluxes, values = entries.sorted()
        return fluxes, products, values


class _Entries:
    """Entries of a matrix that reads or tests flux densities, in `each` (1, 2) rows for every place; a flux is its density times a
    weight."""

    def __init__(self, space: FlowSpace, each: int):
        self.space, self.each, self.first = space, each, 0
        self.products: list[Ints] = []
        self.fluxes: list[Ints] = []
        self.values: list[Floats] = []

    def add(
        self, place: Ints, fluxes: Ints, values: Floats | float, which: int = 0, velocity: bool = False
    ) -> None:
        """In row number `which` of each `place` of this kind; `velocity`: what counts is not the mass flux but that over the density."""
        self.products.append(self.first + self.each * place + which)
        self.fluxes.append(fluxes)
        per_flux = values / self.space.weights[fluxes]
        if velocity and self.space.density is not None:
            per_flux = per_flux / self.space.density[fluxes]
        self.values.append(per_flux)

    def next(self, places: int) -> None:
        """Go on to the next kind, after one of so many places."""
        self.first += self.each * places

    def sorted(self) -> tuple[Ints, Ints, Floats]:
        """Product, flux and value of every entry, by product."""
        products = np.concatenate(self.products)
        order = np.argsort(products, kind="stable")
        return products[order], np.concatenate(self.fluxes)[order], np.concatenate(self.values)[order]
