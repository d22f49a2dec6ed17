"""Gas flow: Darcy-Brinkman with convection in the frame of the vibrating reactor.

    div u = 0
    (rho/eps) (du/dt + u.grad(u/eps)) = -grad p + div(mu_e grad U) - (mu/K) (U - v_s) - rho a(t),   U = u + (1-eps) v_s

`u` is the superficial gas velocity relative to the mesh [m/s], `v_s` the bed's velocity relative to the mesh and `a` the mesh's
acceleration; gravity and the vertical acceleration are gradients and vanish into the pressure `p` [Pa]. `U`, the volume flux of gas and
solids together, is continuous across the faces of the moving bed and as free of divergence as u: gas at the surface of the bed moves with
v_s, pore gas is carried at eps v_s. Gas layers have eps = 1, 1/K = 0 and U = u. Walls are no-slip, ports prescribe the normal velocity,
outlets have p = 0 and no tangential velocity gradient. Where a bed passes the closed ends of a strip, u = 0 there and U = (1-eps) v_s.

Discretisation: Raviart-Thomas of lowest order on quadrilaterals with piecewise constant pressure. The flux through every facet is one
unknown and div u vanishes exactly in every cell: the marker-and-cell scheme, written as forms. Convection is explicit, so one factor
serves all steps. The unknowns are those of `mpm.flow.space`, the terms of the equation the functions of `mpm.flow.terms`; this module
assembles and solves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import ufl
from numpy.typing import NDArray
from ufl import Form, dx

from mpm.flow.fields import FlowField
from mpm.flow.space import CLOSED, FlowSpace
from mpm.flow.terms import (
    Medium,
    bed_entrainment,
    convection,
    drag,
    frame_acceleration,
    inertia,
    pressure_and_continuity,
    viscosity,
)
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import StepMotion
from mpm.numerics.fem import PETSc, dolfinx
from mpm.numerics.linear import DirectSolver, check
from mpm.parallel import largest

if TYPE_CHECKING:
    from mpm.case.case import Case

Floats = NDArray[np.float64]


class FlowProblem:
    """Assembled flow operators of a case; advances or balances the mixed vector (u, p), its `state`.

    One factor belongs to the time step `dt` [s] (backward Euler), one to the steady operator; each is made when first needed. Steps of a
    `refined` problem are the same to 1e-12 at every run on as many ranks.
    """

    def __init__(self, case: Case, strip: Strip, dt: float, refined: bool = False):
        self.case, self.strip, self.dt, self.refined = case, strip, float(dt), refined
        self.space = FlowSpace(case, strip)
        self.medium = Medium.from_case(case, strip)
        self.state = dolfinx.fem.Function(self.space.mixed, name="flow")
        self._assemble()
        self._solvers: dict[str, DirectSolver] = {}
        self._jacobian: dolfinx.fem.Form | None = None

    def _assemble(self) -> None:
        (u, p), (v, q) = ufl.TrialFunctions(self.space.mixed), ufl.TestFunctions(self.space.mixed)
        m, mesh = self.medium, self.strip.mesh
        closed = ufl.Measure("ds", domain=mesh, subdomain_data=self.space.facets)(CLOSED)
        stokes = viscosity(u, v, m, closed) + drag(u, v, m) + pressure_and_continuity(u, p, v, q)
        if (
            not self.case.geometry.outlets
        ):  # the pressure's level is free: let cell 0 leak p, which pins it at 0 there
            level = dolfinx.fem.Function(m.porosity.function_space)
            first = np.flatnonzero(self.strip.cell == 0)
            level.x.array[level.function_space.dofmap.list[first, 0]] = 1.0
            stokes += -level * p * q * dx
        self.steady_matrix = _matrix(stokes)
        self.mass_matrix = _matrix(inertia(u, v, m) + dolfinx.fem.Constant(mesh, 0.0) * p * q * dx)
        solids = self.space.along_x(m.moving_solid)  # their volume flux per unit velocity of the bed
        self.entrainment = _vector(bed_entrainment(ufl.split(solids)[0], v, m, closed))
        self.acceleration = _vector(frame_acceleration(v, m))
        velocity, _ = ufl.split(self.state)
        self.convection_share = dolfinx.fem.Constant(mesh, 1.0)  # below 1 on the way to a fast flow
        convective = self.convection_share * convection(velocity, v, m)
        self._convection = dolfinx.fem.form(convective)
        self._jacobian_form = stokes + ufl.derivative(convective, self.state)
        self._force = _vector(self._convection)
        self._rhs, self._work, self._fix = (self.steady_matrix.createVecLeft() for _ in range(3))

    def release(self) -> None:
        """Give the factors' memory back; they are made anew when needed again. Collective."""
        for solver in self._solvers.values():
            solver.destroy()
        self._solvers.clear()

    def _solver(self, kind: str) -> DirectSolver:
        if kind not in self._solvers:
            matrix = self.steady_matrix.copy()
            if kind == "step":
                matrix.axpy(
                    1.0 / self.dt, self.mass_matrix, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
                )
            matrix.zeroRowsColumns(self.space.own_fixed + matrix.getOwnershipRange()[0], 1.0)
            self._solvers[kind] = DirectSolver(matrix, f"flow ({kind})", symmetric=True, refined=self.refined)
        return self._solvers[kind]

    # --- solving ---

    def convective_force(self) -> PETSc.Vec:
        """N(u) of the present state; the same vector at every call."""
        force = self._force
        with force.localForm() as local:
            local.set(0.0)
        dolfinx.fem.petsc.assemble_vector(force, self._convection)
        force.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return force

    def step(self, motion: StepMotion, convective: PETSc.Vec | None = None) -> None:
        """Advance the state by one backward Euler step under the step's mean forcing; convection is taken at the old state."""
        convective = convective if convective is not None else self.convective_force()
        self.mass_matrix.mult(self.state.x.petsc_vec, self._rhs)
        self._rhs.scale(1.0 / self.dt)
        self._solve("step", motion, convective)

    def solve_steady(self, motion: StepMotion, convective: PETSc.Vec) -> None:
        """Set the state to the steady solution under `motion` with a given convective force."""
        self._rhs.set(0.0)
        self._solve("steady", motion, convective)

    def _solve(self, kind: str, motion: StepMotion, convective: PETSc.Vec) -> None:
        solver = self._solver(kind)
        rhs = self._rhs
        rhs.axpy(motion.bed_velocity, self.entrainment)
        rhs.axpy(motion.acceleration, self.acceleration)
        rhs.axpy(-1.0, convective)
        self._prescribe(rhs, kind, motion.frame_velocity_y)
        solver.solve(rhs, self._work)
        self._adopt(self._work)

    def steady_residual(self, motion: StepMotion, convective: PETSc.Vec | None = None) -> PETSc.Vec:
        """K x + N - f of the steady equations at the present state; the same vector at every call.

        N is the convective force of the state unless another one is given, as the mean of a cycle is.
        """
        residual = self._work
        self.steady_matrix.mult(self.state.x.petsc_vec, residual)
        residual.axpy(1.0, self.convective_force() if convective is None else convective)
        residual.axpy(-motion.bed_velocity, self.entrainment)
        residual.axpy(-motion.acceleration, self.acceleration)
        residual.array[self.space.own_fixed] = 0.0
        return residual

    def newton_update(self, residual: PETSc.Vec, exact: bool = False) -> float:
        """Subtract J^-1 residual from the state; returns the largest change of a velocity over the largest velocity.

        J includes the derivative of the convection. Its system is solved by GMRES with the factor of the steady operator as
        preconditioner, to 1e-4 of the residual; `exact` makes a factor of J itself. Raises ConvergenceError.
        """
        if self._jacobian is None:
            self._jacobian = dolfinx.fem.form(self._jacobian_form)
        # the convection's derivative couples the same facets: copying the pattern spares building it, the peak of memory
        matrix = self.steady_matrix.duplicate()
        dolfinx.fem.petsc.assemble_matrix(matrix, self._jacobian)
        matrix.assemble()
        matrix.zeroRowsColumns(self.space.own_fixed + matrix.getOwnershipRange()[0], 1.0)
        if exact:
            solver = DirectSolver(matrix, "flow (Newton)")
            solver.solve(residual, self._fix)
            solver.destroy()
        else:
            self._precondition(matrix, residual)
            matrix.destroy()
        self.state.x.array[: self.space.own] -= self._fix.array
        self.state.x.scatter_forward()
        change, fastest = largest(
            self.strip.comm, [self.space.fastest(values) for values in (self._fix.array, self.state.x.array)]
        )
        return float(change / fastest) if fastest > 0.0 else 0.0

    def _precondition(self, matrix: PETSc.Mat, residual: PETSc.Vec) -> None:
        """Solve matrix x = residual into `_fix` with the factor of the steady operator."""
        stokes = self._solver("steady")
        ksp = PETSc.KSP().create(matrix.comm)
        # on the right, which fgmres is too; but gmres keeps half the vectors, and this preconditioner does not change
        ksp.setType("gmres")
        ksp.setPCSide(PETSc.PC.Side.RIGHT)
        ksp.setTolerances(rtol=1e-4, atol=0.0, max_it=200)
        ksp.setPC(stokes.ksp.getPC())
        ksp.setOperators(matrix, stokes.matrix)
        ksp.setGMRESRestart(30)
        try:
            ksp.solve(residual, self._fix)
            check(ksp, "flow (Newton)")
        finally:
            stokes.ksp.setOperators(stokes.matrix)
            ksp.destroy()

    def _prescribe(self, rhs: PETSc.Vec, kind: str, frame_velocity_y: float) -> None:
        """Move the prescribed unknowns to the right-hand side."""
        values = self.space.prescribed(frame_velocity_y)
        self._fix.set(0.0)
        self._fix.array[self.space.own_fixed] = values
        lifted = rhs.duplicate()
        self.steady_matrix.mult(self._fix, lifted)
        rhs.axpy(-1.0, lifted)
        if kind == "step":
            self.mass_matrix.mult(self._fix, lifted)
            rhs.axpy(-1.0 / self.dt, lifted)
        lifted.destroy()
        rhs.array[self.space.own_fixed] = values

    def _adopt(self, values: PETSc.Vec) -> None:
        self.state.x.array[: self.space.own] = values.array
        self.state.x.scatter_forward()

    # --- looking at the state ---

    @property
    def values(self) -> Floats:
        """The state's unknowns, those of neighbouring ranks included: the array itself, to be read and written."""
        return np.asarray(self.state.x.array)

    def field(self) -> FlowField:
        """The present state as a velocity field; a copy."""
        return self.field_of(self.values)

    def field_of(self, values: Floats) -> FlowField:
        """A copy of `values`, made earlier, as a velocity field."""
        return FlowField(self.space.velocities(values), self.space.pressure(values).copy())

    def start_from(self, field: FlowField) -> None:
        """Make `field` the present state."""
        self.space.fill(self.values, field.velocities, field.pressure)


def _matrix(form: Form) -> PETSc.Mat:
    matrix = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(form))
    matrix.assemble()
    return matrix


def _vector(form: Form) -> PETSc.Vec:
    vector = dolfinx.fem.petsc.assemble_vector(dolfinx.fem.form(form))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector
