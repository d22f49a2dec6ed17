"""The matrices A + M/dt of a flow and the factors of Z^T (A + M/dt) Z, one for each time step, made when first needed."""

from __future__ import annotations

from mpm.flow.forms import FlowForms
from mpm.flow.space import FlowSpace
from mpm.numerics.fem import PETSc
from mpm.numerics.linear import DirectSolver

STEADY = float("inf")  # s, the time step without inertia


class Factors:
    """Those of the `forms` on the fluxes of `space`; symmetric and positive definite where the gas has one density."""

    def __init__(self, forms: FlowForms, space: FlowSpace):
        self._forms, self._space = forms, space
        self._matrices: dict[float, PETSc.Mat] = {STEADY: forms.viscous}
        self._solvers: dict[float, DirectSolver] = {}

    def operator(self, dt: float) -> PETSc.Mat:
        """A + M/dt."""
        if dt not in self._matrices:
            matrix = self._matrices[dt] = self._forms.viscous.copy()
            matrix.axpy(1.0 / dt, self._forms.mass)
        return self._matrices[dt]

    def solver(self, dt: float) -> DirectSolver:
        """The factor of Z^T (A + M/dt) Z."""
        if dt not in self._solvers:
            reduced = self.operator(dt).ptap(self._space.curl)
            definite = self._space.density is None
            self._solvers[dt] = DirectSolver(reduced, f"flow (step of {dt:.3g} s)", definite)
        return self._solvers[dt]

    def release(self, kept: float | None = None) -> None:
        """Give the memory of all factors back but for that of one step; they are made anew when needed again. Collective."""
        for dt in [dt for dt in self._matrices if dt != STEADY]:
            self._matrices.pop(dt).destroy()
        for dt in [dt for dt in self._solvers if dt != kept]:
            self._solvers.pop(dt).destroy()
