"""Kinetics of any rate law over a step, without a mesh: agreement with the closed forms, derivatives, bounds, balances, small systems."""

from collections.abc import Mapping

import numpy as np
import pytest

from mpm.case.case import load_case
from mpm.physics.general_gas import GeneralGas
from mpm.physics.general_kinetics import GeneralKinetics
from mpm.physics.kinetics import GasKinetics, SurfaceKinetics
from mpm.physics.mechanism import Mechanism
from mpm.physics.powers import TRACE, power
from mpm.physics.rate_solvers import gas_kinetics, surface_kinetics
from mpm.physics.rates import Arrhenius, Dependence, Law
from mpm.physics.reaction import SurfaceReaction
from mpm.physics.slow_and_fast import combined
from mpm.physics.small_systems import invariants, solve_cells
from mpm.physics.substances import Site, Species

from .cases import CASES, rate
from .test_kinetics import SITES, N, T, random_state, ring

GASES = ("A", "B", "C")


def law(k: float, gases: Mapping[str, float], sites: Mapping[str, float], **more: object) -> Law:
    return Law(constant=Arrhenius(k), gas_orders=gases, site_orders=sites, **more)  # type: ignore[arg-type]


def reaction(
    key: str, there: Law, back: Law | None, nu_gas: Mapping[str, float], nu_site: Mapping[str, float]
) -> SurfaceReaction:
    return SurfaceReaction(
        key=key, equation=key, forward=there, backward=back, nu_gas=nu_gas, nu_site=nu_site
    )


def mixed() -> Mechanism:
    """Adsorption, dissociation onto two places, a surface reaction with half an order, growth without change, coverage dependence."""
    bend = {"a": Dependence(a=-1.0, m=0.5, E=5e3)}
    reactions = (
        reaction(
            "ads", law(0.7, {"A": 1.0}, {"free": 1.0}), law(1e-6, {}, {"a": 1.0}, coverage=bend), {"A": -1.0},
            {"free": -1.0, "a": 1.0},
        ),
        reaction("dis", law(0.2, {"B": 1.0}, {"free": 2.0}), law(1e-5, {}, {"b": 1.0}), {"B": -1.0}, {"free": -2.0, "b": 1.0}),
        reaction("mix", law(3e-6, {}, {"a": 0.5, "b": 1.0}), None, {"C": 1.0}, {"a": -1.0, "b": -1.0, "free": 3.0}),
        reaction("grow", law(0.01, {"A": 0.5, "C": 1.0}, {"free": 1.0}), None, {"A": -1.0}, {}),
    )  # fmt: skip
    return Mechanism(
        name="mixed",
        species=tuple(Species(name, 0.03, {}) for name in GASES),
        sites=(Site("free", {}), Site("a", {}), Site("b", {}, places=2.0)),
        films=(),
        surface_reactions=reactions,
        gas_reactions=(),
    )


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(16)


@pytest.mark.parametrize("dt", [1e-6, 1e-2, 1e3, 1e12])
@pytest.mark.parametrize("kind", ["alumina", "ring"])
def test_it_agrees_with_the_closed_forms(rng: np.random.Generator, kind: str, dt: float) -> None:
    """Fails when Newton's method on the coverages, the events that follow from it or the coefficients differ from elimination."""
    alumina = load_case(CASES / "single_cycle.toml").mechanism
    mechanism, coupled = (alumina, ("TMA", "H2O")) if kind == "alumina" else (ring(), GASES)
    concentration, theta = random_state(rng, len(coupled), len(mechanism.sites))
    general, closed = (
        GeneralKinetics(mechanism, coupled, SITES, T),
        SurfaceKinetics(mechanism, coupled, SITES, T),
    )
    np.testing.assert_allclose(
        general.coverage(concentration, theta, dt), closed.coverage(concentration, theta, dt), atol=1e-14
    )
    values, expected = general.rates(concentration, theta, dt)[0], closed.rates(concentration, theta, dt)[0]
    # where little reacts, events are known to the rounding of the coverages
    np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-15 * SITES[0] / dt)


def test_the_simplest_kinetics_are_chosen() -> None:
    """Fails when alumina pays for generality, or a general mechanism is given the closed forms of another."""
    alumina = load_case(CASES / "single_cycle.toml").mechanism
    assert isinstance(surface_kinetics(alumina, ("TMA",), SITES, T), SurfaceKinetics)
    assert isinstance(gas_kinetics(alumina, ("TMA", "H2O"), N, T), GasKinetics)
    assert isinstance(surface_kinetics(mixed(), GASES, SITES, T), GeneralKinetics)


def test_gas_of_second_order_agrees_with_the_closed_form(rng: np.random.Generator) -> None:
    """Fails when general gas reactions have another rate or slope than k C_1 C_2, or another tangent beyond zero."""
    alumina = load_case(CASES / "single_cycle.toml").mechanism
    concentration = rng.uniform(0.0, 1.0, (2, N))
    general, closed = GeneralGas(alumina, ("TMA", "H2O"), N, T), GasKinetics(alumina, ("TMA", "H2O"), T)
    for value, expected in zip(general.rates(concentration), closed.rates(concentration), strict=True):
        np.testing.assert_allclose(value, expected, rtol=1e-14)
    negative, _ = general.rates(-concentration)
    assert not negative.any()


@pytest.mark.parametrize("dt", [1e-5, 1e-3, 1e-1, 10.0])
def test_slopes_are_the_derivatives_of_the_rates(rng: np.random.Generator, dt: float) -> None:
    """Fails when the Jacobian of general surface rates is not that of the rates."""
    kinetics = GeneralKinetics(mixed(), GASES, SITES, T)
    _, theta = random_state(rng, 3, 3)
    concentration = rng.uniform(0.2, 1.0, (3, N)) * 1e-3
    values, slopes = kinetics.rates(concentration, theta, dt)
    for j in range(3):
        h = 1e-6 * concentration[j]
        up, down = concentration.copy(), concentration.copy()
        up[j], down[j] = up[j] + h, down[j] - h
        difference = (kinetics.rates(up, theta, dt)[0] - kinetics.rates(down, theta, dt)[0]) / (2 * h)
        scale = np.abs(values / concentration.min(axis=0)).max()
        np.testing.assert_allclose(slopes[:, j], difference, rtol=1e-4, atol=1e-8 * scale)


@pytest.mark.parametrize("dt", [1e-6, 1e-2, 1e2, 1e12])
def test_bounds_and_balances(rng: np.random.Generator, dt: float) -> None:
    """Fails when any step takes a coverage out of [0, 1], loses places, or events do not account for the change exactly."""
    kinetics = GeneralKinetics(mixed(), GASES, SITES, T)
    concentration, theta = random_state(rng, 3, 3)
    theta[:, 10:20] = np.eye(3)[:, [0]]
    new = kinetics.coverage(concentration, theta, dt)
    assert new.min() >= 0.0 and new.max() <= 1.0
    np.testing.assert_allclose(new.sum(axis=0), 1.0, atol=1e-14)
    values, _ = kinetics.rates(concentration, theta, dt)
    turned = kinetics.nu_places.T @ values * dt / SITES
    np.testing.assert_allclose(
        new - theta, turned, atol=1e-14 * max(1.0, np.abs(values).max() * dt / SITES[0])
    )


@pytest.mark.parametrize("time", [1e-4, 1e-2, 1.0])
def test_conveyed_solids(rng: np.random.Generator, time: float) -> None:
    """Fails when the coverage that leaves a cell and the mean rates in it do not balance, or a derivative of them is wrong."""
    kinetics = GeneralKinetics(mixed(), GASES, SITES, T)
    theta = rng.dirichlet(np.full(3, 4.0), N).T
    concentration = rng.uniform(0.2, 1.0, (3, N)) * 1e-3
    passed = kinetics.conveyed(concentration, theta, time)
    turned = kinetics.nu_places.T @ passed.rates * time / SITES
    np.testing.assert_allclose(passed.out - theta, turned, atol=1e-13 * max(1.0, np.abs(turned).max()))
    for values, slopes, name in (
        (concentration, (passed.rates_c, passed.out_c), "c"),
        (theta, (passed.rates_theta, passed.out_theta), "theta"),
    ):
        for j in range(3):
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
                    slope[:, j], difference, rtol=1e-3, atol=1e-6 * size, err_msg=f"{what} by {name} {j}"
                )


def test_conveyed_solids_tend_to_the_exponential() -> None:
    """Fails when the implicit steps in a cell do not converge to theta_in exp(-nu k C h/(v n_s)) of a first-order reaction."""
    mechanism = load_case(CASES / "single_cycle.toml").mechanism
    kinetics = GeneralKinetics(mechanism, ("H2O",), SITES, T)
    c, time, errors, cells = 2e-3, 1e-5, [], [1, 2, 4, 8]
    exact = np.exp(-2.0 * 1.9 * c * time / SITES[0])
    for n in cells:
        theta = np.tile([[0.0], [1.0]], N)
        for _ in range(n):
            theta = kinetics.conveyed(np.full((1, N), c), theta, time / n).out
        errors.append(abs(theta[1, 0] - exact))
    assert errors[0] < 0.1 and rate([1 / n for n in cells], errors) == pytest.approx(1.0, abs=0.1)


def autocatalytic(k: float) -> Mechanism:
    """free + a -> 2 a, which Newton's method from almost no a takes for one that dies out."""
    grow = reaction("grow", law(k, {}, {"free": 1.0, "a": 1.0}), None, {}, {"free": -1.0, "a": 1.0})
    fade = reaction("fade", law(1e-9 * k, {}, {"a": 1.0}), None, {}, {"a": -1.0, "free": 1.0})
    return Mechanism(
        name="driven", species=(), sites=(Site("free", {}), Site("a", {})), films=(), surface_reactions=(grow, fade), gas_reactions=()
    )  # fmt: skip


def test_a_reaction_that_its_product_drives() -> None:
    """(theta' - theta)/dt = (k/n_s) theta' (1 - theta'): the root in [0, 1]. Fails when Newton's method is left where it got lost."""
    k, dt = 1.0, 1e-3
    kinetics = GeneralKinetics(autocatalytic(k), (), SITES, T)
    start = np.logspace(-9, -1, N)
    theta = kinetics.coverage(np.zeros((0, N)), np.stack([1.0 - start, start]), dt)
    g = k * dt / SITES[0]
    expected = ((g - 1.0) + np.sqrt((g - 1.0) ** 2 + 4.0 * g * start)) / (2.0 * g)
    np.testing.assert_allclose(theta[1], expected, rtol=1e-6)


def test_slow_reactions_do_not_drown_in_fast_ones() -> None:
    """a <=> b at 1e12 per second beside b -> c at 1e-3: after 100 s a share 1/(1 + 0.05) of a and b is left, to nine digits.

    Fails when equations of the sites are added up as they stand: the fast reaction's rounding is then 1e-2 of the slow one.
    """
    fast, slow, dt = 1e12 * SITES[0], 1e-3 * SITES[0], 100.0
    swap = reaction("swap", law(fast, {}, {"a": 1.0}), law(fast, {}, {"b": 1.0}), {}, {"a": -1.0, "b": 1.0})
    loss = reaction("loss", law(slow, {}, {"b": 1.0}), None, {}, {"b": -1.0, "c": 1.0})
    mechanism = Mechanism(
        name="x", species=(), sites=tuple(Site(name, {}) for name in "abc"), films=(), surface_reactions=(swap, loss), gas_reactions=()
    )  # fmt: skip
    kinetics = GeneralKinetics(mechanism, (), SITES, T)
    theta = kinetics.coverage(np.zeros((0, N)), np.tile([[1.0], [0.0], [0.0]], N), dt)
    np.testing.assert_allclose(theta[:2], 0.5 / 1.05, rtol=1e-9)
    values, _ = kinetics.rates(np.zeros((0, N)), np.tile([[1.0], [0.0], [0.0]], N), dt)
    np.testing.assert_allclose(values[1] * dt / SITES, 1.0 - 1.0 / 1.05, rtol=1e-9)


def test_equations_are_told_apart_by_speed() -> None:
    """The second equation of a <=> b (fast), b -> c (slow) is that of a + b, without the fast one. Fails when it holds both."""
    nu = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
    equations = combined(nu, np.array([[1e9], [1.0]]))
    assert equations.leading[:2, 0].tolist() == [0, 1] and equations.leading[2, 0] == -1
    assert equations.of_reactions[1:, 0, 0].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(np.abs(equations.of_sites[1, :, 0] @ nu.T), [0.0, 1.0])
    wanted = equations.sum_reactions(np.array([[[3.0]], [[5.0]]]))
    np.testing.assert_allclose(equations.corrected(np.zeros((2, 1, 1)), wanted)[:, 0, 0], [3.0, 5.0])


@pytest.mark.parametrize(("reactions", "kinds"), [(0, 2), (1, 1), (3, 2), (2, 4), (6, 3), (7, 5)])
def test_the_fastest_lead_in_every_cell(rng: np.random.Generator, reactions: int, kinds: int) -> None:
    """Fails when in some cell an equation is no combination of the sites', or the fastest reaction that equations still hold does not
    lead the next one, or a later one holds it, too."""
    nu = rng.integers(-2, 3, (reactions, kinds)).astype(float)
    speed = 10.0 ** rng.uniform(-30, 10, (reactions, 40)) * (rng.random((reactions, 40)) > 0.2)
    found = combined(nu, speed)
    for cell in range(40):
        sites, held = found.of_sites[:, :, cell], found.of_reactions[:, :, cell]
        np.testing.assert_allclose(sites @ nu.T, held, atol=1e-9)
        assert abs(np.linalg.det(sites)) > 1e-9
        for i, lead in enumerate(found.leading[:, cell]):
            left = held[i:].any(axis=0)
            assert (lead >= 0) == left.any()
            if lead >= 0:
                assert speed[lead, cell] == speed[left, cell].max()
                assert held[i, lead] != 0.0 and not held[i + 1 :, lead].any()


@pytest.mark.parametrize("order", [0.0, 0.5, 0.9, 1.0, 1.7, 2.0, 3.0])
def test_powers_are_smooth_and_end_at_nothing(order: float) -> None:
    """x^p with its slope, continuous at TRACE, 0 at 0. Fails when a rate goes on where nothing is left."""
    x = np.concatenate([np.linspace(0.1, 5.0, 50) * TRACE, np.logspace(-10, 2, 30)])
    value, slope = power(x, order)
    far = x > TRACE
    np.testing.assert_allclose(value[far], x[far] ** order, rtol=1e-12)
    h = 1e-5 * x
    difference = (power(x + h, order)[0] - power(x - h, order)[0]) / (2 * h)
    near_kink = np.abs(x - TRACE) < 2 * h
    np.testing.assert_allclose(
        slope[~near_kink], difference[~near_kink], rtol=1e-4, atol=1e-9 * np.abs(slope).max()
    )
    assert power(np.zeros(1), order)[0][0] == 0.0 and (np.diff(value) >= 0.0).all()


@pytest.mark.parametrize("unknowns", [1, 2, 3, 4, 6])
def test_small_systems(rng: np.random.Generator, unknowns: int) -> None:
    """Fails when a system of another scale, or next to a singular one, is solved wrongly."""
    matrix, x = rng.normal(size=(unknowns, unknowns, N)), rng.normal(size=(unknowns, 2, N))
    matrix *= 10.0 ** rng.uniform(-9, 9, (unknowns, 1, N))
    rhs = np.einsum("ijn,jmn->imn", matrix, x)
    np.testing.assert_allclose(solve_cells(matrix, rhs), x, rtol=1e-7, atol=1e-9)
    matrix[:, :, 3] = 0.0
    np.testing.assert_allclose(
        np.delete(solve_cells(matrix, rhs), 3, axis=2), np.delete(x, 3, axis=2), rtol=1e-7, atol=1e-9
    )


def test_sums_that_stay() -> None:
    """Places of two kinds of site, and a dimer on two of them. Fails when a sum is missing, or one that reactions change is kept."""
    sums, _ = invariants(np.array([[-1.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.0], [-2.0, 2.0, 0.0, 0.0]]))
    assert np.linalg.matrix_rank(sums) == 2
    np.testing.assert_allclose(
        np.linalg.svd(np.vstack([sums, [[1, 1, 0, 0], [0, 0, 1, 1]]]))[1][2:], 0.0, atol=1e-12
    )


@pytest.mark.parametrize("dt", [1e-3, 1.0])
def test_reactions_that_undo_each_other_count_as_one(dt: float) -> None:
    """Adsorption and desorption at 1e12 per second, listed apart: events are net and known to the rounding of the coverages, so that gas
    does not see that of 1e9 turnovers. Fails when both are counted, or a pair of other heats or amounts is taken for one."""
    up = reaction(
        "up", law(1e15 * SITES[0], {"A": 1.0}, {"free": 1.0}), None, {"A": -1.0}, {"free": -1.0, "a": 1.0}
    )
    down = reaction("down", law(1e12 * SITES[0], {}, {"a": 1.0}), None, {"A": 1.0}, {"free": 1.0, "a": -1.0})
    twice = reaction(
        "twice", law(1e-3, {"A": 1.0}, {"free": 2.0}), None, {"A": -2.0}, {"free": -2.0, "a": 2.0}
    )
    mechanism = Mechanism(
        name="x", species=(Species("A", 0.03, {}),), sites=(Site("free", {}), Site("a", {})), films=(),
        surface_reactions=(up, down, twice), gas_reactions=(),
    )  # fmt: skip
    kinetics = GeneralKinetics(mechanism, ("A",), SITES, T)
    concentration = np.asarray(1e-3 * (1.0 + 1e-13 * np.arange(N)))[None, :].astype(np.float64)
    start = np.tile([[0.5], [0.5]], N)
    values, _ = kinetics.rates(concentration, start, dt)
    assert not values[1].any() and values[2].all()
    np.testing.assert_allclose(values[0] * dt / SITES, values[0, 0] * dt / SITES[0], atol=2e-13)
    theta = kinetics.coverage(concentration, start, dt)
    np.testing.assert_allclose(theta[1] - 0.5, (values[0] + 2.0 * values[2]) * dt / SITES, atol=1e-15)
    theta = kinetics.coverage(concentration, np.tile([[1.0], [0.0]], N), dt)
    np.testing.assert_allclose(theta[1], 0.5, atol=1e-6)
