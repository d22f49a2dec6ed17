"""The closed forms in C against the same equations in Python: residuals, slopes, events, and cells that balance by themselves."""

from typing import Any

import numpy as np
import pytest

from mpm.reactor.reactor import Reactor
from mpm.transport.closed_forms import ClosedForms, local_terms
from mpm.transport.local_terms import LocalTerms, StepEquations
from mpm.transport.reactions import Reactions

from .cases import SHORT, TINY, cycle, zone
from .general import SIX_GASES

FEED = 1e-4  # mol/m/s


def two_kinds(*without: str) -> dict[str, Any]:
    """Three gases on two kinds of sites, two of them on the same one, which meet each other in the gas as well; some reactions left out."""
    given: Any = SIX_GASES["chemistry"]
    reaction = {
        "r1": {"equation": "A + free -> sA", "A": "2 m/s"},
        "r2": {"equation": "D + free -> sA + A", "A": "0.3 m/s"},
        "r3": {"equation": "B + sA -> C + free", "A": "1 m/s"},
        "r4": {"equation": "A + B -> C", "A": "2 m^3/mol/s"},
        "r5": {"equation": "B + D -> F", "A": "3 m^3/mol/s"},
    }
    for key in without:
        del reaction[key]
    site = {name: given["site"][name] for name in ("free", "sA")}
    fed = {"A": 3e-4, "B": 2e-4, "D": 1e-4}
    return {
        "chemistry": {**given, "site": site, "reaction": reaction},
        "geometry.inlet.tma.mass_fractions": fed,
    }


def reactions_of(kind: str) -> Reactions:
    case = {
        "one gas": lambda: zone(SHORT, TINY),
        "cycle": lambda: cycle(SHORT, TINY),
        "three gases": lambda: zone({**SHORT, **two_kinds()}, TINY),
        "gases alone": lambda: zone({**SHORT, **two_kinds("r1", "r2", "r3")}, TINY),
        "surfaces alone": lambda: zone({**SHORT, **two_kinds("r4", "r5")}, TINY),
    }[kind]()
    return Reactor(case).system.transport.reactions


KINDS = ("one gas", "cycle", "three gases", "surfaces alone")


def random_step(reactions: Reactions, seed: int, dt: float) -> tuple[StepEquations, np.ndarray, np.ndarray]:
    """Equations, an iterate with concentrations over twelve decades, some of none and some below it, and its fluxes."""
    draw = np.random.default_rng(seed)
    shape = (reactions.coupled, reactions.strip.owned)
    new = 10.0 ** draw.uniform(-12.0, 0.0, shape) * draw.choice([1.0, 1.0, 1.0, 0.0, -0.1], shape)
    diagonal = reactions.gas_volume / dt * (1.0 + draw.random(shape))
    flux = diagonal * new * draw.uniform(0.5, 1.5, shape)
    theta = draw.dirichlet([0.4, 0.4], len(reactions.coverage.cells)).T
    rhs = 10.0 ** draw.uniform(-12.0, 0.0, shape) * diagonal
    return StepEquations(diagonal, rhs, np.ascontiguousarray(theta), dt), new, flux


def both(reactions: Reactions) -> tuple[LocalTerms, LocalTerms]:
    shape = (reactions.strip.owned, reactions.coupled, reactions.coupled)
    compiled, plain = local_terms(reactions, np.zeros(shape)), LocalTerms(reactions, np.zeros(shape))
    assert isinstance(compiled, ClosedForms)
    return compiled, plain


@pytest.mark.parallel
@pytest.mark.parametrize("dt", [1e-6, 1e-2, 1e3])
@pytest.mark.parametrize("kind", [*KINDS, "gases alone"])
def test_they_weigh_alike(kind: str, dt: float) -> None:
    """Fails when a rate, a slope, a tangent below zero or a sum differs between the two."""
    reactions = reactions_of(kind)
    compiled, plain = both(reactions)
    for seed in range(3):
        step, new, flux = random_step(reactions, seed, dt)
        expected, found = plain.weigh(step, new, flux.copy()), compiled.weigh(step, new, flux.copy())
        for name in ("surface", "gas"):
            ours, theirs = getattr(found.events, name), getattr(expected.events, name)
            np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-14 * np.abs(theirs).max(initial=0.0))
        size = np.abs(flux) + np.abs(step.rhs)
        assert np.all(
            np.abs(found.residual - expected.residual) <= 1e-12 * (size + np.abs(expected.residual))
        )
        # a slope is a difference of terms as large as those of cells whose sites are all free
        np.testing.assert_allclose(
            compiled.blocks, plain.blocks, rtol=1e-11, atol=1e-14 * np.abs(plain.blocks).max()
        )
        for name in ("missed", "carried", "made", "lowest", "largest"):
            assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-12), name
        assert compiled.mutual() == pytest.approx(plain.mutual(), rel=1e-6, abs=1e-12)


@pytest.mark.parallel
@pytest.mark.parametrize("dt", [1e-2, 10.0])
@pytest.mark.parametrize("kind", KINDS)
def test_cells_balance_alike(kind: str, dt: float) -> None:
    """Fails when the two choose other cells, or another concentration in one."""
    reactions = reactions_of(kind)
    compiled, plain = both(reactions)
    for seed in range(3):
        step, new, flux = random_step(reactions, seed, dt)
        expected, found = np.maximum(new, 0.0), np.maximum(new, 0.0)
        start = found.copy()
        plain.balance(step, expected, flux, FEED)
        compiled.balance(step, found, flux, FEED)
        assert np.any(found != start)
        np.testing.assert_array_equal(found != start, expected != start)
        np.testing.assert_allclose(
            found, expected, rtol=1e-5, atol=0.0
        )  # what little is left is a difference


def test_rate_constants_are_those_of_the_gas_now() -> None:
    """Fails when the closed forms go on with the rate constants of another temperature."""
    reactions = reactions_of("cycle")
    compiled, plain = both(reactions)
    step, new, flux = random_step(reactions, 1, 1e-2)
    before = compiled.weigh(step, new, flux.copy()).events
    reactions.heat_to(np.linspace(400.0, 700.0, reactions.strip.owned))
    after, expected = (terms.weigh(step, new, flux.copy()).events for terms in (compiled, plain))
    np.testing.assert_allclose(after.surface, expected.surface, rtol=1e-12)
    np.testing.assert_allclose(after.gas, expected.gas, rtol=1e-12)
    assert not np.allclose(before.surface, after.surface, rtol=1e-3)


def test_what_is_no_number_is_told() -> None:
    """Fails when an iterate that is no number counts as weighed."""
    reactions = reactions_of("cycle")
    compiled, _ = both(reactions)
    step, new, flux = random_step(reactions, 1, 1e-2)
    new[0, 3] = np.nan
    flux[0, 3] = np.nan
    assert not np.isfinite(compiled.weigh(step, new, flux).missed)


def test_coverages_may_lie_in_any_order() -> None:
    """Fails when coverages that were found otherwise, site by site for each cell, cannot be stepped from."""
    system = Reactor(zone(SHORT, TINY)).system
    system.coverage.become(np.asfortranarray(system.coverage.theta))
    assert not system.coverage.theta.flags.c_contiguous
    system.transport.advance(system.operators(system.velocity), 0.0, 0.01)
    assert system.coverage.theta.max() <= 1.0


def test_concentrations_may_lie_in_any_order() -> None:
    """Fails when concentrations whose species lie beside each other, as a finer mesh gets them from a coarser one, cannot be used."""
    ends = []
    for order in (np.ascontiguousarray, np.asfortranarray):
        transport = (system := Reactor(cycle(SHORT, TINY)).system).transport
        amounts = np.random.default_rng(9).random(transport.concentration.shape)
        transport.concentration = order(1e-6 * amounts)
        transport.advance(system.operators(system.velocity), 0.0, 0.01)
        transport.advance(system.operators(system.velocity), 0.01, 0.01)
        ends.append(transport.concentration)
    np.testing.assert_array_equal(ends[0], ends[1])


def test_other_laws_stay_in_python() -> None:
    """Fails when reactions without a closed form get one."""
    reactions = Reactor(zone({**SHORT, **SIX_GASES}, TINY)).system.transport.reactions
    shape = (reactions.strip.owned, reactions.coupled, reactions.coupled)
    assert not isinstance(local_terms(reactions, np.zeros(shape)), ClosedForms)
