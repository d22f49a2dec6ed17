"""Exponentially fitted fluxes: limits, exactness in one dimension, positivity, and what ports feed."""

import math
from typing import Any

import numpy as np
import pytest
import sympy as sp

from mpm.flow.fields import FaceFlow
from mpm.mesh.strip import Strip
from mpm.physics.exponentials import bernoulli
from mpm.transport.fluxes import FluxAssembler, FluxOperator, cell_diffusivity
from mpm.transport.schemes import two_point_flux

from .cases import MPI, strip_case, zone

D = 2.88e-5


def uniform_flow(strip: Strip, ux: float, uy: float) -> FaceFlow:
    """The same velocity on every face, walls included."""
    inner = np.where(strip.faces.vertical_flow, uy, ux)
    return FaceFlow(
        inner, np.full(len(strip.wall_cells("bottom")), uy), np.full(len(strip.wall_cells("top")), uy)
    )


def net_outflow(strip: Strip, op: FluxOperator, c: np.ndarray) -> np.ndarray:
    """Net flux out of every cell through inner faces and open ports (one rank)."""
    faces = strip.faces
    flux = op.from_behind * c[faces.behind] - op.from_ahead * c[faces.ahead]
    net = np.bincount(faces.behind, flux, len(c)) - np.bincount(faces.ahead, flux, len(c))
    for port in (*op.inlets.values(), *op.outlets.values()):
        np.add.at(net, port.cells, port.out * c[port.cells])
    return net


def test_bernoulli_function() -> None:
    """Fails when B(z) loses digits near 0, where the series takes over, or overflows far away; B(-z) = B(z) + z."""
    for z in (1e-12, 1e-6, 0.999e-3, 1.001e-3, 0.1, 1.0, 30.0, 600.0):
        for value in (z, -z):
            exact = float(sp.N(sp.Rational(value) / (sp.exp(sp.Rational(value)) - 1), 30))
            assert float(bernoulli(np.array(value))) == pytest.approx(exact, rel=1e-12), value
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        assert bernoulli(np.array([0.0, 1e6, 1e300])).tolist() == pytest.approx([1.0, 0.0, 0.0], abs=1e-290)
        assert bernoulli(np.array(-1e6)) == pytest.approx(1e6)
    both = np.linspace(-40.0, 40.0, 801)
    np.testing.assert_allclose(bernoulli(-both), bernoulli(both) + both, rtol=1e-12, atol=1e-13)


def test_flux_limits() -> None:
    """Fails when zero diffusion is not pure upwind, zero velocity not central, a - b not the velocity, or a coefficient negative."""
    a, b = two_point_flux(np.array([0.3, -0.3, 0.0]), np.zeros(3))
    assert a.tolist() == [0.3, 0.0, 0.0] and b.tolist() == [0.0, 0.3, 0.0]
    a, b = two_point_flux(np.zeros(2), np.array([2.0, 1e-30]))
    np.testing.assert_allclose([a, b], [[2.0, 1e-30], [2.0, 1e-30]])
    rng = np.random.default_rng(3)
    u, g = rng.normal(size=2000) * 10.0 ** rng.uniform(-9, 3, 2000), 10.0 ** rng.uniform(-20, 3, 2000)
    a, b = two_point_flux(u, g)
    assert a.min() >= 0.0 and b.min() >= 0.0
    np.testing.assert_allclose(a - b, u, rtol=1e-12, atol=1e-15 * g.max())


def test_exact_solution_in_one_dimension() -> None:
    """sympy: exp(u R(y)) with R' = 1/D carries no net flux for constant u, whatever D(y) is."""
    y, u = sp.symbols("y u")
    diffusivity, resistance = sp.Function("D")(y), sp.Function("R")(y)
    c = sp.exp(u * resistance)
    flux = (u * c - diffusivity * sp.diff(c, y)).subs(sp.diff(resistance, y), 1 / diffusivity)
    assert sp.simplify(flux) == 0


@pytest.mark.parametrize("velocity", [3.5e-2, -1e-2, 1e-6])
def test_exponential_profile_through_layers_is_exact_at_the_nodes(velocity: float) -> None:
    """Fails when the flux is not that of the exact solution exp(u R(y)), R = integral of dy/D_eff, on graded rows and across layers.

    Also a superposed constant must carry exactly u C.
    """
    case = zone({"geometry.layer.bed.grading": 5.0, "geometry.layer.frit.grading": 0.2})
    strip = Strip(case, MPI.COMM_SELF)
    grid = strip.grid
    materials = [case.geometry.layers[i].material for i in grid.row_layer]
    d = np.array([D * (m.porosity / m.tortuosity_factor[1] if m else 1.0) for m in materials])
    resistance = np.cumsum(grid.dy / d) - 0.5 * grid.dy / d
    profile = np.exp(velocity * (resistance - resistance[-1 if velocity > 0 else 0]))
    op = FluxAssembler(case, strip, cell_diffusivity(strip, D)).operator(uniform_flow(strip, 0.0, velocity))
    faces = strip.faces
    up = faces.vertical_flow
    for constant in (0.0, 0.7):
        c = (profile + constant)[strip.row]
        flux = (op.from_behind * c[faces.behind] - op.from_ahead * c[faces.ahead])[up]
        np.testing.assert_allclose(
            flux, velocity * constant * grid.dx, rtol=1e-11, atol=1e-14 * op.from_behind.max()
        )


def test_effective_diffusivity_per_direction() -> None:
    """Fails when eps D/tau^2 is not taken per direction: in plane 2.85 and through 2.68 in the frit of the thesis."""
    strip = Strip(zone(), MPI.COMM_SELF)
    along_x, along_y = cell_diffusivity(strip, D)
    frit, gas = strip.grid.row_layer[strip.row] == 1, strip.grid.row_layer[strip.row] == 0
    np.testing.assert_allclose(along_x[frit], 0.37 * D / 2.85)
    np.testing.assert_allclose(along_y[frit], 0.37 * D / 2.68)
    np.testing.assert_allclose(along_x[gas], D)
    np.testing.assert_allclose(along_y[gas], D)


@pytest.mark.parametrize("diffusivity", [0.0, D])
def test_operator_is_an_m_matrix(diffusivity: float) -> None:
    """Fails when an off-diagonal could be positive, or a constant is not preserved by a flow without divergence."""
    case = strip_case([{"name": "gas", "height": "3 mm", "cells": 5}], columns=6)
    strip = Strip(case, MPI.COMM_SELF)
    op = FluxAssembler(case, strip, cell_diffusivity(strip, diffusivity)).operator(
        uniform_flow(strip, 0.02, 0.0)
    )
    assert op.from_behind.min() >= 0.0 and op.from_ahead.min() >= 0.0
    net = net_outflow(strip, op, np.full(strip.grid.cells, 2.0))
    np.testing.assert_allclose(net, 0.0, atol=1e-15 * max(op.from_behind.max(), 1e-30))
    c = np.random.default_rng(1).uniform(0.0, 1.0, strip.grid.cells)
    assert abs(net_outflow(strip, op, c).sum()) < 1e-14 * op.from_behind.max() * len(
        c
    )  # what leaves one cell enters another


def port_flow(case: Any, strip: Strip) -> FaceFlow:
    """Prescribed inflow through the bottom ports, nothing else."""
    flow = uniform_flow(strip, 0.0, 0.0)
    for inlet in case.geometry.inlets:
        columns = strip.column[strip.wall_cells(inlet.side)]
        flow.bottom[:] += strip.grid.overlap(inlet)[columns] / strip.grid.dx * inlet.velocity
    return flow


@pytest.mark.parametrize("width", [0.9, 4.0, 5.137])
def test_inlets_feed_velocity_times_width(width: float) -> None:
    """Fails when a port that covers facets in part, or shares one with its neighbour, does not feed exactly v w C."""
    edge = 104.8 - width / 2
    case = zone(
        {
            "geometry.inlet.tma.center": "104.8 mm",
            "geometry.inlet.tma.width": f"{width} mm",
            "geometry.inlet.purge.center": f"{edge - 2.0!r} mm",
            "geometry.inlet.purge.width": "4 mm",
            "geometry.inlet.purge.velocity": "1.1 cm/s",
        }
    )
    strip = Strip(case, MPI.COMM_SELF)
    op = FluxAssembler(case, strip, cell_diffusivity(strip, D)).operator(port_flow(case, strip))
    for inlet in case.geometry.inlets:
        assert op.inlets[inlet.name].into.sum() == pytest.approx(inlet.velocity * inlet.width, rel=1e-12)
        assert op.inlets[inlet.name].out.max() == 0.0


def test_inlet_diffusion_adds_the_half_cell() -> None:
    """Fails when `inlet_diffusion` does not exchange with the port over half a cell, or adds to the net volume flow."""
    case = zone({"geometry.inlet_diffusion": True})
    strip = Strip(case, MPI.COMM_SELF)
    op = FluxAssembler(case, strip, cell_diffusivity(strip, D)).operator(port_flow(case, strip))
    port = op.inlets["tma"]
    np.testing.assert_allclose(port.into - port.out, 0.035 * port.area, rtol=1e-12)
    half = D / (0.5 * strip.grid.dy[0])
    expected = half * (0.035 / half) / -math.expm1(-0.035 / half)
    np.testing.assert_allclose(port.into / port.area, expected, rtol=1e-12)


def test_inlet_at_rest_in_the_lab_still_passes_what_the_frame_pumps() -> None:
    """Fails when an inlet of zero velocity loses the flow that the moving frame drives through it: gas would not balance."""
    case = zone(
        {"geometry.inlet.purge.velocity": "0 m/s", "motion.inlet_frame": "lab", "fidelity": "resolved"}
    )
    strip = Strip(case, MPI.COMM_SELF)
    flow = port_flow(case, strip)
    columns = strip.column[strip.wall_cells("bottom")]
    flow.bottom[:] += 0.01 * strip.grid.overlap(case.geometry.inlets[0])[columns] / strip.grid.dx
    op = FluxAssembler(case, strip, cell_diffusivity(strip, D)).operator(flow)
    assert op.inlets["purge"].into.sum() == pytest.approx(0.01 * 4e-3, rel=1e-12)
