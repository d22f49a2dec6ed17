"""Species and coverage against exact solutions, with rates: a reacting column, a drifting Gaussian, Bohart and Adams, carried coverage."""

from typing import Any

import numpy as np
import pytest
import sympy as sp

from mpm.flow.fields import FlowField
from mpm.mesh.strip import Strip
from mpm.reactor.reactor import Reactor
from mpm.transport.coverage import Coverage
from mpm.transport.species import Transport

from .cases import MPI, TINY, assert_laws, column_case, norm, rate, run, strip_case, zone

A = 0.9  # rate constant of the alumina mechanism's TMA reaction at 473 K [m/s]


def middles(edges: np.ndarray) -> np.ndarray:
    return 0.5 * (edges[1:] + edges[:-1])


# --- advection, diffusion and a first-order sink in a column (Danckwerts 1953) ---


def danckwerts(u: float, d: float, sink: float, length: float) -> Any:
    """C/C_in of d C'' - u C' - sink C = 0 with u C - d C' = u C_in at 0 and C' = 0 at `length`."""
    roots = np.roots([d, -u, -sink])
    matrix = [u - d * roots, roots * np.exp(roots * length)]
    weights = np.linalg.solve(matrix, [u, 0.0])
    return lambda y: np.exp(np.outer(y, roots)) @ weights


def test_danckwerts_solution() -> None:
    """sympy: sums of exp(r y) with d r^2 - u r - sink = 0 satisfy the equation; the two conditions hold numerically."""
    y, u, d, sink, p, q = sp.symbols("y u d sink p q", positive=True)
    plus, minus = [(u + s * sp.sqrt(u**2 + 4 * d * sink)) / (2 * d) for s in (1, -1)]
    c = p * sp.exp(plus * y) + q * sp.exp(minus * y)
    assert sp.simplify(d * sp.diff(c, y, 2) - u * sp.diff(c, y) - sink * c) == 0
    profile, h = danckwerts(0.03, 2e-4, 4.0, 0.02), 1e-6
    slope = (profile(np.array([h])) - profile(np.array([0.0])))[0] / h
    assert 0.03 * profile(np.array([0.0]))[0] - 2e-4 * slope == pytest.approx(0.03, rel=1e-4)
    assert (profile(np.array([0.02])) - profile(np.array([0.02 - h])))[0] / h == pytest.approx(0.0, abs=1e-2)


def test_reacting_column_with_diffusion() -> None:
    """Fails when inlet, outlet, diffusion, advection or uptake of the whole solver are not of second order in the row height.

    Sites are so many that the coverage stays 1, which makes the uptake S k C a first-order sink; 12 steps of 10 s, each of
    which divides the distance by about 100, are the steady state.
    """
    eps, tau, diffusivity, surface, u, length = 0.4, 1.6, 4e-4, 4.0, 0.035, 0.02
    errors, cells = [], [8, 16, 32, 64]
    exact = danckwerts(u, eps * diffusivity / tau, surface * A, length)
    for n in cells:
        case = column_case(
            length,
            n,
            u,
            {
                "porosity": eps,
                "permeability": "4 um^2",
                "tortuosity_factor": [7.0, tau],
                "surface_to_volume": f"{surface} 1/m",
                "site_density": "1e4 mol/m^2",
            },
            inlet={"mass_fractions": {"TMA": 2e-4}},
            gas={"diffusivity": f"{diffusivity} m^2/s"},
            motion={"gamma": 0.0, "bed_velocity": "0 m/s", "start": "0 s"},
            time={"end": "120 s", "step": "10 s"},
            output={"every": "120 s"},
        )
        _, result = run(case)
        feed = case.feed_concentrations({"TMA": 2e-4})["TMA"]
        column = result.field("C_TMA") / feed
        np.testing.assert_allclose(column, column[:, :1] * np.ones(3), rtol=1e-9)
        errors.append(norm(column[:, 0] - exact(middles(result.grid.y))))
    assert errors[-1] < 1e-3, errors
    assert rate([1 / n for n in cells], errors) > 1.9, errors


# --- a Gaussian that drifts across the seam of an anisotropic porous strip ---


def test_gaussian_solution() -> None:
    """sympy: the drifting Gaussian satisfies eps dC/dt + u.grad C = div(eps D/tau^2 grad C)."""
    t, x, y, u, v, eps, dx, dy, s = sp.symbols("t x y u v eps d_x d_y s", positive=True)
    wide, high = s + 2 * dx * t, s + 2 * dy * t
    c = sp.exp(-((x - u * t / eps) ** 2) / (2 * wide) - (y - v * t / eps) ** 2 / (2 * high)) / sp.sqrt(
        wide * high
    )
    residual = eps * sp.diff(c, t) + u * sp.diff(c, x) + v * sp.diff(c, y)
    residual -= eps * (dx * sp.diff(c, x, 2) + dy * sp.diff(c, y, 2))
    assert sp.simplify(residual / c) == 0


def test_drifting_gaussian() -> None:
    """Fails when advection-diffusion in two directions is not of second order in the cell and first in time (steps quadruple), or
    differs at the seam, which the Gaussian crosses."""
    eps, tau, diffusivity, u, v, end = 0.4, (2.0, 1.25), 1e-4, 0.1, 0.05, 6e-3
    width, height, start, s = 0.01, 0.016, (0.0092, 0.007), 1.2e-3**2
    errors, columns = [], [20, 40, 80]
    for n in columns:
        port = {"center": "5 mm", "width": "10 mm"}
        case = strip_case(
            [{"name": "packing", "height": f"{height} m", "cells": int(1.6 * n), "material": "packing"}], n, width,
            geometry={
                "inlet": [{"name": "in", "velocity": f"{v} m/s", "mass_fractions": {"CH4": 1e-3}, "start": "1 s", **port}],
                "outlet": [{"name": "out", **port}],
            },
            material={
                "packing": {
                    "porosity": eps, "permeability": "4 um^2", "tortuosity_factor": list(tau), "surface_to_volume": "0 1/m",
                }
            },
            gas={"diffusivity": f"{diffusivity} m^2/s"},
        )  # fmt: skip
        strip = Strip(case, MPI.COMM_SELF)
        transport = Transport(case, strip, Coverage(case, strip))
        assert transport.names == ("CH4",)
        sides = np.array([v, u, u, v])[:, None] * np.ones(strip.local)
        operators = transport.operators(FlowField(sides, np.zeros(strip.local)))
        x, y = middles(strip.grid.x)[strip.column], middles(strip.grid.y)[strip.row]

        def exact(t: float, x: np.ndarray = x, y: np.ndarray = y) -> np.ndarray:
            wide, high = s + 2 * diffusivity / tau[0] * t, s + 2 * diffusivity / tau[1] * t
            along = sum(
                np.exp(-((x - start[0] - u / eps * t + k * width) ** 2) / (2 * wide)) for k in (-1, 0, 1, 2)
            )
            return (
                s * along * np.exp(-((y - start[1] - v / eps * t) ** 2) / (2 * high)) / np.sqrt(wide * high)
            )

        transport.concentration = exact(0.0)[None, :]
        steps = 8 * (n // 20) ** 2
        for k in range(steps):
            transport.advance(operators, k * end / steps, end / steps)
        errors.append(norm(transport.concentration[0] - exact(end)) / norm(exact(end)))
        assert transport.concentration.min() >= -1e-14 * transport.ports.largest_feed
    assert errors[-1] < 0.02, errors
    assert rate([1 / n for n in columns], errors) > 1.8, errors


# --- Langmuir uptake in plug flow (Bohart and Adams 1920) ---


def bohart_adams(big_x: Any, big_t: Any) -> tuple[Any, Any]:
    """(C/c0, reacted fraction) with X = S k x/u, T = (k c0/n_s)(t - eps x/u) >= 0."""
    exp = sp.exp if isinstance(big_x, sp.Expr) else np.exp
    whole = exp(big_t) + exp(big_x) - 1
    return exp(big_t) / whole, (exp(big_t) - 1) / whole


def test_bohart_adams_solution() -> None:
    """sympy: eps dC/dt + u dC/dx + S k C (1 - q) = 0 and n_s dq/dt = k C (1 - q), C = c0 at the inlet and q = 0 when the gas arrives."""
    x, t, u, k, c0, n_s, eps, s = sp.symbols("x t u k c_0 n_s eps S", positive=True)
    c, q = bohart_adams(s * k * x / u, k * c0 / n_s * (t - eps * x / u))
    c = c0 * c
    assert sp.simplify(eps * sp.diff(c, t) + u * sp.diff(c, x) + s * k * c * (1 - q)) == 0
    assert sp.simplify(n_s * sp.diff(q, t) - k * c * (1 - q)) == 0
    assert sp.simplify(c.subs(x, 0) - c0) == 0
    assert sp.simplify(q.subs(t, eps * x / u)) == 0


def column(cells: int, steps: int, end: float = 2.0, **gas: str) -> Any:
    """A column of 10 transfer units without diffusion, dosed with TMA so that the front passes its middle in `end` [s]."""
    length, u, mass_fraction = 0.02, 0.035, 2e-4
    surface = 10 * u / (A * length)
    return column_case(
        length, cells, u,
        {
            "porosity": 0.4, "permeability": "4 um^2", "surface_to_volume": f"{surface!r} 1/m", "site_density": "5e-4 mol/m^2",
        },
        inlet={"mass_fractions": {"TMA": mass_fraction}},
        gas={"diffusivity": "0 m^2/s", **gas},
        motion={"gamma": 0.0, "bed_velocity": "0 m/s", "start": "0 s"},
        time={"end": f"{end!r} s", "step": f"{end / steps!r} s"},
        output={"every": f"{end / 4!r} s"},
    )  # fmt: skip


def test_plug_flow_with_langmuir_uptake() -> None:
    """Fails when uptake and transport are split, the coverage lags, or conservation shifts the front: both profiles converge at first
    order (upwind, backward Euler) to Bohart and Adams' solution, without overshoot."""
    gas_errors, solid_errors, cells = [], [], [40, 80, 160]
    for n in cells:
        case = column(n, 2 * n)
        _, result = run(case)
        c0 = case.feed_concentrations({"TMA": 2e-4})["TMA"]
        x = middles(result.grid.y - result.grid.y[0])
        packing = case.materials["packing"]
        big_x = packing.surface_to_volume * A * x / 0.035
        big_t = A * c0 / packing.site_density * (2.0 - 0.4 * x / 0.035)
        assert big_t.min() > 0.0
        c, reacted = bohart_adams(big_x, big_t)
        gas = result.field("C_TMA")[:, 1] / c0
        solid = result.coverage("packing", "OAl(CH3)2")[:, 1]
        assert gas.max() <= 1.0 + 1e-12
        assert np.all(np.diff(gas) <= 1e-12) and np.all(np.diff(solid) <= 1e-12)
        gas_errors.append(np.abs(gas - c).mean())
        solid_errors.append(np.abs(solid - reacted).mean())
    for errors in (gas_errors, solid_errors):
        assert errors[-1] < 6e-3, errors
        assert rate([1 / n for n in cells], errors) == pytest.approx(1.0, abs=0.12), errors


def test_uptake_equals_what_is_missing_at_the_outlet() -> None:
    """Fails when the reported amounts (fed, left, reacted, stored) are not those of the fields: sites turned over equal TMA consumed."""
    case = column(40, 80)
    _, result = run(case)
    tma, ch4 = result.summary["species"]["TMA"], result.summary["species"]["CH4"]
    c0 = case.feed_concentrations({"TMA": 2e-4})["TMA"]
    assert tma["fed"] == pytest.approx(0.035 * 3e-3 * c0 * 2.0, rel=1e-12)
    packing, height = case.materials["packing"], result.grid.dy[:, None]
    sites = packing.surface_to_volume * packing.site_density * result.grid.dx
    assert tma["reacted"] == pytest.approx(
        (sites * height * result.coverage("packing", "OAl(CH3)2")).sum(), rel=1e-10
    )
    assert tma["stored"] == pytest.approx(
        (0.4 * result.grid.dx * height * result.field("C_TMA")).sum(), rel=1e-10
    )
    assert ch4["produced"] == pytest.approx(tma["reacted"], rel=1e-12)


# --- coverage carried by the bed ---


@pytest.mark.parametrize("gamma", [0.0, 0.3])
def test_reactor_carries_a_coverage_step_once_around(gamma: float) -> None:
    """Fails when a whole run (without dose) changes, smears or shifts a coverage that goes once around the periodic strip."""
    cycles = 80
    length = 139.7e-3
    changes = {
        "geometry.bed_inflow": "periodic",
        "geometry.inlet.tma.mass_fractions.TMA": 0.0,
        "motion.gamma": gamma,
        "motion.bed_velocity": f"{length * 16 / cycles!r} m/s",
        "motion.start": "0 s",
        "time.step": f"{1 / 16 / 5!r} s",
        "time.end": f"{cycles / 16!r} s",
        "output.every": "1 s",
    }
    reactor = Reactor(zone(changes, TINY), MPI.COMM_SELF)
    step = np.zeros((len(reactor.system.coverage.rows), reactor.grid.columns))
    step[:, 3:11] = 1.0
    coverage = reactor.system.coverage
    coverage.become(coverage.scatter.to_local(np.stack([1.0 - step.ravel(), step.ravel()])))
    reactor.system.count_from_here()
    result = reactor.run(callback=assert_laws)
    np.testing.assert_array_equal(reactor.system.coverage.whole()[1], step)
    assert reactor.system.coverage.shifted == reactor.grid.columns
    np.testing.assert_array_equal(
        result.coverage("bed", "OAl(CH3)2"), step[reactor.system.coverage.moving_rows]
    )
