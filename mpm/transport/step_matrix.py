"""The matrix of one time step of what spreads alike, storage/dt + fluxes, and its solver."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.mesh.strip import Strip
from mpm.numerics.box_matrix import ABOVE, AFTER, BEFORE, BELOW, NOWHERE, BoxMatrix, BoxSolver
from mpm.parallel import largest, total
from mpm.transport.fluxes import FluxOperator

FALL = 1e-13  # of a right-hand side, where that is not below what a step may leave before
FALL_HEATED = 3e-15  # of that in gas that expands, so that what is uniform there stays so to 1e-12: little more than rounding
LOOSE = 10.0  # times what is wanted: a residual over the diagonal, which is near that over the pivots, with which a solution is taken
CORRECTIONS = 4  # of what a residual still misses
KNOWN = 1024  # matrices of which the heaviest entry is remembered: far more than a cycle has
ROUNDING = 16.0 * np.finfo(float).eps  # of what a residual is the difference of
NEVER = -1  # version of no operator
TRACE = 1e-11  # of a right-hand side: what a step may leave of a species that is there in traces, which balance to 1e-9, too


class BoxFluxes:
    """Where the fluxes of operators on a strip are in a BoxMatrix."""

    def __init__(self, strip: Strip):
        faces, own = strip.faces, strip.owned
        across = ~faces.vertical_flow
        left, right = (AFTER, BEFORE) if strip.box.leftwards else (BEFORE, AFTER)
        numbers = np.arange(len(faces.behind))
        self._from_behind = (left, BELOW)  # the sides at which a cell takes what faces take from behind
        self._faces = np.full((4, own), NOWHERE)  # at each side of each cell
        for side, cell, between in (
            (left, faces.ahead, across),
            (right, faces.behind, across),
            (BELOW, faces.ahead, faces.vertical_flow),
            (ABOVE, faces.behind, faces.vertical_flow),
        ):
            mine = numbers[between & (cell < own)]
            self._faces[side, cell[mine]] = mine

    def enter(self, operator: FluxOperator, matrix: BoxMatrix) -> None:
        """Make the couplings of a matrix with one unknown, (4, own) [m2/s], those of an operator."""
        for side in range(4):
            taken = operator.from_behind if side in self._from_behind else operator.from_ahead
            matrix.couple(side, self._faces[side], taken)


class StepMatrix:
    """storage/dt + fluxes for what spreads alike, with the solver that goes with it.

    Stored are species, in the volume of the gas, unless `update` says otherwise. A solution leaves a sum of |residual| over all cells below
    `residual` [mol/m/s], or a residual over the diagonal below `fall` of that of the right-hand side, in the 2-norm; about.
    """

    def __init__(self, strip: Strip, name: str, residual: float, fall: float = FALL):
        self.strip, self.name = strip, name
        self.matrix = BoxMatrix(strip.box, 1)
        self.version = NEVER  # of the operator
        self._fluxes, self._dt = BoxFluxes(strip), 0.0
        self._residual, self._fall = residual / np.sqrt(max(strip.grid.cells, 1)), fall
        # largest entry of the diagonal, by version and step: those of a cycle come again
        self._heaviest: dict[tuple[int, float], float] = {}
        self._factorised = False

    @cached_property
    def _krylov(self) -> BoxSolver:
        return BoxSolver(self.matrix, self.name)

    @property
    def couplings(self) -> Floats:
        """Of the operator, (4, own) [m2/s]."""
        return np.asarray(self.matrix.couplings[0])

    @property
    def diagonal(self) -> Floats:
        """(own,) [m2/s], a view."""
        return self.matrix.blocks[:, 0, 0]

    def update(self, operator: FluxOperator, dt: float, storage: Floats | None = None) -> None:
        """Make it the matrix of `operator` over a step of `dt` [s], infinite for the steady one; collective.

        `storage` (own,) [m2] goes with the version of the operator; left out: the volume of the gas.
        """
        if (self.version, self._dt) == (operator.version, dt):
            return
        if self.version != operator.version:
            self._fluxes.enter(operator, self.matrix)
        held = self.strip.gas_volume[: self.strip.owned] if storage is None else storage
        self.diagonal[:] = operator.outflow + held / dt
        self.version, self._dt = operator.version, dt
        if (self.version, dt) not in self._heaviest:
            if len(self._heaviest) >= KNOWN:
                self._heaviest.clear()
            most = largest(self.strip.comm, [self.diagonal.max(initial=0.0)])[0]
            self._heaviest[self.version, dt] = float(most)
        self._factorised = False

    def multiply(self, values: Floats, result: Floats | None = None) -> Floats:
        """The product with own `values`, (own,), in `result` where there is one; collective."""
        made = np.empty(len(values)) if result is None else result
        self.matrix.multiply(values, made)
        return made

    def solve(self, rhs: Floats, guess: Floats) -> Floats:
        """From own values `guess` to the solution, (own,); collective. Raises ConvergenceError.

        The residual is looked at again in the end: what BiCGStab goes on from may have drifted away from it.
        """
        missing, size, left, _ = self._missing(guess, rhs)
        if size == 0.0:
            return np.zeros_like(rhs)
        if not self._factorised:
            self._krylov.factorise()
            self._factorised = True
        least = min(
            max(self._residual / self._heaviest[self.version, self._dt], self._fall * size), TRACE * size
        )
        found, enough = guess, least
        for _ in range(CORRECTIONS):
            if left <= enough:
                break
            found = found + self._krylov.solve(missing[None], 0.0, least)[0][0]
            missing, _, left, carried = self._missing(found, rhs)
            enough = max(LOOSE * least, ROUNDING * max(size, carried))
        if left <= enough:
            return found
        raise ConvergenceError(
            f"{self.name}: a residual of {left:.3g} stays, over the diagonal, of {size:.3g}"
        )

    def _missing(self, values: Floats, rhs: Floats) -> tuple[Floats, float, float, float]:
        """What `values` miss of `rhs`; 2-norms over the diagonal of `rhs`, of that, and of what the diagonal makes of them; collective."""
        missing, squares = self.matrix.miss(values, rhs)
        size, left, carried = np.sqrt(total(self.strip.comm, squares))
        return missing, float(size), float(left), float(carried)
