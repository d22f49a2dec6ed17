"""PETSc matrices over the cells of the strip, filled from face fluxes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.mesh.strip import Strip
from mpm.numerics.linear import KrylovSolver, ServingSolver
from mpm.numerics.sparse import sparse_matrix
from mpm.transport.fluxes import FluxOperator

# ranks on which solving the whole system on each takes less time than iterating together: on two 3 ms instead of 13 (49,731 cells,
# averaged); iterations were not timed on more, and would take half of that on four
FEW = 4
FALL = 1e-13  # of a residual, where it is not below what a step may leave before
FALL_HEATED = 3e-15  # of that in gas that expands, so that what is uniform there stays so to 1e-12: little more than rounding


TRACE = 1e-10  # of what there is: what a step may leave of a species that is there in traces, which balance to 1e-9, too


class FacePattern:
    """Which own cell is coupled to which neighbour, face by face from either side, and what flux operators enter there."""

    def __init__(self, strip: Strip):
        faces, own = strip.faces, strip.owned
        self._behind = np.flatnonzero(faces.behind < own)  # faces with an own cell behind them
        self._ahead = np.flatnonzero(faces.ahead < own)
        self.cells = np.concatenate([faces.behind[self._behind], faces.ahead[self._ahead]])
        self.neighbours = np.concatenate([faces.ahead[self._behind], faces.behind[self._ahead]])

    def coupling(self, operator: FluxOperator) -> Floats:
        """Entries that couple `cells` to `neighbours`, (pairs,) [m2/s]."""
        entries, split = np.empty(len(self.cells)), len(self._behind)
        np.negative(operator.from_ahead[self._behind], out=entries[:split])
        np.negative(operator.from_behind[self._ahead], out=entries[split:])
        return entries


class CellMatrix:
    """A PETSc matrix over own cells with `unknowns` per cell: face fluxes off the diagonal, dense blocks on it.

    `dense` are those own cells in which unknowns are coupled to each other, by default all: of the blocks of others only the diagonal is
    entered.
    """

    def __init__(self, strip: Strip, unknowns: int, dense: Ints | None = None):
        self.pattern = pattern = FacePattern(strip)
        number, own = strip.global_cell, strip.owned
        each = np.arange(unknowns)
        rows = (number[pattern.cells] * unknowns + each[:, None]).ravel()
        columns = (number[pattern.neighbours] * unknowns + each[:, None]).ravel()
        coupled = np.ones((own, unknowns, unknowns), dtype=bool)
        if dense is not None:
            coupled[:] = np.eye(unknowns, dtype=bool)
            coupled[dense] = True
        cell, i, j = np.nonzero(coupled)
        self._entered = None if dense is None else np.flatnonzero(coupled)  # of all entries of blocks
        first = number[cell] * unknowns
        entries = np.concatenate([rows, first + i]), np.concatenate([columns, first + j])
        self.matrix = sparse_matrix(strip.comm, own * unknowns, own * unknowns, entries)
        self._couplings = len(rows)
        self._values = np.zeros(len(rows) + len(cell))
        self._diagonal = self.matrix.createVecLeft() if unknowns == 1 else None
        self._versions: list[int] = []  # of the operators in `_values`
        self._outflow = np.empty((0, own))
        self._holds_fluxes = False

    def set_fluxes(self, operators: Sequence[FluxOperator]) -> Floats:
        """Enter the face fluxes of one operator per unknown; returns what they add to the diagonal, (unknowns, own) [m2/s]."""
        versions = [operator.version for operator in operators]
        if versions != self._versions:
            self._outflow = np.stack([operator.outflow for operator in operators])
            pairs = len(self.pattern.cells)
            for i, operator in enumerate(operators):
                self._values[i * pairs : (i + 1) * pairs] = self.pattern.coupling(operator)
            self._versions, self._holds_fluxes = versions, False
        return self._outflow

    def assemble(self, blocks: Floats) -> None:
        """Set the diagonal blocks (own, unknowns, unknowns) and assemble; of one unknown per cell only the diagonal is entered anew."""
        if self._diagonal is not None and self._holds_fluxes:
            self._diagonal.array[:] = blocks.ravel()
            self.matrix.setDiagonal(self._diagonal)
            return
        flat = blocks.ravel()
        self._values[self._couplings :] = flat if self._entered is None else flat[self._entered]
        self.matrix.setValuesCOO(self._values)
        self._holds_fluxes = True


class StepMatrix:
    """storage/dt + fluxes for what spreads alike, with the solvers that go with it; `fill` and `even` as in KrylovSolver.

    Stored are species, in the volume of the gas, unless `update` says otherwise. A solution leaves a sum of |residual| over all cells below
    `residual` [mol/m/s], or `fall` of that which it starts from; where residuals are weighed by the diagonal (several ranks, `even`) that
    holds of weighed ones.
    """

    def __init__(
        self,
        strip: Strip,
        name: str,
        residual: float,
        fill: int = 0,
        fall: float = FALL,
        even: bool = False,
    ):
        self.strip, self.name = strip, name
        self.cells = CellMatrix(strip, 1)
        self._holds: tuple[int, float] | None = None
        self._krylov = KrylovSolver(self.cells.matrix, name, 0.0, fill=fill, even=even)
        least = residual / np.sqrt(max(self.cells.matrix.size[0], 1))
        self._krylov.ksp.setTolerances(rtol=fall, atol=least)
        self._least, self._heated = least, fall == FALL_HEATED
        self._serving: ServingSolver | None = None  # once the matrix recurs
        self._x, self._y = self.cells.matrix.createVecs()

    def update(self, operator: FluxOperator, dt: float, storage: Floats | None = None) -> None:
        """Make it the matrix of `operator` over a step of `dt` [s], infinite for the steady one.

        `storage` (own,) [m2] goes with the version of the operator; left out: the volume of the gas.
        """
        if self._holds != (operator.version, dt):
            held = self.strip.gas_volume[: self.strip.owned] if storage is None else storage
            self.cells.assemble(self.cells.set_fluxes([operator])[0] + held / dt)
            self._holds = (operator.version, dt)

    def multiply(self, values: Floats) -> Floats:
        """The product with own `values`, (own,); collective."""
        self._x.array[:] = values
        self.cells.matrix.mult(self._x, self._y)
        return np.array(self._y.array)

    def solve(self, rhs: Floats, guess: Floats, recurs: bool = False) -> Floats:
        """BiCGStab from own values `guess` to the solution, (own,); collective. Raises ConvergenceError.

        Where the matrix `recurs`, step after step, with a complete factor of it that is kept, on a FEW ranks.
        """
        self._y.array[:] = rhs
        if recurs and self.strip.comm.size <= FEW:
            self._serving = self._serving or ServingSolver(self.cells.matrix, self.name)
            self._serving.solve(self._y, self._x, self._holds)
        else:
            self._x.array[:] = guess
            if self._heated:  # no factor serves twice, by which traces would be exact
                size = float(self._y.norm())
                if size == 0.0:
                    return np.zeros_like(rhs)
                self._krylov.ksp.atol = min(self._least, TRACE * size)
            self._krylov.solve(self._y, self._x, guess=True)
        return np.array(self._x.array)
