"""The rows of docs/reproduction.md on the coarsest mesh: they run, measure and decide; what holds on any mesh is asserted."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from reproduction import ROWS, Lab  # noqa: E402
from reproduction.report import table  # noqa: E402
from reproduction.row import FAILS, HOLDS, Checks, Finding  # noqa: E402


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    return Lab(tmp_path_factory.mktemp("reproduce"), coarse=True)


def measure(lab: Lab, name: str) -> Finding:
    """A row's finding, which must be complete, serialisable and decided."""
    finding = ROWS[name].measure(lab)
    assert finding.verdict in (HOLDS, FAILS) or finding.verdict.startswith("reproduced only for: ")
    assert (finding.measured and finding.why) or finding.verdict == HOLDS
    json.dumps(finding.numbers)
    return finding


def test_all_rows_are_there() -> None:
    """R1 to R23, each with figure, statement and expectation; the table tells a row that has not been measured."""
    assert sorted(ROWS, key=lambda name: int(name[1:])) == [f"R{n}" for n in range(1, 24)]
    assert table({}).count("not measured") == 23


def test_verdicts_follow_the_comparisons() -> None:
    """No comparison true: not reproduced; all: reproduced; some: only for those. Fails when a verdict could be asserted."""
    checks = Checks()
    checks.add("a", 1.0 > 2.0)
    assert checks.verdict == FAILS
    checks.add("b", 2.0 > 1.0)
    assert checks.verdict == "reproduced only for: b (not for: a)"
    checks.outcomes["a"] = True
    assert checks.verdict == HOLDS


def test_flow_rows(lab: Lab) -> None:
    """R1, R2, R3, R5: flow before and during vibration."""
    assert measure(lab, "R1").verdict == HOLDS
    speeds = measure(lab, "R2").numbers
    assert speeds["gamma 0.3"]["speed"] == pytest.approx(0.0338, rel=2e-3)
    assert speeds["gamma 0.6"]["speed"] == pytest.approx(0.0676, rel=2e-3)
    shares = measure(lab, "R3").numbers
    assert shares["frit, Gamma 0.30, developed"]["share"] == 1.0
    ratios = measure(lab, "R5").numbers
    assert ratios["developed"]["ratio"]["headspace"] == pytest.approx(2.0, abs=0.1)


def test_dose_rows(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """R9, R10, R11, R13, R14, R23: one zone by dose; what has been run is not run again."""
    lean = measure(lab, "R9").numbers
    assert 0.05 < 1.0 - lean["exit_mean"] < 0.35
    assert lean["exit_profile"] == sorted(lean["exit_profile"], reverse=True)
    assert measure(lab, "R10").verdict == HOLDS
    assert measure(lab, "R11").numbers["0.001"]["change"] < 0.01
    measure(lab, "R13")
    spikes = measure(lab, "R14").numbers
    assert spikes["0.01"]["peak"] > spikes["0.001"]["peak"] > spikes["0.0001"]["peak"]
    boxes = [numbers["box_mean"] for numbers in measure(lab, "R23").numbers.values()]
    assert boxes == sorted(boxes)

    def fail(*arguments: Any) -> None:
        raise AssertionError("a stored run was made again")

    monkeypatch.setattr("mpm.reactor.reactor.Reactor.__init__", fail)
    assert measure(lab, "R10").verdict == HOLDS


def test_cycle_rows(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """R16 to R21 on the full cycle with ports of 2.2 mm: ordering of the CVD rates, fronts, boxes, overshoot."""
    monkeypatch.setattr("reproduction.cycle_rows.WIDTHS", ("2.2 mm",))
    assert measure(lab, "R16").numbers["2.2 mm"]["zone 2 at 0 s"] == 1.0
    measure(lab, "R17")
    measure(lab, "R18")
    assert measure(lab, "R19").verdict == HOLDS
    rates = measure(lab, "R20").numbers["2.2 mm"]
    assert rates["ratio"] > 10.0
    assert rates["peak over final"]["stoichiometric"] > rates["peak over final"]["delayed"]
    assert measure(lab, "R21").numbers["2.2 mm"]["at 60 s"] < 0.1
