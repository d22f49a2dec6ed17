"""Flow and temperature of the steady state by Newton's method on both at once.

    Z^T (A + dN/du + M/tau) Z dpsi - g Z^T dw/dT dT = -Z^T (A u + N - f)
    d(div u h)/du Z dpsi + (L + V/tau) dT           = s - L h

Hot gas rises and cold gas sinks, and both take their temperature along: found one after the other the two need a hundred turns where the
gas of a strip turns over, or never meet. w is the weight of the gas, L h the flux of heat out of every cell (`mpm.transport.heat`), s what
comes in, tau a pseudo-time [s] that grows as the changes shrink. Viscosity, and the density that makes a velocity of a mass flux, are those
of the temperature before the step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.constants import GRAVITY
from mpm.mesh.strip import BOTTOM, RIGHT, TOP, Strip
from mpm.numerics.fem import PETSc
from mpm.numerics.linear import DirectSolver
from mpm.numerics.sparse import sparse_matrix
from mpm.transport.cell_matrix import CellMatrix
from mpm.transport.heat import Heat
from mpm.transport.heat_flux import HeatOperator
from mpm.transport.schemes import coefficient_slope

if TYPE_CHECKING:
    from mpm.flow.problem import FlowProblem
    from mpm.flow.space import FlowSpace
    from mpm.flow.state import GasState
    from mpm.motion.kinematics import StepMotion


class Overturning:
    """Newton's system of flow and heat in one strip."""

    def __init__(self, heat: Heat, strip: Strip):
        self.heat, self.strip = heat, strip
        self._cells = CellMatrix(strip, 1)

    def step(
        self,
        problem: FlowProblem,
        gas: GasState,
        motion: StepMotion,
        operator: HeatOperator,
        supply: Floats,
        tau: float,
    ) -> tuple[Floats, Floats]:
        """The changes of psi (own unknowns,) and of temperature (own cells,) [K] of one step; collective.

        `operator` holds the fluxes of heat in the flow of `problem`, `supply` (own,) what comes in [K m2/s]. Raises ConvergenceError.
        """
        own = self.strip.owned
        excess = self.heat.excess
        self._cells.assemble(self._cells.set_fluxes([operator.fluxes])[0])
        x, y = self._cells.matrix.createVecs()
        x.array[:] = excess
        self._cells.matrix.mult(x, y)
        right = supply - y.array
        self._cells.assemble(self._cells.set_fluxes([operator.fluxes])[0] + self.strip.volume[:own] / tau)
        parts = [
            [problem.jacobian(tau), self._lifted(problem, gas)],
            [self._carried(problem, operator), self._cells.matrix],
        ]
        whole = PETSc.Mat().createNest(parts, comm=self.strip.comm)
        matrix = whole.convert("aij", PETSc.Mat())
        solution, rhs = matrix.createVecs()
        imbalance = problem.imbalance(motion)
        rhs.array[:] = np.concatenate([-imbalance, right])
        solver = DirectSolver(matrix, "steady flow and heat")
        try:
            solver.solve(rhs, solution)
        finally:
            solver.destroy()
        return np.array(solution.array[: len(imbalance)]), np.array(solution.array[len(imbalance) :])

    def _lifted(self, problem: FlowProblem, gas: GasState) -> PETSc.Mat:
        """-g Z^T dw/dT: weight rests on the flux at the bottom and at the top of each cell, half on either."""
        space, strip, own = problem.space, self.strip, self.strip.owned
        rows, columns, values = [], [], []
        lighter = -gas.reference * gas.relative[:own] / gas.temperature[:own]  # d rho/dT
        for side in (BOTTOM, TOP):
            dofs = space.dofs[:own, side]
            rows.append(_numbers(space, dofs))
            columns.append(strip.global_cell[:own])
            values.append(GRAVITY * 0.5 * strip.volume[:own] / space.weights[dofs] * lighter)
        counts = problem.lighter(gas) is not None
        weight = sparse_matrix(strip.comm, space.own, own, (np.concatenate(rows), np.concatenate(columns)))
        weight.setValuesCOO(np.concatenate(values) * counts)
        return space.curl.transposeMatMult(weight)

    def _carried(self, problem: FlowProblem, operator: HeatOperator) -> PETSc.Mat:
        """d(div u h)/du Z: what a flux more through a facet takes out of the cell behind it and brings into the one ahead."""
        space, strip, own = problem.space, self.strip, self.strip.owned
        faces = strip.faces
        excess = strip.scatter.to_all(self.heat.excess)[strip.cell]
        scheme = self.heat.fluxes.case.transport.scheme
        slope = coefficient_slope(operator.velocity, operator.conductance, scheme)
        passed = (1.0 + slope) * excess[faces.behind] - slope * excess[faces.ahead]
        sides = np.where(faces.vertical_flow, TOP, RIGHT)
        dofs = space.dofs[faces.behind, sides]
        per_flux = passed * strip.face_length / space.weights[dofs]
        behind, ahead = np.flatnonzero(faces.behind < own), np.flatnonzero(faces.ahead < own)
        rows = [strip.global_cell[faces.behind[behind]], strip.global_cell[faces.ahead[ahead]]]
        columns = [_numbers(space, dofs[behind]), _numbers(space, dofs[ahead])]
        values = [per_flux[behind], -per_flux[ahead]]
        means = self.heat.fluxes.outlet_means(operator, self.heat.excess)
        for name, port in operator.fluxes.outlets.items():
            outlet = next(o for o in self.heat.fluxes.case.geometry.outlets if o.name == name)
            facet, sign = (TOP, 1.0) if outlet.side == "top" else (BOTTOM, -1.0)
            dofs = space.dofs[port.cells, facet]
            coming = means[name][0] if name in means else 0.0
            rows.append(strip.global_cell[port.cells])
            columns.append(_numbers(space, dofs))
            held = np.where(port.out > 0.0, excess[port.cells], coming)
            values.append(sign * held * strip.grid.dx / space.weights[dofs])
        matrix = sparse_matrix(strip.comm, own, space.own, (np.concatenate(rows), np.concatenate(columns)))
        matrix.setValuesCOO(np.concatenate(values))
        return matrix.matMult(space.curl)


def _numbers(space: FlowSpace, dofs: Ints) -> Ints:
    """Global numbers of local fluxes."""
    return np.asarray(space.fluxes.dofmap.index_map.local_to_global(dofs.astype(np.int32)), dtype=np.int64)
