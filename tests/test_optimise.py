"""`mpm optimise`: the dose that titrates with the least precursor, against what the mass balance says it is."""

import csv
import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

from mpm.advice.doses import doses_of
from mpm.case.case import load_case
from mpm.cli import main
from mpm.cli.searchover import print_over, variants
from mpm.cli.searchscreen import print_point
from mpm.errors import ConvergenceError, InputError
from mpm.optimise import Point, Search, optimise
from mpm.screen import screen

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


def cheapest(rows: list[dict[str, str]], target: float) -> float:
    """The least cost of the points that reach the target at both exits."""
    exits = [min(float(row[f"titration.{name}.exit_mean"]) for name in ("tma", "water")) for row in rows]
    return min(
        float(row["cost"]) for row, reached in zip(rows, exits, strict=True) if reached >= target - 1e-4
    )


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
    assert {"dose_ratio.tma", "dose_ratio.water", "excess_number.tma", "excess_number.water"} <= set(rows[0])
    assert (tmp_path / "plots" / "search.png").stat().st_size > 10_000
    out = capsys.readouterr().out
    told = " ".join(out.split())
    assert (
        f"Found in {len(rows)} steady states: the target coverage of 0.95 is reached at every exit with"
        in told
    )
    last = rows[[f"{float(row['cost']):.6g}" for row in rows].index(f"{cheapest(rows, 0.95):.6g}")]
    for inlet in ("tma", "water"):
        ratio, excess = float(last[f"dose_ratio.{inlet}"]), float(last[f"excess_number.{inlet}"])
        assert f"dose ratio {ratio:.4g} ({excess:.4g} molecules per site)" in told
    assert f"mpm run {tmp_path}/case.toml" in told and "umol/m/s" in told


def test_what_another_key_does_to_the_doses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a search over another key does not give each value its own doses (in proportion to the speed of the bed, where all
    precursor is consumed), loses a value that has none, or cannot be repeated in its directory."""
    settings = [f"{key}={json.dumps(value)}" for key, value in TINY.items()]
    settings += ["motion.profile=force_balance", "motion.angle=45 deg"]
    arguments = [
        "optimise",
        str(CASES / "single_zone.toml"),
        "-o",
        str(tmp_path),
        "--target",
        "0.9",
        "--limit",
        "4",
    ]
    arguments += [part for setting in settings for part in ("--set", setting)]
    for values in ("0.05,0.3", "0.05,0.3,0.45"):
        assert main([*arguments, "--over", f"motion.gamma={values}"]) == 0, capsys.readouterr().err
    with (tmp_path / "over.csv").open() as file:
        resting, slow, fast = csv.DictReader(file)
    assert float(resting["motion.bed_velocity"]) == 0.0
    assert "a bed that does not move" in resting["reason"]
    speeds, doses = (
        [float(row[name]) for row in (slow, fast)]
        for name in ("motion.bed_velocity", "geometry.inlet.tma.mass_fractions.TMA")
    )
    assert speeds[0] == pytest.approx(0.01343, rel=1e-3)
    assert doses[1] / doses[0] == pytest.approx(speeds[1] / speeds[0], rel=1e-3)
    best = load_case(tmp_path / "0.45" / "case.toml")
    assert best.motion.gamma == 0.45
    assert best.geometry.inlets[1].mass_fractions["TMA"] == pytest.approx(doses[1], rel=1e-12)
    told = " ".join(capsys.readouterr().out.split())
    assert "0.05: bed at 0 cm/s; no doses found" in told


@pytest.mark.parametrize(
    "over",
    [
        "motion.gamma",
        "motion.gamma=",
        "=0.3",
        "motion.gamma=0.3,0.3",
        "motion.gama=0.3",
        "motion.gamma=fast",
        "geometry.inlet.tma.mass_fractions.TMA=1e-4,2e-4",
    ],
)
def test_a_search_over_nonsense_is_one_line(
    over: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a list of values that is none, a value that no case has, or a dose, is more than one line, or leaves a
    directory."""
    assert (
        main(["optimise", str(CASES / "single_zone.toml"), "-o", str(tmp_path / "new"), "--over", over]) == 2
    )
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("over", "settings", "why"),
    [
        ("motion.gamma=0.3,0.45", [], "mean velocity, not the cycle"),
        ("motion.friction=0.4,0.5", [], "motion.profile is not force_balance"),
        ("motion.bed_velocity=1 cm/s,2 cm/s", ["motion.profile=force_balance"], "forces decide"),
        ("geometry.inlet.tma.start=0 s,5 s", [], "of dose windows"),
        ("time.end=5 s,10 s", [], "a steady state has no time"),
        ("gas.conductivity=0.03 W/m/K,0.04 W/m/K", [], "temperature is one number"),
    ],
)
def test_a_search_over_a_key_that_nothing_reads_is_refused(
    over: str, settings: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when values that all give the same steady states are searched one by one, as if they told something; the default among them is
    one of them."""
    arguments = ["optimise", str(CASES / "single_zone.toml"), "-o", str(tmp_path / "new"), "--over", over]
    assert main([*arguments, *(part for one in settings for part in ("--set", one))]) == 2
    (told,) = capsys.readouterr().err.strip().splitlines()
    assert over.partition("=")[0] in told and why in told
    assert not (tmp_path / "new").exists()


def test_a_key_that_is_read_is_searched() -> None:
    """Fails when a value that is the default, or says that nothing vibrates, passes for one that has no effect."""
    case = load_case(CASES / "single_zone.toml", {"motion.profile": "force_balance"})
    for over in (
        "motion.friction=0.3,0.4,0.5",
        "motion.gamma=0,0.3",
        "gas.pressure=1 bar,626 torr",
        "transport.vibrational_dispersion=false,true",
        "conventions=mpm,closed-code",
    ):
        key, cases = variants(case, over, velocities=False)
        assert key == over.partition("=")[0] and len(cases) == over.count(",") + 1


def test_numbers_that_no_search_takes_are_told_once_over_all_values(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a target that is none is found only at each value, as if there were no doses, or leaves a directory."""
    arguments = ["optimise", str(CASES / "single_zone.toml"), "-o", str(tmp_path / "new"), "--target", "2"]
    assert main([*arguments, "--over", "motion.gamma=0.3,0.45"]) == 2
    assert capsys.readouterr().err.strip().splitlines() == [
        "optimise: --target: found 2; accepted: above 0 and at most 1"
    ]
    assert not (tmp_path / "new").exists()


def test_values_of_a_search_are_told_as_typed(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a search over the bed's speed shows it without its unit, or one that chooses velocities does not tell them."""
    row = {
        "motion.bed_velocity": 0.01,
        "geometry.inlet.tma.mass_fractions.TMA": 1e-4,
        "geometry.inlet.tma.velocity": 0.04,
        "excess_number.tma": 0.99,
    }
    print_over("motion.bed_velocity", ["1 cm/s"], [row], Path("found"), screen())
    told = " ".join(capsys.readouterr().out.replace("\u00a0", " ").split())
    assert (
        "1 cm/s: bed at 1 cm/s; mass fraction tma 0.0001, tma at 4 cm/s; molecules per site 0.99 of tma"
        in told
    )


def test_a_coverage_a_little_below_the_target_is_said_to_be_so(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a coverage below the target counts as reaching it and nothing says why."""
    search = Search(zone(mesh=TINY), doses_of(zone(mesh=TINY), 0.99, False), 0.99, 10.0)
    for share, said in ((0.9898, "too lean"), (0.98995, "reaches it to 0.0001"), (0.9901, "reaches it")):
        one = {"tma": 1.0}
        point = Point(doses={}, exits={"tma": share}, ratios=one, excess=one, fed=1.0, cvd=0.0)
        print_point(search, point, screen())
        assert " ".join(capsys.readouterr().out.split()).endswith(f"; {said}")


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
    for option in ({"weight": -1.0}, {"weight": math.nan}, {"limit": 0}, {"target": math.nan}):
        with pytest.raises(InputError, match=f"--{next(iter(option))}: found"):
            optimise(zone(mesh=TINY), **option)
    crowded = zone(
        {"material.glass_beads.site_density": "1.4e-5 mol/m^2"}, TINY
    )  # more sites than the richest feed titrates
    with pytest.raises(ConvergenceError, match="none of"):
        optimise(crowded, target=1.0, limit=1)


INLET = "geometry.inlet.tma"


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({f"{INLET}.mass_fractions": {"TMA": 0.0}}, "no inlet that feeds a precursor"),
        ({f"{INLET}.velocity": "0 m/s"}, f"{INLET}.velocity: found 0 m/s"),
        ({f"{INLET}.mass_fractions": {"TMA": 2e-4, "H2O": 1e-4}}, "found the precursors TMA, H2O"),
        ({f"{INLET}.stop": "2 s"}, "found doses that end at 2 s"),
        (
            {"geometry.zone": [{"name": "all", "start": "0 mm", "end": "139.7 mm"}]},
            "found no zone that it doses",
        ),
        ({"motion.bed_velocity": "0 m/s"}, "found a bed that does not move"),
    ],
)
def test_a_dose_that_titrates_nothing_is_refused(change: dict[str, Any], found: str) -> None:
    """Fails when a search starts whose result could not mean anything, or a traceback tells of it."""
    with pytest.raises(InputError, match=re.escape(found)):
        optimise(zone(change, TINY))


SURFACE_ALONE = {
    "mechanism": "inline",
    "species": {
        "TMA": {"formula": "Al(CH3)3", "molar_mass": "72.09 g/mol"},
        "CH4": {"molar_mass": "16.04 g/mol"},
    },
    "site": {"OH": {}, "OAl(CH3)2": {}},
    "reaction": {"tma": {"equation": "OH + TMA -> CH4 + OAl(CH3)2", "sticking": 0.01}},
}


def test_without_a_gas_reaction_the_dose_is_that_of_the_mass_balance() -> None:
    """Fails when a mechanism without gas-phase reactions, whose summary has no CVD, stops the search or changes its dose."""
    best, _, _ = optimise(zone({"chemistry": SURFACE_ALONE}, TINY), target=0.5)
    with_gas, _, _ = optimise(zone(mesh=TINY), target=0.5)
    assert best.cvd == 0.0 and best.exits["tma"] == pytest.approx(0.5, abs=0.005)
    assert best.doses == pytest.approx(with_gas.doses, rel=0.01)


def test_a_directory_that_cannot_be_written_is_refused_before_the_search(tmp_path: Path) -> None:
    """Fails when the search is done first and its result lost, or bad input leaves a directory behind."""
    (tmp_path / "file").write_text("")
    assert main(["optimise", "single_zone", "-o", str(tmp_path / "file" / "below")]) == 2
    assert main(["optimise", "single_zone", "-o", str(tmp_path / "new"), "--limit", "0"]) == 2
    assert not (tmp_path / "new").exists()


def test_what_was_seen_is_kept_when_the_target_is_not_reached(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a search that does not reach its target ends without saying so, with the doses of an earlier one, or with nothing to
    look at; or when it is begun without the warnings of check."""
    settings = [part for key, value in TINY.items() for part in ("--set", f"{key}={json.dumps(value)}")]
    crowded = [
        "--set",
        "material.glass_beads.site_density='1.4e-5 mol/m^2'",
        "--set",
        "gas.pressure='1 torr'",
    ]
    (tmp_path / "points.csv").write_text("of an earlier search\n")
    (tmp_path / "case.toml").write_text("of an earlier search\n")
    arguments = ["optimise", "single_zone", "-o", str(tmp_path), "--limit", "1", "--target", "1"]
    assert main([*arguments, *settings, *crowded]) == 3
    out, err = capsys.readouterr()
    assert "the target is not reached: none of " in err and "try a lower --target" in err
    assert len(err.splitlines()) == 1
    assert "warning: " in out and "too lean" in out and "Found" not in out
    assert not (tmp_path / "case.toml").exists()
    assert len((tmp_path / "points.csv").read_text().splitlines()) >= 2
    assert (tmp_path / "plots" / "search.png").exists()


def test_a_search_does_not_replace_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the doses of a search take the place of the case of a run."""
    (tmp_path / "case.toml").write_text(zone(mesh=TINY).to_toml())
    assert main(["optimise", "single_zone", "-o", str(tmp_path)]) == 2
    assert "the directory of a run" in capsys.readouterr().err
