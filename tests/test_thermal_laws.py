"""Laws of heat without a mesh: properties of gases, conductivity of beds, exchange, natural convection, heats of reaction, rarefied gas."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from mpm.case.case import load_case
from mpm.case.chemistry import mechanism_schema
from mpm.constants import GAS_CONSTANT as R
from mpm.physics.diffusion import thermal_diffusion
from mpm.physics.fluidisation import mean_free_path
from mpm.physics.gases import CARRIERS
from mpm.physics.mechanism import Mechanism
from mpm.physics.porous import bosanquet, knudsen_diffusivity, slip_factor
from mpm.physics.thermal import (
    MODELS,
    darcy_rayleigh,
    effective_conductivity,
    exchange_time,
    nusselt_of_particles,
    rayleigh,
    volumetric_heat_capacity,
    zehner_schluender,
)

REFERENCE: dict[str, list[tuple[float, float, float, float]]] = {
    "N2": [(300, 1.789e-5, 0.02597, 1041), (473, 2.506e-5, 0.03741, 1053), (600, 2.958e-5, 0.04484, 1075)],
    "Ar": [(300, 2.274e-5, 0.01784, 521.5), (473, 3.268e-5, 0.02563, 520.7), (600, 3.900e-5, 0.03057, 520.6)],
    "He": [(300, 1.993e-5, 0.1560, 5193), (473, 2.729e-5, 0.2139, 5193), (600, 3.222e-5, 0.2524, 5193)],
}  # fmt: skip
"""(T [K], viscosity [Pa s], conductivity [W/m/K], c_p [J/kg/K]) at 101325 Pa of CoolProp 8.0.0, which evaluates the reference equations."""


@pytest.fixture(scope="module")
def alumina() -> Mechanism:
    return load_case("single_cycle").mechanism


# Gases


@pytest.mark.parametrize("name", REFERENCE)
def test_gases_are_those_of_the_reference_equations(name: str) -> None:
    """Fails when a constant of a formula is misprinted: all are within 2.2 % (heat capacities 0.3 %) of equations fitted to all data."""
    gas = CARRIERS[name]
    for temperature, viscosity, conductivity, heat_capacity in REFERENCE[name]:
        assert gas.viscosity(float(temperature)) == pytest.approx(viscosity, rel=0.022)
        assert gas.conductivity(float(temperature)) == pytest.approx(conductivity, rel=0.017)
        assert gas.heat_capacity(float(temperature)) == pytest.approx(heat_capacity, rel=0.003)


def test_heat_capacity_of_nitrogen_is_smooth_where_its_constants_change() -> None:
    gas = CARRIERS["N2"]
    assert gas.heat_capacity(500.0) == pytest.approx(gas.heat_capacity(500.001), rel=2e-3)
    assert gas.heat_capacity(1.0) == gas.heat_capacity(100.0)  # beyond its range the value at its end
    assert gas.heat_capacity(1e9) == gas.heat_capacity(2000.0)


def test_a_typed_property_is_scaled_as_the_carriers() -> None:
    """Fails when a typed value is forgotten away from gas.temperature, or changes at it."""
    gas = load_case("single_zone", {"gas.viscosity": "2e-5 Pa s", "gas.conductivity": "0.0454 W/m/K"}).gas
    assert gas.viscosity_at(473.0) == 2e-5 and gas.conductivity_at(473.0) == 0.0454
    model = CARRIERS["N2"]
    assert gas.viscosity_at(300.0) == pytest.approx(2e-5 * model.viscosity(300.0) / model.viscosity(473.0))
    many = gas.conductivity_at(np.array([300.0, 473.0]))
    assert many == pytest.approx([gas.conductivity_at(300.0), 0.0454], rel=1e-14)
    assert gas.diffusivity_factor(946.0) == pytest.approx(2.0**1.75)


def test_an_unknown_carrier_follows_a_power_law() -> None:
    own = {"carrier": "Kr", "molar_mass": "83.8 g/mol", "viscosity": "3e-5 Pa s", "temperature": "400 K"}
    typed = {"conductivity": "0.012 W/m/K", "heat_capacity": "248 J/kg/K"}
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    case = load_case(
        {"geometry": {"length": "100 mm", "layer": layer}, "gas": {**own, **typed}, "energy": {}}
    )
    assert case.gas.viscosity_at(800.0) == pytest.approx(3e-5 * 2.0**0.75)
    assert case.gas.conductivity_at(800.0) == pytest.approx(0.012 * 2.0**0.75)


# Beds


@pytest.mark.parametrize("model", MODELS)
def test_a_bed_of_one_conductivity_has_that_one(model: Any) -> None:
    for porosity in (0.1, 0.46, 0.9):
        assert effective_conductivity(model, porosity, 0.7, 0.7) == pytest.approx(0.7, rel=1e-12)


def test_models_keep_their_order_and_bounds() -> None:
    """Fails when a bed conducts more than side by side or less than one behind the other (Wiener's bounds)."""
    for ratio in (0.02, 0.5, 3.0, 35.0, 500.0):
        values = {m: effective_conductivity(m, 0.46, 1.0, ratio) for m in MODELS}
        assert min(values.values()) == values["series"] and max(values.values()) == values["parallel"]


def test_hand_values_of_the_models() -> None:
    assert effective_conductivity("parallel", 0.4, 0.03, 1.3) == pytest.approx(0.792)
    assert effective_conductivity("series", 0.4, 0.03, 1.3) == pytest.approx(1.0 / (0.4 / 0.03 + 0.6 / 1.3))
    assert effective_conductivity("geometric", 0.5, 0.04, 1.0) == pytest.approx(0.2)
    shape = effective_conductivity("geometric", np.full(3, 0.5), np.full(3, 0.04), np.ones(3))
    assert shape == pytest.approx([0.2, 0.2, 0.2])


@pytest.mark.parametrize("porosity", [0.26, 0.4, 0.46, 0.7])
@pytest.mark.parametrize("ratio", [0.1, 2.0, 35.0, 1000.0])
def test_zehner_and_schluender_is_the_flow_of_heat_through_their_cell(porosity: float, ratio: float) -> None:
    """Fails when the closed form is not what it was made from: solid and gas one behind the other in every ring of the unit cell.

    The particle's outline is r^2 + z^2/(B - (B - 1) z)^2 = 1 (Zehner and Schluender 1970), so that its height at r is
    z = B w/(1 + (B - 1) w), w = sqrt(1 - r^2).
    """
    b = 1.25 * ((1.0 - porosity) / porosity) ** (10.0 / 9.0)

    def ring(r: float) -> float:
        w = math.sqrt(1.0 - r * r)
        z = b * w / (1.0 + (b - 1.0) * w)
        return 2.0 * r / (1.0 - z + z / ratio)

    root = math.sqrt(1.0 - porosity)
    expected = 1.0 - root + root * quad(ring, 0.0, 1.0, epsabs=1e-12)[0]
    found = zehner_schluender(np.array(porosity), np.array(1.0), np.array(ratio))
    assert float(found) == pytest.approx(expected, rel=1e-8)


def test_zehner_and_schluender_where_its_closed_form_is_zero_over_zero() -> None:
    """Fails when the value jumps at k_s/k = B, or where the series takes over."""
    b = 1.25 * (0.6 / 0.4) ** (10.0 / 9.0)
    ratio = b / (1.0 - np.array([-0.0501, -0.0499, -1e-9, 0.0, 1e-9, 0.0499, 0.0501]))
    values = zehner_schluender(np.full(7, 0.4), np.ones(7), ratio)
    assert np.all(np.diff(values) > 0.0)
    assert values[[0, 5]] == pytest.approx(values[[1, 6]], rel=2e-4)
    assert values[2] == pytest.approx(values[3], abs=1e-8) == pytest.approx(values[4], abs=1e-8)


def test_glass_beads_in_nitrogen_differ_by_a_factor_of_nine() -> None:
    """The four models for the bed of the thesis [W/m/K]: why `mpm check` names the one that is used."""
    gas = CARRIERS["N2"].conductivity(473.0)
    found = [effective_conductivity(model, 0.46, gas, 1.3) for model in MODELS]
    assert found == pytest.approx([0.7192, 0.0788, 0.2544, 0.1952], abs=1e-4)


def test_exchange_and_heat_capacity_by_hand() -> None:
    assert nusselt_of_particles(0.7, 0.0) == 2.0
    assert nusselt_of_particles(0.729, 32.0) == pytest.approx(2.0 + 1.1 * 0.9 * 8.0)
    held = volumetric_heat_capacity(0.46, gas=760.0, density=2500.0, heat_capacity=871.0)
    assert held == pytest.approx(0.46 * 760.0 + 0.54 * 2.1775e6)
    time = exchange_time(porosity=0.5, density=2000.0, heat_capacity=1000.0, transfer=1000.0, surface=5e4)
    assert time == pytest.approx(0.02)


def test_numbers_of_natural_convection_by_hand() -> None:
    """100 K across 12.7 mm of nitrogen at 423 K: 4.1e3, above the critical 1708."""
    gas = CARRIERS["N2"]
    density = 101325.0 * gas.molar_mass / (R * 423.0)
    alpha = gas.conductivity(423.0) / (density * gas.heat_capacity(423.0))
    state: dict[str, float] = {
        "difference": 100.0,
        "temperature": 423.0,
        "viscosity": gas.viscosity(423.0),
        "density": density,
    }
    ra = rayleigh(height=12.7e-3, diffusivity=alpha, **state)
    assert ra == pytest.approx(9.81 * 100.0 / 423.0 * 12.7e-3**3 / (gas.viscosity(423.0) / density * alpha))
    assert ra == pytest.approx(4.08e3, rel=1e-2)
    porous = darcy_rayleigh(
        height=12.7e-3,
        permeability=4e-12,
        conductivity=gas.conductivity(423.0),
        gas_heat_capacity=gas.heat_capacity(423.0),
        **state,
    )
    assert porous == pytest.approx(ra * 4e-12 / 12.7e-3**2)  # Ra times the number of Darcy


# Rarefied gas


def test_slip_and_knudsen_diffusion_by_hand() -> None:
    assert slip_factor(1e-7, 1e-5) == pytest.approx(1.08)
    assert knudsen_diffusivity(3e-6, 0.04, 300.0) == pytest.approx(
        1e-6 * math.sqrt(2400.0 * R / (math.pi * 0.04))
    )
    assert bosanquet(2e-5, 2e-5) == pytest.approx(1e-5)
    assert bosanquet(2e-5, 1e9) == pytest.approx(2e-5, rel=1e-12)  # wide pores
    assert bosanquet(2e3, 1e-5) == pytest.approx(1e-5, rel=1e-8)  # nothing but walls


def test_a_material_without_pores_is_that_of_a_dense_gas() -> None:
    """Fails when a case that does not say how wide its pores are gets other properties, or when wide pores do not come to the same."""
    case = load_case("single_zone")
    beads, path = case.materials["glass_beads"], case.gas.mean_free_path
    assert beads.slip_permeability(path) is beads.permeability
    assert beads.pore_diffusivity(2.88e-5, 0.072, 473.0) == 2.88e-5
    wide = case.with_({"material.glass_beads.pore_diameter": "100 m"}).materials["glass_beads"]
    assert wide.slip_permeability(path) == pytest.approx(beads.permeability, rel=1e-7)
    assert wide.pore_diffusivity(2.88e-5, 0.072, 473.0) == pytest.approx(2.88e-5, rel=1e-8)
    assert wide.pore_diffusivity(0.0, 0.072, 473.0) == 0.0


def test_slip_at_low_pressure_is_klinkenbergs() -> None:
    """K (1 + b/p): the part that slip adds falls as 1/p; at 200 Pa it is what rules in pores of 23 um."""
    pores = {"material.glass_beads.pore_diameter": "23 um"}
    added = []
    for pressure in (200.0, 20000.0):
        case = load_case("single_zone", {**pores, "gas.pressure": f"{pressure} Pa"})
        assert case.gas.mean_free_path == mean_free_path(
            viscosity=case.gas.viscosity, pressure=pressure, temperature=473.0, molar_mass=case.gas.molar_mass
        )
        beads = case.materials["glass_beads"]
        added.append(beads.slip_permeability(case.gas.mean_free_path)[1] / beads.permeability[1] - 1.0)
    assert added[0] == pytest.approx(100.0 * added[1], rel=1e-9) and added[0] > 10.0


# Soret


def test_heavy_molecules_leave_what_is_hot() -> None:
    """Fails when the sign or the size is wrong: thermal diffusion factors of gases are some tenths (Grew and Ibbs 1952)."""
    molar_density, diffusivity = 101325.0 / (R * 473.0), 2.88e-5
    tma, methane = (thermal_diffusion(mass, 28.01e-3, 473.0) for mass in (72.09e-3, 16.04e-3))
    assert thermal_diffusion(28.01e-3, 28.01e-3, 473.0) == 0.0
    assert 0.1 < tma / (molar_density * diffusivity) < 0.5
    assert methane < 0.0


# Heats of reaction


def test_hess_sum_is_that_of_the_tables(alumina: Mechanism) -> None:
    """2 TMA + 3 H2O -> Al2O3 + 6 CH4 by way of the surface: what the sites are worth must drop out."""
    tma, water = alumina.surface_reactions
    cycle = 2.0 * alumina.heat_of_reaction(tma, 298.15) + alumina.heat_of_reaction(water, 298.15)
    tables = -1675.7e3 + 6.0 * -74.6e3 - 2.0 * -86.5e3 - 3.0 * -241.826e3
    assert cycle == pytest.approx(tables, rel=1e-12) == pytest.approx(-1224.8e3, rel=1e-4)


def test_heats_of_the_halves(alumina: Mechanism) -> None:
    """TMA on OH as Widjaja and Musgrave (2002) have it, 1.30 to 1.70 eV; all reactions set heat free, in the gas too."""
    electronvolt = 96485.33
    tma, water = (alumina.heat_of_reaction(r, 473.0) for r in alumina.surface_reactions)
    assert tma == pytest.approx(-1.5 * electronvolt, rel=1e-4)
    assert water < -4.0 * 1.3 * electronvolt
    (cvd,) = alumina.gas_reactions
    assert alumina.heat_of_reaction(cvd, 473.0) == pytest.approx(-424.49e3, rel=1e-6)
    many = alumina.heat_of_reaction(alumina.surface_reactions[0], np.array([300.0, 600.0]))
    assert many == pytest.approx([tma, tma])


def inline(**changes: Any) -> dict[str, Any]:
    """A case with one reaction X + Y -> Z in the gas."""
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    species = {
        "X": {"molar_mass": "16 g/mol", "formula": "CH4"},
        "Y": {"molar_mass": "18 g/mol", "formula": "H2O"},
        "Z": {"molar_mass": "34 g/mol", "formula": "CH6O"},
    }
    for name, keys in changes.pop("species", {}).items():
        species[name] |= keys
    reaction = {"equation": "X + Y -> Z", "A": "1 m^3/mol/s", **changes.pop("reaction", {})}
    return {
        "geometry": {"length": "100 mm", "layer": layer},
        "chemistry": {"mechanism": "inline", "species": species, "reaction": {"r": reaction}},
        "energy": {},
        **changes,
    }


def heat(temperature: float, **changes: Any) -> float:
    mechanism = load_case(inline(**changes)).mechanism
    return mechanism.heat_of_reaction(mechanism.gas_reactions[0], temperature)


ENTHALPIES = {
    "X": {"enthalpy": "-10 kJ/mol"},
    "Y": {"enthalpy": "-20 kJ/mol"},
    "Z": {"enthalpy": "-50 kJ/mol"},
}


def test_heat_follows_temperature_where_all_heat_capacities_are_known() -> None:
    """Kirchhoff: dH(T) = dH(298.15 K) + sum nu c (T - 298.15 K); with some heat capacities missing none counts."""
    capacities = {"X": "30 J/mol/K", "Y": "30 J/mol/K", "Z": "70 J/mol/K"}
    full = {name: {**ENTHALPIES[name], "heat_capacity": c} for name, c in capacities.items()}
    assert heat(298.15, species=full) == pytest.approx(-20e3)
    assert heat(398.15, species=full) == pytest.approx(-20e3 + 10.0 * 100.0)
    del full["Z"]["heat_capacity"]
    assert heat(398.15, species=full) == pytest.approx(-20e3)


def test_a_given_heat_wins_and_none_is_none() -> None:
    assert heat(500.0, reaction={"heat_of_reaction": "-33 kJ/mol"}, species=ENTHALPIES) == -33e3
    assert heat(500.0) == 0.0


def test_keys_of_heat_are_in_the_schema_of_mechanism_files() -> None:
    tables = mechanism_schema()["$defs"]
    assert {"enthalpy", "heat_capacity"} <= tables["SpeciesTable"]["properties"].keys()
    assert {"enthalpy", "heat_capacity"} <= tables["FilmTable"]["properties"].keys()
    assert "heat_of_reaction" in tables["ReactionTable"]["properties"]


def test_the_mechanism_file_says_where_its_enthalpies_are_from() -> None:
    """Fails when an enthalpy is changed in the file without its comment: the sources are the only proof of the numbers."""
    text = (Path(__file__).parents[1] / "mpm" / "mechanisms" / "alumina.toml").read_text(encoding="utf-8")
    for said in ("NASA/TP-2002-211556", "NIST Chemistry WebBook", "Widjaja and Musgrave", "-1224.8 kJ/mol"):
        assert said in text
