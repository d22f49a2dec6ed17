"""The unknowns of the flow, and its convection: exact for any stream function, and equal to the finite elements that they stand for."""

from typing import Any

import numpy as np
import pytest
import ufl

from mpm.case.case import Case
from mpm.errors import InputError
from mpm.flow.convection import Convection
from mpm.flow.fields import FlowField, boundary_flows, face_flow
from mpm.flow.given import port_fields
from mpm.flow.problem import FlowProblem
from mpm.flow.space import FlowSpace
from mpm.flow.steady import steady_flow
from mpm.flow.terms import Medium
from mpm.mesh.strip import RIGHT, TOP, Strip
from mpm.motion.kinematics import StepMotion
from mpm.numerics.fem import PETSc, dolfinx
from mpm.numerics.sparse import sparse_matrix
from mpm.parallel import largest

from .cases import MPI, TINY, assert_free_of_divergence, strip_case, zone

COMM = MPI.COMM_WORLD
CLOSED_ENDS = {"geometry.periodic": False}
BOTH_WALLS: dict[str, Any] = {
    "geometry.outlet": [
        {"name": "above", "center": "104.775 mm", "width": "10 mm"},
        {"name": "below", "center": "70 mm", "width": "20 mm", "side": "bottom"},
    ]
}
MESHES = [{}, CLOSED_ENDS, {**CLOSED_ENDS, "geometry.layer.bed.grading": 4.0}, BOTH_WALLS]


def swirling(space: FlowSpace, inflow: float = 1.0, turn: float = 1.7) -> Any:
    """A field with `inflow` times the case's ports and a stream function without any order."""
    field, psi = space.function(), space.curl.createVecRight()
    first, last = psi.getOwnershipRange()
    psi.array[:] = 1e-4 * np.sin(turn * np.arange(first, last) + 0.3)
    space.curl.mult(psi, field.x.petsc_vec)
    field.x.array[: space.own] += inflow * port_fields(space)[0][: space.own]
    field.x.scatter_forward()
    return field


@pytest.mark.parallel
@pytest.mark.parametrize("changes", MESHES)
def test_any_stream_function_keeps_the_gas(changes: dict[str, Any]) -> None:
    """Fails when a stream function makes gas in a cell, or lets any through a wall or an inlet beyond what the case prescribes."""
    case = zone(changes, TINY)
    strip = Strip(case, COMM)
    space = FlowSpace(case, strip)
    field = FlowField(space.velocities(swirling(space).x.array), np.zeros(strip.local))
    assert_free_of_divergence(case, strip, field)
    flows = boundary_flows(case, strip, face_flow(strip, field.velocities))
    for inlet in case.geometry.inlets:
        assert flows[inlet.name] == pytest.approx(inlet.velocity * inlet.width, rel=1e-12)
    above = [outlet for outlet in case.geometry.outlets if outlet.side == "top"]
    closed = ~np.any([strip.grid.opening(outlet) for outlet in above], axis=0)
    lid = np.abs(face_flow(strip, field.velocities).top[closed[strip.column[strip.wall_cells("top")]]])
    assert largest(COMM, [lid.max(initial=0.0)])[0] == 0.0


@pytest.mark.parallel
def test_every_flow_of_the_grid_has_a_stream_function() -> None:
    """Fails when an unknown is missing, so that some flow without divergence cannot be had: facets less cells (whose divergences sum to
    what the outlets leave free), less closed walls, is how many there are."""
    for changes in ({}, CLOSED_ENDS, BOTH_WALLS, {**BOTH_WALLS, **CLOSED_ENDS}):
        case = zone(changes, TINY)
        strip = Strip(case, COMM)
        grid = strip.grid
        facets = grid.rows * (grid.columns + (0 if grid.periodic else 1)) + (grid.rows + 1) * grid.columns
        opened = sum(int(grid.opening(outlet).sum()) for outlet in case.geometry.outlets)
        closed = 2 * grid.columns - opened + (0 if grid.periodic else 2 * grid.rows)
        assert FlowSpace(case, strip).curl.size[1] == facets - closed - grid.cells


def convection_form(u: Any, v: Any, m: Medium) -> Any:
    """(rho/eps) u.grad(u/eps), central in the jumps between cells, as a UFL form."""
    n = ufl.FacetNormal(ufl.domain.extract_unique_domain(v))
    c = m.density / m.porosity
    un = ufl.dot(u, n)
    incoming = ufl.conditional(ufl.lt(un, 0), un, 0)
    degree = {"quadrature_degree": 2}

    def along(w: Any) -> Any:
        return w - ufl.dot(w, n) * n

    carried = ufl.inner(ufl.jump(u / m.porosity), ufl.avg(c * along(v)))
    return (
        ufl.inner(c / m.porosity * ufl.dot(ufl.grad(u), u), v) * ufl.dx(metadata=degree)
        - ufl.dot(u("+"), n("+")) * carried * ufl.dS(metadata=degree)
        - c / m.porosity * incoming * ufl.inner(along(u), v) * ufl.ds(metadata=degree)
    )


@pytest.mark.parallel
@pytest.mark.parametrize("inflow", [1.0, -1.0])
@pytest.mark.parametrize("changes", MESHES[:2])
def test_convection_is_that_of_the_finite_elements(changes: dict[str, Any], inflow: float) -> None:
    """Fails when a product of the differences is missing or has another weight than in the form, its derivative likewise; with ports
    through which gas comes in and goes out."""
    case = zone(changes, TINY)
    strip = Strip(case, COMM)
    space = FlowSpace(case, strip)
    field, medium = swirling(space, inflow), Medium.from_case(case, strip)
    form = convection_form(field, ufl.TestFunction(space.fluxes), medium)
    expected = dolfinx.fem.petsc.assemble_vector(dolfinx.fem.form(form))
    expected.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    convection = Convection(space, medium.density)
    scale = largest(COMM, [np.abs(expected.array).max()])[0]
    found = convection.force(field.x.array).array[: space.own]
    np.testing.assert_allclose(found, expected.array, rtol=0.0, atol=1e-12 * scale)

    slope = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(ufl.derivative(form, field)))
    slope.assemble()
    # nothing through walls: whether gas comes in there would hang on rounding
    change = swirling(space, inflow=0.0, turn=0.9)
    slope.mult(change.x.petsc_vec, expected)
    scale = largest(COMM, [np.abs(expected.array).max()])[0]
    found = convection.slopes(field.x.array)(change.x.array).array[: space.own]
    np.testing.assert_allclose(found, expected.array, rtol=0.0, atol=1e-12 * scale)

    entries = convection.slope_matrix(field.x.array)
    matrix = sparse_matrix(COMM, space.own, space.own, entries[:2])
    matrix.setValuesCOO(entries[2])
    product = matrix.createVecLeft()
    matrix.mult(change.x.petsc_vec, product)
    np.testing.assert_allclose(product.array, expected.array, rtol=0.0, atol=1e-12 * scale)


def moved_ports(*sides: str) -> Case:
    """A closed strip with inlets of equal width in these walls, at rest in the lab's frame."""
    ports = [
        {"name": side, "side": side, "center": "1.5 mm", "width": "1 mm", "velocity": "0 m/s"}
        for side in sides
    ]
    return strip_case(
        [{"name": "gas", "height": "3 mm", "cells": 6}],
        columns=6,
        geometry={"inlet": ports, "outlet": []},
        fidelity="resolved",
        motion={"gamma": 0.3, "bed_velocity": "0 m/s", "inlet_frame": "lab"},
    )


def test_a_frame_pumps_what_ports_let_pass() -> None:
    """Fails when a flow is sought that fills a closed strip through one port that stays in the lab; through two it passes."""
    case = moved_ports("bottom", "top")
    FlowProblem(case, Strip(case, MPI.COMM_SELF), 1e-3)
    case = moved_ports("bottom")
    with pytest.raises(InputError, match="no outlet for what the moving reactor takes in"):
        FlowProblem(case, Strip(case, MPI.COMM_SELF), 1e-3)


@pytest.mark.parallel
def test_pressure_balances_the_forces_everywhere() -> None:
    """Fails when the pressure, summed along columns, is not the one that balances every facet of a flow with bed, drag and inertia: then
    the momentum that it leaves would move the gas on."""
    case = zone({"fidelity": "resolved"}, TINY)
    strip = Strip(case, COMM)
    problem = FlowProblem(case, strip, 1e-3)
    motion = StepMotion(bed_velocity=0.02, acceleration=3.0, frame_velocity_y=0.0)
    steady_flow(problem, motion)
    problem.weigh(motion)
    forces = problem.space.function()
    forces.x.array[: problem.space.own] = problem.unbalanced.array
    forces.x.scatter_forward()
    pressure = problem.pressure()
    faces, dofs = strip.faces, problem.space.dofs
    through = np.where(faces.vertical_flow, dofs[faces.behind, TOP], dofs[faces.behind, RIGHT])
    asked = forces.x.array[through] * np.sign(problem.space.weights[through])
    drop = pressure[faces.behind] - pressure[faces.ahead]
    scale = largest(COMM, [np.abs(drop).max()])[0]
    np.testing.assert_allclose(drop, asked, rtol=0.0, atol=1e-7 * scale)
