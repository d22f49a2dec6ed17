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

from pathlib import Path
from typing import Any

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.errors import ConvergenceError
from mpm.numerics.box import Box
from mpm.numerics.compiled import Struct, compiled, pointer
from mpm.numerics.messages import HANDLE, Neighbourhood

RELAXED = 0.9  # from 0.8 to 1 the number of iterations hardly changes; 0 takes up to half as many again
ITERATIONS = 1000  # of BiCGStab before it counts as failed
HEADER = Path(__file__).with_name("box.h")
SOURCES = [HEADER.with_name(name) for name in ("box.c", "box_matrix.c", "box_solver.c")]
BEFORE, AFTER, BELOW, ABOVE = range(4)
NOWHERE = -1  # in place of a number


class BoxMatrix:
    """A matrix over the cells of a `box` with `unknowns` per cell; vectors are (unknowns, cells).

    `couplings` (unknowns, 4, cells): entries that couple a cell to its neighbour BEFORE and AFTER it, BELOW and ABOVE it; `blocks` (cells,
    unknowns, unknowns) its own. Both are changed in place.
    """

    def __init__(self, box: Box, unknowns: int):
        self.box, self.unknowns = box, unknowns
        self.couplings = np.zeros((unknowns, 4, box.cells))
        self.blocks = np.zeros((box.cells, unknowns, unknowns))
        module = kernels(box, unknowns)
        self._c, self._neighbours = module.lib, Neighbourhood(module, box, unknowns * box.rows)
        self._x = np.zeros((unknowns, box.cells + 2 * box.rows))  # with the columns of neighbours
        self._own = self._x[:, box.rows : box.rows + box.cells]
        self._arrays = [pointer(a) for a in (self.couplings, self.blocks, self._x)]

    def couple(self, side: int, numbers: Ints, taken: Floats) -> None:
        """Let the couplings at a `side` be the negative of `taken`, of which each cell has its number in `numbers` (cells,), or NOWHERE."""
        self._c.couple(self.box.cells, pointer(numbers), pointer(taken), pointer(self.couplings[0, side]))

    def multiply(self, x: Floats, result: Floats) -> None:
        """A x to `result`; collective."""
        self._own[:] = x
        self._c.multiply(self._neighbours.known, *self._arrays, pointer(result))
        self._neighbours.check()

    def miss(self, x: Floats, rhs: Floats) -> tuple[Floats, Floats]:
        """rhs - A x, and the squares of `rhs` and of that over the diagonal and of `x`, summed over own cells; collective."""
        self._own[:] = x
        result, squares = np.empty(x.shape), np.zeros(3)
        self._c.miss(self._neighbours.known, *self._arrays, *map(pointer, (rhs, result, squares)))
        self._neighbours.check()
        return result, squares


class Factor:
    """The incomplete factor of `unknowns` per cell of a box, of which it couples so many `together`, and BiCGStab with it."""

    def __init__(self, box: Box, unknowns: int, together: int):
        self.box, self.parts, self.together = box, unknowns // together, together
        module = kernels(box, together)
        self._c, self._struct = module.lib, Struct(module, "Factor")
        self._neighbours = Neighbourhood(module, box, unknowns * together * box.rows)
        rows, cells, parts = box.rows, box.cells, self.parts
        self.inverse = np.zeros((parts, cells, together, together))  # of P
        self._swept = np.zeros((parts, 4, cells if together == 1 else 0))  # couplings times P^-1
        wide: tuple[int, ...] = (parts, together, cells + 2 * rows)
        narrow = (parts, together, rows)
        shapes = dict.fromkeys(("x", "nothing"), wide) | dict.fromkeys(("column", "beyond"), narrow)
        shapes |= dict.fromkeys(("y", "p", "v", "t", "r", "shadow"), (unknowns, cells))
        shapes |= {"excess": self.inverse.shape, "edges": (3, parts, rows, together, together)}
        shapes["own"] = (parts if parts > 1 else 0, cells)
        pairs = parts * (parts - 1)
        self._struct.lend(inverse=self.inverse, **{name: np.zeros(shape) for name, shape in shapes.items()})
        self._struct.lend(cells=np.empty(pairs * cells, np.int64), entries=np.empty(pairs * cells))
        self._struct.lend(pairs=np.zeros((pairs, 3), np.int64))
        self._struct.known.parts = parts

    def renew(self, couplings: Floats, blocks: Floats, least: float = 0.0) -> None:
        """Take up a matrix, `couplings` and `blocks` as in BoxMatrix; collective.

        Blocks count between two parts where they are above `least` times the diagonal one of that which acts.
        """
        self._c.renew(
            *(self._neighbours.known, self._struct.known, RELAXED, least),
            *map(pointer, (couplings, blocks, self._swept)),
        )
        self._neighbours.check()
        self._struct.lend(couplings=self._swept if self.together == 1 else couplings)

    def follow(self, blocks: Floats, least: float = 0.0) -> None:
        """Go on with the pivots of other blocks beside the same couplings."""
        self._c.follow(self._neighbours.known, self._struct.known, least, pointer(blocks))

    def solve(self, rhs: Floats, tolerance: float, least: float) -> tuple[Floats, int, float]:
        """As BoxSolver.solve, with -1 - n for n iterations that do not converge, and the residual that is left; collective."""
        x, left = np.empty((self.parts * self.together, self.box.cells)), np.zeros(1)
        iterations = self._c.solve(
            *(self._neighbours.known, self._struct.known, pointer(np.ascontiguousarray(rhs))),
            *(tolerance, least, ITERATIONS, pointer(x), pointer(left)),
        )
        self._neighbours.check()
        return x, int(iterations), float(np.sqrt(left[0]))


class BoxSolver:
    """BiCGStab with an incomplete factor for one `matrix`.

    A factor takes up either all unknowns of a cell together or each by itself: that is enough, and takes half the time, where none comes
    back to itself by way of others.
    """

    def __init__(self, matrix: BoxMatrix, name: str):
        self.matrix, self.name = matrix, name
        self._factors: dict[int, Factor] = {}  # by the number of unknowns that each couples
        self._together = 1

    def factorise(self, together: bool = False, coupled: float = 0.0, pivots: bool = True) -> None:
        """Take up the matrix as it is now, all unknowns of a cell `together` or each by itself; collective.

        Each by itself, blocks count between two unknowns where they are above `coupled` times the diagonal one of that which acts. Without
        `pivots`, those of the last factor of this kind stay, for blocks that have changed little beside the same couplings.
        """
        matrix = self.matrix
        self._together = matrix.unknowns if together else 1
        if self._together not in self._factors:
            self._factors[self._together] = Factor(matrix.box, matrix.unknowns, self._together)
            pivots = True
        factor = self._factors[self._together]
        if pivots:
            factor.renew(matrix.couplings, matrix.blocks, coupled)
        else:
            factor.follow(matrix.blocks, coupled)

    def solve(self, rhs: Floats, tolerance: float, least: float = 0.0) -> tuple[Floats, int]:
        """The solution (unknowns, cells) from a guess of nothing, and the number of iterations; collective. Raises ConvergenceError.

        It leaves a residual r below `tolerance` of its first one or below `least`, in the 2-norm of (P + L)^-1 r: what it is over
        the pivots when what comes in from cells before is counted, too.
        """
        found, iterations, left = self._factors[self._together].solve(rhs, tolerance, least)
        if iterations < 0:
            raise ConvergenceError(
                f"{self.name}: the linear solver stopped after {-1 - iterations} iterations at residual {left:.3g}"
            )
        return found, iterations


def kernels(box: Box, together: int) -> Any:
    """The C for so many unknowns that a factor or a product couples; collective."""
    return compiled(box.comm, HEADER, *SOURCES, UNKNOWNS=together, HANDLE=HANDLE)
