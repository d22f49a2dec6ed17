"""The flow equations linearised about a flow: what Newton's method and the decay of small changes need.

    J psi = Z^T (A + dN/du + M/dt) Z psi

A is the matrix of viscosity and drag, M that of inertia, N the convection (`mpm.flow.problem`). Convection is small beside viscosity in
most of a reactor, so that a factor of Z^T (A + M/dt) Z is a good preconditioner: about ten iterations to 1e-4.
"""

from __future__ import annotations

from mpm.arrays import Floats
from mpm.flow.convection import Convection
from mpm.flow.space import FlowSpace
from mpm.numerics.fem import PETSc
from mpm.numerics.linear import ITERATIONS, DirectSolver, check
from mpm.numerics.sparse import sparse_matrix


class Jacobian:
    """J about the fluxes `values` (local fluxes,), with `creeping` = A + M/dt and a `share` of the convection; `mult` is for PETSc."""

    def __init__(
        self, space: FlowSpace, creeping: PETSc.Mat, convection: Convection, values: Floats, share: float
    ):
        self.space, self.creeping, self.share = space, creeping, share
        self.slope = convection.slopes(values)
        self._change, self._force = space.function(), creeping.createVecLeft()

    def mult(self, _: PETSc.Mat, psi: PETSc.Vec, result: PETSc.Vec) -> None:
        """result = J psi."""
        change, force = self._change, self._force
        self.space.curl.mult(psi, change.x.petsc_vec)
        change.x.scatter_forward()
        self.creeping.mult(change.x.petsc_vec, force)
        slope = self.slope(change.x.array)
        force.array[:] += self.share * slope.array[: self.space.own]
        self.space.curl.multTranspose(force, result)

    def solve(self, factor: DirectSolver, rhs: PETSc.Vec, psi: PETSc.Vec, tolerance: float) -> None:
        """Solve J psi = rhs by GMRES, on the right preconditioned with the `factor` of Z^T (A + M/dt) Z. Raises ConvergenceError."""
        comm = factor.matrix.comm
        matrix = PETSc.Mat().createPython(factor.matrix.getSizes(), self, comm)
        ksp = PETSc.KSP().create(comm)
        ksp.setType("gmres")
        ksp.setPCSide(PETSc.PC.Side.RIGHT)
        ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=ITERATIONS)
        ksp.setPC(factor.ksp.getPC())
        ksp.setOperators(matrix, factor.matrix)
        try:
            ksp.solve(rhs, psi)
            check(ksp, "flow (Newton)")
        finally:
            factor.ksp.setOperators(factor.matrix)
            ksp.destroy()
            matrix.destroy()


def assembled_jacobian(
    space: FlowSpace, creeping: PETSc.Mat, convection: Convection, values: Floats, share: float
) -> PETSc.Mat:
    """Z^T (A + dN/du) Z about the fluxes `values` as a matrix, with `creeping` = A and a `share` of the convection."""
    rows, columns, entries = convection.slope_matrix(values)
    whole = sparse_matrix(space.strip.comm, space.own, space.own, (rows, columns))
    whole.setValuesCOO(share * entries)
    whole.axpy(1.0, creeping)
    return whole.ptap(space.curl)
