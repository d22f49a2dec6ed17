"""PETSc matrices over the cells of the strip, filled from face fluxes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mpm.arrays import Floats
from mpm.mesh.strip import Strip
from mpm.numerics.sparse import sparse_matrix
from mpm.transport.fluxes import FluxOperator


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
    """A PETSc matrix over own cells with `unknowns` per cell: face fluxes off the diagonal, dense blocks on it."""

    def __init__(self, strip: Strip, unknowns: int):
        self.pattern = pattern = FacePattern(strip)
        number, own = strip.global_cell, strip.owned
        each = np.arange(unknowns)
        rows = (number[pattern.cells] * unknowns + each[:, None]).ravel()
        columns = (number[pattern.neighbours] * unknowns + each[:, None]).ravel()
        cell, i, j = np.indices((own, unknowns, unknowns)).reshape(3, -1)
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
        self._values[self._couplings :] = blocks.ravel()
        self.matrix.setValuesCOO(self._values)
        self._holds_fluxes = True
