"""The table of reported numbers: every number that a run writes has a name in words, a unit and a meaning."""

import pytest

from mpm import Reactor, load_case
from mpm.report.quantities import QUANTITIES, known, quantity
from mpm.report.quantity import RATIO
from mpm.report.trees import flatten
from tests.cases import COARSE


@pytest.mark.parametrize("case", ["single_zone", "single_cycle"])
def test_every_number_of_a_run_is_in_the_table(case: str) -> None:
    """Fails when summary.json or history.csv report a number that no screen can name."""
    coarse = {**COARSE, "geometry.cell_width": "4 mm", "time.end": "0.3 s", "time.step": "0.1 s"}
    result = Reactor(load_case(case, coarse)).run()
    names = [name for name in (*flatten(result.summary), *result.history) if not name.startswith("versions.")]
    assert len(names) > 50
    assert [name for name in names if not known(name)] == []


def test_units_for_people_are_the_same_dimension() -> None:
    """Fails when a unit to be shown does not convert to the SI unit of the number."""
    assert [q.name for q in QUANTITIES if not q.factor > 0.0] == []
    height = quantity("front.tma.height")
    assert height.of(-0.0033) == pytest.approx(-3.3) and height.unit_shown == "mm"


def test_a_steady_state_counts_amounts_per_second() -> None:
    """Fails when the unit of an amount forgets what the fidelity makes of it."""
    fed = "species.TMA.fed"
    assert (quantity(fed).unit, quantity(fed, steady=True).unit) == ("mol/m", "mol/m/s")
    assert quantity(fed, steady=True).unit_shown == "umol/m/s"
    assert quantity("titration.tma.exit_mean", steady=True).unit == RATIO


def test_names_of_the_case_stand_in_the_words() -> None:
    """Fails when a label keeps a placeholder."""
    label = quantity("outlets.zone1.x.Al(OH)3").label
    assert "Al(OH)3" in label and "zone1" in label
    assert not any(mark in quantity(q.name).label for q in QUANTITIES for mark in "{}")
