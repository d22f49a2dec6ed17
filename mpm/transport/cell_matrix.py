"""PETSc matrices over the cells of the strip, filled from face fluxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpm.mesh.strip import Strip
from mpm.numerics.fem import PETSc
from mpm.numerics.linear import KrylovSolver
from mpm.transport.fluxes import FluxOperator

Floats = NDArray[np.float64]


class CellMatrix:
    """A PETSc matrix over own cells with `b` unknowns per cell: face fluxes off the diagonal, dense blocks on it."""

    def __init__(self, strip: Strip, b: int):
        faces, own = strip.faces, strip.owned
        number = strip.global_cell
        self.b, self.own = b, own
        self.from_behind, self.from_ahead = (
            np.flatnonzero(faces.behind < own),
            np.flatnonzero(faces.ahead < own),
        )
        rows_behind, rows_ahead = faces.behind[self.from_behind], faces.ahead[self.from_ahead]
        to_ahead, to_behind = faces.ahead[self.from_behind], faces.behind[self.from_ahead]
        i, j = np.divmod(np.arange(b * b), b)
        block_rows = (number[:own, None] * b + i).ravel()
        block_columns = (number[:own, None] * b + j).ravel()
        rows = [number[rows_behind] * b + k for k in range(b)] + [
            number[rows_ahead] * b + k for k in range(b)
        ]
        columns = [number[to_ahead] * b + k for k in range(b)] + [number[to_behind] * b + k for k in range(b)]
        self.matrix = PETSc.Mat().create(strip.comm)
        self.matrix.setSizes(((own * b, None), (own * b, None)))
        self.matrix.setType("aij")
        self.matrix.setPreallocationCOO(
            np.concatenate([*rows, block_rows]).astype(PETSc.IntType),
            np.concatenate([*columns, block_columns]).astype(PETSc.IntType),
        )
        self.count = b * (len(rows_behind) + len(rows_ahead))
        self.values = np.zeros(self.count + own * b * b)
        self._diagonal = self.matrix.createVecLeft() if b == 1 else None
        self._holds_fluxes = False
        self._diagonal_faces = (rows_behind, rows_ahead)

    def set_fluxes(self, operators: list[FluxOperator]) -> Floats:
        """Enter the face fluxes of one operator per unknown; returns what they add to the diagonal, (b, own) [m2/s]."""
        behind, ahead = self.from_behind, self.from_ahead
        diagonals = {}
        for op in operators:
            if id(op) not in diagonals:
                diagonal = np.bincount(self._diagonal_faces[0], op.a[behind], self.own)
                diagonal += np.bincount(self._diagonal_faces[1], op.b[ahead], self.own)
                for port in (*op.inlets.values(), *op.outlets.values()):
                    np.add.at(diagonal, port.cells, port.out)
                diagonals[id(op)] = diagonal
        self.values[: self.count] = np.concatenate(
            [-op.b[behind] for op in operators] + [-op.a[ahead] for op in operators]
        )
        self._holds_fluxes = False
        return np.stack([diagonals[id(op)] for op in operators])

    def assemble(self, blocks: Floats) -> None:
        """Set the diagonal blocks (own, b, b) and assemble; of one unknown per cell only the diagonal is entered anew."""
        if self._diagonal is not None and self._holds_fluxes:
            self._diagonal.array[:] = blocks.ravel()
            self.matrix.setDiagonal(self._diagonal)
            return
        self.values[self.count :] = blocks.ravel()
        self.matrix.setValuesCOO(self.values)
        self._holds_fluxes = True


class StepMatrix:
    """gas_volume/dt + fluxes for one species, with the solvers that go with it; `fill` as in KrylovSolver."""

    def __init__(self, strip: Strip, gas_volume: Floats, name: str, fill: int = 0):
        self.cells = CellMatrix(strip, 1)
        self.gas_volume, self.name, self.fill = gas_volume, name, fill
        self.key: tuple[int, float] | None = None
        self.krylov: KrylovSolver | None = None
        self.x, self.y = self.cells.matrix.createVecs()

    def update(self, operator: FluxOperator, dt: float) -> None:
        diagonal = self.cells.set_fluxes([operator])[0] + self.gas_volume / dt
        self.cells.assemble(diagonal)

    def multiply(self, values: Floats) -> Floats:
        self.x.array[:] = values
        self.cells.matrix.mult(self.x, self.y)
        return self.y.array.copy()

    def solve(self, rhs: Floats, guess: Floats, residual: float) -> Floats:
        """BiCGStab from `guess` until the residual norm is below `residual` [mol/m/s]."""
        if self.krylov is None:
            self.krylov = KrylovSolver(self.cells.matrix, self.name, 0.0, fill=self.fill)
            self.krylov.ksp.setTolerances(
                rtol=1e-13, atol=residual / np.sqrt(max(self.cells.matrix.size[0], 1))
            )
        self.y.array[:] = rhs
        self.x.array[:] = guess
        self.krylov.solve(self.y, self.x, guess=True)
        return self.x.array.copy()
