"""What a precursor makes of a surface, followed in time: counts and times against closed forms, and against the counts of first order."""

import math

import numpy as np
import pytest

from mpm.guide.mechanism import case_with
from mpm.physics.exposure import HORIZON, Exposed, _followed, _stepped, expose
from mpm.physics.general_kinetics import GeneralKinetics
from mpm.physics.mechanism import Mechanism
from mpm.physics.rates import Dependence, Law
from mpm.physics.saturation import Saturation, saturation
from mpm.physics.substances import Site, Species
from mpm.physics.surface_rates import SurfaceRates

from .cases import zone
from .general import law, mechanism, surface

T, N = 473.0, 7e-8
A = (Species("A", 0.03, {}),)
EMPTY, HELD = Site("*", {}), Site("A*", {})


def found(m: Mechanism, concentration: float, fresh: dict[str, float] | None = None) -> Saturation:
    return saturation(m, "A", {"A": concentration}, fresh or {"*": 1.0}, T, N)


def langmuir(k: float, back: float, extra: Law | None = None) -> Mechanism:
    """A + * <=> A*."""
    forward = extra or law(k, {"A": 1.0}, {"*": 1.0})
    return mechanism(
        surface(
            "adsorption",
            {"*": -1.0, "A*": 1.0},
            forward,
            law(back, {}, {"A*": 1.0}) if back else None,
            {"A": -1.0},
        ),
        species=A,
        sites=(EMPTY, HELD),
    )


@pytest.mark.parametrize("concentration", [1e-4, 1e-2, 1.0])
def test_langmuir(concentration: float) -> None:
    """Fails when what stays is not K C/(1 + K C), or the lifetime of sites not 1/(k C/n_s + k_b/n_s)."""
    k, back = 0.5, 0.005
    reached = k * concentration / (k * concentration + back)
    one = found(langmuir(k, back), concentration)
    assert one.need == pytest.approx(reached, rel=1e-6)
    assert one.lifetime == pytest.approx(N / (k * concentration + back), rel=1e-5)
    assert one.speed == pytest.approx(k)


def test_dissociative_and_two_places() -> None:
    """Fails when A2 + 2 * <=> 2 A* does not end at sqrt(K C)/(1 + sqrt(K C)), or a group on two places takes one molecule per place."""
    split = mechanism(
        surface(
            "split",
            {"*": -2.0, "A*": 2.0},
            law(2.0, {"A": 1.0}, {"*": 2.0}),
            law(None, {}, {"A*": 2.0}),
            {"A": -1.0},
            equilibrium=25.0,
        ),
        species=A,
        sites=(EMPTY, HELD),
    )
    root = math.sqrt(25.0 * 0.01)
    assert found(split, 0.01).need == pytest.approx(0.5 * root / (1.0 + root), rel=1e-6)
    wide = mechanism(
        surface("wide", {"*": -2.0, "W": 1.0}, law(1.0, {"A": 1.0}, {"*": 2.0}), gases={"A": -1.0}),
        species=A,
        sites=(EMPTY, Site("W", {}, places=2.0)),
    )
    after = expose(wide, {"A": 1.0}, {"*": 1.0}, T, N)
    assert after is not None
    assert after.taken["A"] == pytest.approx(0.5, rel=1e-4) and after.coverage["W"] == pytest.approx(
        1.0, rel=1e-4
    )


@pytest.mark.parametrize("order", [0.0, 0.5, 1.0, 2.0])
def test_orders_of_the_site(order: float) -> None:
    """Fails when dtheta/dt = -s theta^m does not end when it should: theta^(1-m) = 1 - (1-m) s t."""
    m = langmuir(0.0, 0.0, law(1.0, {"A": 1.0}, {"*": order}))
    one, left = found(m, 0.01), math.exp(-1.0)
    assert one.need == pytest.approx(1.0, rel=1e-4)
    turnovers = 1.0 if order == 1.0 else (1.0 - left ** (1.0 - order)) / (1.0 - order)
    assert one.lifetime == pytest.approx(turnovers * N / 0.01, rel=1e-3)


def test_order_of_the_gas() -> None:
    """Fails when the speed of uptake is not flux over concentration: k C^2/C."""
    m = langmuir(0.0, 0.0, law(3.0, {"A": 2.0}, {"*": 1.0}))
    assert found(m, 0.01).speed == pytest.approx(3.0 * 0.01)


def test_dependence_on_coverage() -> None:
    """Fails when 10^(a theta) of what is there already is left out: at theta = 1/2 the rate is 10^(a/2) of that without."""
    bent = Law(
        constant=law(1.0, {}, {}).constant,
        gas_orders={"A": 1.0},
        site_orders={"*": 1.0},
        coverage={"A*": Dependence(a=-2.0)},
    )
    m = langmuir(0.0, 0.0, bent)
    assert found(m, 0.01, {"*": 0.5, "A*": 0.5}).speed == pytest.approx(0.05)
    assert found(m, 0.01).need == pytest.approx(1.0, rel=1e-4)


def test_growth_that_does_not_stop_has_no_need() -> None:
    """Fails when growth without a change of sites, or catalysis over a state that comes back, is given a dose that saturates."""
    grown = mechanism(
        surface("growth", {}, law(0.1, {"A": 1.0}, {"*": 1.0}), gases={"A": -1.0}, film={"F": 1.0}),
        species=A,
        sites=(EMPTY,),
    )
    assert found(grown, 0.01).need is None and found(grown, 0.01).lifetime is None
    assert found(grown, 0.01).speed == pytest.approx(0.1)
    assert grown.titrated_sites("A") == ()
    cycle = mechanism(
        *langmuir(0.5, 0.0).surface_reactions,
        surface("onwards", {"A*": -1.0, "*": 1.0}, law(1e-6, {}, {"A*": 1.0}), film={"F": 1.0}),
        species=A,
        sites=(EMPTY, HELD),
    )
    assert found(cycle, 0.01).need is None
    assert cycle.titrated_sites("A") == ("A*",)


def test_sites_made_in_the_end() -> None:
    """Fails when a molecule that sits down and reacts afterwards is titrated by the state in between, or by the empty site that its
    desorption leaves."""
    later = mechanism(
        *langmuir(0.5, 1e-3).surface_reactions,
        surface("onwards", {"A*": -1.0, "B*": 1.0}, law(1e-6, {}, {"A*": 1.0})),
        surface("off", {"A*": -1.0, "*": 1.0}, law(1e-6, {}, {"A*": 1.0}), gases={"A": 1.0}),
        species=A,
        sites=(EMPTY, HELD, Site("B*", {})),
    )
    assert later.titrated_sites("A") == ("B*",)
    assert found(later, 0.01).need == pytest.approx(1.0, rel=1e-3)


def test_first_order_agrees_with_counting() -> None:
    """Fails when the surface followed in time takes another amount, or another time, than alumina's half-reactions counted."""
    m = zone().mechanism
    for gas, fresh in (("TMA", {"OH": 1.0}), ("H2O", {"OAl(CH3)2": 1.0})):
        counted = saturation(m, gas, {gas: 1e-3}, fresh, T, N)
        after = expose(m, {gas: 1e-3}, fresh, T, N)
        assert after is not None and counted.need is not None and counted.lifetime is not None
        assert after.taken[gas] == pytest.approx(counted.need, rel=1e-6)
        assert after.time(gas, 1.0 - math.exp(-1.0)) == pytest.approx(counted.lifetime, rel=1e-6)


def test_a_precursor_meets_what_suits_it() -> None:
    """Fails when B, which sits down a little on fresh solids, is not measured by what A has made for it."""
    both = mechanism(
        surface("a", {"*": -1.0, "A*": 1.0}, law(1.0, {"A": 1.0}, {"*": 1.0}), gases={"A": -1.0}),
        surface("b", {"A*": -1.0, "*": 1.0}, law(1.0, {"B": 1.0}, {"A*": 1.0}), gases={"B": -2.0}),
        surface(
            "sits",
            {"*": -1.0, "B*": 1.0},
            law(1.0, {"B": 1.0}, {"*": 1.0}),
            law(1.0, {}, {"B*": 1.0}),
            {"B": -1.0},
        ),
        species=(*A, Species("B", 0.02, {})),
        sites=(EMPTY, HELD, Site("B*", {})),
    )
    one = saturation(both, "B", {"B": 0.01}, {"*": 1.0}, T, N, others=[{"A": 0.01}])
    assert one.met["A*"] == pytest.approx(1.0, abs=1e-6)
    assert one.need == pytest.approx(2.0 + 0.01 / 1.01, rel=1e-4)
    alone = saturation(both, "B", {"B": 0.01}, {"*": 1.0}, T, N)
    assert alone.need == pytest.approx(0.01 / 1.01, rel=1e-4)


def test_random_mechanisms_are_followed() -> None:
    """Fails when one of forty mechanisms, rates over ten decades, orders 1/2 to 2, groups on two places, half of the reactions reversible,
    is not followed to the end, loses places, or takes up what its stoichiometry does not allow."""
    rng = np.random.default_rng(16)
    for _ in range(40):
        names = ["*", *(f"S{i}" for i in range(rng.integers(1, 5)))]
        places = [1.0, *(float(rng.choice([1, 1, 2])) for _ in names[1:])]
        reactions = []
        for number in range(rng.integers(1, 8)):
            a, b = rng.choice(len(names), 2, replace=False)
            nu, back = {names[a]: -places[b], names[b]: places[a]}, rng.random() < 0.5
            gases = {"A": -1.0} if rng.random() < 0.5 else {}
            k, kb, order = 10 ** rng.uniform(-8, 2), 10 ** rng.uniform(-8, 2), rng.choice([0.5, 1.0, 2.0])
            there = law(k, dict.fromkeys(gases, 1.0), {names[a]: places[b] if back else float(order)})
            reactions.append(
                surface(f"r{number}", nu, there, law(kb, {}, {names[b]: places[a]}) if back else None, gases)
            )
        m = mechanism(
            *reactions,
            species=A,
            sites=tuple(Site(name, {}, places=held) for name, held in zip(names, places, strict=True)),
        )
        after = expose(m, {"A": 10 ** rng.uniform(-4, 0)}, {"*": 1.0}, T, N)
        assert after is not None
        assert sum(after.coverage.values()) == pytest.approx(1.0, abs=1e-6)
        assert min(after.coverage.values()) >= 0.0


def test_deposition_from_two_gases() -> None:
    """Fails when a precursor that alone finds nothing to do is not measured beside the gas of another feed, or both are then said to be
    needed where one is enough."""
    both = mechanism(
        surface(
            "growth",
            {},
            law(3.0, {"A": 1.0, "B": 1.0}, {"*": 1.0}),
            gases={"A": -1.0, "B": -2.0},
            film={"F": 1.0},
        ),
        species=(*A, Species("B", 0.02, {})),
        sites=(EMPTY,),
    )
    one = saturation(both, "B", {"B": 0.01}, {"*": 1.0}, T, N, others=[{"A": 0.5}, {"B": 7.0}])
    assert one.beside == ("A",) and one.endless and one.need is None
    assert one.speed == pytest.approx(2.0 * 3.0 * 0.5)
    assert found(langmuir(0.5, 0.1), 0.01).beside == ()


def test_sites_that_are_made_and_hold_more() -> None:
    """Fails when OH that water has made no longer counts because more water sits down on it, or an intermediate that only gives back the
    sites that there were does not count at all."""
    water = mechanism(
        surface("makes", {"Me": -1.0, "OH": 1.0}, law(1.0, {"W": 1.0}, {"Me": 1.0}), gases={"W": -1.0}),
        surface(
            "sits",
            {"OH": -1.0, "OHW": 1.0},
            law(1.0, {"W": 1.0}, {"OH": 1.0}),
            law(1.0, {}, {"OHW": 1.0}),
            {"W": -1.0},
        ),
        species=(Species("W", 0.018, {}),),
        sites=(Site("OH", {}), Site("Me", {}), Site("OHW", {})),
    )
    assert water.titrated_sites("W") == ("OH", "OHW")
    split = mechanism(
        surface(
            "lands",
            {"*": -2.0, "W2": 1.0},
            law(1.0, {"A": 1.0}, {"*": 2.0}),
            law(1.0, {}, {"W2": 1.0}),
            {"A": -1.0},
        ),
        surface(
            "turns",
            {"W2": -1.0, "*": 1.0, "A*": 1.0},
            law(1.0, {}, {"W2": 1.0}),
            law(1.0, {}, {"*": 1.0, "A*": 1.0}),
        ),
        surface("grows", {"A*": -2.0, "*": 2.0}, law(1.0, {}, {"A*": 1.0}), film={"F": 2.0}),
        species=A,
        sites=(EMPTY, HELD, Site("W2", {}, places=2.0)),
    )
    assert split.titrated_sites("A") == ("W2", "A*")


def test_ways_that_are_fast_beyond_rounding() -> None:
    """Fails when what a surface takes is the rounding of ways there and back of 1e10 events per place and second, added up."""
    fast = langmuir(600.0, 4000.0)
    one = found(fast, 0.03)
    reached = 600.0 * 0.03 / (600.0 * 0.03 + 4000.0)
    assert one.need == pytest.approx(reached, rel=1e-4)
    assert one.lifetime == pytest.approx(N / (600.0 * 0.03 + 4000.0), rel=2e-2)
    slowly = mechanism(
        *fast.surface_reactions,
        surface("stays", {"A*": -1.0, "B*": 1.0}, law(1e-6, {}, {"A*": 1.0})),
        species=A,
        sites=(EMPTY, HELD, Site("B*", {})),
    )
    after = expose(slowly, {"A": 0.03}, {"*": 1.0}, T, N)
    assert after is not None
    assert after.taken["A"] == pytest.approx(1.0, rel=1e-3)
    assert after.time("A", 0.5) == pytest.approx(math.log(2.0) / (1e-6 / N * reached), rel=2e-2)


@pytest.mark.parametrize(
    ("name", "gas", "site"),
    [("zinc_oxide", "DEZ", "OH"), ("titania", "TiCl4", "OH"), ("alumina_thermal", "H2O", "OAl(CH3)2")],
)
def test_two_integrators_agree(name: str, gas: str, site: str) -> None:
    """Fails when LSODA on the rate laws and the implicit steps of the solver, which share no code, differ: what is taken by 1e-6, the time
    for two thirds of it by 2 %, for 99 % of it, where a step is long, by 6 %."""
    m = case_with(name, {}, None, None).mechanism
    rates = SurfaceRates(m, {gas: 1e-3}, T, N)
    start = np.array([*(float(n == site) for n in m.site_names), *(0.0 for _ in m.species_names)])
    tracks = (
        _followed(rates, start),
        _stepped(GeneralKinetics(m, m.species_names, np.array([N]), T), {gas: 1e-3}, rates, start),
    )
    numbers = []
    for track in tracks:
        assert track is not None
        end = dict(zip((*m.site_names, *m.species_names), track.at(HORIZON), strict=True))
        taken = {n: end[n] for n in m.species_names}
        exposed = Exposed({n: end[n] for n in m.site_names}, taken, frozenset(), track)
        numbers.append((taken[gas], exposed.time(gas, 0.63), exposed.time(gas, 0.99)))
    for found_one, other, error in zip(*numbers, (1e-6, 0.02, 0.06), strict=True):
        assert found_one == pytest.approx(other, rel=error)
