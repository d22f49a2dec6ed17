"""Surface and gas reaction rates over a step, without a mesh: closed forms, derivatives, bounds, balances."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from mpm.case.case import load_case
from mpm.physics.exponentials import dphi1, dphi2, phi1, phi2
from mpm.physics.kinetics import GasKinetics, SurfaceKinetics
from mpm.physics.mechanism import Mechanism
from mpm.physics.rates import Arrhenius, Law
from mpm.physics.reaction import SurfaceReaction
from mpm.physics.roles import Roles
from mpm.physics.substances import Site, Species

from .cases import CASES, rate

T = 473.0
N = 40
SITES = np.full(N, 6.92e-8)


@pytest.fixture(scope="module")
def alumina() -> Mechanism:
    return load_case(CASES / "single_cycle.toml").mechanism


def with_third_site(mechanism: Mechanism) -> Mechanism:
    """The same reactions among three states, the third of which nothing makes: takes the general solver."""
    return replace(mechanism, sites=(*mechanism.sites, Site("inert", {})))


def ring() -> Mechanism:
    """Three states turned over by three gases in a ring, two sites at a time in the second reaction."""
    gases = tuple(Species(name, 0.03, {}) for name in ("A", "B", "C"))

    def reaction(gas: str, start: str, stop: str, events: float, k: float) -> SurfaceReaction:
        return SurfaceReaction(
            key=gas,
            equation=f"{start} + {gas} -> {stop}",
            forward=Law(constant=Arrhenius(k), gas_orders={gas: 1.0}, site_orders={start: 1.0}),
            nu_gas={gas: -events},
            nu_site={start: -events, stop: events},
        )

    reactions = (
        reaction("A", "x", "y", 1.0, 0.7),
        reaction("B", "y", "z", 2.0, 1.3),
        reaction("C", "z", "x", 1.0, 0.2),
    )
    sites = tuple(Site(s, {}) for s in "xyz")
    return Mechanism(
        name="ring", species=gases, sites=sites, films=(), surface_reactions=reactions, gas_reactions=()
    )


@pytest.fixture
def rng() -> np.random.Generator:
    """One for each test: what a test draws does not depend on those before it."""
    return np.random.default_rng(11)


def random_state(rng: np.random.Generator, species: int, sites: int) -> tuple[np.ndarray, np.ndarray]:
    """Concentrations over nine decades, some of them zero, and coverages that sum to one."""
    concentration = 10.0 ** rng.uniform(-9.0, 0.0, (species, N))
    concentration[:, :4] = 0.0
    theta = rng.dirichlet(np.full(sites, 0.4), N).T
    return concentration, np.ascontiguousarray(theta / theta.sum(axis=0))


def surface(mechanism: Mechanism, coupled: tuple[str, ...]) -> SurfaceKinetics:
    return SurfaceKinetics(mechanism, coupled, SITES, T)


def test_functions_of_the_exponential_keep_their_digits() -> None:
    """Fails when a term of a series near zero, or the form beyond it, is wrong: each against sympy's 40 digits."""
    x = sp.Symbol("x")
    one = (1 - sp.exp(-x)) / x
    two = (1 - one) / x
    places = (1e-9, 1e-5, 0.01, 0.0199, 0.0201, 0.1, 0.5, 3.0, 40.0)  # the series ends at 0.02
    for function, exact in ((phi1, one), (phi2, two), (dphi1, sp.diff(one, x)), (dphi2, sp.diff(two, x))):
        expected = [float(exact.subs(x, sp.Rational(place)).evalf(40)) for place in places]
        np.testing.assert_allclose(
            function(np.array(places)), expected, rtol=1e-10, err_msg=function.__name__
        )


@pytest.mark.parametrize("dt", [1e-6, 1e-2, 1e3])
def test_three_sites_agree_with_the_closed_form_of_two(
    rng: np.random.Generator, alumina: Mechanism, dt: float
) -> None:
    """Fails when the general solver or the closed form for two kinds of sites has a wrong coefficient, rate or slope."""
    two, three = surface(alumina, ("TMA", "H2O")), surface(with_third_site(alumina), ("TMA", "H2O"))
    concentration, theta = random_state(rng, 2, 2)
    wide = np.vstack([theta, np.zeros(N)])
    np.testing.assert_allclose(
        three.coverage(concentration, wide, dt)[:2], two.coverage(concentration, theta, dt), atol=1e-13
    )
    (rates, slopes), (closed_rates, closed_slopes) = (
        three.rates(concentration, wide, dt),
        two.rates(concentration, theta, dt),
    )
    np.testing.assert_allclose(rates, closed_rates, rtol=1e-9, atol=1e-14 * closed_rates.max())
    # the slopes of the general solver lose digits with the ratio of step to site lifetime (1e10 at the longest step)
    np.testing.assert_allclose(slopes, closed_slopes, rtol=1e-5, atol=1e-12 * np.abs(closed_slopes).max())


@pytest.mark.parametrize("kind", ["alumina", "ring"])
@pytest.mark.parametrize("dt", [1e-5, 1e-3, 1e-1])
def test_slopes_are_the_derivatives_of_the_rates(
    rng: np.random.Generator, alumina: Mechanism, kind: str, dt: float
) -> None:
    """Fails when the Jacobian of the surface rates is not that of the rates (Newton would crawl or stall)."""
    mechanism, coupled = (alumina, ("TMA", "H2O")) if kind == "alumina" else (ring(), ("A", "B", "C"))
    kinetics = surface(mechanism, coupled)
    _, theta = random_state(rng, len(coupled), len(mechanism.sites))
    concentration = rng.uniform(0.2, 1.0, (len(coupled), N)) * 1e-3
    values, slopes = kinetics.rates(concentration, theta, dt)
    for j in range(len(coupled)):
        h = 1e-6 * concentration[j]
        up, down = concentration.copy(), concentration.copy()
        up[j], down[j] = up[j] + h, down[j] - h
        difference = (kinetics.rates(up, theta, dt)[0] - kinetics.rates(down, theta, dt)[0]) / (2 * h)
        scale = np.abs(values / concentration.min(axis=0)).max()
        np.testing.assert_allclose(slopes[:, j], difference, rtol=1e-5, atol=1e-8 * scale)


@pytest.mark.parametrize("kind", ["alumina", "ring"])
@pytest.mark.parametrize("dt", [1e-6, 1e-2, 1e2, 1e8])
def test_coverage_stays_between_zero_and_one(
    rng: np.random.Generator, alumina: Mechanism, kind: str, dt: float
) -> None:
    """Fails when any step, however long, takes a coverage out of [0, 1] or loses sites; rates must account for the change exactly."""
    mechanism, coupled = (alumina, ("TMA", "H2O")) if kind == "alumina" else (ring(), ("A", "B", "C"))
    kinetics = surface(mechanism, coupled)
    concentration, theta = random_state(rng, len(coupled), len(mechanism.sites))
    theta[:, 10:20] = np.eye(len(theta))[:, [0]]  # fresh
    new = kinetics.coverage(concentration, theta, dt)
    assert new.min() >= 0.0 and new.max() <= 1.0
    np.testing.assert_allclose(new.sum(axis=0), 1.0, atol=1e-12)
    values, _ = kinetics.rates(concentration, theta, dt)
    turned = kinetics.nu_places.T @ values * dt / SITES
    np.testing.assert_allclose(
        new - theta, turned, atol=1e-12 * max(1.0, np.abs(values).max() * dt / SITES[0])
    )


def test_uptake_continues_linearly_below_zero(alumina: Mechanism) -> None:
    """Fails when a negative Newton iterate meets the pole of the uptake, changes the coverage or loses monotony."""
    kinetics = surface(alumina, ("TMA",))
    theta = np.tile([[0.7], [0.3]], N)
    concentration = np.linspace(-1.0, 1e-3, N)[None, :]
    values, slopes = kinetics.rates(concentration, theta, 1e-2)
    below = concentration[0] < 0.0
    np.testing.assert_allclose(values[0, below], slopes[0, 0, below] * concentration[0, below])
    assert (slopes[0, 0] > 0.0).all() and (np.diff(values[0]) > 0.0).all()
    assert np.array_equal(kinetics.coverage(concentration, theta, 1e-2)[:, below], theta[:, below])


def test_coverage_under_constant_gas_decays_exponentially(alumina: Mechanism) -> None:
    """Fails when theta does not converge to exp(-k C t/n_s) at first order in the step, for water with its two sites per event too."""
    for gas, start, per_event in (("TMA", 0, 1.0), ("H2O", 1, 2.0)):
        kinetics = surface(alumina, (gas,))
        c = 2e-3
        life = SITES[0] / (per_event * float(kinetics.constant[0][0]) * c)
        errors, steps = [], [50, 100, 200, 400]
        for n in steps:
            theta = np.eye(2)[:, [start]].repeat(N, axis=1)
            for _ in range(n):
                theta = kinetics.coverage(np.full((1, N), c), theta, life / n)
            errors.append(abs(theta[start, 0] - np.exp(-1.0)))
        assert rate([1 / n for n in steps], errors) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("kind", ["alumina", "ring"])
@pytest.mark.parametrize("time", [1e-6, 1e-3, 1.0])
def test_conveyed_solids(rng: np.random.Generator, alumina: Mechanism, kind: str, time: float) -> None:
    """Fails when the coverage that leaves a cell and the mean rates in it do not balance, or any of their derivatives is wrong."""
    mechanism, coupled = (alumina, ("TMA", "H2O")) if kind == "alumina" else (ring(), ("A", "B", "C"))
    kinetics = surface(mechanism, coupled)
    _, theta = random_state(rng, len(coupled), len(mechanism.sites))
    concentration = rng.uniform(0.2, 1.0, (len(coupled), N)) * 1e-3
    passed = kinetics.conveyed(concentration, theta, time)
    turned = kinetics.nu_places.T @ passed.rates * time / SITES
    np.testing.assert_allclose(passed.out - theta, turned, atol=1e-12 * max(1.0, np.abs(turned).max()))
    assert passed.out.min() >= 0.0 and passed.out.max() <= 1.0 + 1e-14
    for values, slopes, name in (
        (concentration, (passed.rates_c, passed.out_c), "c"),
        (theta, (passed.rates_theta, passed.out_theta), "theta"),
    ):
        for j in range(len(values)):
            h = 1e-6 * values[j].mean()
            ends = []
            for sign in (1.0, -1.0):
                moved = values.copy()
                moved[j] += sign * h
                gas, sites = (moved, theta) if name == "c" else (concentration, moved)
                ends.append(kinetics.conveyed(gas, sites, time))
            for what, slope in zip(("rates", "out"), slopes, strict=True):
                difference = (getattr(ends[0], what) - getattr(ends[1], what)) / (2 * h)
                size = np.abs(getattr(passed, what)).max() / values[j].mean()
                np.testing.assert_allclose(
                    slope[:, j], difference, rtol=1e-4, atol=1e-6 * size, err_msg=f"{what} by {name} {j}"
                )


def test_conveyed_solids_are_exact_for_one_reaction(alumina: Mechanism) -> None:
    """Fails when theta_out is not theta_in exp(-nu k C h/(v n_s)), the exact exposure to a constant concentration."""
    kinetics = surface(alumina, ("H2O",))
    theta, c, time = np.tile([[0.0], [1.0]], N), 2e-3, 1e-5
    passed = kinetics.conveyed(np.full((1, N), c), theta, time)
    k = float(kinetics.constant[0][0])
    np.testing.assert_allclose(passed.out[1], np.exp(-2.0 * k * c * time / SITES), rtol=1e-13)


def test_rate_constants_are_those_of_the_thesis(alumina: Mechanism) -> None:
    """Fails when A, the stoichiometry of (5-17), (5-18), (5-19) or the unit of the gas reaction is changed."""
    kinetics = surface(alumina, ("TMA", "H2O"))
    assert [float(k[0]) for k in kinetics.constant] == pytest.approx([0.9, 1.9])
    assert kinetics.nu_places.tolist() == [[-1.0, 1.0], [2.0, -2.0]]
    assert [r.nu_gas[r.gas] for r in kinetics.reactions] == [-1.0, -3.0]
    gas = GasKinetics(alumina, ("TMA", "H2O"), T)
    values, slopes = gas.rates(np.array([[2.0], [3.0]]))
    assert values[0, 0] == pytest.approx(6e-3)
    np.testing.assert_allclose(slopes[0, :, 0], [3e-3, 2e-3])


def test_gas_reaction_ignores_negative_concentrations(alumina: Mechanism) -> None:
    """Fails when two negative Newton iterates make a positive rate."""
    gas = GasKinetics(alumina, ("TMA", "H2O"), T)
    values, slopes = gas.rates(np.array([[-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]))
    assert not values.any()
    assert (slopes >= 0.0).all()


def test_roles_follow_what_is_fed(alumina: Mechanism) -> None:
    """Fails when a species that can appear is left out of the run, or one that cannot is followed."""
    assert Roles.of(alumina, {"TMA"}) == Roles(("TMA",), ("CH4",))
    assert Roles.of(alumina, {"H2O"}) == Roles(("H2O",), ("CH4",))
    assert Roles.of(alumina, {"TMA", "H2O"}) == Roles(("TMA", "H2O"), ("CH4", "Al(OH)3"))
    assert Roles.of(alumina, {"CH4"}) == Roles((), ("CH4",))
    assert Roles.of(alumina, set()) == Roles((), ())


def test_site_density_presets_differ_hundredfold() -> None:
    """Fails when the named site density of the chemistry is not about 100 times that of the thesis."""
    case = load_case(
        CASES / "single_zone.toml", {"material.glass_beads.site_density": "one-per-24-square-angstrom"}
    )
    layer = case.geometry.moving_layer
    assert layer is not None and layer.material is not None
    assert layer.material.site_density == pytest.approx(100 * 6.92e-8, rel=1e-3)
