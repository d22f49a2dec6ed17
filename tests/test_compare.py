"""Two runs beside each other: what counts as a difference."""

from typing import Any

import pytest

from mpm.compare import changed_keys, changed_numbers

from .cases import TINY, zone


def test_changed_keys_are_those_that_were_changed() -> None:
    """Fails when a changed, added or missing key is not listed by the name that --set takes, or one is listed that was not changed."""
    case = zone({"title": "one"}, TINY)
    other = case.with_(
        {
            "title": "another",
            "geometry.inlet.tma.velocity": "4 cm/s",
            "geometry.inlet.tma.windows": [["1 s", "2 s"], ["3 s", "4 s"]],
            "geometry.inlet.tma.mass_fractions.H2O": 1e-5,
            "geometry.periodic": False,
            "motion.bed_velocity": "13.000000000000001 mm/s",  # rounding
        }
    )
    found = {change.key: (change.first, change.second) for change in changed_keys(case, other)}
    assert found == {
        "geometry.inlet.tma.velocity": ("0.035 m/s", "0.04 m/s"),
        "geometry.inlet.tma.start": ("0.0 s", None),
        "geometry.inlet.tma.windows": (None, "[[1.0 s, 2.0 s], [3.0 s, 4.0 s]]"),
        "geometry.inlet.tma.mass_fractions.H2O": (None, "1e-05"),
        "geometry.periodic": ("true", "false"),
    }
    assert changed_keys(case, case.with_({"title": "another"})) == []


SUMMARY: dict[str, Any] = {
    "status": "done",
    "fidelity": "averaged",
    "cells": 100,
    "wall_seconds": 3.0,
    "versions": {"mpm": "1"},
    "flow": {"bed_superficial_velocity": [1e-20, 0.02], "mass_error": 1e-15},
    "species": {"TMA": {"fed": 2e-6, "stored": 1e-22, "balance_error": 1e-13}},
    "titration": {"tma": {"exit_mean": 0.5, "exit_profile": [0.4, 0.6]}},
}


def changed(**sections: Any) -> dict[str, Any]:
    return SUMMARY | sections


def test_changed_numbers_leave_rounding_out() -> None:
    """Fails when rounding, the computer's own numbers or a profile's rows are listed, or a real difference is not, or its unit is lost."""
    other = changed(
        wall_seconds=5.0,
        flow={"bed_superficial_velocity": [-3e-20, 0.02 * (1 + 1e-8)], "mass_error": 2e-15},
        species={"TMA": {"fed": 3e-6, "stored": 3e-22, "balance_error": 4e-12}},
        titration={"tma": {"exit_mean": 0.25, "exit_min": 0.2, "exit_profile": [0.1, 0.4]}},
    )
    found = {number.quantity.name: number for number in changed_numbers(SUMMARY, other)}
    assert set(found) == {"species.TMA.fed", "titration.tma.exit_mean", "titration.tma.exit_min"}
    fed = found["species.TMA.fed"]
    assert fed.relative == pytest.approx(0.5)
    assert (fed.quantity.of(3e-6), fed.quantity.unit_shown) == (pytest.approx(3.0), "umol/m")
    assert found["titration.tma.exit_mean"].relative == pytest.approx(-0.5)
    assert found["titration.tma.exit_min"].first is None
    assert found["titration.tma.exit_min"].relative is None
    assert changed_numbers(SUMMARY, SUMMARY) == []
    names = {number.quantity.name for number in changed_numbers(SUMMARY, SUMMARY, everything=True)}
    assert {"wall_seconds", "flow.mass_error", "titration.tma.exit_profile.1"} <= names


def test_amounts_per_second_are_not_compared_with_amounts() -> None:
    """Fails when moles that a steady state feeds in a second stand beside those of a whole run."""
    numbers = [
        n
        for n in changed_numbers(SUMMARY, changed(fidelity="steady"))
        if n.quantity.name == "species.TMA.fed"
    ]
    assert [(n.first, n.second, n.quantity.unit) for n in numbers] == [
        (2e-6, None, "mol/m"),
        (None, 2e-6, "mol/m/s"),
    ]
