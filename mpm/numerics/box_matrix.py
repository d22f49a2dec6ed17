"""Matrices over the box of a rank, and BiCGStab for them with an incomplete factor that costs next to nothing.

A = L + D + U couples every cell to its four neighbours, unknown by unknown, and the unknowns of a cell among each other by the blocks D.
Its incomplete factor is M = (P + L) P^-1 (P + U): only the pivots P differ from D. A cell that is eliminated would couple its later
neighbours; these entries are dropped, and `RELAXED` of what diffusion has in them is taken off the diagonal of their columns instead
(Gustafsson 1978; by columns as in nested factorization, Appleyard and Cheshire 1983): what leaves a cell arrives, so that of storage and
fluxes sums of columns are never negative, and no pivot is. What is carried one way is left alone: of a gas that goes round in circles
a factor that made up for it would be worse than none. Since A = (P + L) + (D - 2 P) + (P + U), the system that BiCGStab sees takes one
sweep either way (Eisenstat 1981):

    (P + L)^-1 A (P + U)^-1 P y = x + f,    (P + U) x = P y,    (P + L) f = P y + (D - 2 P) x

Cells are eliminated in the order of `mpm.numerics.box`, so that on any number of ranks the factor is one of the whole matrix.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.numerics.bicgstab import BiCGStab
from mpm.numerics.box import END, START, Box
from mpm.numerics.compiled import NOTHING, compiled, pointer

RELAXED = 0.9  # from 0.8 to 1 the number of iterations hardly changes; 0 takes up to half as many again
SOURCE = Path(__file__).with_name("box_matrix.c")
FUNCTIONS = """
void find_pivots(int rows, int columns, int first, int end, double relaxed, const double *couplings, const double *blocks,
                 const double *from_start, const double *from_end, double *inverse, double *excess, double *swept);
void sweep_back(int rows, int columns, int first, int end, int to_start, const double *couplings, const double *inverse,
                const double *y, double *x);
void sweep_on(int rows, int columns, int first, int end, const double *couplings, const double *inverse, const double *excess,
              const double *beyond, const double *y, double *x, double *f, double *result);
void act(long count, const long *cells, const double *entries, const double *x, double *y);
void multiply(int rows, int columns, const double *couplings, const double *blocks, const double *x, double *result);
"""
BEFORE, AFTER, BELOW, ABOVE = range(4)


class BoxMatrix:
    """A matrix over the cells of a `box` with `unknowns` per cell; vectors are (unknowns, cells).

    `couplings` (unknowns, 4, cells): entries that couple a cell to its neighbour BEFORE and AFTER it, BELOW and ABOVE it; `blocks` (cells,
    unknowns, unknowns) its own. Both are changed in place.
    """

    def __init__(self, box: Box, unknowns: int):
        self.box, self.unknowns = box, unknowns
        self.couplings = np.zeros((unknowns, 4, box.cells))
        self.blocks = np.zeros((box.cells, unknowns, unknowns))
        self._c = kernels(box, unknowns)
        self._x = BoxVector(box, unknowns)

    def multiply(self, x: Floats, result: Floats) -> None:
        """A x to `result`; collective."""
        box = self.box
        self._x.own[:] = x
        for side in box.sides:
            box.give(side, self._x.column[side])
        for side in box.sides:
            box.take(side, self._x.beyond[side])
        box.finish()
        self._c.multiply(*box.shape, *map(pointer, (self.couplings, self.blocks, self._x.all, result)))


class BoxVector:
    """A vector with the columns of neighbours: `all` (unknowns, rows + cells + rows), views of its `own` cells, of the own `column` at each
    side and of that `beyond` it."""

    def __init__(self, box: Box, unknowns: int):
        rows, cells = box.rows, box.cells
        self.all = np.zeros((unknowns, cells + 2 * rows))
        self.own = self.all[:, rows : rows + cells]
        self.column = {START: self.all[:, rows : 2 * rows], END: self.all[:, cells : cells + rows]}
        self.beyond = {START: self.all[:, :rows], END: self.all[:, cells + rows :]}


class Factor:
    """The incomplete factor of unknowns that it couples, of a BoxMatrix or of one that only these make up."""

    def __init__(self, box: Box, unknowns: int):
        self.box, self.unknowns = box, unknowns
        self._c = kernels(box, unknowns)
        self.inverse = np.zeros((box.cells, unknowns, unknowns))  # of P
        self._excess = np.zeros_like(self.inverse)  # P^-1 D - 2
        self._swept = np.zeros((1, 4, box.cells if unknowns == 1 else 0))  # couplings times P^-1
        self._x, self._nothing = (BoxVector(box, unknowns) for _ in range(2))
        self._column, self._beyond = (np.zeros((unknowns, box.rows)) for _ in range(2))
        self._fixed = [pointer(a) for a in (self._swept, self.inverse, self._excess)]  # that sweeps take
        self._at = [pointer(a) for a in (self._x.all, self._nothing.all, self._column, self._beyond)]

    def renew(self, couplings: Floats, blocks: Floats) -> None:
        """Find P for these, as in BoxMatrix; collective."""
        box, rows = self.box, self.box.rows
        edge = {START: slice(0, rows), END: slice(box.cells - rows, box.cells)}
        out = {START: couplings[:, BEFORE], END: couplings[:, AFTER]}
        beyond = [np.zeros((rows, self.unknowns, self.unknowns)) for _ in (START, END)]
        made = self.inverse, self._excess, self._swept
        arrays = [pointer(a) for a in (couplings, blocks, *beyond, *made)]
        for first, end, earlier, later in box.pieces:
            for side in earlier:
                box.take(side, beyond[side])
            self._c.find_pivots(*box.shape, first, end, RELAXED, *arrays)
            for side in later:
                box.give(side, self.inverse[edge[side]] * out[side][:, edge[side]].T[:, None, :])
        box.finish()
        if self.unknowns > 1:
            self._fixed[0] = pointer(couplings)

    def weigh(self, rhs: Floats) -> Floats:
        """P^-1 times a vector."""
        if self.unknowns == 1:
            return self.inverse.ravel() * rhs
        return np.ascontiguousarray(np.matmul(self.inverse, rhs.T[:, :, None])[:, :, 0].T)

    def sweep_back(self, y: Floats) -> Floats:
        """x of (P + U) x = P y, a view that the next sweep changes; collective."""
        box, x = self.box, self._x
        swept, inverse, _ = self._fixed
        given, made = pointer(y), self._at[0]
        rows, columns = box.shape
        for first, end, earlier, later in reversed(box.pieces):
            for side in later:
                box.take(side, x.beyond[side])
            self._c.sweep_back(rows, columns, first, end, START in later, swept, inverse, given, made)
            for side in earlier:
                box.give(side, x.column[side])
        box.finish()
        return x.own

    def sweep_on(self, y: Floats, result: Floats) -> None:
        """x + f of (P + L) f = P y + (D - 2 P) x to `result`, x that of `sweep_back`; collective."""
        self._on(y, self._at[0], result)

    def sweep_on_alone(self, y: Floats, result: Floats) -> None:
        """f of (P + L) f = P y to `result`; collective."""
        self._on(y, self._at[1], result)

    def _on(self, y: Floats, x: Any, result: Floats) -> None:
        """With `x` where C finds it."""
        box, there = self.box, (self._column, self._beyond)
        _, _, column, beyond = self._at
        given, made = pointer(y), pointer(result)
        rows, columns = box.shape
        self._column[:] = 0.0
        for first, end, earlier, later in box.pieces:
            for side in earlier:
                box.take(side, there[side])
            after = beyond if END in earlier else NOTHING
            self._c.sweep_on(rows, columns, first, end, *self._fixed, after, given, x, column, made)
            for side in later:
                box.give(side, self._column)
        box.finish()


class BoxSolver:
    """BiCGStab with an incomplete factor for one `matrix`.

    A factor takes up either all unknowns of a cell together or each by itself: that is enough, and takes half the time, where none comes
    back to itself by way of others.
    """

    def __init__(self, matrix: BoxMatrix, name: str):
        self.matrix, self.name = matrix, name
        self._c = kernels(matrix.box, 1)
        self._factors: dict[int, list[Factor]] = {}  # by the number of unknowns of each
        self._together = 1
        self._across: list[tuple[int, int, Ints, Floats]] = []
        self._krylov = BiCGStab(matrix.box.comm, matrix.unknowns * matrix.box.cells, self._seen, name)

    def factorise(self, together: bool = False, coupled: float = 0.0) -> None:
        """Take up the matrix as it is now, all unknowns of a cell `together` or each by itself; collective.

        Each by itself, blocks count between two unknowns where they are above `coupled` times the diagonal one of that which acts.
        """
        matrix = self.matrix
        self._together = matrix.unknowns if together else 1
        for part, factor in self._parts():
            factor.renew(matrix.couplings[part], np.ascontiguousarray(matrix.blocks[:, part, part]))
        self._across = []
        if self._together < matrix.unknowns:
            self._across = list(self._couplings(coupled))

    def _couplings(self, least: float) -> Iterator[tuple[int, int, Ints, Floats]]:
        """Unknown, the other that acts on it, cells where that counts, and P^-1 D there."""
        matrix = self.matrix
        for i, factor in enumerate(self._factors[1]):
            for j in range(matrix.unknowns):
                if i != j:
                    between = matrix.blocks[:, i, j]
                    cells = np.flatnonzero(np.abs(between) > least * np.abs(matrix.blocks[:, j, j]))
                    if len(cells):
                        yield i, j, cells, between[cells] * factor.inverse[cells, 0, 0]

    def _parts(self) -> Iterator[tuple[slice, Factor]]:
        """The factors in use and their unknowns."""
        size, unknowns = self._together, self.matrix.unknowns
        if size not in self._factors:
            self._factors[size] = [Factor(self.matrix.box, size) for _ in range(unknowns // size)]
        for i, factor in enumerate(self._factors[size]):
            yield slice(i * size, (i + 1) * size), factor

    def _seen(self, y: Floats, result: Floats) -> None:
        """What BiCGStab sees of the matrix."""
        shape = self.matrix.unknowns, self.matrix.box.cells
        given, made = y.reshape(shape), result.reshape(shape)
        found = self._back(given)
        if self._across:
            given = given.copy()
        for i, j, cells, entries in self._across:
            self._c.act(
                len(cells), pointer(cells, "long"), pointer(entries), pointer(found[j]), pointer(given[i])
            )
        for part, factor in self._parts():
            factor.sweep_on(given[part], made[part])

    def _back(self, y: Floats) -> list[Floats]:
        """x of each unknown."""
        return [x for part, factor in self._parts() for x in factor.sweep_back(y[part])]

    def solve(self, rhs: Floats, tolerance: float, least: float = 0.0) -> tuple[Floats, int]:
        """The solution (unknowns, cells) from a guess of nothing, and the number of iterations; collective. Raises ConvergenceError.

        It leaves a residual r below `tolerance` of its first one or below `least`, in the 2-norm of (P + L)^-1 r: what it is over
        the pivots when what comes in from cells before is counted, too.
        """
        shape = self.matrix.unknowns, self.matrix.box.cells
        seen = np.empty(shape)
        for part, factor in self._parts():
            factor.sweep_on_alone(factor.weigh(rhs[part]), seen[part])
        found, iterations = self._krylov.solve(seen.ravel(), tolerance, least)
        return np.stack(self._back(found.reshape(shape))), iterations


def kernels(box: Box, unknowns: int) -> Any:
    """The functions of box_matrix.c for so many unknowns; collective."""
    return compiled(box.comm, SOURCE, FUNCTIONS, UNKNOWNS=unknowns)
