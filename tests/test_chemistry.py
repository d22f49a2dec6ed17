"""The mechanism: numbers of the built-in one, balances, rate laws, overrides, and one that is not alumina."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic_core import PydanticCustomError

from mpm.case.case import Case, load_case
from mpm.errors import InputError
from mpm.physics.elements import parse_formula
from mpm.physics.equation import is_reversible, parse_equation
from mpm.physics.mechanism import mole_fractions

EXAMPLE = Path(__file__).parent / "example_case.toml"
R = 8.31446261815324

TITANIA = """
name = "titania"
[species.TiCl4]
molar_mass = "189.68 g/mol"
[species.H2O]
molar_mass = "18.02 g/mol"
[species.HCl]
molar_mass = "36.46 g/mol"
[site.OH]
[site.OTiCl3]
[film.TiO2]
[reaction.chloride]
equation = "OH + TiCl4 -> OTiCl3 + HCl"
sticking = 0.02
[reaction.water]
equation = "OTiCl3 + 2 H2O -> OH + TiO2 + 3 HCl"
A = "150 cm/s"
Ea = "20 kJ/mol"
"""


@pytest.fixture(scope="module")
def case() -> Case:
    return load_case(EXAMPLE)


def example(**tables: Any) -> dict[str, Any]:
    """A small case as tables, for mechanisms of its own."""
    return {
        "geometry": {
            "length": "10 mm",
            "cell_width": "1 mm",
            "layer": [{"name": "gas", "height": "1 mm", "cells": 2}],
        },
        **tables,
    }


def test_equations_of_the_thesis(case: Case) -> None:
    """(5-17), (5-18), (5-19): rates of progress as written, stoichiometry per event."""
    tma, water = case.mechanism.surface_reactions
    (cvd,) = case.mechanism.gas_reactions
    assert str(tma) == "OH + TMA -> CH4 + OAl(CH3)2"
    assert (tma.gas, tma.site, tma.product_sites) == ("TMA", "OH", ("OAl(CH3)2",))
    assert dict(tma.nu_gas) == {"TMA": -1, "CH4": 1}
    assert dict(tma.nu_site) == {"OH": -1, "OAl(CH3)2": 1}
    assert dict(water.nu_gas) == {"H2O": -3, "CH4": 4}
    assert dict(water.nu_site) == {"OAl(CH3)2": -2, "OH": 2}
    assert dict(water.film) == {"Al2O3": 1}
    assert dict(cvd.nu_gas) == {"TMA": -1, "H2O": -3, "CH4": 3, "Al(OH)3": 1}
    assert cvd.reactants == ("TMA", "H2O")
    assert (tma.molecules_per_site, water.molecules_per_site) == (1.0, 1.5)
    assert case.mechanism.half_reactions("H2O") == (water,)
    assert case.mechanism.half_reactions("CH4") == ()
    assert case.mechanism.species_names == ("TMA", "H2O", "CH4", "Al(OH)3")
    assert case.mechanism.site_names == ("OH", "OAl(CH3)2")


def test_rate_constants_of_the_thesis(case: Case) -> None:
    """A = 0.9 and 1.9 m/s and 1.0 m3/kmol/s at 473 K; the surface constants follow the thermal velocity."""
    tma, water = case.mechanism.surface_reactions
    assert float(tma.rate_constant(473.0)) == pytest.approx(0.9, rel=1e-12)
    assert float(water.rate_constant(473.0)) == pytest.approx(1.9, rel=1e-12)
    assert float(case.mechanism.gas_reactions[0].rate_constant(473.0)) == 1e-3
    temperature = np.array([300.0, 473.0, 600.0])
    assert tma.rate_constant(temperature) == pytest.approx(0.9 * np.sqrt(temperature / 473.0))


def test_sticking_gives_kinetic_theory(case: Case) -> None:
    """lambda sqrt(R T/(2 pi M)): 0.932 and 1.864 m/s for 0.01, the numbers that the thesis rounds to 0.9 and 1.9."""
    changed = case.with_({"chemistry.reaction.tma.sticking": 0.01, "chemistry.reaction.water.sticking": 0.01})
    tma, water = changed.mechanism.surface_reactions
    assert float(tma.rate_constant(473.0)) == pytest.approx(0.932, abs=5e-4)
    assert float(water.rate_constant(473.0)) == pytest.approx(1.864, abs=5e-4)
    expected = 0.01 * math.sqrt(R * 300.0 / (2.0 * math.pi * 0.07209))
    assert float(tma.rate_constant(300.0)) == pytest.approx(expected, rel=1e-14)


def test_sticking_may_be_activated(case: Case) -> None:
    """sticking (T/T_ref)^b exp(-Ea/RT), at 473 K 0.01 exp(-20 kJ/mol/RT) = 0.01 x 0.0062; with T_ref = 1 K the a T^b exp(-Ea/RT) of
    Chemkin and Cantera. Fails when one of the keys has no effect, or one set beside sticking is lost, in whatever order."""
    key = "chemistry.reaction.tma."
    factor = math.exp(-20e3 / (R * 473.0))
    assert factor == pytest.approx(0.0062, abs=5e-5)
    plain = 0.01 * math.sqrt(R * 473.0 / (2.0 * math.pi * 0.07209))
    for changes, expected in (
        ({"sticking": 0.01, "Ea": "20 kJ/mol"}, factor),
        ({"Ea": "20 kJ/mol", "sticking": 0.01}, factor),
        ({"sticking": 0.01, "b": 1.0, "reference_temperature": "400 K"}, 473.0 / 400.0),
        ({"sticking": 1e-5, "b": 1.0, "reference_temperature": "1 K"}, 1e-3 * 473.0),
    ):
        changed = case.with_({key + name: value for name, value in changes.items()})
        for one in (changed, load_case(changed.to_dict())):
            (tma,) = one.mechanism.half_reactions("TMA")
            assert float(tma.rate_constant(473.0)) == pytest.approx(expected * plain, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"sticking": 0.01, "b": 1.0}, "no reference_temperature"),  # T^b in kelvin, or of T over what?
        ({"sticking": 0.5, "Ea": "-20 kJ/mol"}, "a sticking coefficient of 80.8 at 473 K"),
        ({"sticking": 0.5, "A": "1 m/s"}, "both sticking and A"),
        ({"A": "1 m/s", "Ea": "-9e5 kJ/mol"}, "rate constant of inf"),
        ({"A": "3 kg"}, r"A: found '3 kg'; accepted: .*0\.9 m/s.*, or .*m\^3/kmol/s"),
    ],
)
def test_rates_that_cannot_be_are_refused(case: Case, changes: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        case.with_({f"chemistry.reaction.tma.{name}": value for name, value in changes.items()})


def test_an_override_replaces_the_other_form_of_the_rate(case: Case) -> None:
    """A over a sticking coefficient and back; also on the resolved dump, which spells the rate out."""
    sticky = case.with_({"chemistry.reaction.tma.sticking": 0.1})
    assert sticky.mechanism.surface_reactions[0].sticking_coefficient(473.0) == 0.1
    back = load_case(sticky.to_dict(), {"chemistry.reaction.tma.A": "90 cm/s"})
    assert back.mechanism.surface_reactions[0].sticking_coefficient(473.0) is None
    assert float(back.mechanism.surface_reactions[0].rate_constant(473.0)) == 0.9
    off = case.with_({"chemistry.reaction.cvd.A": "0 m^3/mol/s"})
    assert float(off.mechanism.gas_reactions[0].rate_constant(473.0)) == 0.0


@pytest.mark.parametrize(
    ("formula", "atoms"),
    [
        ("CH4", {"C": 1, "H": 4}),
        ("Al(CH3)3", {"Al": 1, "C": 3, "H": 9}),
        ("OAl(CH3)2", {"O": 1, "Al": 1, "C": 2, "H": 6}),
        ("Al(OH)3", {"Al": 1, "O": 3, "H": 3}),
        ("Ti(OCH(CH3)2)4", {"Ti": 1, "O": 4, "C": 12, "H": 28}),
    ],
)
def test_formula(formula: str, atoms: dict[str, float]) -> None:
    assert parse_formula(formula) == atoms


@pytest.mark.parametrize("formula", ["al2", "Al(OH", "AlOH)3", "Al-O"])
def test_what_is_no_formula(formula: str) -> None:
    with pytest.raises(ValueError):
        parse_formula(formula)


def test_equation_reads_coefficients_with_and_without_a_space() -> None:
    known = dict.fromkeys(("A", "B2", "C(D)3"))
    assert parse_equation("2 A + 3B2 -> 1.5 C(D)3", known) == ({"A": 2.0, "B2": 3.0}, {"C(D)3": 1.5})


@pytest.mark.parametrize(
    "equation",
    [
        "A+B2->.5 C+",
        "A + B2 => 1/2 C+",
        "A + B2 → 0.5C+",
        "A +B2 --> .5 C+",
        "A+B2 ⇒ 0.5 C+",
        "A + 1 B2 ==> 1/2C+",
    ],
)
def test_other_spellings_of_an_equation(equation: str) -> None:
    """The arrows of Cantera and of word processors, blanks left out, fractions; a name may end in +."""
    assert parse_equation(equation, dict.fromkeys(("A", "B2", "C+"))) == ({"A": 1.0, "B2": 1.0}, {"C+": 0.5})


@pytest.mark.parametrize("arrow", ["<=>", "<->", "⇌", "⇄", "<==>"])
def test_arrows_that_go_both_ways(arrow: str) -> None:
    """Fails when the arrow of a reversible reaction is read as one way, or one way as both."""
    known = dict.fromkeys(("A", "*", "A*"))
    assert parse_equation(f"A + 2 * {arrow} 2A*", known) == ({"A": 1.0, "*": 2.0}, {"A*": 2.0})
    assert is_reversible(f"A + 2 * {arrow} 2A*") and not is_reversible("A + 2 * => 2A*")


@pytest.mark.parametrize(
    "equation",
    [
        "A + B2 = C",
        "A <=> B2 -> C",
        "A + B2 C",
        "A -> B2 -> C",
        "-> C",
        "A ->",
        "0 A -> C",
        "1/0 A -> C",
    ],
)
def test_what_is_no_equation_is_told_how_to_write_one(equation: str) -> None:
    """Fails when the line does not name the arrows: = is both ways to Cantera, one way to others."""
    with pytest.raises(PydanticCustomError) as caught:
        parse_equation(equation, dict.fromkeys(("A", "B2", "C")))
    assert "-> is the arrow" in str(caught.value) and "1/2" in str(caught.value)


def test_every_reaction_conserves_elements_and_sites(case: Case) -> None:
    """Recounted here from the values, independently of the check at loading."""
    mechanism = case.mechanism
    kept: list[Any] = [*mechanism.species, *mechanism.sites, *mechanism.films]
    atoms = {x.name: x.elements for x in kept}
    for reaction in mechanism.surface_reactions:
        assert sum(reaction.nu_site.values()) == 0.0
        changes = {**reaction.nu_gas, **reaction.nu_site, **reaction.film}
        for element in ("Al", "C", "H", "O"):
            assert sum(nu * atoms[name].get(element, 0.0) for name, nu in changes.items()) == 0.0
    for element in ("Al", "C", "H", "O"):
        nu = mechanism.gas_reactions[0].nu_gas
        assert sum(n * atoms[name].get(element, 0.0) for name, n in nu.items()) == 0.0


def test_a_mechanism_of_ones_own(tmp_path: Path) -> None:
    """Titania from the chloride: named by path relative to the case, then carried along by the resolved dump."""
    (tmp_path / "titania.toml").write_text(TITANIA)
    (tmp_path / "case.toml").write_text(
        '[geometry]\nlength = "10 mm"\n[[geometry.layer]]\nname = "bed"\nheight = "1 mm"\ncells = 2\n'
        'material = "glass_beads"\nmoving = true\n[chemistry]\nmechanism = "titania.toml"\n'
    )
    case = load_case(tmp_path / "case.toml")
    assert case.mechanism.name == "titania"
    assert case.mechanism.site_names == ("OH", "OTiCl3")
    bed = case.geometry.layers[0].material
    assert bed is not None
    assert bed.initial_coverage == {"OH": 1.0, "OTiCl3": 0.0}
    assert set(case.gas.diffusivity) == {"TiCl4", "H2O", "HCl"}
    water = case.mechanism.surface_reactions[1]
    assert water.molecules_per_site == 2.0
    assert float(water.rate_constant(500.0)) == pytest.approx(1.5 * math.exp(-20e3 / (R * 500.0)), rel=1e-12)
    (tmp_path / "titania.toml").unlink()
    assert load_case(case.to_dict()) == case


def test_an_inline_mechanism_starts_from_nothing() -> None:
    """One tracer without reactions: what transport tests need."""
    case = load_case(
        example(chemistry={"mechanism": "inline", "species": {"Ar": {"molar_mass": "39.95 g/mol"}}})
    )
    assert case.mechanism.species_names == ("Ar",)
    assert (case.mechanism.surface_reactions, case.mechanism.gas_reactions) == ((), ())


@pytest.mark.parametrize(
    ("reaction", "text"),
    [
        ({"equation": "2 OH + TMA -> 2 OH + TMA", "A": "1 m/s"}, "changes something"),
        ({"equation": "OH + TMA + H2O -> OH + TMA + H2O", "A": "1 m/s"}, "changes something"),
        ({"equation": "OH + OAl(CH3)2 <=> OH + OAl(CH3)2", "A": "1 m/s"}, "changes something"),
        ({"equation": "OH + TMA -> CH4 + OAl(CH3)2"}, "neither sticking nor A"),
        ({"equation": "OH + TMA -> CH4 + OAl(CH3)2", "A": "1 m/s", "sticking": 0.1}, "both sticking and A"),
        ({"equation": "TMA + 3 H2O -> 3 CH4 + Al(OH)3", "sticking": 0.1}, "order 1 in TMA, 1 in H2O"),
        ({"equation": "TMA -> TMA", "A": "1 m^3/mol/s"}, "changes something"),
        ({"equation": "OH + TMA = CH4 + OAl(CH3)2", "A": "1 m/s"}, "-> is the arrow"),
        ({"equation": "OH -> TMA -> OH", "A": "1 m/s"}, "with -> and ->"),
    ],
)
def test_rate_laws_that_do_not_fit_are_refused(reaction: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError) as caught:
        load_case(example(chemistry={"reaction": {"new": reaction}}))
    assert "chemistry.reaction.new" in str(caught.value) and text in str(caught.value)


def test_inlet_concentration_uses_the_mixture(case: Case) -> None:
    """C = x p/(R T) with x the mole fraction: the thesis' dose, and a feed that is half precursor by mass."""
    dose = case.feed_concentrations({"TMA": 2e-4})
    assert dose["TMA"] == pytest.approx(2.0024e-3, rel=1e-4)
    x = mole_fractions(case.mechanism, 0.02801, {"TMA": 0.5})["TMA"]
    assert x == pytest.approx((0.5 / 0.07209) / (0.5 / 0.07209 + 0.5 / 0.02801), rel=1e-14)
    pair = mole_fractions(case.mechanism, 0.02801, {"TMA": 2e-4, "H2O": 7.5e-5})
    assert pair["H2O"] / pair["TMA"] == pytest.approx(1.5, rel=2e-3)  # the stoichiometric pair
