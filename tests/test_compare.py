"""Two runs beside each other: what counts as a difference."""

from pathlib import Path
from typing import Any

import pytest

from mpm.case.case import Case
from mpm.cli import main
from mpm.output.compare import changed_keys, changed_numbers
from mpm.output.directory import RunDirectory

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
    assert fed.quantity.of(3e-6) == pytest.approx(3.0) and fed.quantity.unit_shown == "umol/m"
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


def written(directory: Path, case: Case, summary: dict[str, Any] | None) -> str:
    run = RunDirectory(directory)
    run.prepare()
    run.write_case(case.to_toml())
    if summary is not None:
        run.write_summary(summary)
    run.release()
    return str(directory)


def test_two_runs_side_by_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when `mpm compare` does not show both values of what differs with unit and difference, shows what is the same without being
    asked, or takes a run that has no numbers yet."""
    monkeypatch.chdir(tmp_path)
    case = zone(mesh=TINY)
    one = written(Path("one"), case, SUMMARY)
    other = written(
        Path("two"),
        case.with_({"motion.bed_velocity": "8 mm/s"}),
        changed(
            species={"TMA": {"fed": 3e-6, "stored": 1e-22, "balance_error": 1e-13}},
            flow={"bed_superficial_velocity": [0.01, 0.02], "mass_error": 1e-15},
        ),
    )
    assert main(["compare", one, other]) == 0
    text = capsys.readouterr().out
    lines = [" ".join(line.split()) for line in text.splitlines()]
    assert lines[:2] == ["A: one (Single TMA zone)", "B: two (Single TMA zone)"]
    assert "motion.bed_velocity 1.3 cm/s -> 0.8 cm/s" in lines
    assert "TMA fed 2 -> 3 umol/m (+50 %)" in lines
    assert "superficial gas velocity in the bed, along 0 -> 1 cm/s" in lines
    assert "upwards" not in text and "balance" not in text and "profile" not in text
    assert main(["compare", one, other, "--all"]) == 0
    everything = capsys.readouterr().out
    assert "upwards" in everything and "row 1 from below" in everything and "computing time" in everything
    assert main(["compare", one, one]) == 0
    assert "The cases are the same.\nThe numbers are the same" in capsys.readouterr().out
    assert main(["compare", one, written(Path("young"), case, None)]) == 2
    assert "young: found no summary.json; accepted: a run that has ended" in capsys.readouterr().err
