"""Linear solvers that are built once, reused, and never fail silently."""

from __future__ import annotations

from mpm.errors import ConvergenceError
from mpm.fem import PETSc

REASONS = {
    value: name
    for name, value in vars(PETSc.KSP.ConvergedReason).items()
    if not name.startswith("_") and isinstance(value, int)
}


class DirectSolver:
    """A sparse LU factor (MUMPS), made at the first solve and kept; call `refactor` after the matrix has changed."""

    def __init__(self, matrix: PETSc.Mat, name: str):
        self.name, self.matrix = name, matrix
        self.ksp = PETSc.KSP().create(matrix.comm)
        self.ksp.setOperators(matrix)
        self.ksp.setType("preonly")
        pc = self.ksp.getPC()
        pc.setType("lu")
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setMumpsIcntl(
            14, 60
        )  # per cent of spare workspace: the saddle point pivots a lot

    def solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve for one right-hand side. Raises ConvergenceError when the factor or the solution is not usable."""
        self.ksp.solve(rhs, solution)
        check(self.ksp, self.name)

    def refactor(self) -> None:
        self.ksp.setOperators(self.matrix)


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
