"""Mechanisms in Cantera's YAML against Cantera itself: rates of progress, what is refused, what a resolved case keeps."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mpm.advice.caveats import polynomial_caveats, site_density_caveats
from mpm.case.case import Case, load_case
from mpm.case.settings import parse_settings
from mpm.cli import main
from mpm.errors import InputError
from mpm.physics.mechanism import Mechanism
from mpm.physics.rate_solvers import surface_kinetics
from mpm.physics.rate_table import RateTable
from mpm.physics.rates import Law

from .cases import TINY, assert_laws, run, zone

ct = pytest.importorskip("cantera", reason="the extra chemistry is not installed")
R = 8.31446261815324
SURFACES = [
    ("ptcombust.yaml", "Pt_surf", (500.0, 900.0, 1400.0)),
    ("methane_pox_on_pt.yaml", "Pt_surf", (400.0, 900.0, 1400.0)),
    (
        "diamond.yaml",
        "diamond_100",
        (600.0, 1200.0),
    ),  # reversible, with a film, from enthalpies and entropies
    ("SiF4_NH3_mec.yaml", "SI3N4", (1000.0, 1713.0)),  # species that hold two and four places
    ("sofc.yaml", "metal_surface", (800.0, 1100.0)),  # sticking coefficients of reversible reactions
]


def case_of(mechanism: str, temperature: float = 900.0, **chemistry: Any) -> Case:
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    return load_case(
        {
            "geometry": {"length": "10 mm", "cell_width": "1 mm", "layer": layer},
            "chemistry": {"mechanism": mechanism, "gas_reactions": False, **chemistry},
            "gas": {"carrier": "He", "temperature": f"{temperature} K"},
        }
    )


def progress(case: Case, amounts: dict[str, float], T: float, site_density: float) -> np.ndarray:
    """Rates of progress (reactions, 2) there and back as `mpm.physics.rates` defines them, in the order of the file."""
    found = []
    for reaction in case.mechanism.reactions:
        constants = case.mechanism.rate_constants(reaction, T, site_density)
        ways = [float(k) * product(law, amounts, T) for k, law in zip(constants, reaction.laws, strict=False)]
        found.append([*ways, 0.0][:2])
    return np.array(found)


def product(law: Law, amounts: dict[str, float], T: float) -> float:
    value = math.prod(amounts[name] ** order for name, order in {**law.gas_orders, **law.site_orders}.items())
    for name, of in law.coverage.items():
        theta = amounts[name]
        value *= 10.0 ** (of.a * theta) * theta**of.m * math.exp(-of.E * theta / (R * T))
    return value


@pytest.mark.parametrize(("file", "phase", "temperatures"), SURFACES, ids=lambda value: str(value)[:12])
def test_rates_of_progress_are_canteras(file: str, phase: str, temperatures: tuple[float, ...]) -> None:
    """To 1e-10 of each reaction's gross rate, at random compositions, pressures and coverages. Fails when a unit, an order, a sticking
    coefficient, a dependence on coverage, an equilibrium or the size of a species is taken for another."""
    surface = ct.Interface(file, phase)
    gas = next(beside for beside in surface.adjacent.values() if beside.thermo_model == "ideal-gas")
    case = case_of(file, max(temperatures), phase=phase)
    assert len(case.mechanism.reactions) == surface.n_reactions
    random = np.random.default_rng(16)
    for T in temperatures:
        for pressure in (2e3, ct.one_atm):
            gas.TPX = T, pressure, random.dirichlet(np.ones(gas.n_species))
            for beside in surface.adjacent.values():
                beside.TP = T, ct.one_atm if beside is not gas else pressure
            surface.TP = T, ct.one_atm
            surface.coverages = random.dirichlet(0.3 * np.ones(surface.n_species))
            amounts = {
                **dict(zip(gas.species_names, gas.concentrations * 1e3, strict=True)),
                **dict(zip(surface.species_names, surface.coverages, strict=True)),
            }
            ours = progress(case, amounts, T, surface.site_density * 1e3)
            theirs = (
                np.stack([surface.forward_rates_of_progress, surface.reverse_rates_of_progress], axis=1) * 1e3
            )
            gross = theirs.sum(axis=1, keepdims=True)
            assert (np.abs(ours - theirs) <= 1e-10 * gross).all(), surface.reaction_equations()


def states(surface: Any, temperature: float, cells: int) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
    """Random compositions, pressures and coverages: the gas, concentrations [mol/m3], coverages, and forward and backward rates of progress
    [mol/m2/s] (2, reactions, cells) that Cantera has for them."""
    gas = next(beside for beside in surface.adjacent.values() if beside.thermo_model == "ideal-gas")
    random = np.random.default_rng(int(temperature))
    amounts, coverages, rates = [], [], []
    for _ in range(cells):
        for beside in surface.adjacent.values():
            beside.TP = temperature, ct.one_atm
        gas.TPX = temperature, 10 ** random.uniform(2, 5), random.dirichlet(np.ones(gas.n_species))
        surface.TP = temperature, ct.one_atm
        surface.coverages = random.dirichlet(0.3 * np.ones(surface.n_species))
        amounts.append(gas.concentrations * 1e3)
        coverages.append(surface.coverages)
        rates.append(np.stack([surface.forward_rates_of_progress, surface.reverse_rates_of_progress]) * 1e3)
    return gas, np.array(amounts).T, np.array(coverages).T, np.stack(rates, axis=-1)


@pytest.mark.parametrize(("file", "phase", "temperatures"), SURFACES, ids=lambda value: str(value)[:12])
def test_net_rates_of_the_solver_are_canteras(file: str, phase: str, temperatures: tuple[float, ...]) -> None:
    """What runs compute with, in 20 cells at once: net rates to 1e-10 of the gross ones. Fails when its table and the laws differ."""
    surface = ct.Interface(file, phase)
    case = case_of(file, max(temperatures), phase=phase)
    mechanism, reactions = case.mechanism, case.mechanism.surface_reactions
    for T in temperatures:
        gas, amounts, coverages, theirs = states(surface, T, 20)
        order = [gas.species_index(name) for name in mechanism.species_names]
        places = [surface.species_index(name) for name in mechanism.site_names]
        density = np.full(20, surface.site_density * 1e3)
        table = RateTable(mechanism, reactions, mechanism.species_names, density)
        table.heat_to(T)
        ours = table.rates(table.gas_part(amounts[order]), coverages[places])
        net, gross = np.zeros(theirs.shape[1:]), np.zeros(theirs.shape[1:])
        for way in table.ways:  # reactions that undo each other count as one
            net[way.counted] += way.sign * theirs[int(way.back), way.reaction]
            gross[way.counted] += theirs[int(way.back), way.reaction]
        assert (np.abs(ours.net - net) <= 1e-10 * gross).all()
        assert ours.gross == pytest.approx(gross, rel=1e-10)
        assert net.any() and len(table.ways) >= len(reactions)


ALL_AT_ONCE = """
units: {length: cm, quantity: mol, activation-energy: kJ/mol}
phases:
- name: gas
  thermo: ideal-gas
  species: [{gri30.yaml/species: [H2, O2, CH4, AR]}]
- name: solid
  thermo: fixed-stoichiometry
  species: [B]
- name: s
  thermo: ideal-surface
  species: [P, H(S), O(S), OO(S)]
  kinetics: surface
  reactions: all
  Motz-Wise: true
  site-density: 2.7e-9
  adjacent-phases: [gas, solid]
  state: {T: 900.0, coverages: {H(S): 1.0}}
species:
- {name: P, composition: {}, thermo: {model: constant-cp, h0: 0.0 J/mol, s0: 0.0 J/mol/K}}
- {name: H(S), composition: {H: 1}, thermo: {model: constant-cp, T0: 400 K, h0: -40 kJ/mol, s0: 9 J/mol/K, cp0: 12 J/mol/K}}
- {name: O(S), composition: {O: 1}, thermo: {model: constant-cp, h0: -100 kJ/mol, s0: 20 J/mol/K, cp0: 20 J/mol/K}}
- {name: OO(S), composition: {O: 2}, sites: 2, thermo: {model: constant-cp, h0: -90 kJ/mol, s0: 60 J/mol/K}}
- {name: B, composition: {C: 1}, thermo: {model: constant-cp, h0: 3 kJ/mol, s0: 6 J/mol/K},
   equation-of-state: {model: constant-volume, density: 2.2 g/cm^3}}
reactions:
- {equation: H2 + 2 P <=> 2 H(S), sticking-coefficient: {A: 0.1, b: 0.2, Ea: 5}}
- {equation: O2 + 2 P <=> OO(S), sticking-coefficient: {A: 2.0, b: -0.3, Ea: 0}, Motz-Wise: false,
   coverage-dependencies: {H(S): {a: 0.3, m: 0.5, E: 4}}}
- {equation: OO(S) <=> 2 O(S), rate-constant: {A: 1.0e+12, b: 0.1, Ea: 60}, coverage-dependencies: {O(S): [0.0, 0.0, -8.0]}}
- {equation: B + 4 H(S) <=> CH4 + 4 P, rate-constant: {A: 1.0e+36, b: 0.0, Ea: 20}}
- {equation: 2 O(S) + H2 => O2 + 2 P + H2, rate-constant: {A: 1.0e+22, b: 0.5, Ea: 10}, orders: {O(S): 1.5, H2: 0.5, H(S): 0.25},
   nonreactant-orders: true}
"""


def test_all_that_a_reaction_of_cantera_may_have(tmp_path: Path) -> None:
    """Motz and Wise of the phase and of one reaction, a sticking coefficient whose A is above 1, coverages in reversible reactions, kinds
    that hold two places, a film that is used up, orders of what is no reactant, reference temperatures. To 1e-10, as those above."""
    (tmp_path / "s.yaml").write_text(ALL_AT_ONCE)
    surface = ct.Interface(str(tmp_path / "s.yaml"), "s")
    mechanism = case_of(str(tmp_path / "s.yaml")).mechanism
    assert mechanism.site_names[0] == "H(S)" and mechanism.films[0].density == pytest.approx(2200.0)
    for T in (400.0, 900.0):
        gas, amounts, coverages, theirs = states(surface, T, 20)
        density = np.full(20, surface.site_density * 1e3)
        table = RateTable(mechanism, mechanism.surface_reactions, mechanism.species_names, density)
        table.heat_to(T)
        order = [gas.species_index(name) for name in mechanism.species_names]
        places = [surface.species_index(name) for name in mechanism.site_names]
        ours = table.rates(table.gas_part(amounts[order]), coverages[places])
        assert (np.abs(ours.net - (theirs[0] - theirs[1])) <= 1e-10 * theirs.sum(axis=0)).all()
        assert ours.gross == pytest.approx(theirs.sum(axis=0), rel=1e-10)


AREA = 1e4  # [1/m] of surface per volume of gas


def canteras_cell(
    surface: Any, temperature: float, feed: str, times: np.ndarray
) -> tuple[Any, np.ndarray, np.ndarray]:
    """The gas, concentrations [mol/m3] and coverages (..., times) of a closed cell of fixed volume by Cantera's rates of production.

    dC/dt = AREA w, d theta_k/dt = w_k sigma_k/Gamma, followed to 1e-9.
    """
    gas = surface.adjacent["gas"]
    gas.TPX = temperature, ct.one_atm, feed
    surface.TP = temperature, ct.one_atm
    surface.coverages = {surface.species_names[0]: 1.0}
    own = [surface.kinetics_species_index(name) for name in gas.species_names]
    sites = [surface.kinetics_species_index(name) for name in surface.species_names]
    sizes = np.array([one.size for one in surface.species()])

    def slopes(_: float, state: np.ndarray) -> np.ndarray:
        C, theta = np.maximum(state[: len(own)], 0.0), np.maximum(state[len(own) :], 0.0)
        gas.TDX = temperature, float(C @ gas.molecular_weights), C
        surface.set_unnormalized_coverages(theta)
        made = surface.net_production_rates
        return np.concatenate([AREA * made[own], made[sites] * sizes / surface.site_density])

    start = np.concatenate([gas.concentrations, surface.coverages])
    end = solve_ivp(slopes, (0.0, times[-1]), start, "BDF", times, rtol=1e-9, atol=1e-14)
    assert end.success
    return gas, end.y[: len(own)] * 1e3, end.y[len(own) :]


def our_cell(
    mechanism: Mechanism,
    C: np.ndarray,
    theta: np.ndarray,
    density: float,
    temperature: float,
    times: np.ndarray,
    steps: int,
) -> tuple[np.ndarray, np.ndarray]:
    """The same by implicit steps, so many between two of the times, the first of which is the start."""
    surface = surface_kinetics(mechanism, mechanism.species_names, np.array([density]), temperature)
    names = mechanism.species_names
    nu = np.array([[r.nu_gas.get(name, 0.0) for name in names] for r in surface.reactions])
    passed = [(C[:, 0], theta[:, 0])]
    for dt in np.diff(times) / steps:
        for _ in range(steps):
            new = C
            for _ in range(30):
                rates, slopes = surface.rates(new, theta, float(dt))
                residual = new - C - dt * AREA * (nu.T @ rates)
                matrix = np.eye(len(names)) - dt * AREA * np.einsum("ri,rj->ij", nu, slopes[:, :, 0])
                change = np.linalg.solve(matrix, -residual)
                new = new + change
                if np.abs(change).max() < 1e-13 * C.sum():
                    break
            C, theta = new, surface.coverage(new, theta, float(dt))
        passed.append((C[:, 0], theta[:, 0]))
    return np.array([one for one, _ in passed]).T, np.array([one for _, one in passed]).T


def test_trajectory_of_a_closed_cell_is_canteras() -> None:
    """Methane and oxygen on fresh platinum, over six decades of time: to 1e-4 of all gas and of all places.

    Implicit steps of first order, 1, 2 and 4 between two times, extrapolated (Aitken and Neville). Fails when what reactions make of gas
    and sites, or what a solver's step takes them for, is not what the rates say.
    """
    T, times = 1000.0, np.concatenate([[0.0], np.logspace(-8, -2, 49)])
    surface = ct.Interface("ptcombust.yaml", "Pt_surf")
    gas, amounts, coverages = canteras_cell(surface, T, "CH4:0.1, O2:0.05, AR:0.85", times)
    mechanism = case_of("ptcombust.yaml", T).mechanism
    amounts = amounts[[gas.species_index(name) for name in mechanism.species_names]]
    coverages = coverages[[surface.species_index(name) for name in mechanism.site_names]]
    start = amounts[:, :1], coverages[:, :1]
    one, two, four = (our_cell(mechanism, *start, surface.site_density * 1e3, T, times, n) for n in (1, 2, 4))
    for coarse, finer, finest, expected, whole in zip(
        one, two, four, (amounts, coverages), (ct.one_atm / (R * T), 1.0), strict=True
    ):
        first, second = 2.0 * finer - coarse, 2.0 * finest - finer
        best = second + (second - first) / 3.0
        assert np.abs(best - expected).max() < 1e-4 * whole
        assert (
            np.abs(finest - expected).max() > 1e-4 * whole
        )  # without extrapolation it would not have been met


GAS = """
phases:
- name: gas
  thermo: ideal-gas
  species: [{gri30.yaml/species: [H2, H, O2, O, OH, H2O, N2]}]
  kinetics: gas
  reactions: all
  state: {T: 1000.0, P: 1 atm}
reactions:
- {equation: O + H2 <=> H + OH, id: exchange, rate-constant: {A: 3.87e+04 cm^3/mol/s, b: 2.7, Ea: 6260.0 cal/mol}}
- {equation: 2 OH <=> O + H2O, rate-constant: {A: 3.57e+04 cm^3/mol/s, b: 2.4, Ea: -2110.0 cal/mol}}
- {equation: H2O => H + OH, rate-constant: {A: 1.0e+6 1/s, b: 0.0, Ea: 100.0 kJ/mol}}
- {equation: 2 H + O2 => H2O + O, rate-constant: {A: 1.0e+6 m^6/kmol^2/s, b: 0.0, Ea: 0}}
- {equation: 2 H + H2 <=> 2 H2, rate-constant: {A: 9.0e+16 cm^6/mol^2/s, b: -0.6, Ea: 0.0}}
- {equation: H + OH + O2 <=> H2O + O2, rate-constant: {A: 9.0e+16 cm^6/mol^2/s, b: -0.6, Ea: 0.0}}
"""


def test_reactions_of_a_gas_alone_are_canteras(tmp_path: Path) -> None:
    """Of one, two and three molecules, both ways, to 1e-10. Fails when kmol are taken for mol, or mass action for orders of 1."""
    (tmp_path / "gas.yaml").write_text(GAS)
    gas = ct.Solution(str(tmp_path / "gas.yaml"), "gas")
    case = case_of(str(tmp_path / "gas.yaml"), phase="gas")
    assert any(reaction.third_body for reaction in gas.reactions())  # Cantera keeps partners apart
    assert "N2" not in case.mechanism.species_names  # in no reaction
    assert [reaction.key for reaction in case.mechanism.reactions] == [
        "exchange",
        "G2",
        "G3",
        "G4",
        "G5",
        "G6",
    ]
    random = np.random.default_rng(3)
    for T in (500.0, 1500.0):
        gas.TPX = T, ct.one_atm, random.dirichlet(np.ones(gas.n_species))
        amounts = dict(zip(gas.species_names, gas.concentrations * 1e3, strict=True))
        theirs = np.stack([gas.forward_rates_of_progress, gas.reverse_rates_of_progress], axis=1) * 1e3
        assert progress(case, amounts, T, 1.0) == pytest.approx(theirs, rel=1e-10)


ONE_RANGE = """
phases:
- {name: g, thermo: ideal-gas, species: [A, B], kinetics: gas, reactions: all}
species:
- {name: A, composition: {H: 2}, thermo: {model: NASA7, temperature-ranges: [300, 3000], data: [[3.5, 0.001, 0, 0, 0, -1000, 3]]}}
- {name: B, composition: {H: 2}, thermo: {model: NASA7, temperature-ranges: [300, 3000], data: [[3.5, 0.002, 0, 0, 0, -1500, 3]]}}
reactions:
- {equation: A <=> B, rate-constant: {A: 10, b: 0, Ea: 0}}
"""


def test_a_polynomial_of_one_range_is_canteras(tmp_path: Path) -> None:
    """Fails when its single set of numbers, which has no middle temperature, is refused or holds for a part of its range."""
    (tmp_path / "g.yaml").write_text(ONE_RANGE)
    gas = ct.Solution(str(tmp_path / "g.yaml"), "g")
    (reaction,) = (mechanism := case_of(str(tmp_path / "g.yaml"), phase="g").mechanism).gas_reactions
    for T in (400.0, 1500.0, 2500.0):
        gas.TP = T, ct.one_atm
        assert float(mechanism.equilibrium_constant(reaction, T)) == pytest.approx(
            gas.equilibrium_constants[0], rel=1e-12
        )


def test_heats_are_canteras() -> None:
    """Enthalpies of reaction by the polynomials, J/mol. Fails when a range of temperature or a coefficient is another's."""
    surface = ct.Interface("ptcombust.yaml", "Pt_surf")
    case = load_case(
        case_of("ptcombust.yaml").origin.data,
        {"energy": {}, "gas.heat_capacity": "5193 J/kg/K", "gas.conductivity": "0.15 W/m/K"},
    )
    for T in (400.0, 900.0, 1200.0):
        surface.adjacent["gas"].TP = T, ct.one_atm
        surface.TP = T, ct.one_atm
        ours = [float(case.mechanism.heat_of_reaction(r, T)) for r in case.mechanism.reactions]
        assert ours == pytest.approx(surface.delta_enthalpy * 1e-3, rel=1e-10, abs=1e-6)


def test_a_resolved_case_is_complete_in_toml() -> None:
    """Fails when it names the file, forgets what an equilibrium needs, or keeps polynomials that nothing reads."""
    case = case_of("ptcombust.yaml")
    tables = case.to_dict()["chemistry"]
    assert tables["mechanism"] == "inline" and tables["name"] == "ptcombust" and "phase" not in tables
    with_polynomials = {
        name for kind in ("species", "site") for name, table in tables[kind].items() if "nasa" in table
    }
    assert with_polynomials == {"H(S)", "O(S)", "OH(S)", "PT(S)", "H2O(S)"}  # of reactions 12, 13 and 14
    assert load_case(case.to_dict()) == case
    assert case.mechanism.site_names[0] == "PT(S)"
    assert case_of("methane_pox_on_pt.yaml").mechanism.site_names[:2] == (
        "H(S)",
        "PT(S)",
    )  # 0.99 covered in its state
    film = case_of("diamond.yaml", 1200.0).mechanism.films[0]
    assert film.name == "C(d)" and film.density == pytest.approx(3520.0)
    assert film.molar_mass == pytest.approx(0.012011)


def test_single_numbers_can_be_set() -> None:
    """Fails when keys of a reaction of the file, or which file it is, cannot be overridden."""
    case = case_of("ptcombust.yaml")
    changed = case.with_({"chemistry.reaction.R5.sticking": 0.5, "chemistry.reaction.R5.motz_wise": True})
    (five,) = (r for r in changed.mechanism.surface_reactions if r.key == "R5")
    assert float(five.rate_constant(900.0)) == pytest.approx(
        0.5 / 0.75 * math.sqrt(R * 900.0 / (2 * math.pi * 31.998e-3))
    )
    other = case.with_({"chemistry.mechanism": "sofc.yaml", "chemistry.phase": "metal_surface"})
    assert other.mechanism.site_names[0] == "(m)"
    assert load_case(other.to_dict()) == other


def test_a_file_of_cantera_can_be_set_in_a_shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its name, wherever the user stands; one that lies there is meant first."""
    monkeypatch.chdir(tmp_path)
    typed = ["chemistry.mechanism=sofc.yaml", "chemistry.phase=metal_surface"]
    assert case_of("ptcombust.yaml").with_(parse_settings(typed)).mechanism.site_names[0] == "(m)"
    Path("sofc.yaml").write_text("")
    assert parse_settings(typed)["chemistry.mechanism"] == str(tmp_path / "sofc.yaml")


SURFACE = """
phases:
- name: gas
  thermo: ideal-gas
  species: [{{gri30.yaml/species: [H2, O2, H2O, AR]}}]
- name: solid
  thermo: {solid}
  species: [{solid_species}]
- name: s
  thermo: ideal-surface
  species: [{{ptcombust.yaml/species: [PT(S), H(S), O(S)]}}]
  kinetics: surface
  reactions: all
  site-density: 2.7e-9 mol/cm^2
  adjacent-phases: [gas, solid]
species:
- {{name: B, composition: {{Pt: 1}}, thermo: {{model: constant-cp}}, equation-of-state: {{model: constant-volume, density: 21 g/cm^3}}}}
- {{name: C, composition: {{Pt: 1}}, thermo: {{model: constant-cp}}, equation-of-state: {{model: constant-volume, density: 21 g/cm^3}}}}
reactions:
- {reaction}
"""
CARRIED = "H2 + 2 PT(S) => 2 H(S)"


@pytest.mark.parametrize(
    ("reaction", "line"),
    [
        (
            "{equation: H2 + 2 PT(S) => 2 H(S), type: Blowers-Masel, rate-constant: {A: 1 m^5/mol^2/s, b: 0, Ea0: 0, w: 1 kJ/mol}}",
            "mechanism: found reaction 1 of s, 'H2 + 2 PT(S) => 2 H(S)', of type interface-Blowers-Masel; accepted: elementary",
        ),
        (
            "{equation: H2 + 2 PT(S) => 2 H(S), rate-constant: {A: 1 m^5/mol^2/s, b: 0, Ea: 0}, "
            "coverage-dependencies: {H(S): {a: 0, m: 0, E: [1.0e3, 2.0e3, 0, 0]}}}",
            "whose activation energy is a polynomial of the coverage of H(S)",
        ),
        (
            "{equation: H2 + 2 PT(S) => 2 H(S), orders: {PT(S): -0.5}, negative-orders: true, "
            "rate-constant: {A: 1, b: 0, Ea: 0}}",
            "with a negative order",
        ),
        (
            "{equation: H2 + 2 PT(S) => 2 H(S), sticking-coefficient: {A: 2.0, b: 0, Ea: 0}}",
            "reaction.R1.sticking: found 2.0",
        ),
        (
            "{equation: H2 + 2 PT(S) => 2 H(S), sticking-coefficient: {A: 0.5, b: 0, Ea: 0}, Motz-Wise: true, "
            "coverage-dependencies: {H(S): {a: 0, m: 0, E: 1.0e3}}}",
            "whose sticking coefficient depends on coverage within the correction of Motz and Wise",
        ),
        (
            "{equation: B + H2 + 2 PT(S) => B + 2 H(S), rate-constant: {A: 1 m^5/mol^2/s, b: 0, Ea: 0}}",
            "with B of a solution",
        ),
    ],
)
def test_what_has_no_counterpart_is_refused_by_name(
    reaction: str, line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when such a reaction is taken over as another, or the line does not name it; `mpm check` ends with 2."""
    several = "of a solution" in line
    text = SURFACE.format(
        reaction=reaction,
        solid="ideal-condensed, standard-concentration-basis: unity" if several else "fixed-stoichiometry",
        solid_species="B, C" if several else "B",
    ).replace(", standard", "\n  standard")
    (tmp_path / "s.yaml").write_text(text)
    (tmp_path / "case.toml").write_text(
        '[geometry]\nbase = "single_zone"\n[chemistry]\nmechanism = "s.yaml"\n'
    )
    assert main(["check", str(tmp_path / "case.toml")]) == 2
    said = capsys.readouterr().err
    assert line in said and said.strip().count("\n") == 0 and "chemistry." in said


@pytest.mark.parametrize(
    ("chemistry", "line"),
    [
        ({"mechanism": "ptcombust.yaml", "gas_reactions": True}, "reaction 1 of gas, '2 O + M <=> O2 + M', of type three-body-Arrhenius; "
         "accepted: elementary reactions by A, b and Ea, and sticking coefficients; gas_reactions = false leaves those of the gas out"),
        ({"mechanism": "ptcombust.yaml", "phase": "Pt"}, "chemistry.phase: found 'Pt', no phase of ptcombust.yaml; "),
        ({"mechanism": "sofc.yaml"}, "phase: found nothing, and 2 surface phases in sofc.yaml; accepted: one of metal_surface, oxide"),
        ({"mechanism": "sofc.yaml", "phase": "oxide_surface"}, "which moves charge"),
        ({"mechanism": "nothing.yaml"}, "chemistry.mechanism: found 'nothing.yaml', no such file"),
        ({"mechanism": "alumina", "phase": "gas", "gas_reactions": True}, "found phase beside a mechanism that is no file of Cantera"),
        ({"mechanism": "ptcombust.yaml", "gas_reactions": "no"}, "chemistry.gas_reactions: found 'no'; accepted: true or false"),
    ],
)  # fmt: skip
def test_what_does_not_fit_the_file_is_told(chemistry: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError) as caught:
        case_of(**chemistry)
    assert line in str(caught.value) and "\n" not in str(caught.value)


def test_a_file_that_cantera_cannot_read_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("a: [1, 2\nb: }")
    with pytest.raises(
        InputError,
        match=r"bad\.yaml \(Error on line 2 of .*end of sequence flow not found\); accepted: a file that",
    ):
        case_of(str(tmp_path / "bad.yaml"))


def test_without_the_package_the_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a missing package is a traceback, or mechanisms in TOML need it."""
    monkeypatch.setitem(__import__("sys").modules, "cantera", None)
    with pytest.raises(
        InputError, match=r"the package cantera is not installed; accepted: pip install 'mpm\[chemistry\]'"
    ):
        case_of("ptcombust.yaml")
    assert load_case("single_zone").mechanism.name == "alumina"


def test_another_site_density_than_the_files_is_told() -> None:
    """Fails when constants per site meet another number of sites than they were written for, and nobody says so."""
    bed = [{"name": "bed", "height": "1 mm", "cells": 2, "material": "glass_beads"}]
    case = case_of("ptcombust.yaml").with_(
        {"geometry.layer": bed, "motion.gamma": 0.0, "motion.bed_velocity": "0 m/s"}
    )
    (line,) = site_density_caveats(case)
    assert line.startswith(
        "ptcombust was written for 2.7063e-05 mol/m2 of sites, here its constants per site meet 6.92e-08 mol/m2 of glass_beads"
    )
    assert site_density_caveats(case.with_({"material.glass_beads.site_density": "2.7063e-5 mol/m^2"})) == []
    assert site_density_caveats(load_case("single_zone")) == []


def test_polynomials_beyond_their_range_are_told() -> None:
    """Fails when a way back is read off a polynomial where nobody fitted it, in silence; or a name is told that no equilibrium reads."""
    case = case_of("ptcombust.yaml")
    assert polynomial_caveats(case) == []
    (line,) = polynomial_caveats(case.with_({"gas.temperature": "250 K"}))
    assert (
        line
        == "nasa polynomials of PT(S), H(S), H2O(S), OH(S), O(S) are those of 300 to 3000 K and are continued to 250 K"
    )


def test_a_new_case_of_a_file_of_cantera_is_that_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when `mpm new --from` forgets the phase or that the gas does not react."""
    monkeypatch.chdir(tmp_path)
    text = '[geometry]\nbase = "single_zone"\n[gas]\ntemperature = "900 K"\n'
    chemistry = '[chemistry]\nmechanism = "ptcombust.yaml"\nphase = "Pt_surf"\ngas_reactions = false\n'
    Path("case.toml").write_text(text + chemistry)
    assert main(["new", "new.toml", "--from", "case.toml"]) == 0
    assert load_case("new.toml") == load_case("case.toml")


@pytest.mark.parametrize("fidelity", ["averaged", "steady"])
def test_methane_burns_on_platinum_in_a_zone(fidelity: str) -> None:
    """ptcombust at 900 K and its own places: 24 reactions, some of which undo each other 1e5 times in a step.

    Fails when the rounding of such turnovers is more than a step may leave, or events of a pair are not net.
    """
    density = "2.7063e-5 mol/m^2"
    case = zone(
        {
            "chemistry.mechanism": "ptcombust.yaml",
            "chemistry.phase": "Pt_surf",
            "chemistry.gas_reactions": False,
            "gas.temperature": "900 K",
            "geometry.inlet.tma.mass_fractions": {"CH4": 2e-3, "O2": 1e-3},
            "material.glass_beads.site_density": density,
            "material.sintered_powder.site_density": density,
            "fidelity": fidelity,
            "time.end": "0.15 s",
            "output.every": "0.15 s",
        },
        {**TINY, "geometry.cell_width": "20 mm"},
    )
    reactor, result = run(case)
    assert_laws(reactor)
    made = {name: result.summary["species"][name]["produced"] for name in ("CO2", "CO", "H2O", "H2")}
    assert made["CO2"] > 0.0 and made["H2O"] > 0.0, made
