"""Saturation, titration and what `check` says of a precursor count all its reactions: several kinds of sites, ways and steps."""

import pytest

from mpm.advice.checks import check_case
from mpm.case.case import Case
from mpm.physics.mechanism import Mechanism
from mpm.physics.rates import Arrhenius, Law
from mpm.physics.reaction import SurfaceReaction
from mpm.physics.saturation import coverage_met, molecules_per_site, saturate, slowest_turnover, uptake
from mpm.physics.substances import Site, Species

from .cases import COARSE, run, zone

T = 473.0


def reaction(
    gas: str, start: str, stops: dict[str, float], molecules: float = 1.0, k: float = 1.0
) -> SurfaceReaction:
    """`molecules` of a gas turn the sites `start` into `stops`."""
    sites = {start: -sum(stops.values()), **stops}
    return SurfaceReaction(
        key=f"{gas}-{start}",
        equation="",
        forward=Law(constant=Arrhenius(k), gas_orders={gas: 1.0}, site_orders={start: 1.0}),
        nu_gas={gas: -molecules},
        nu_site=sites,
    )


def mechanism(*reactions: SurfaceReaction) -> Mechanism:
    sites = dict.fromkeys(name for r in reactions for name in r.nu_site)
    gases = dict.fromkeys(r.gas for r in reactions)
    return Mechanism(
        name="test",
        species=tuple(Species(name, 0.03, {}) for name in gases),
        sites=tuple(Site(name, {}) for name in sites),
        films=(),
        surface_reactions=reactions,
        gas_reactions=(),
    )


def test_alumina_needs_what_its_equations_say() -> None:
    """Fails when TMA does not need 1 molecule per site, or water 1.5 though fresh powder carries none of its sites."""
    case = zone()
    fresh = {"OH": 1.0, "OAl(CH3)2": 0.0}
    assert molecules_per_site(case.mechanism, "TMA", fresh, T) == 1.0
    assert molecules_per_site(case.mechanism, "H2O", fresh, T) == 1.5
    assert coverage_met(case.mechanism, "H2O", fresh, T) == {"OAl(CH3)2": 1.0}
    assert case.mechanism.titrated_sites("TMA") == ("OAl(CH3)2",)
    assert case.mechanism.titrated_sites("H2O") == ("OH",)
    # what is gone from the gas: one TMA, three water per event
    assert uptake(case.mechanism, "TMA", fresh, T) == pytest.approx(0.9)
    assert uptake(case.mechanism, "H2O", {"OAl(CH3)2": 1.0}, T) == pytest.approx(3 * 1.9)


def test_two_kinds_of_sites() -> None:
    """Fails when one of two kinds counts alone: a quarter needs 1 molecule, three quarters need 2, in the mean 1.75."""
    both = mechanism(
        reaction("A", "fast", {"X": 1.0}, k=5.0), reaction("A", "slow", {"Y": 1.0}, molecules=2.0, k=0.1)
    )
    fresh = {"fast": 0.25, "slow": 0.75}
    assert molecules_per_site(both, "A", fresh, T) == pytest.approx(1.75)
    assert set(both.titrated_sites("A")) == {"X", "Y"}
    assert slowest_turnover(both, "A", fresh, T) == pytest.approx(0.1)
    assert uptake(both, "A", fresh, T) == pytest.approx(0.25 * 5.0 + 0.75 * 0.1 * 2.0)


def test_one_after_another() -> None:
    """Fails when a site that reacts on counts as titrated, or only its first step is fed: OH -> X -> Y takes 2 molecules."""
    chain = mechanism(reaction("A", "OH", {"X": 1.0}), reaction("A", "X", {"Y": 1.0}))
    assert molecules_per_site(chain, "A", {"OH": 1.0}, T) == pytest.approx(2.0)
    assert chain.titrated_sites("A") == ("Y",)


def test_two_ways_share_a_site_as_their_speeds_are() -> None:
    """Fails when competing reactions are not weighed: 3/4 of the sites take 1 molecule, 1/4 takes 2 and makes two kinds."""
    ways = mechanism(
        reaction("A", "OH", {"X": 1.0}, k=3.0),
        reaction("A", "OH", {"X": 1.0, "Y": 1.0}, molecules=4.0, k=0.5),  # two sites per event
    )
    after = saturate(ways, "A", {"OH": 1.0}, T)
    assert after is not None
    assert after[1] == pytest.approx(0.75 * 1.0 + 0.25 * 2.0)
    assert after[0] == pytest.approx({"X": 0.875, "Y": 0.125})


def test_a_surface_that_never_saturates() -> None:
    """Fails when a precursor that turns sites round in circles, or that finds none, gets a finite dose."""
    ring = mechanism(reaction("A", "OH", {"X": 1.0}), reaction("A", "X", {"OH": 1.0}))
    assert molecules_per_site(ring, "A", {"OH": 1.0}, T) is None
    assert molecules_per_site(ring, "A", {"other": 1.0}, T) is None


def two_hydroxyls() -> Case:
    """The coarse steady zone with two kinds of OH, of which TMA titrates both: a quarter of one, three quarters of the other."""
    changes = {
        "fidelity": "steady",
        "chemistry.site.OHb": {"formula": "OH"},
        "chemistry.site.OAlb": {"formula": "OAl(CH3)2"},
        "chemistry.reaction.tmab": {"equation": "OHb + TMA -> CH4 + OAlb", "sticking": 0.002},
        "material.glass_beads.initial_coverage": {"OH": 0.25, "OHb": 0.75},
    }
    return zone(changes, COARSE)


def test_a_run_with_two_kinds_of_hydroxyl() -> None:
    """Fails when titration, dose ratio or the coverage front of an inlet see one of the two kinds: 0.25 instead of 1 at the exit."""
    case = two_hydroxyls()
    numbers = check_case(case)["inlets"]["tma"]
    assert numbers["dose_ratio"] == numbers["excess_number"] == pytest.approx(1.791, abs=1e-3)
    _, result = run(case)
    assert result.summary["titration"]["tma"]["exit_mean"] == pytest.approx(1.0, abs=1e-6)
    assert result.summary["titration"]["tma"]["box_mean"] > 0.25
    single = run(zone({"fidelity": "steady"}, COARSE))[1].summary
    front = result.summary["front"]["tma"]["bed"]["coverage"]
    assert front == pytest.approx(single["front"]["tma"]["bed"]["coverage"], abs=3e-3)
