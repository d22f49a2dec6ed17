"""The rows of docs/reproduction.md on the coarsest mesh: they run, measure and decide; fails when a verdict or number moves."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from reproduction import ROWS, Lab  # noqa: E402
from reproduction.columns import Columns, table  # noqa: E402
from reproduction.row import FAILS, HOLDS, Checks  # noqa: E402


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    return Lab(tmp_path_factory.mktemp("reproduce"), coarse=True)


ONLY = "reproduced only for: "
VERDICTS = {
    "R1": HOLDS,
    "R2": ONLY + "|V| against 3 cm/s",
    "R3": ONLY + "frit, periodic ends; frit, closed ends",
    "R5": HOLDS,
    "R9": HOLDS,
    "R10": HOLDS,
    "R11": HOLDS,
    "R13": ONLY + "low, rising, moderate",
    "R14": HOLDS,
    "R16": ONLY + "zone 2 starts at 1, ports 2.2 mm",
    "R17": ONLY + "zone 2 does not, ports 2.2 mm",
    "R18": FAILS,
    "R19": HOLDS,
    "R20": ONLY + "rich at least 10 times above, ports 2.2 mm; start-up spike, ports 2.2 mm",
    "R21": FAILS,
    "R23": FAILS,
}
"""What the coarsest mesh decides, without the conditions that do not hold. Its runs are the same each time, so its verdicts are."""


def measure(lab: Lab, name: str) -> dict[str, Any]:
    """The numbers of a row, which must decide as ever, be complete and be serialisable."""
    finding = ROWS[name].measure(lab)
    assert finding.verdict.partition(" (not for: ")[0] == VERDICTS[name]
    assert (finding.measured and finding.why) or finding.verdict == HOLDS
    json.dumps(finding.numbers)
    return finding.numbers


def test_all_rows_are_there() -> None:
    """R1 to R23, each with figure, statement and expectation; the table tells a row that has not been measured."""
    assert sorted(ROWS, key=lambda name: int(name[1:])) == [f"R{n}" for n in range(1, 24)]
    assert table(Columns({}, {}, {}, {})).count("not measured") == 2 * 23


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
    measure(lab, "R1")
    speeds = measure(lab, "R2")
    assert speeds["gamma 0.3"]["speed"] == pytest.approx(0.0338, rel=2e-3)
    assert speeds["gamma 0.6"]["speed"] == pytest.approx(0.0676, rel=2e-3)
    shares = measure(lab, "R3")
    assert shares["frit, Gamma 0.30, developed"]["share"] == 1.0
    ratios = measure(lab, "R5")
    assert ratios["developed"]["ratio"]["headspace"] == pytest.approx(2.0, abs=0.1)


def test_dose_rows(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """R9, R10, R11, R13, R14, R23: one zone by dose; what has been run is not run again."""
    lean = measure(lab, "R9")
    assert 0.05 < 1.0 - lean["exit_mean"] < 0.35
    assert lean["exit_profile"] == sorted(lean["exit_profile"], reverse=True)
    measure(lab, "R10")
    assert measure(lab, "R11")["0.001"]["change"] < 0.01
    assert measure(lab, "R13")["Y 0.001"]["knees"] == pytest.approx((1.13, 2.39), abs=0.05)  # s
    spikes = measure(lab, "R14")
    assert spikes["0.01"]["peak"] > spikes["0.001"]["peak"] > spikes["0.0001"]["peak"]
    boxes = [numbers["box_mean"] for numbers in measure(lab, "R23").values()]
    assert boxes == sorted(boxes)

    def fail(*arguments: Any) -> None:
        raise AssertionError("a stored run was made again")

    monkeypatch.setattr("mpm.reactor.reactor.Reactor.__init__", fail)
    measure(lab, "R10")


def test_cycle_rows(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """R16 to R21 on the full cycle with ports of 2.2 mm: ordering of the CVD rates, fronts, boxes, overshoot."""
    monkeypatch.setattr("reproduction.cycle_rows.WIDTHS", ("2.2 mm",))
    assert measure(lab, "R16")["2.2 mm"]["zone 2 at 0 s"] == 1.0
    assert measure(lab, "R17")["2.2 mm"] == pytest.approx({"zone1": 1.0025, "zone2": 1.0020}, abs=2e-4)
    assert measure(lab, "R18")["2.2 mm"]["shift"] == pytest.approx(11.2e-3, abs=2e-4)
    assert measure(lab, "R19")["2.2 mm"]["now"] > 0.99
    rates = measure(lab, "R20")["2.2 mm"]
    assert rates["ratio"] > 10.0
    assert rates["peak over final"]["stoichiometric"] > rates["peak over final"]["delayed"]
    assert measure(lab, "R21")["2.2 mm"]["at 60 s"] < 0.1
