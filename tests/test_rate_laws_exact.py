"""General rate laws against exact solutions: isotherms, orders in a closed cell, equilibria in a column, a product that inhibits.

The kinetics alone first, then the whole solver.
"""

import math
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case
from mpm.flow.fields import FlowField
from mpm.mesh.strip import Strip
from mpm.physics.general_kinetics import SUBSTEPS, GeneralKinetics
from mpm.transport.coverage import Coverage
from mpm.transport.species import Transport

from .cases import MPI, assert_laws, column_case, norm, rate, run, strip_case
from .test_transport_exact import danckwerts, middles

N_S = 2e-5  # mol/m2
R = 8.31446261815324
GAS = {name: {"molar_mass": "30 g/mol", "elements": {"X": 1}} for name in ("A", "B", "P")}
GAS["A2"] = {"molar_mass": "60 g/mol", "elements": {"X": 2}}
SITE: dict[str, Any] = {
    "*": {"elements": {}},
    **{name: {"elements": {"X": 1}} for name in ("A*", "B*", "P*")},
}


def mechanism(**reactions: Any) -> dict[str, Any]:
    """Four gases and four site species with these reactions, as the table [chemistry]."""
    return {"mechanism": "inline", "species": GAS, "site": SITE, "reaction": reactions}


def packed(chemistry: dict[str, Any]) -> Case:
    """A strip of one layer, for its mechanism."""
    layer = {"name": "gas", "height": "1 mm", "cells": 2}
    return strip_case([layer], chemistry=chemistry)


def kinetics(gases: tuple[str, ...], cells: int, **reactions: Any) -> GeneralKinetics:
    """Those reactions on surfaces with N_S places in so many cells."""
    mech = packed(mechanism(**reactions)).mechanism
    return GeneralKinetics(mech, gases, np.full(cells, N_S), 473.0)


def at_rest(surface: GeneralKinetics, concentration: np.ndarray, start: str = "*") -> np.ndarray:
    """Coverage after a very long step from a surface of `start` alone."""
    theta = np.zeros((len(SITE), concentration.shape[1]))
    theta[list(SITE).index(start)] = 1.0
    new = surface.coverage(concentration, theta, 1e15)
    assert new.min() >= 0.0
    np.testing.assert_allclose(new.sum(axis=0), 1.0, atol=1e-14)
    return new


CONCENTRATIONS = np.logspace(-8, 2, 41)


@pytest.mark.parametrize("given", ["reverse", "equilibrium", "thermochemistry"])
def test_langmuir_isotherm(given: str) -> None:
    """theta = K C/(1 + K C), from fresh and from full surfaces. Fails when a way back is lost, or K of any origin is another."""
    K = 40.0  # m3/mol
    reaction: dict[str, Any] = {"equation": "A + * <=> A*", "A": "2 m/s"}
    chemistry = mechanism(r=reaction)
    if given == "reverse":
        reaction["reverse"] = {"A": f"{2.0 / K} mol/m^2/s"}
    elif given == "equilibrium":
        reaction["equilibrium_constant"] = f"{K} m^3/mol"
    else:
        T, p = 473.0, 1e5
        change = -R * T * math.log(K * p / (R * T))  # of the Gibbs energy
        known = {"enthalpy": "0 J/mol", "entropy": "0 J/mol/K"}
        chemistry["species"] = {**GAS, "A": {**GAS["A"], **known}}
        bound = {"enthalpy": f"{change!r} J/mol", "entropy": "0 J/mol/K"}
        chemistry["site"] = {**SITE, "*": {**SITE["*"], **known}, "A*": {**SITE["A*"], **bound}}
    surface = GeneralKinetics(packed(chemistry).mechanism, ("A",), np.full(41, N_S), 473.0)
    expected = K * CONCENTRATIONS / (1.0 + K * CONCENTRATIONS)
    for start in ("*", "A*"):
        theta = at_rest(surface, CONCENTRATIONS[None, :], start)
        np.testing.assert_allclose(theta[1], expected, rtol=1e-9)


def test_langmuir_relaxes_at_the_sum_of_both_rates() -> None:
    """theta - theta_eq ~ exp(-(k C + k_d n_s) t/n_s). Fails when k per site is not multiplied by n_s, or one of the ways counts twice."""
    k, back, c = 2.0, 30.0, 1e-3  # m/s, 1/s, mol/m3
    surface = kinetics(
        ("A",), 1, r={"equation": "A + * <=> A*", "A": f"{k} m/s", "reverse": {"A": f"{back} 1/s"}}
    )
    speed = k * c / N_S + back
    equilibrium = k * c / N_S / speed
    errors, steps = [], [50, 100, 200]
    for n in steps:
        theta = np.eye(len(SITE))[:, [0]]
        for _ in range(n):
            theta = surface.coverage(np.array([[c]]), theta, 1.0 / speed / n)
        errors.append(abs(theta[1, 0] - equilibrium * (1.0 - np.exp(-1.0))))
    assert errors[-1] < 2e-3 * equilibrium
    assert rate([1 / n for n in steps], errors) == pytest.approx(1.0, abs=0.03)


def test_dissociative_adsorption() -> None:
    """A2 + 2 * <=> 2 A*: theta = sqrt(K C)/(1 + sqrt(K C)). Fails when an order of a reversible reaction is not its coefficient."""
    K = 40.0
    surface = kinetics(
        ("A2",), 41, r={"equation": "A2 + 2 * <=> 2 A*", "A": "2 m/s", "equilibrium_constant": f"{K} m^3/mol"}
    )
    root = np.sqrt(K * CONCENTRATIONS)
    for start in ("*", "A*"):
        np.testing.assert_allclose(
            at_rest(surface, CONCENTRATIONS[None, :], start)[1], root / (1.0 + root), rtol=1e-9
        )


def test_langmuir_hinshelwood() -> None:
    """r = k theta_A theta_B of two gases in adsorption equilibrium, largest where both cover alike.

    Fails when the order in one of the sites is lost, or the surface reaction disturbs the equilibria although it is slow.
    """
    K, k = 50.0, 1e-9  # m3/mol, mol/m2/s
    surface = kinetics(
        ("A", "B"), 9,
        a={"equation": "A + * <=> A*", "A": "100 m/s", "equilibrium_constant": f"{K} m^3/mol"},
        b={"equation": "B + * <=> B*", "A": "100 m/s", "equilibrium_constant": f"{K} m^3/mol"},
        r={"equation": "A* + B* -> 2 P + 2 *", "A": f"{k} mol/m^2/s"},
    )  # fmt: skip
    c = np.stack([np.linspace(0.01, 0.09, 9), np.linspace(0.09, 0.01, 9)])
    theta = at_rest(surface, c)
    whole = 1.0 + K * c.sum(axis=0)
    np.testing.assert_allclose(theta[1:3], K * c / whole, rtol=1e-5)
    values, _ = surface.rates(c, theta, 1e15)
    np.testing.assert_allclose(values[2], k * K * c[0] * K * c[1] / whole**2, rtol=1e-5)
    assert values[2].argmax() == 4


def closed_cell(chemistry: dict[str, Any], start: dict[str, float]) -> tuple[Case, Transport]:
    """Gas at rest with `start` [mol/m3] of each species in it; a port that stays shut tells which are there."""
    port = {"center": "1.5 mm", "width": "3 mm"}
    case = strip_case(
        [{"name": "gas", "height": "1 mm", "cells": 2}],
        geometry={
            "inlet": [{"name": "in", "velocity": "1 cm/s", "mass_fractions": dict.fromkeys(start, 1e-4), "start": "1e4 s", **port}],
            "outlet": [{"name": "out", **port}],
        },
        chemistry=chemistry,
    )  # fmt: skip
    strip = Strip(case, MPI.COMM_SELF)
    transport = Transport(case, strip, Coverage(case, strip))
    amounts = np.array([start.get(name, 0.0) for name in transport.names])
    transport.concentration = np.repeat(amounts[:, None], strip.owned, axis=1)
    return case, transport


def advanced(transport: Transport, end: float, steps: int) -> np.ndarray:
    """Concentrations (species,) at `end` [s], uniform in the gas at rest."""
    strip = transport.strip
    operators = transport.operators(FlowField(np.zeros((4, strip.local)), np.zeros(strip.local)))
    for k in range(steps):
        transport.advance(operators, k * end / steps, end / steps)
    first, most = transport.concentration[:, :1], transport.concentration.max()
    np.testing.assert_allclose(
        transport.concentration, first * np.ones(strip.owned), rtol=1e-9, atol=1e-15 * most
    )
    return np.asarray(transport.concentration[:, 0])


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 3.0])
def test_decay_of_any_order(order: float) -> None:
    """C^(1-n) = C_0^(1-n) + (n-1) k t; half order is over at 2 sqrt(C_0)/k and stays so.

    Fails when an order is not that of the file, the error not of first order in the step, or half an order takes what is not there.
    """
    start, k, end = 2e-3, 0.7, 1.0
    k /= start ** (order - 1.0)
    unit = f"mol/m^3/s*(m^3/mol)^{order:g}"
    errors, steps = [], [20, 40, 80]
    for n in steps:
        _, transport = closed_cell(
            mechanism(r={"equation": "A -> P", "A": f"{k!r} {unit}", "orders": {"A": order}}), {"A": start}
        )
        a, p = advanced(transport, end, n)
        exact = (
            start * np.exp(-k * end)
            if order == 1.0
            else (start ** (1 - order) + (order - 1) * k * end) ** (1 / (1 - order))
        )
        assert a + p == pytest.approx(start, rel=1e-13)
        errors.append(abs(a - exact) / start)
    assert errors[-1] < 5e-3
    assert rate([1 / n for n in steps], errors) == pytest.approx(1.0, abs=0.05)
    if order == 0.5:
        a, p = advanced(transport, 3.0 * 2.0 * np.sqrt(start) / k, 40)
        assert -1e-15 * start <= a < 1e-9 * start and p == pytest.approx(start, rel=1e-12)


def test_gas_comes_to_its_equilibrium() -> None:
    """2 A <=> A2: C_A2/C_A^2 = K. Fails when a gas that meets itself is not of second order, or K is not in m3/mol."""
    K, start = 300.0, 2e-3
    _, transport = closed_cell(
        mechanism(r={"equation": "2 A <=> A2", "A": "1e6 m^3/mol/s", "equilibrium_constant": f"{K} m^3/mol"}),
        {"A": start},
    )
    found = dict(zip(transport.names, advanced(transport, 1.0, 10), strict=True))
    assert found["A2"] / found["A"] ** 2 == pytest.approx(K, rel=1e-8)
    assert found["A"] + 2.0 * found["A2"] == pytest.approx(start, rel=1e-12)


PACKING = {
    "porosity": 0.4, "permeability": "4 um^2", "tortuosity_factor": [7.0, 1.6], "surface_to_volume": "2e4 1/m",
    "site_density": f"{N_S} mol/m^2",
}  # fmt: skip


def test_equilibrium_in_a_column() -> None:
    """A <=> B in plug flow: the affinity k_f C_A - k_b C_B decays like a species with the sink eps (k_f + k_b), A + B stays.

    Fails when the way back is not that of the concentration beside it, or the steady state is not of second order in the row height.
    """
    forward, back, u, length, diffusivity = 3.0, 1.5, 0.035, 0.02, 4e-4
    errors, cells = [], [8, 16, 32]
    exact = danckwerts(u, 0.4 * diffusivity / 1.6, 0.4 * (forward + back), length)
    for n in cells:
        case = column_case(
            length, n, u, {**PACKING, "surface_to_volume": "0 1/m"},
            inlet={"mass_fractions": {"A": 2e-4}},
            gas={"diffusivity": f"{diffusivity} m^2/s"},
            chemistry=mechanism(r={"equation": "A <=> B", "A": f"{forward} 1/s", "reverse": {"A": f"{back} 1/s"}}),
            fidelity="steady",
        )  # fmt: skip
        reactor, result = run(case)
        assert_laws(reactor)
        feed = case.feed_concentrations({"A": 2e-4})["A"]
        a, b = (result.field(f"C_{name}")[:, 0] / feed for name in "AB")
        affinity = (forward * a - back * b) / forward
        errors.append(norm(affinity - exact(middles(result.grid.y))))
        np.testing.assert_allclose(a + b, 1.0, rtol=1e-9)
    assert errors[-1] < 1e-3, errors
    assert rate([1 / n for n in cells], errors) > 1.9, errors


def inhibited(k: float, back: float, q: float, feed: float, places: float) -> tuple[float, float]:
    """A + OH* -> X* + P and back in a stirred cell that solids cross in SUBSTEPS implicit steps, by bisection on what they take.

    q (C_in - C_A) = w = q C_P of one balance, theta_X of the solids from dtheta/dt = (k C_A (1 - theta) - k' C_P theta)/n_s per step:
    q is the flow of gas, `places` the flow of places [mol/s], both per metre; k, k' [m/s] come times the time in the cell over n_s.
    """
    low, high = 0.0, min(q * feed, places)
    for _ in range(200):
        w = 0.5 * (low + high)
        there, again = k * (feed - w / q) / SUBSTEPS, back * w / q / SUBSTEPS
        theta = 0.0
        for _ in range(SUBSTEPS):
            theta = (theta + there) / (1.0 + there + again)
        low, high = (w, high) if theta * places > w else (low, w)
    return theta, w


def test_a_product_that_binds_again() -> None:
    """TiCl4-like: A + OH* <=> X* + P holds itself back; the steady coverage of solids that leave, and the use made of A, by hand.

    Fails when the product's concentration does not enter the rate, or a cell that solids cross is not integrated as its docstring says.
    """
    forward, back, speed, length, height = 0.4, 4.0, 0.01, 3e-3, 2e-3
    chemistry = {
        "mechanism": "inline",
        "species": {name: GAS[name] for name in ("A", "P")},
        "site": {"OH*": {"elements": {"X": 1}}, "X*": {"elements": {"X": 1}}},
        "reaction": {
            "r": {"equation": "A + OH* <=> X* + P", "A": f"{forward} m/s", "reverse": {"A": f"{back} m/s"}}
        },
    }
    case = column_case(
        height, 1, 0.05, PACKING,
        geometry={"cell_width": f"{length} m", "bed_inflow": "fresh", "periodic": False, "layer": [
            {"name": "packing", "height": f"{height} m", "cells": 1, "material": "packing", "moving": True}]},
        inlet={"mass_fractions": {"A": 2e-3}}, chemistry=chemistry,
        motion={"gamma": 0.0, "bed_velocity": f"{speed} m/s", "start": "0 s"}, fidelity="steady",
    )  # fmt: skip
    reactor, result = run(case)
    assert_laws(reactor)
    feed = case.feed_concentrations({"A": 2e-3})["A"]
    time, q, places = length / speed, 0.05 * length, speed * height * 2e4 * N_S
    theta, w = inhibited(forward * time / N_S, back * time / N_S, q, feed, places)
    assert 0.1 < theta < 0.9
    assert result.field("theta_X*").mean() == pytest.approx(theta, rel=1e-8)
    assert result.summary["species"]["A"]["reacted"] == pytest.approx(w, rel=1e-8)
    free, _ = inhibited(forward * time / N_S, 0.0, q, feed, places)
    assert free > 1.2 * theta


def bed(chemistry: dict[str, Any], columns: int = 8, **more: Any) -> Case:
    """A bed covered with A* that moves to the right below a stream of carrier gas."""
    length, port = 8e-3, {"center": "4 mm", "width": "8 mm"}
    return strip_case(
        [{"name": "bed", "height": "1 mm", "cells": 2, "material": "packing", "moving": True}],
        columns, length,
        geometry={
            "bed_inflow": "fresh",
            "inlet": [{"name": "in", "velocity": "1 cm/s", **port}],
            "outlet": [{"name": "out", **port}],
        },
        material={"packing": {**PACKING, "initial_coverage": {"A*": 1.0, "*": 0.0}}},
        motion={"gamma": 0.0, "bed_velocity": "1 cm/s", "start": "0 s"},
        chemistry=chemistry,
        **more,
    )  # fmt: skip


def test_solids_that_let_go_by_themselves() -> None:
    """A* -> A + * where no gas has a say: a share 1/(1 + k t/m)^m is left after each cell, m steps in it, and all of it is gas.

    Fails when reactions without a gas are left out of a run, steady or in time, or are counted in one of gas and solids alone.
    """
    k, residence = 2.0, 0.1  # 1/s, s in a cell
    chemistry = mechanism(r={"equation": "A* -> A + *", "A": f"{k} 1/s"})
    reactor, result = run(bed(chemistry, fidelity="steady"))
    assert_laws(reactor)
    left = (1.0 + k * residence / SUBSTEPS) ** (-SUBSTEPS * np.arange(1, 9))
    np.testing.assert_allclose(result.field("theta_A*"), np.tile(left, (2, 1)), rtol=1e-10)
    made = 1e-2 * 1e-3 * 2e4 * N_S * (1.0 - left[-1])
    assert result.summary["species"]["A"]["produced"] == pytest.approx(made, rel=1e-10)
    assert result.summary["species"]["A"]["left"] == pytest.approx(made, rel=1e-9)
    reactor, moving = run(bed(chemistry, time={"end": "2 s", "step": "10 ms"}, output={"every": "1 s"}))
    assert_laws(reactor)
    # columns of the averaged bed move on as a whole: at any time each is up to one further on its way
    ages = np.exp(-k * residence * np.arange(0, 10))
    found = moving.field("theta_A*").mean(axis=0)
    assert (found > 0.97 * ages[1:9]).all() and (found < 1.03 * ages[:8]).all()


def test_gas_that_solids_let_go_and_take_up_again() -> None:
    """A* <=> A + * with nothing fed: the three fidelities end, balance, and agree on what leaves.

    Fails when a run without a feed has no scale for its residuals, or is taken for one in which nothing happens.
    """
    chemistry = mechanism(r={"equation": "A* <=> A + *", "A": "2 1/s", "reverse": {"A": "0.05 m/s"}})
    reactor, steady = run(bed(chemistry, fidelity="steady"))
    assert_laws(reactor)
    reactor, long = run(bed(chemistry, time={"end": "2 s", "step": "10 ms"}, output={"every": "1 s"}))
    assert_laws(reactor)
    made = steady.summary["species"]["A"]
    assert 0.05 < 1.0 - steady.field("theta_A*")[:, -1].mean() < 0.8
    assert made["left"] == pytest.approx(made["produced"], rel=1e-9)
    np.testing.assert_allclose(long.field("theta_A*")[:, -1], steady.field("theta_A*")[:, -1], atol=0.05)


def test_periodic_solids_keep_every_kind_of_site() -> None:
    """Sites that never meet those of the reactions, on solids that come back: each kind keeps its share, in a few steps.

    Fails when a share that no reaction changes is an unknown: the system is singular, and Newton's method wanders along it.
    """
    chemistry = mechanism(
        up={"equation": "A + * -> A*", "A": "1 m/s"},
        down={"equation": "A* -> A + *", "A": "0.01 1/s"},
        lost={"equation": "A + A* -> P + A*", "A": "4e-4 m/s"},
    )
    case = bed(chemistry, fidelity="steady").with_(
        {
            "geometry.bed_inflow": "periodic",
            "geometry.inlet.in.mass_fractions": {"A": 3e-4},
            "material.packing.initial_coverage": {"*": 0.7, "A*": 0.0, "B*": 0.3},
        }
    )
    reactor, result = run(case)
    assert_laws(reactor)
    assert result.summary["steps"] <= 8
    np.testing.assert_allclose(result.field("theta_*") + result.field("theta_A*"), 0.7, rtol=1e-10)
    np.testing.assert_allclose(result.field("theta_B*"), 0.3, rtol=1e-10)
