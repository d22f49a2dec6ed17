"""Gas flow: Darcy-Brinkman with convection in the frame of the vibrating reactor.

    div u = 0
    (rho/eps) (du/dt + u.grad(u/eps)) = -grad p + div(mu_e grad U) - (mu/K) (U - v_s) - rho a(t),   U = u + (1-eps) v_s

`u` is the superficial gas velocity relative to the mesh [m/s], `v_s` the bed's velocity relative to the mesh and `a` the mesh's
acceleration; gravity and the vertical acceleration are gradients and vanish into the pressure `p` [Pa], but for gas that differs in
density. `U`, the volume flux of gas and solids together, is continuous across the faces of the moving bed and as free of divergence as u:
gas at the surface of the bed moves with v_s, pore gas is carried at eps v_s. Gas layers have eps = 1, 1/K = 0 and U = u. Walls are no-slip,
ports prescribe the normal velocity, outlets have p = 0 and no tangential velocity gradient. Where a bed passes the closed ends of a strip,
u = 0 there and U = (1-eps) v_s.

Discretisation: Raviart-Thomas of lowest order on quadrilaterals, the marker-and-cell scheme written as forms; the flux through every facet
is one number. div u = 0 holds by construction, because the unknowns are a stream function psi (`mpm.flow.space`). With A the matrix of
viscosity and drag, M that of inertia, N the convection (`mpm.flow.convection`), f the forces of bed and frame and Z the curl, a step from
the state u, which is u_p once the flows of its ports are those of the step, is

    Z^T (A + M/dt) Z dpsi = Z^T (f - N(u) - A u_p - M (u_p - u)/dt),    u' = u_p + Z dpsi,

symmetric and positive definite. In gas of different temperatures (`mpm.flow.state`) the unknown is the mass flux, counted as a volume flux
at the case's density: rho/rho_ref u in place of u, with the same constraint and u = D^-1 of it, D the density at the facets. A and M then
become A D^-1 and M D^-1, which are no longer symmetric, the equation gains the weight (rho - rho_ref) (g + a_y), and what heating drives
out of a cell, -eps d(rho/rho_ref)/dt, is in u_p. Convection is explicit, so one factor serves all steps. What is solved for is a change, so
that rounding is relative to that. The terms of the equation are the functions of `mpm.flow.terms`; this module assembles and solves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GRAVITY
from mpm.flow.convection import Convection
from mpm.flow.courant import driving_speed
from mpm.flow.factors import STEADY, Factors
from mpm.flow.fields import FlowField
from mpm.flow.forms import FlowForms
from mpm.flow.given import port_fields, spreading
from mpm.flow.linearised import Jacobian, assembled_jacobian
from mpm.flow.space import FlowSpace
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import StepMotion
from mpm.numerics.fem import PETSc
from mpm.numerics.linear import DirectSolver
from mpm.numerics.memory import give_back
from mpm.parallel import largest

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.flow.state import GasState

# of the speed that ports, motion and buoyancy could give: slower gas is at rest, but for rounding, of which weight leaves more
STILL, STILL_HEATED = 1e-10, 1e-9
NEWTON_TOLERANCE = 1e-4  # of the inner iteration of a Newton update
PortState = tuple[float, float]  # share of the inlets' velocities, vertical velocity of the frame [m/s]
CLOSED_PORTS: PortState = (0.0, 0.0)


class FlowProblem:
    """Assembled flow operators of a case; advances or balances the fluxes u, its state.

    A factor belongs to each time step [s], `dt` of backward Euler or STEADY, made when first needed. Steps of a `refined` problem are the
    same to 1e-12 at every run on as many ranks. `unbalanced` (own fluxes) is the force that the pressure must balance.
    """

    def __init__(
        self, case: Case, strip: Strip, dt: float, refined: bool = False, gas: GasState | None = None
    ):
        self.case, self.strip, self.dt, self.refined, self.gas = case, strip, float(dt), refined, gas
        self.space = FlowSpace(case, strip, gas)
        self.state = self.space.function()
        self.convection_share = 1.0  # below 1 on the way to a fast flow
        self._forms = forms = FlowForms(case, strip, self.space, gas)
        self.viscous, self._factors = forms.viscous, Factors(forms, self.space)
        self.convection = Convection(self.space, forms.inertial_density)
        self.unbalanced, self._work = (self.viscous.createVecLeft() for _ in range(2))
        self._psi, self._rhs = (self.space.curl.createVecRight() for _ in range(2))
        give_back(strip.comm)  # what forms take while they are assembled is as much as a factor
        self._ports = CLOSED_PORTS  # of the state
        self._spread = 0.0 * self.values  # what the state carries of the gas that heating drives out
        self._port_fields = port_fields(self.space)
        if self._port_fields[1].any():  # moved in every step: without forces that must cancel then
            self._port_fields = (self._port_fields[0], self._creeping(self._port_fields[1]))

    @property
    def mass(self) -> PETSc.Mat:
        """M; a steady flow has no use for it."""
        return self._forms.mass

    def release(self, kept: float | None = None) -> None:
        """Give the memory of all factors back but for one that is `kept`; they are made anew when needed again. Collective."""
        self._factors.release(kept)

    def destroy(self) -> None:
        """Free all that is held outside of Python, once another problem takes its place; collective."""
        self._factors.release()
        self._forms.destroy()
        give_back(self.strip.comm)

    def lighter(self, gas: GasState) -> PETSc.Vec | None:
        """Weight of `gas` less that of this problem's (own fluxes,), None where weight does not count; collective."""
        if self._forms.weight is None:
            return None
        other = self._forms.weight_of(gas)
        other.axpy(-1.0, self._forms.weight)
        other.scale(GRAVITY)
        return other

    def weigh_as(self, gas: GasState) -> None:
        """Let the weight be that of `gas` from now on; collective."""
        self._forms.weigh_as(gas)

    # --- solving ---

    def convective_force(self) -> PETSc.Vec:
        """N(u) of the present state; the same vector at every call."""
        force = self.convection.force(self.values)
        force.scale(self.convection_share)
        return force

    def step(
        self, motion: StepMotion, convective: PETSc.Vec | None = None, source: Floats | None = None
    ) -> None:
        """Advance the state by one backward Euler step under the step's mean forcing; convection is taken at the old state.

        `source` (own cells,) [m2/s]: what heating drives out of each cell.
        """
        convective = convective if convective is not None else self.convective_force()
        moved = self._move_ports(motion)
        if source is not None:
            more = spreading(self.space, source) - self._spread
            self._spread = self._spread + more
            self.values[:] += more
            moved = more if moved is None else moved + more
        self.weigh(motion, convective)
        if moved is not None:
            self._work.array[:] = moved[: self.space.own] / self.dt
            self.mass.multAdd(self._work, self.unbalanced, self.unbalanced)
        self._balance(self.dt, passes=1 + self.refined)

    def solve_steady(self, motion: StepMotion, convective: PETSc.Vec) -> None:
        """Set the state to the steady solution under `motion` with a given convective force."""
        self._move_ports(motion)
        self.weigh(motion, convective)
        self._balance(STEADY, passes=2 + self.refined)

    def driven(self, source: Floats, weight: PETSc.Vec | None) -> Floats:
        """Creeping flow (local fluxes,), ports closed, of what cells give off, `source` (own,) [m2/s], and of a `weight`; collective."""
        state, unbalanced = self.values.copy(), self.unbalanced.array.copy()
        found = self._creeping(spreading(self.space, source), weight, passes=1)
        self.values[:], self.unbalanced.array[:] = state, unbalanced
        return found

    def _move_ports(self, motion: StepMotion) -> Floats | None:
        """Give the state the port flows of a step; returns its change (local fluxes,), None without any."""
        wanted = (1.0, motion.frame_velocity_y)
        if wanted == self._ports:
            return None
        shares = [new - old for new, old in zip(wanted, self._ports, strict=True)]
        moved = shares[0] * self._port_fields[0] + shares[1] * self._port_fields[1]
        self.values[:] += moved
        self._ports = wanted
        return np.asarray(moved)

    def _creeping(self, values: Floats, force: PETSc.Vec | None = None, passes: int | None = None) -> Floats:
        """The flow with the same ports and sources as the fluxes `values`, without inertia, under this `force` alone."""
        self.values[:] = values
        self.viscous.mult(self.state.x.petsc_vec, self.unbalanced)
        if force is not None:
            self.unbalanced.axpy(-1.0, force)
        self._balance(STEADY, passes or 2 + self.refined)
        found = self.values.copy()
        self.values[:] = 0.0
        return found

    def weigh(self, motion: StepMotion, convective: PETSc.Vec | None = None) -> None:
        """Work out A u + N - f of the steady equations at the present state: what the pressure must balance.

        N is the convective force of the state unless another one is given.
        """
        residual = self.unbalanced
        self.viscous.mult(self.state.x.petsc_vec, residual)
        residual.axpy(-motion.bed_velocity, self._forms.entrainment)
        residual.axpy(-motion.acceleration, self._forms.acceleration)
        if self._forms.weight is not None:
            residual.axpy(-(GRAVITY + motion.acceleration_y), self._forms.weight)
        force = self.convective_force() if convective is None else convective
        residual.array[:] += force.array[: self.space.own]

    def _balance(self, dt: float, passes: int = 1) -> None:
        """Change the state so that `unbalanced` has no curl; it is kept up to date."""
        if self._psi.size == 0:
            return  # walls all around a cell
        for _ in range(passes):
            self.space.curl.multTranspose(self.unbalanced, self._rhs)
            self._factors.solver(dt).solve(self._rhs, self._psi)
            self._adopt()
            self._factors.operator(dt).multAdd(self._work, self.unbalanced, self.unbalanced)

    def _adopt(self) -> None:
        """Subtract the curl of `_psi` from the state; leaves the change in `_work`."""
        self._psi.scale(-1.0)
        self.space.curl.mult(self._psi, self._work)
        self.values[: self.space.own] += self._work.array
        self.state.x.scatter_forward()

    def newton_update(
        self,
        motion: StepMotion,
        convective: PETSc.Vec | None = None,
        exact: bool = False,
        tolerance: float = NEWTON_TOLERANCE,
    ) -> float:
        """One Newton step on the steady equations at the state's ports; returns the largest change of a velocity over the largest velocity.

        N is the convective force of the state unless another one is given, as the mean of a cycle is. The Jacobian, A + dN/du, is solved by
        GMRES to `tolerance` with the factor of A as preconditioner; `exact` makes a factor of the Jacobian itself. Raises ConvergenceError.
        """
        self.weigh(motion, convective)
        if self._psi.size == 0:
            return 0.0
        self.space.curl.multTranspose(self.unbalanced, self._rhs)
        if exact:
            solver = DirectSolver(self.jacobian(STEADY), "flow (Newton)")
            solver.solve(self._rhs, self._psi)
            solver.destroy()
        else:
            self._iterate(STEADY, tolerance)
        self._adopt()
        change = self.space.fastest(self._work.array)
        still = STILL if self.gas is None else STILL_HEATED
        fastest = max(self.space.fastest(self.values), still * driving_speed(self.case, self.gas))
        change, fastest = largest(self.strip.comm, [change, fastest])
        return float(change / fastest) if fastest > 0.0 else 0.0

    def jacobian(self, time: float) -> PETSc.Mat:
        """Z^T (A + dN/du + M/time) Z at the state, to be destroyed by who asked for it; collective."""
        return assembled_jacobian(
            self.space, self._factors.operator(time), self.convection, self.values, self.convection_share
        )

    def imbalance(self, motion: StepMotion) -> Floats:
        """Z^T (A u + N - f) at the state under `motion` (own unknowns,); collective."""
        self.weigh(motion)
        self.space.curl.multTranspose(self.unbalanced, self._rhs)
        return np.array(self._rhs.array)

    def change(self, psi: Floats) -> None:
        """Add Z psi to the state; collective."""
        self._psi.array[:] = -psi
        self._adopt()

    def decayed(self, change: Floats, time: float, tolerance: float) -> Floats:
        """What is left of a `change` of the flow (local fluxes,), ports closed, after an implicit step of `time` [s]; collective.

        Z^T (A + dN/du + M/time) Z psi = Z^T M change/time, to the `tolerance`. Raises ConvergenceError.
        """
        left = self.space.function()
        if self._psi.size:
            self._work.array[:] = change[: self.space.own] / time
            self.mass.mult(self._work, left.x.petsc_vec)
            self.space.curl.multTranspose(left.x.petsc_vec, self._rhs)
            self._iterate(time, tolerance)
            self.space.curl.mult(self._psi, left.x.petsc_vec)
            left.x.scatter_forward()
        return np.array(left.x.array)

    def _iterate(self, dt: float, tolerance: float) -> None:
        """Solve Z^T (A + dN/du + M/dt) Z psi = rhs to the `tolerance`, with the factor of Z^T (A + M/dt) Z as preconditioner."""
        jacobian = Jacobian(
            self.space, self._factors.operator(dt), self.convection, self.values, self.convection_share
        )
        jacobian.solve(self._factors.solver(dt), self._rhs, self._psi, tolerance)

    # --- looking at the state ---

    @property
    def values(self) -> Floats:
        """The state's fluxes, those of neighbouring ranks included: the array itself, to be read and written."""
        return np.asarray(self.state.x.array)

    def pressure(self) -> Floats:
        """Pressure in every local cell [Pa] that goes with the step just made; collective."""
        forces = self.space.function()
        forces.x.array[: self.space.own] = self.unbalanced.array
        forces.x.scatter_forward()
        return self.space.pressure(forces.x.array)

    def field(self) -> FlowField:
        """The present state as a velocity field, with the pressure of the step just made; a copy. Collective."""
        return FlowField(self.space.velocities(self.values), self.pressure())

    def start_from(self, field: FlowField, ports: PortState, source: Floats | None = None) -> None:
        """Make `field`, whose `ports` and `source` (own cells,) [m2/s] these are, the present state."""
        self.values[:] = self.space.from_velocities(field.velocities)
        self._ports = ports
        if source is not None:
            self._spread = spreading(self.space, source)
