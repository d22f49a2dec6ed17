"""Where the solvers of a step start: polynomials in time, sums that no reaction changes, an order of cells."""

import numpy as np
import pytest

from mpm.reactor.reactor import Reactor
from mpm.transport.foresight import Past, possible

from .cases import SHORT, TINY, zone


@pytest.mark.parametrize("remembered", [0, 1, 2, 3])
def test_polynomials_are_foreseen(remembered: int) -> None:
    """Fails when a polynomial in time, of as many states as are remembered and the present one, is not continued exactly."""
    coefficients = np.arange(1.0, remembered + 2.0)
    times = 0.5 * np.arange(remembered + 2)
    *before, now, then = (np.array([np.polyval(coefficients, t)]) for t in times)
    past = Past(3)
    for state in before:
        past = past.followed_by(state, 0.5)
    assert past.foreseen(now, 0.5) == pytest.approx(then, rel=1e-13)


def test_only_steps_of_one_length_are_remembered() -> None:
    """Fails when states at unequal distances in time are taken for equal ones, or more are kept than asked for."""
    past = Past(2)
    for value, dt in ((0.0, 1.0), (1.0, 1.0), (2.0, 1.0)):
        past = past.followed_by(np.array([value]), dt)
    assert [state.item() for state in past.states] == [2.0, 1.0]
    assert past.foreseen(np.array([3.0]), 0.25) == pytest.approx([3.25])
    past = past.followed_by(np.array([3.0]), 0.25)
    assert [state.item() for state in past.states] == [3.0]
    assert past.foreseen(np.array([3.25]), 0.5) == pytest.approx([3.75])


def test_nothing_negative_is_foreseen() -> None:
    """Fails when solvers start from a negative concentration where the present one is not."""
    then = possible(np.array([-1.0, 0.0, 2.0]), np.array([0.5, 0.25, 1.0]))
    assert then.tolist() == [0.5, 0.25, 2.0]


@pytest.mark.parametrize("fidelity", ["averaged", "resolved"])
def test_where_solvers_start_is_not_seen_in_the_answer(fidelity: str) -> None:
    """Fails when concentration or coverage depend on the guess by more than the solvers' tolerance."""
    case = zone({**SHORT, "fidelity": fidelity, "time.end": "0.2 s"}, TINY)
    guessing, not_guessing = Reactor(case), Reactor(case)
    not_guessing.system.transport.past = Past(0)
    for reactor in (guessing, not_guessing):
        reactor.run()
    one, other = guessing.system.transport, not_guessing.system.transport
    assert len(one.past.states) > 0 == len(other.past.states)
    assert np.abs(one.concentration - other.concentration).max() < 1e-11 * one.ports.largest_feed
    assert np.abs(one.coverage.theta - other.coverage.theta).max() < 1e-10
    assert one.concentration.min() >= 0.0


@pytest.mark.parametrize(("fed", "exact"), [({"TMA": 1e-4}, True), ({"TMA": 1e-4, "H2O": 1e-4}, False)])
def test_only_exact_sums_are_tied(fed: dict[str, float], exact: bool) -> None:
    """Fails when TMA + CH4 is not known to be untouched by what TMA does to a bed, or a sum is made up that the three reactions of both
    precursors change: there is none without Al(OH)3."""
    case = zone({**SHORT, "geometry.inlet.tma.mass_fractions": fed}, TINY)
    reactions = Reactor(case).system.transport.reactions
    assert reactions.tied == pytest.approx(np.ones((1, 1)) if exact else np.zeros((2, 2)))
