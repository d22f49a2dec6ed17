"""The terms of the momentum balance assembled on the fluxes of a strip: matrices of what is linear in the flow, vectors of what drives
it."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import ufl
from ufl import Form

from mpm.arrays import Floats
from mpm.flow.space import CLOSED, FlowSpace
from mpm.flow.terms import Medium, bed_entrainment, drag, frame_acceleration, inertia, viscosity, weight
from mpm.mesh.strip import Strip
from mpm.numerics.fem import PETSc, dolfinx
from mpm.numerics.sparse import thinned

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.flow.state import GasState


class FlowForms:
    """A, `viscous` (viscosity and drag), M, `mass` (inertia), and forces: `entrainment` per unit velocity of the bed, `acceleration` per
    unit acceleration of the frame along x, `weight` per unit of gravity (None where the gas has none that counts)."""

    def __init__(self, case: Case, strip: Strip, space: FlowSpace, gas: GasState | None):
        self.space, self._medium = space, Medium.from_case(case, strip, gas)
        # what a unit of flux weighs: the fluxes count volumes in the state of the case
        self.inertial_density: float | Floats = case.gas.density
        if gas is not None:
            self.inertial_density = gas.reference * gas.mass
        m, u, v = self._medium, ufl.TrialFunction(space.fluxes), ufl.TestFunction(space.fluxes)
        closed = ufl.Measure("ds", domain=strip.mesh, subdomain_data=space.facets)(CLOSED)
        self.viscous = self._of_fluxes(viscosity(u, v, m, closed) + drag(u, v, m))
        solids = space.along_x(m.moving_solid)  # their volume flux per unit velocity of the bed
        self.entrainment = _vector(bed_entrainment(solids, v, m, closed))
        self.acceleration = _vector(frame_acceleration(v, m))
        self.weight: PETSc.Vec | None = None
        if gas is not None and case.energy is not None and case.energy.buoyancy:
            self._weight = dolfinx.fem.form(weight(v, m.buoyant))
            self.weight, self._other_weight = (self.viscous.createVecLeft() for _ in range(2))
            self.weigh_as(gas)

    def weigh_as(self, gas: GasState) -> None:
        """Let `weight` be that of gas in another state; collective."""
        if self.weight is not None:
            self._weigh(gas, self.weight)

    def weight_of(self, gas: GasState) -> PETSc.Vec:
        """That of gas in another state, the same vector at every call; collective."""
        self._weigh(gas, self._other_weight)
        return self._other_weight

    def _weigh(self, gas: GasState, result: PETSc.Vec) -> None:
        buoyant = self._medium.buoyant
        if buoyant is None:
            raise ValueError("gas of one density has no weight that counts")
        self.space.strip.set_cell_values(buoyant, gas.buoyant)
        force = _assembled(self._weight)
        result.array[:] = force.array[: self.space.own]
        force.destroy()

    def destroy(self) -> None:
        """Free the matrices and vectors; collective."""
        held = [self.viscous, self.entrainment, self.acceleration, *([self.weight] if self.weight else [])]
        for one in [*held, *([self.mass] if "mass" in vars(self) else [])]:
            one.destroy()

    @cached_property
    def mass(self) -> PETSc.Mat:
        u, v = ufl.TrialFunction(self.space.fluxes), ufl.TestFunction(self.space.fluxes)
        return self._of_fluxes(inertia(u, v, self._medium))

    def _of_fluxes(self, form: Form) -> PETSc.Mat:
        """The matrix of a form in the velocity that acts on the fluxes."""
        matrix = thinned(_matrix(form))
        if self.space.density is not None:
            per_flux = matrix.createVecRight()
            per_flux.array[:] = 1.0 / self.space.density[: self.space.own]
            matrix.diagonalScale(None, per_flux)
        return matrix


def _matrix(form: Form) -> PETSc.Mat:
    matrix = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(form))
    matrix.assemble()
    return matrix


def _vector(form: Form) -> PETSc.Vec:
    return _assembled(dolfinx.fem.form(form))


def _assembled(form: dolfinx.fem.Form) -> PETSc.Vec:
    vector = dolfinx.fem.petsc.assemble_vector(form)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector
