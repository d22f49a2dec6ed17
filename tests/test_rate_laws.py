"""General reactions in a mechanism: what their tables mean, in units of shares and per site, both ways, overridden key by key."""

import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case, load_case
from mpm.case.sources import write_toml
from mpm.errors import InputError
from mpm.physics.rates import Dependence, Law
from mpm.sweep.plan import plan
from mpm.sweep.sweepfile import read_sweep

R = 8.31446261815324
SITES = 2e-5  # mol/m2
WATER = {"molar_mass": "18.015 g/mol", "enthalpy": "-241.826 kJ/mol", "entropy": "188.8 J/mol/K"}
SUBSTANCES: dict[str, Any] = {
    "species": {
        "H2O": WATER,
        "O2": {"molar_mass": "31.998 g/mol"},
        "H2": {"molar_mass": "2.016 g/mol"},
        "SiH4": {"molar_mass": "32.117 g/mol"},
    },
    "site": {"*": {}, "H2O*": {}, "O*": {}, "H*": {}, "OO": {"formula": "O2", "sites": 2}},
    "film": {"Si": {}},
}


def with_reaction(reaction: dict[str, Any], overrides: dict[str, Any] | None = None, **more: Any) -> Case:
    """A small case of these substances with one reaction, called r."""
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    return load_case(
        {
            "geometry": {"length": "10 mm", "cell_width": "1 mm", "layer": layer},
            "chemistry": {"mechanism": "inline", **SUBSTANCES, **more, "reaction": {"r": reaction}},
        },
        overrides,
    )


def rate(case: Case, concentration: dict[str, float], theta: dict[str, float], T: float = 473.0) -> float:
    """Net rate of progress of the one reaction, from its laws as their docstrings define them."""
    (reaction,) = case.mechanism.reactions
    constants = case.mechanism.rate_constants(reaction, T, SITES)
    total = 0.0
    for (sign, law), constant in zip(reaction.ways, constants, strict=False):
        total += sign * float(constant) * product(law, {**concentration, **theta}, T)
    return total


def product(law: Law, amounts: dict[str, float], T: float) -> float:
    value = math.prod(amounts[name] ** order for name, order in {**law.gas_orders, **law.site_orders}.items())
    for name, of in law.coverage.items():
        theta = amounts[name]
        value *= 10.0 ** (of.a * theta) * theta**of.m * math.exp(-of.E * theta / (R * T))
    return value


CONCENTRATION = {"H2O": 0.3, "O2": 0.02, "H2": 0.5, "SiH4": 0.7}
THETA = {"*": 0.2, "H2O*": 0.3, "O*": 0.15, "H*": 0.25, "OO": 0.1}


@pytest.mark.parametrize(
    ("reaction", "expected"),
    [
        ({"equation": "H2O + * -> H2O*", "A": "3 m/s"}, 3 * 0.3 * 0.2),
        ({"equation": "H2O + * -> H2O*", "A": "3 m^3/mol/s"}, 3 * SITES * 0.3 * 0.2),
        ({"equation": "H2O* -> H2O + *", "A": "3 1/s"}, 3 * SITES * 0.3),
        ({"equation": "H2O* -> H2O + *", "A": "3 mol/m^2/s"}, 3 * 0.3),
        ({"equation": "O* + 2 H* -> H2O* + 2 *", "A": "3 m^2/mol/s"}, 3 * SITES**2 * 0.15 * 0.25),
        (
            {"equation": "O* + 2 H* -> H2O* + 2 *", "A": "3 m^4/mol^2/s", "orders": {"H*": 2}},
            3 * SITES**3 * 0.15 * 0.25**2,
        ),
        ({"equation": "O2 + 2 * -> 2 O*", "A": "3 m/s", "orders": {"*": 2}}, 3 * 0.02 * 0.2**2),
        ({"equation": "O2 + 2 * -> 2 O*", "A": "3 cm/s"}, 0.03 * 0.02 * 0.2),
        ({"equation": "O2 + 2 * -> OO", "A": "3 m/s"}, 3 * 0.02 * 0.2),
        ({"equation": "OO -> O2 + 2 *", "A": "3 1/s"}, 3 * SITES / 2 * 0.1),  # theta n_s/2 of them per area
        ({"equation": "2 OO -> O2 + OO + 2 *", "A": "3 m^2/mol/s", "orders": {"OO": 2}}, 3 * (SITES / 2 * 0.1) ** 2),
        (
            {"equation": "H2O + * -> H2O*", "A": "3 m^2.5/mol^0.5/s", "orders": {"H2O": 1.5}},
            3 * 0.3**1.5 * 0.2,
        ),
        (
            {"equation": "H2O + * -> H2O*", "A": "3 mol^0.5/m^0.5/s", "orders": {"H2O": 0.5}},
            3 * 0.3**0.5 * 0.2,
        ),
        ({"equation": "H2O + * -> H2O*", "A": "3 mol/m^2/s", "orders": {"H2O": 0}}, 3 * 0.2),
        ({"equation": "SiH4 + * -> * + Si + 2 H2", "A": "3 m/s"}, 3 * 0.7 * 0.2),
        ({"equation": "Si + 2 H2 + * -> * + SiH4", "A": "3 m/s"}, 3 * 0.5 * 0.2),  # film: order 0
        ({"equation": "H2O + * + O2 -> H2O* + O2", "A": "3 m^4/mol/s"}, 3 * 0.3 * 0.02 * 0.2),
        ({"equation": "H2O -> H2 + 1/2 O2", "A": "3 1/s"}, 3 * 0.3),
        ({"equation": "2 H2O -> 2 H2 + O2", "A": "3 1/s"}, 3 * 0.3),
        ({"equation": "H2O + H2O -> 2 H2 + O2", "A": "3 l/mol/s", "orders": {"H2O": 2}}, 3e-3 * 0.3**2),
        ({"equation": "H2O + H2 -> 2 H2 + 1/2 O2", "A": "3 m^3/mol/s"}, 3 * 0.3 * 0.5),
        ({"equation": "H2O -> H2 + 1/2 O2", "A": "3 mol/m^3/s", "orders": {"H2O": 0}}, 3.0),
        ({"equation": "H2 + 1/2 O2 + SiH4 -> H2O + SiH4", "A": "3 m^6/mol^2/s"}, 3 * 0.5 * 0.02 * 0.7),
        ({"equation": "H2O <=> H2 + 1/2 O2", "A": "3 1/s", "equilibrium_constant": "2 mol^0.5/m^1.5"},
         3 * (0.3 - 0.5 * 0.02**0.5 / 2)),
        ({"equation": "H2O + * <=> H2O*", "A": "3 m/s", "reverse": {"A": "5 1/s"}}, 3 * 0.3 * 0.2 - 5 * SITES * 0.3),
        (
            {"equation": "H2O + * <=> H2O*", "A": "3 m^3/mol/s", "equilibrium_constant": "0.5 m^3/mol"},
            3 * SITES * (0.3 * 0.2 - 0.3 / 0.5),
        ),
        ({"equation": "O2 + 2 * <=> 2 O*", "A": "3 m/s", "equilibrium_constant": {"A": "2 l/mol"}},
         3 * (0.02 * 0.2**2 - 0.15**2 / 0.002)),
        (  # forward order halved: the way back is slower by as much, or it would not rest at K
            {"equation": "O2 + 2 * <=> 2 O*", "A": "3 m/s", "orders": {"*": 2.5}, "equilibrium_constant": "4 m^3/mol"},
            3 * (0.02 * 0.2**2.5 - 0.15**2 * 0.2**0.5 / 4),
        ),
        (
            {"equation": "O* + H2 <=> * + H2O", "A": "3 m/s", "equilibrium_constant": 4},
            3 * (0.15 * 0.5 - 0.2 * 0.3 / 4),
        ),
        (
            {"equation": "O* + H2 <=> * + H2O", "A": "3 m/s", "reverse": {"A": "7 m/s", "orders": {"O2": 1, "H2O": 0}}},
            3 * 0.15 * 0.5 - 7 * 0.2 * 0.02,
        ),
    ],
)  # fmt: skip
def test_rates_are_those_of_the_equation(reaction: dict[str, Any], expected: float) -> None:
    """By hand: k n_s^p prod C^eta prod theta^mu, way there less way back, in shares and per site. Fails when an order, a unit or the site
    density is counted otherwise, or when the resolved case means something else."""
    case = with_reaction(reaction)
    assert rate(case, CONCENTRATION, THETA) == pytest.approx(expected, rel=1e-12)
    again = load_case(case.to_dict())
    assert again == case and rate(again, CONCENTRATION, THETA) == rate(case, CONCENTRATION, THETA)


def test_coverage_changes_constants() -> None:
    """10^(a theta) theta^m exp(-E theta/RT) of the way there; with an equilibrium both ways, else those of the way back are its own."""
    coverage = {"O*": {"a": 0.5, "m": 0.3, "E": "6 kJ/mol"}}
    factor = 10 ** (0.5 * 0.15) * 0.15**0.3 * math.exp(-6e3 * 0.15 / (R * 473.0))
    plain = {"equation": "H2O + * <=> H2O*", "A": "3 m/s", "coverage": coverage}
    case = with_reaction({**plain, "equilibrium_constant": "0.5 m^3/mol"})
    expected = 3 * factor * (0.3 * 0.2 - 0.3 / 0.5)
    assert rate(case, CONCENTRATION, THETA) == pytest.approx(expected, rel=1e-12)
    case = with_reaction({**plain, "reverse": {"A": "5 1/s", "coverage": {"H*": {"m": 1}}}})
    expected = 3 * factor * 0.3 * 0.2 - 5 * SITES * 0.3 * 0.25
    assert rate(case, CONCENTRATION, THETA) == pytest.approx(expected, rel=1e-12)
    (reaction,) = case.mechanism.surface_reactions
    assert reaction.forward.coverage == {"O*": Dependence(0.5, 0.3, 6e3)}


def test_sticking_with_and_without_motz_wise() -> None:
    """lambda/(1 - lambda/2) sqrt(RT/2 pi M), of shares whatever the orders in sites."""
    speed = math.sqrt(R * 473.0 / (2 * math.pi * 31.998e-3))
    for motz_wise, share in ((False, 0.8), (True, 0.8 / 0.6)):
        case = with_reaction(
            {"equation": "O2 + 2 * -> 2 O*", "sticking": 0.8, "motz_wise": motz_wise, "orders": {"*": 2}}
        )
        assert rate(case, CONCENTRATION, THETA) == pytest.approx(share * speed * 0.02 * 0.2**2, rel=1e-12)
        assert ("motz_wise" in write_toml(case.to_dict())) == motz_wise


def test_equilibrium_follows_from_enthalpy_and_entropy() -> None:
    """K = exp(-(dH - T dS)/RT) (p0/RT)^dn at 298.15 K data without heat capacities; another reference pressure moves the gases only."""
    site = {
        "*": {"enthalpy": "0 J/mol", "entropy": "0 J/mol/K"},
        "H2O*": {"enthalpy": "-310 kJ/mol", "entropy": "60 J/mol/K"},
    }
    reaction = {"equation": "H2O + * <=> H2O*", "A": "3 m/s"}
    for pressure in (1e5, 101325.0):
        case = with_reaction(reaction, {"chemistry.reference_pressure": f"{pressure} Pa"}, site=site)
        T = 500.0
        K = math.exp(-(-310e3 + 241826.0 - T * (60.0 - 188.8)) / (R * T)) * R * T / pressure
        (one,) = case.mechanism.surface_reactions
        assert float(case.mechanism.equilibrium_constant(one, T)) == pytest.approx(K, rel=1e-12)
        expected = 3 * (0.3 * 0.2 - 0.3 / K)
        assert rate(case, CONCENTRATION, {"*": 0.2, "H2O*": 0.3}, T) == pytest.approx(expected, rel=1e-12)
        assert load_case(case.to_dict()) == case
        assert ("reference_pressure" in case.to_dict()["chemistry"]) == (pressure != 1e5)


def test_what_an_equilibrium_reads_stays_in_a_case_without_heat() -> None:
    """A built-in mechanism's enthalpies are dropped where nothing reads them; those of a reversible reaction change results."""
    changes = {
        "chemistry.reaction.tma.equation": "OH + TMA <=> CH4 + OAl(CH3)2",
        **{f"chemistry.species.{name}.entropy": "200 J/mol/K" for name in ("TMA", "CH4")},
        **{f"chemistry.site.{name}.entropy": "30 J/mol/K" for name in ("OH", "OAl(CH3)2")},
    }
    base = load_case("single_zone")
    case = base.with_(changes)
    tables = case.to_dict()["chemistry"]
    assert tables["species"]["TMA"]["enthalpy"] == "-86500.0 J/mol" and "entropy" in tables["site"]["OH"]
    assert "enthalpy" not in tables["species"]["H2O"] and "enthalpy" not in tables["film"]["Al2O3"]
    assert load_case(case.to_dict()) == case
    assert "enthalpy" not in str(base.to_dict())


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"reverse.A": "6 1/s"}, 3 * 0.06 - 6 * SITES * 0.3),
        ({"equilibrium_constant": "2 m^3/mol"}, 3 * (0.06 - 0.15)),
        ({"equilibrium_constant.A": "2 m^3/mol"}, 3 * (0.06 - 0.15)),
        ({"equilibrium_constant": "2 m^3/mol", "orders.H2O": 2, "A": "3 m^4/mol/s"}, 3 * (0.018 - 0.09 / 2)),
        ({"sticking": 0.5, "reverse.A": "6 1/s"}, None),
        ({"reverse": {"A": "6 1/s", "orders": {"H2O*": 2}}}, None),
    ],
)
def test_keys_set_over_a_mechanism(changes: dict[str, Any], expected: float | None) -> None:
    """reverse and equilibrium_constant replace each other by dotted key as A and sticking do. Fails when one is left beside the other."""
    for given in ({"equilibrium_constant": "0.5 m^3/mol"}, {"reverse": {"A": "5 1/s"}}):
        reaction = {"equation": "H2O + * <=> H2O*", "A": "3 m/s", **given}
        dotted = {f"chemistry.reaction.r.{key}": value for key, value in changes.items()}
        if "orders" in str(changes.get("reverse")):
            with pytest.raises(InputError, match=r"m\^2/mol/s"):  # of second order now
                with_reaction(reaction, dotted)
            continue
        case = with_reaction(reaction, dotted)
        (one,) = case.mechanism.surface_reactions
        assert (one.equilibrium is None) == any(key.startswith("reverse") for key in changes)
        if expected is not None:
            assert rate(case, CONCENTRATION, THETA) == pytest.approx(expected, rel=1e-12)
        assert load_case(case.to_dict()) == case


def test_polynomials_and_numbers_replace_each_other() -> None:
    """nasa set over enthalpy and entropy, and the other way round. Fails when both stand beside each other."""
    nasa = {
        "temperatures": [200, 1000, 3500],
        "low": [4, 0, 0, 0, 0, -3e4, -0.8],
        "high": [4, 0, 0, 0, 0, -3e4, -0.8],
    }
    reaction = {"equation": "H2O -> H2 + 1/2 O2", "A": "3 1/s"}
    case = with_reaction(reaction, {"chemistry.species.H2O.nasa": nasa})
    (water, *_) = case.mechanism.species
    assert water.nasa is not None and water.enthalpy is None
    assert float(water.thermochemistry.gibbs(500.0)) == pytest.approx(
        R * (4 * 500 - 3e4) - 500 * R * (4 * np.log(500) - 0.8), rel=1e-12
    )
    back = load_case(case.to_dict(), {"chemistry.species.H2O.entropy": "190 J/mol/K"})
    assert back.mechanism.species[0].nasa is None and back.mechanism.species[0].entropy == 190.0
    assert load_case(case.to_dict()) == case


def test_the_example_of_the_documents_is_valid() -> None:
    """Fails when what docs/case_file.md shows of reactions is refused, or is of other orders than its text says."""
    text = (Path(__file__).parents[1] / "docs" / "case_file.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```toml\n([^`]*chemistry.species[^`]*)^```", text, re.MULTILINE)
    mechanism = load_case(tomllib.loads(example)).mechanism
    water, oxygen = mechanism.surface_reactions
    assert water.backward is not None and water.backward.per_site == 1.0
    assert dict(oxygen.forward.site_orders) == {"*": 2.0} and list(mechanism.places) == [1.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("axis", "levels"),
    [
        ('equilibrium_constant"\nlogspace = { start = "0.1 m^3/mol", stop = "10 m^3/mol", num = 3 }', [0.1, 1.0, 10.0]),
        ('orders.*"\nvalues = [1, 1.5, 2]', [1.0, 1.5, 2.0]),
    ],
)  # fmt: skip
def test_a_sweep_over_a_rate_law(axis: str, levels: list[float], tmp_path: Path) -> None:
    """An axis over an equilibrium constant takes the place of the file's reverse; one over an order in sites leaves A of shares as it is.
    Fails when a point is refused, or is not the one that its level says."""
    (tmp_path / "own.toml").write_text(
        '[species.H2O]\nmolar_mass = "18.02 g/mol"\n[site."*"]\n[site."H2O*"]\n[reaction.on]\n'
        'equation = "H2O + * <=> H2O*"\nA = "1 m/s"\nreverse = { A = "1e5 1/s" }\n'
    )
    (tmp_path / "case.toml").write_text(
        '[geometry]\nbase = "single_zone"\n[chemistry]\nmechanism = "own.toml"\n'
    )
    (tmp_path / "sweep.toml").write_text(
        f'[sweep]\ncase = "case.toml"\n[[sweep.axis]]\nkey = "chemistry.reaction.on.{axis}\n'
    )
    found = []
    for point in plan(read_sweep(tmp_path / "sweep.toml")):
        assert point.case is not None, point.error
        (reaction,) = point.case.mechanism.surface_reactions
        found.append(reaction.equilibrium.A if reaction.equilibrium else reaction.forward.site_orders["*"])
    assert found == pytest.approx(levels)
