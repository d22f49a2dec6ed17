"""Linear solvers that are built once, reused, and never fail silently."""

from __future__ import annotations

from mpm.errors import ConvergenceError
from mpm.numerics.fem import PETSc

REASONS = {
    value: name
    for name, value in vars(PETSc.KSP.ConvergedReason).items()
    if not name.startswith("_") and isinstance(value, int)
}
# MUMPS: minimum degree and nested dissection. On 49,731 cells a factor takes 0.27 instead of 0.44 s with the first, and two ranks share its
# solves better (flow: 16 and 10 ms on one and two, else 14.5 and 12); on a million it takes a quarter more of time and memory
AMD, METIS = 0, 5
FEW = 200_000  # unknowns, below which it is the first
# MUMPS: no ScaLAPACK for the last front, which is small in two dimensions: 8 % less memory, as fast
SEQUENTIAL_ROOT = 1
# MUMPS: per cent of spare workspace, tried in turn: pivoting can need more than was foreseen
SPARE = (5, 20, 100, 500)
SINGLE = "single_"  # prefix of PETSc's options, which alone tell of a factor in single precision
REFINED = 1e-10  # residual over the right-hand side to which FGMRES refines what such a factor gives
REFINEMENTS = 30  # iterations it may take
ITERATIONS = 200  # of a Krylov solver, before it counts as failed, from each start
FACTOR_FAILED = PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED


class DirectSolver:
    """A sparse factor (MUMPS), made at the first solve and kept; a solve after the matrix has changed makes it anew.

    Symmetric positive `definite` matrices get L L^T: half the memory of LU. A factor in `single` precision takes little more than half of
    that again; FGMRES makes up for it in 3 to 5 iterations (GMRES would not: what rounding does to a solve is not linear), and where it
    does not, a factor in double precision takes its place. On several ranks MUMPS never adds up in the same order twice.
    """

    def __init__(self, matrix: PETSc.Mat, name: str, definite: bool = False, single: bool = False):
        self.name, self.matrix, self.definite, self.single = name, matrix, definite, single
        if definite:
            matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._spare = 0
        self._set_up()

    def _set_up(self) -> None:
        self.ksp = PETSc.KSP().create(self.matrix.comm)
        self.ksp.setOperators(self.matrix)
        self.ksp.setType("fgmres" if self.single else "preonly")
        pc = self.ksp.getPC()
        if self.single:
            self.ksp.setTolerances(rtol=REFINED, atol=0.0, max_it=REFINEMENTS)
            pc.setOptionsPrefix(SINGLE)
            PETSc.Options()[f"{SINGLE}pc_precision"] = "single"
        pc.setType("cholesky" if self.definite else "lu")
        pc.setFactorSolverType("mumps")
        if self.single:
            pc.setFromOptions()
        try:
            pc.setFactorSetUpSolverType()
        except PETSc.Error:  # MUMPS was built without single precision
            if not self.single:
                raise
            self.single = False
            self.ksp.destroy()
            self._set_up()
            return
        factor = pc.getFactorMatrix()
        factor.setMumpsIcntl(7, AMD if self.matrix.getSize()[0] < FEW else METIS)
        factor.setMumpsIcntl(13, SEQUENTIAL_ROOT)
        factor.setMumpsIcntl(14, SPARE[self._spare])

    def solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve for one right-hand side. Raises ConvergenceError when the factor or the solution is not usable.

        One in single precision that does not serve is made again in double, one for which the workspace was too small with more.
        """
        self.ksp.solve(rhs, solution)
        while self.ksp.getConvergedReason() < 0 and self._better():
            self.ksp.destroy()
            self._set_up()
            self.ksp.solve(rhs, solution)
        check(self.ksp, self.name)

    def _better(self) -> bool:
        """Whether a better factor than the one that failed is left to be tried, which is then the one to be made."""
        if self.single:
            self.single = False
            return True
        short = self.ksp.getConvergedReason() == FACTOR_FAILED and self._spare + 1 < len(SPARE)
        self._spare += int(short)
        return short

    def destroy(self) -> None:
        """Free the matrix and its factor; collective."""
        self.ksp.destroy()
        self.matrix.destroy()


def check(ksp: PETSc.KSP, name: str) -> None:
    """Raise ConvergenceError unless `ksp` has converged."""
    reason = ksp.getConvergedReason()
    if reason < 0:
        raise ConvergenceError(
            f"{name}: the linear solver stopped with {REASONS.get(reason, reason)} after "
            f"{ksp.getIterationNumber()} iterations at residual {ksp.getResidualNorm():.3g}"
        )
