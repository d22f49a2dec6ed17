"""Linear solvers that are built once, reused, and never fail silently."""

from __future__ import annotations

from mpm.errors import ConvergenceError
from mpm.fem import PETSc

REASONS = {
    value: name
    for name, value in vars(PETSc.KSP.ConvergedReason).items()
    if not name.startswith("_") and isinstance(value, int)
}


METIS = 5  # MUMPS: nested dissection; its own choice needs 1.8 times the memory here
SPARE = 20  # MUMPS: per cent of spare workspace, because the saddle point pivots a lot


class DirectSolver:
    """A sparse factor (MUMPS), made at the first solve and kept; a solve after the matrix has changed makes it anew.

    `symmetric` matrices, definite or not, get L D L^T: half the memory of LU.
    """

    def __init__(self, matrix: PETSc.Mat, name: str, symmetric: bool = False):
        self.name, self.matrix = name, matrix
        self.ksp = PETSc.KSP().create(matrix.comm)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, symmetric)
        self.ksp.setOperators(matrix)
        self.ksp.setType("preonly")
        pc = self.ksp.getPC()
        pc.setType("cholesky" if symmetric else "lu")
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        factor.setMumpsIcntl(7, METIS)
        factor.setMumpsIcntl(14, SPARE)

    def solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve for one right-hand side. Raises ConvergenceError when the factor or the solution is not usable."""
        self.ksp.solve(rhs, solution)
        check(self.ksp, self.name)

    def destroy(self) -> None:
        """Free the matrix and its factor; collective."""
        self.ksp.destroy()
        self.matrix.destroy()


class KrylovSolver:
    """BiCGStab with incomplete LU on each rank; the right choice for advection-diffusion-reaction with small steps."""

    def __init__(self, matrix: PETSc.Mat, name: str, tolerance: float, iterations: int = 200):
        self.name = name
        self.ksp = PETSc.KSP().create(matrix.comm)
        self.ksp.setOperators(matrix)
        self.ksp.setType("bcgs")
        self.ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=iterations)
        pc = self.ksp.getPC()
        if matrix.comm.size == 1:
            pc.setType("ilu")
        else:
            pc.setType("bjacobi")  # its default block solver is ILU(0)

    def solve(
        self, rhs: PETSc.Vec, solution: PETSc.Vec, tolerance: float | None = None, guess: bool = False
    ) -> int:
        """Solve to the relative `tolerance`; returns the number of iterations. Raises ConvergenceError."""
        if tolerance is not None:
            self.ksp.rtol = tolerance
        self.ksp.setInitialGuessNonzero(guess)
        self.ksp.solve(rhs, solution)
        check(self.ksp, self.name)
        return int(self.ksp.getIterationNumber())


def check(ksp: PETSc.KSP, name: str) -> None:
    """Raise ConvergenceError unless `ksp` has converged."""
    reason = ksp.getConvergedReason()
    if reason < 0:
        raise ConvergenceError(
            f"{name}: the linear solver stopped with {REASONS.get(reason, reason)} after "
            f"{ksp.getIterationNumber()} iterations at residual {ksp.getResidualNorm():.3g}"
        )
