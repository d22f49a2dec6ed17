"""Balances of mechanisms whose site species hold several places, whose reactions go back and whose films are used up."""

import numpy as np
import pytest

from mpm.report.balances import element_balances, film_made, site_balance, species_balances
from mpm.report.records import Totals

from .cases import zone
from .general import pair_on_two_places, with_mechanism


def book(whole: float, split: float, etch: float) -> Totals:
    """Ten places, all empty at first, and these events on them; A2 is fed as it is used, A3 stays in the gas."""
    fed = whole + split
    return Totals(
        names=("A2", "A3"),
        fed=np.array([[max(fed, 0.0), 0.0]]),
        out=np.array([[max(-fed, 0.0), 0.0]]),
        back=np.zeros((1, 2)),
        out_volume=np.zeros(1),
        back_volume=np.zeros(1),
        stored=np.array([0.0, etch]),
        stored_initially=np.zeros(2),
        surface=np.array([whole, split, etch]).reshape(3, 1, 1),
        gas=np.zeros((0, 2)),
        reactive_rows=np.array([0]),
        slid=0.0,
        sites=np.array([10.0 - 2.0 * fed + 2.0 * etch, 2.0 * (split - etch), 2.0 * whole]),
        sites_initially=np.array([10.0, 0.0, 0.0]),
        sites_passed=np.zeros(3),
    )


def test_places_elements_and_films_balance() -> None:
    """Fails when a group on two places counts as two groups, or a film that is used up as one that is made."""
    case = with_mechanism(zone(), pair_on_two_places())
    totals = book(1.0, 2.0, 0.5)
    assert site_balance(case, totals) == pytest.approx(0.0, abs=1e-15)
    assert element_balances(case, totals)["A"] == pytest.approx(0.0, abs=1e-15)
    assert film_made(case, totals) == {"F": -0.5}
    assert species_balances(case, totals)["A3"]["produced"] == 0.5


def test_a_place_lost_is_seen() -> None:
    """Fails when the balance of sites does not see that one of the groups on two places has gone."""
    case = with_mechanism(zone(), pair_on_two_places())
    totals = book(1.0, 2.0, 0.5)
    totals.sites[2] -= 1.0
    assert site_balance(case, totals) == pytest.approx(0.1)
    assert element_balances(case, totals)["A"] == pytest.approx(1.0 / 6.0)


def test_more_back_than_there() -> None:
    """Fails when events of a reversible reaction, net below 0, count as gas used or leave the balances open."""
    case = with_mechanism(zone(), pair_on_two_places())
    totals = book(0.0, -1.5, 0.0)
    totals = Totals(**{**vars(totals), "sites_initially": np.array([10.0, 5.0, 0.0])})
    totals.sites[1] += 5.0
    assert site_balance(case, totals) == pytest.approx(0.0, abs=1e-15)
    assert element_balances(case, totals)["A"] == pytest.approx(0.0, abs=1e-15)
    entry = species_balances(case, totals)["A2"]
    assert (entry["produced"], entry["reacted"], entry["left"]) == (1.5, 0.0, 1.5)
