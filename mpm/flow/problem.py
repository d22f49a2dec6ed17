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
serves all steps. The terms of the equation are the functions of `mpm.flow.terms`; this module assembles and solves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import basix.ufl
import numpy as np
import ufl
from numpy.typing import NDArray
from ufl import Form, dx

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
from mpm.mesh.strip import BOTTOM, LEFT, RIGHT, TOP, Strip
from mpm.motion.kinematics import StepMotion
from mpm.numerics.fem import PETSc, dolfinx
from mpm.numerics.linear import DirectSolver, check
from mpm.parallel import largest, total

if TYPE_CHECKING:
    from mpm.case.case import Case, Inlet
    from mpm.mesh.grid import Grid

Floats = NDArray[np.float64]
CLOSED, OPEN = 1, 2  # facet markers: walls and inlets, outlets


@dataclass(frozen=True, eq=False)
class FaceFlow:
    """Velocities normal to faces, positive along the axes [m/s]: `inner` in the order of `strip.faces`, `bottom` and `top` in that of
    `strip.wall_cells`."""

    inner: Floats
    bottom: Floats
    top: Floats


class FlowProblem:
    """Assembled flow operators of a case; advances or balances the mixed vector (u, p).

    One factor belongs to the time step `dt` [s] (backward Euler), one to the steady operator; each is made when first needed. Steps of a
    `refined` problem are the same to 1e-12 at every run on as many ranks.
    """

    def __init__(self, case: Case, strip: Strip, dt: float, refined: bool = False):
        self.case, self.strip, self.dt, self.refined = case, strip, float(dt), refined
        mesh = strip.mesh
        element = basix.ufl.mixed_element(
            [basix.ufl.element("RTCF", "quadrilateral", 1), basix.ufl.element("DQ", "quadrilateral", 0)]
        )
        self.space = dolfinx.fem.functionspace(mesh, element)
        self.medium = Medium.from_case(case, strip)
        self.state = dolfinx.fem.Function(self.space, name="flow")
        self._weights = self._facet_weights()
        self.inflow, self.frame_inflow = self._port_values()
        self._assemble()
        self._solvers: dict[str, DirectSolver] = {}
        self._jacobian = None

    # --- set-up ---

    def _facet_weights(self) -> Floats:
        """Unknown of a facet per unit velocity along the axes (its length, with the sign of the element's orientation)."""
        velocity_space, to_mixed = self.space.sub(0).collapse()
        ones = dolfinx.fem.Function(velocity_space)
        ones.interpolate(lambda x: np.ones((2, x.shape[1])))
        weights = np.ones(len(self.state.x.array))
        weights[to_mixed] = ones.x.array
        dofs = self.space.dofmap.list
        self._facet_dofs, self._pressure_dofs = dofs[:, :4], dofs[:, 4]
        return weights

    def _moving_solids(self) -> dolfinx.fem.Function:
        """(1 - eps) along x in the moving layer: the volume flux of the solids per unit bed velocity, as a mixed vector."""
        solids = dolfinx.fem.Function(self.space, name="solids")
        share = self.medium.moving_solid
        inside = np.flatnonzero(share.x.array[share.function_space.dofmap.list[:, 0]] > 0.0)
        values = share.x.array[share.function_space.dofmap.list[inside, 0]]
        for side in (LEFT, RIGHT):
            dofs = self._facet_dofs[inside, side]
            solids.x.array[dofs] = self._weights[dofs] * values
        solids.x.scatter_forward()
        return solids

    def _port_values(self) -> tuple[Floats, Floats]:
        """Prescribed normal velocities (as unknowns): of the inlets at rest, and per unit vertical velocity of the frame.

        Inlets that stay in the lab's frame see the mesh move past: their velocity relative to it is v - V_y.
        """
        steady, per_frame = np.zeros(len(self._weights)), np.zeros(len(self._weights))
        lab = self.case.motion.inlet_frame == "lab"
        for inlet in self.case.geometry.inlets:
            cells = self.strip.wall_cells(inlet.side)
            bottom = inlet.side == "bottom"
            share = self.strip.grid.overlap(inlet)[self.strip.column[cells]] / self.strip.grid.dx
            dofs = self._facet_dofs[cells, BOTTOM if bottom else TOP]
            steady[dofs] += self._weights[dofs] * share * inlet.velocity * (1.0 if bottom else -1.0)
            if lab:
                per_frame[dofs] -= self._weights[dofs] * share
        return steady, per_frame

    def _markers(self) -> tuple[dolfinx.mesh.MeshTags, NDArray[np.int32]]:
        """Facets marked closed or open, and the unknowns that are prescribed."""
        strip, open_facets = self.strip, []
        for outlet in self.case.geometry.outlets:
            cells = strip.wall_cells(outlet.side)
            opening = strip.grid.opening(outlet)[strip.column[cells]]
            open_facets.append(strip.wall_facets(outlet.side)[opening])
        opened = np.concatenate(open_facets) if open_facets else np.empty(0, np.int64)
        boundary = np.concatenate([strip.wall_facets("bottom"), strip.wall_facets("top"), strip.end_facets()])
        closed = np.setdiff1d(boundary, opened)
        facets = np.concatenate([closed, opened])
        values = np.concatenate([np.full(len(closed), CLOSED), np.full(len(opened), OPEN)])
        order = np.argsort(facets)
        tags = dolfinx.mesh.meshtags(
            strip.mesh, 1, facets[order].astype(np.int32), values[order].astype(np.int32)
        )
        is_closed = np.zeros(int(strip.facets.max(initial=-1)) + 1, dtype=bool)
        is_closed[closed] = True
        own = strip.facets[: strip.owned]
        dofs = np.unique(self._facet_dofs[: strip.owned][is_closed[own]])
        return tags, dofs.astype(np.int32)

    def _assemble(self) -> None:
        (u, p), (v, q) = ufl.TrialFunctions(self.space), ufl.TestFunctions(self.space)
        m = self.medium
        tags, self._fixed = self._markers()
        closed = ufl.Measure("ds", domain=self.strip.mesh, subdomain_data=tags)(CLOSED)
        stokes = viscosity(u, v, m, closed) + drag(u, v, m) + pressure_and_continuity(u, p, v, q)
        if (
            not self.case.geometry.outlets
        ):  # the pressure's level is free: let cell 0 leak p, which pins it at 0 there
            level = dolfinx.fem.Function(m.porosity.function_space)
            first = np.flatnonzero(self.strip.cell == 0)
            level.x.array[level.function_space.dofmap.list[first, 0]] = 1.0
            stokes += -level * p * q * dx
        self.steady_matrix = _matrix(stokes)
        self.mass_matrix = _matrix(inertia(u, v, m) + dolfinx.fem.Constant(self.strip.mesh, 0.0) * p * q * dx)
        self.entrainment = _vector(bed_entrainment(ufl.split(self._moving_solids())[0], v, m, closed))
        self.acceleration = _vector(frame_acceleration(v, m))
        velocity, _ = ufl.split(self.state)
        self.convection_share = dolfinx.fem.Constant(
            self.strip.mesh, 1.0
        )  # below 1 on the way to a fast flow
        self._convection_form = self.convection_share * convection(velocity, v, m)
        self._convection = dolfinx.fem.form(self._convection_form)
        self._jacobian_form = stokes + ufl.derivative(self._convection_form, self.state)
        self._force = _vector(self._convection)
        self.vector = self.state.x.petsc_vec
        self._rhs, self._work, self._fix = (self.steady_matrix.createVecLeft() for _ in range(3))
        own = self.space.dofmap.index_map.size_local
        self._own = own
        self._own_fixed = self._fixed[self._fixed < own]
        faces = np.unique(self._facet_dofs)
        self._own_faces = faces[faces < own]

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
            matrix.zeroRowsColumns(self._own_fixed + matrix.getOwnershipRange()[0], 1.0)
            self._solvers[kind] = DirectSolver(matrix, f"flow ({kind})", symmetric=True, refined=self.refined)
        return self._solvers[kind]

    # --- solving ---

    def ports(self, frame_velocity_y: float) -> Floats:
        """Prescribed values of the inlet unknowns while the frame moves upwards at `frame_velocity_y` [m/s]."""
        return self.inflow + frame_velocity_y * self.frame_inflow

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
        self.mass_matrix.mult(self.vector, self._rhs)
        self._rhs.scale(1.0 / self.dt)
        self._balance("step", motion, convective)

    def settle(self, motion: StepMotion, convective: PETSc.Vec) -> None:
        """Set the state to the steady solution under `motion` with a given convective force."""
        self._rhs.set(0.0)
        self._balance("steady", motion, convective)

    def _balance(self, kind: str, motion: StepMotion, convective: PETSc.Vec) -> None:
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
        self.steady_matrix.mult(self.vector, residual)
        residual.axpy(1.0, self.convective_force() if convective is None else convective)
        residual.axpy(-motion.bed_velocity, self.entrainment)
        residual.axpy(-motion.acceleration, self.acceleration)
        residual.array[self._own_fixed] = 0.0
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
        matrix.zeroRowsColumns(self._own_fixed + matrix.getOwnershipRange()[0], 1.0)
        if exact:
            solver = DirectSolver(matrix, "flow (Newton)")
            solver.solve(residual, self._fix)
            solver.destroy()
        else:
            self._precondition(matrix, residual)
            matrix.destroy()
        self.state.x.array[: self._own] -= self._fix.array
        self.state.x.scatter_forward()
        faces, weights = self._own_faces, self._weights[self._own_faces]
        change, fastest = largest(
            self.strip.comm,
            [
                np.abs(values[faces] / weights).max(initial=0.0)
                for values in (self._fix.array, self.state.x.array)
            ],
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
        values = self.ports(frame_velocity_y)[: self._own][self._own_fixed]
        self._fix.set(0.0)
        self._fix.array[self._own_fixed] = values
        lifted = rhs.duplicate()
        self.steady_matrix.mult(self._fix, lifted)
        rhs.axpy(-1.0, lifted)
        if kind == "step":
            self.mass_matrix.mult(self._fix, lifted)
            rhs.axpy(-1.0 / self.dt, lifted)
        lifted.destroy()
        rhs.array[self._own_fixed] = values

    def _adopt(self, values: PETSc.Vec) -> None:
        self.state.x.array[: self._own] = values.array
        self.state.x.scatter_forward()

    # --- looking at the state ---

    def velocities(self, state: Floats | None = None) -> Floats:
        """Velocities along the axes at the bottom, left, right and top facet of every local cell, (4, cells) [m/s].

        Of the present state, or of a copy of its array made earlier.
        """
        dofs = self._facet_dofs
        values = self.state.x.array if state is None else state
        return np.ascontiguousarray((values[dofs] / self._weights[dofs]).T)

    def pressure(self) -> Floats:
        """Pressure in every local cell [Pa]."""
        return self.state.x.array[self._pressure_dofs]

    def set_state(self, velocities: Floats, pressure: Floats) -> None:
        """Inverse of `velocities` and `pressure`."""
        dofs = self._facet_dofs
        self.state.x.array[dofs] = velocities.T * self._weights[dofs]
        self.state.x.array[self._pressure_dofs] = pressure

    def divergence(self) -> float:
        """Largest |div u| of any cell, as the net flux out of it over the whole inflow (or the largest face flux without one)."""
        u = self.velocities()[:, : self.strip.owned]
        height, dx = self.strip.height[: self.strip.owned], self.strip.grid.dx
        net = (u[RIGHT] - u[LEFT]) * height + (u[TOP] - u[BOTTOM]) * dx
        flux = np.abs(np.concatenate([u[RIGHT] * height, u[TOP] * dx])).max(initial=0.0)
        worst, scale = largest(self.strip.comm, [np.abs(net).max(initial=0.0), flux])
        inflow = sum(abs(i.velocity) * i.width for i in self.case.geometry.inlets) or scale
        return float(worst / inflow) if inflow else 0.0


def face_flow(strip: Strip, velocities: Floats) -> FaceFlow:
    """Face velocities of `velocities` (4, cells) as the transport needs them."""
    faces = strip.faces
    sides = np.where(faces.vertical_flow, TOP, RIGHT)
    bottom, top = strip.wall_cells("bottom"), strip.wall_cells("top")
    return FaceFlow(velocities[sides, faces.behind], velocities[BOTTOM, bottom], velocities[TOP, top])


def inlet_share(case: Case, grid: Grid, inlet: Inlet) -> Floats:
    """Share of the flow through each column's wall facet that belongs to `inlet` (columns,); inlets may meet on a facet.

    By the flows prescribed there; by covered lengths where none is (a port at rest in the lab's frame passes what the frame pumps).
    """
    there = [i for i in case.geometry.inlets if i.side == inlet.side]
    length, lengths = grid.overlap(inlet), sum(grid.overlap(i) for i in there)
    flow, flows = length * inlet.velocity, sum(grid.overlap(i) * i.velocity for i in there)
    by_length = np.divide(length, lengths, out=np.zeros_like(length), where=lengths > 0.0)
    return np.divide(flow, flows, out=by_length, where=flows > 0.0)


def boundary_flows(case: Case, strip: Strip, flow: FaceFlow) -> dict[str, float]:
    """Volume flow through each port, positive into the strip [m2/s, that is m3/s per metre of depth]."""
    walls = {"bottom": flow.bottom, "top": -flow.top}
    grid = strip.grid
    flows = {}
    for inlet in case.geometry.inlets:
        columns = strip.column[strip.wall_cells(inlet.side)]
        flows[inlet.name] = float(walls[inlet.side] @ inlet_share(case, grid, inlet)[columns] * grid.dx)
    for outlet in case.geometry.outlets:
        columns = strip.column[strip.wall_cells(outlet.side)]
        flows[outlet.name] = float(np.sum(walls[outlet.side][grid.opening(outlet)[columns]]) * grid.dx)
    values = total(strip.comm, list(flows.values()))
    return dict(zip(flows, map(float, values), strict=True))


def _matrix(form: Form) -> PETSc.Mat:
    matrix = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(form))
    matrix.assemble()
    return matrix


def _vector(form: Form) -> PETSc.Vec:
    vector = dolfinx.fem.petsc.assemble_vector(dolfinx.fem.form(form))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector
