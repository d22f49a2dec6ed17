"""The table of reported numbers: all that a run writes stands in it, and all that stands in it a run writes."""

import sys
from pathlib import Path

import pytest

from mpm import Reactor, load_case
from mpm.page.numbers import accounts, errors, groups
from mpm.reactor.result import Result
from mpm.report.balances import TERMS
from mpm.report.quantities import HEADINGS, QUANTITIES, SECTIONS, entry, files_of, quantity
from mpm.report.quantity import RATIO
from mpm.report.rounding import natural_scale
from mpm.report.trees import flatten, nest
from tests.cases import COARSE

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def results() -> dict[str, Result]:
    """A zone and a cycle in time, the cycle's steady state with a second gas reaction, cold powder that enters a zone by its own forces."""
    coarse = {**COARSE, "geometry.cell_width": "4 mm"}
    short = {**coarse, "time.end": "0.3 s", "time.step": "0.1 s"}
    second = {"equation": "TMA + 3 H2O -> 3 CH4 + Al(OH)3", "A": "1 cm^3/mol/s"}
    forced = {"motion.profile": "force_balance", "motion.gamma": 0.45}
    cases = {
        "zone": load_case("single_zone", short),
        "cycle": load_case("single_cycle", short),
        "steady": load_case(
            "single_cycle", {**coarse, "fidelity": "steady", "chemistry.reaction.cvd2": second}
        ),
        "warm": load_case(
            "single_zone", {**short, **forced, "energy": {}, "geometry.bed_temperature": "25 degC"}
        ),
    }
    return {name: Reactor(case).run() for name, case in cases.items()}


@pytest.mark.parametrize("run", ["zone", "cycle", "steady", "warm"])
def test_every_number_of_a_run_is_in_the_table(results: dict[str, Result], run: str) -> None:
    """Fails when summary.json or history.csv hold a number without an entry, or with one that knows of another file only."""
    held = {"summary.json": list(flatten(results[run].summary)), "history.csv": list(results[run].history)}
    assert min(map(len, held.values())) > 25
    assert [
        (name, file) for file, names in held.items() for name in names if file not in files_of(name)
    ] == []


def test_every_entry_of_the_table_is_reported(results: dict[str, Result]) -> None:
    """Fails when the table, and with it the documentation, promises a number that no run gives."""
    names = {name for result in results.values() for name in (*flatten(result.summary), *result.history)}
    given = {found.name for name in names if (found := entry(name)) is not None}
    assert [number.name for number in QUANTITIES if number.name not in given] == []


@pytest.mark.parametrize("run", ["zone", "cycle", "steady", "warm"])
def test_the_report_page_tells_every_number(results: dict[str, Result], run: str) -> None:
    """Fails when a section has no heading that the page knows: its numbers would be in the files and on no page."""
    summary = results[run].summary
    told = {row.name for _, rows in groups(summary) for row in rows} | {row.name for row in errors(summary)}
    told |= {f"species.{account.species}.{term}" for account in accounts(summary) for term in TERMS}
    numbers = flatten(summary)
    silent = {name for name in numbers if quantity(name).profile or quantity(name).again}
    silent |= {name for name in numbers if name.startswith("species.") and numbers[name] == 0.0}
    assert set(numbers) - told - silent == set()


def test_sections_stand_under_their_name_and_a_heading() -> None:
    """Fails when a number would be looked for under another name than it is written, or a heading is misspelt."""
    for section in SECTIONS:
        assert section.heading in ("", *HEADINGS)
        assert all(section.name in ("", number.name.split(".")[0]) for number in section.numbers)


def test_the_table_of_the_documentation_is_that_of_the_program() -> None:
    """Fails when a number, its unit or its meaning has changed since `python scripts/number_table.py` has written docs/output.md."""
    sys.path.insert(0, str(ROOT / "scripts"))
    import number_table

    document = (ROOT / "docs" / "output.md").read_text(encoding="utf-8")
    assert number_table.number_table() in document and number_table.renewed(document) == document


def test_a_row_becomes_a_tree_and_a_row_again() -> None:
    """Fails when numbers lose their place between history.csv and summary.json."""
    row = {"time": 1.0, "outlets.a.x.TMA": 0.5, "outlets.a.backflow": 0.0, "outlets.b.x.TMA": 0.25}
    assert nest(row)["outlets"] == {"a": {"x": {"TMA": 0.5}, "backflow": 0.0}, "b": {"x": {"TMA": 0.25}}}
    assert flatten(nest(row)) == row


def test_amounts_are_measured_by_the_largest_feed() -> None:
    """Fails when rounding of an amount is judged by what a reaction makes, or by a share."""
    numbers = {
        "species.TMA.fed": 2.0,
        "species.H2O.fed": 1.0,
        "species.CH4.produced": 5.0,
        "species.TMA.balance_error": 7.0,
    }
    assert natural_scale("species.CH4.left", numbers) == 2.0


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
