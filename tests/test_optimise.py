"""`mpm optimise`: the dose that titrates with the least precursor, against what the mass balance says it is."""

import csv
import json
from pathlib import Path

import pytest

from mpm.case import load_case
from mpm.cli import main
from mpm.errors import ConvergenceError, InputError
from mpm.optimise import doses_of, optimise

from .cases import CASES, TINY, cycle, run, zone


def test_leanest_dose_is_the_mass_balance() -> None:
    """Fails when the search for half a titration of one zone does not end at the dose that the mass balance gives, within 1 %.

    All precursor is consumed there, so that the exit coverage is the dose ratio.
    """
    case = zone(mesh=TINY)
    best, best_case, search = optimise(case, target=0.5)
    assert best.exits["tma"] == pytest.approx(0.5, abs=0.005)
    assert best.exits["tma"] >= 0.4999
    _, result = run(best_case.with_({"fidelity": "steady"}))
    assert result.summary["dose_ratio"]["tma"] == pytest.approx(best.exits["tma"], abs=1e-4)
    assert best_case.fidelity == case.fidelity
    assert len(search.points) <= 30


@pytest.mark.slow
def test_both_zones_through_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the doses written do not titrate both zones, cost more than the saturating ones by a tenth, or cannot be run again."""
    settings = [f"{key}={json.dumps(value)}" for key, value in TINY.items()]
    arguments = [part for setting in settings for part in ("--set", setting)]
    status = main(
        ["optimise", str(CASES / "single_cycle.toml"), "-o", str(tmp_path), "--target", "0.95", *arguments]
    )
    assert status == 0, capsys.readouterr().err
    _, result = run(load_case(tmp_path / "case.toml", {"fidelity": "steady"}))
    exits = {name: entry["exit_mean"] for name, entry in result.summary["titration"].items()}
    assert min(exits.values()) >= 0.9498, exits
    assert max(result.summary["dose_ratio"].values()) < 1.1
    with (tmp_path / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {"titration.tma.exit_mean", "titration.water.exit_mean", "fed", "cvd.total", "cost"} <= set(
        rows[0]
    )
    assert "Best:" in capsys.readouterr().out


def test_velocities_are_doses_too() -> None:
    """Fails when port velocities are not offered with bounds around those of the case, or mass fractions start off the wanted ratio."""
    doses = {dose.key: dose for dose in doses_of(cycle(mesh=TINY), 0.9, velocities=True)}
    assert len(doses) == 4
    velocity = doses["geometry.inlet.water.velocity"]
    assert (velocity.lowest, velocity.start, velocity.highest) == pytest.approx((0.007, 0.035, 0.175))
    assert doses["geometry.inlet.tma.mass_fractions.TMA"].start == pytest.approx(
        2e-4 * 0.9 / 1.7909, rel=1e-3
    )


def test_what_cannot_be_reached_is_said() -> None:
    """Fails when a target out of range, a case without a dose, or a target beyond every dose within bounds is not refused."""
    with pytest.raises(InputError, match="--target"):
        optimise(zone(mesh=TINY), target=1.5)
    with pytest.raises(InputError, match="inlet"):
        optimise(zone({"geometry.inlet.tma.mass_fractions": {"TMA": 0.0}}, TINY))
    with pytest.raises(ConvergenceError, match="none of"):
        optimise(zone(mesh=TINY), target=1.0, limit=1)
