"""Engineering numbers against the thesis and the classic correlations, and the warnings of `mpm check`."""

import json
import math
from pathlib import Path

import pytest

from mpm.advice import engineering as eng
from mpm.advice.checks import check_case
from mpm.case.case import Case, load_case
from mpm.case.throughflow import flow_resistance, rising_velocity, spreading_length
from mpm.cli import main
from mpm.mesh.grid import Grid
from mpm.report.dosing import inlet_excess

from .cases import COARSE

EXAMPLE = Path(__file__).parent / "example_case.toml"


@pytest.fixture(scope="module")
def case() -> Case:
    return load_case(EXAMPLE)


@pytest.mark.parametrize(
    ("width", "mass_fraction", "velocity", "expected"),
    [  # equation 5-20, tabulated independently of mpm
        (4.0, 1e-4, 3.5, 0.895505),
        (4.0, 2e-4, 3.5, 1.79112),
        (4.0, 1e-3, 3.5, 8.95998),
        (4.0, 1e-2, 3.5, 90.0959),
        (2.25, 2e-4, 3.5, 1.0075),
        (4.5, 1e-4, 4.0, 1.15129),
    ],
)
def test_excess_number(
    case: Case, width: float, mass_fraction: float, velocity: float, expected: float
) -> None:
    changed = case.with_(
        {
            "geometry.inlet.tma.width": f"{width} mm",
            "geometry.inlet.tma.velocity": f"{velocity} cm/s",
            "geometry.inlet.tma.mass_fractions.TMA": mass_fraction,
        }
    )
    found = inlet_excess(changed, changed.geometry.inlets[1])
    assert found is not None
    species, excess, ratio, _ = found
    assert species == "TMA"
    assert excess == pytest.approx(expected, rel=3e-4)
    assert ratio == excess


def profile_case(path: Path, mean: float, comment: str = "", **motion: object) -> Case:
    """The zone with a profile file of this mean [m/s]."""
    rows = "".join(f"{p},{mean + 0.01 * math.cos(math.radians(p))!r},0,1\n" for p in range(0, 360, 5))
    path.write_text(f"phase_deg,u_x_m/s,u_y_m/s,contact\n{comment}{rows}")
    return load_case(EXAMPLE, {"motion.profile": str(path), **{f"motion.{k}": v for k, v in motion.items()}})


@pytest.mark.parametrize("mean", [0.026, -0.026])
def test_a_profile_sets_the_speed_of_all_engineering_numbers(tmp_path: Path, mean: float) -> None:
    """Fails when `motion.bed_velocity` enters excess number, dose ratio or residence time of a bed moved by a file, in either direction."""
    case = profile_case(tmp_path / "p.csv", mean)
    report = check_case(case)
    assert report["inlets"]["tma"]["excess_number"] == pytest.approx(
        0.8955, abs=2e-4
    )  # half that at 1.3 cm/s
    assert report["inlets"]["tma"]["dose_ratio"] == report["inlets"]["tma"]["excess_number"]
    assert report["bed"]["residence_time"] == pytest.approx(0.1397 / 0.026, rel=1e-9)
    assert report["motion"]["bed_velocity"] == pytest.approx(mean, rel=1e-9)
    assert report["motion"]["bed_velocity_from"] == f"mean of {tmp_path / 'p.csv'}"


MADE = '# conditions = { frequency = "16 Hz", gamma = 0.3, angle = "60 deg", waveform = "sine" }\n'


@pytest.mark.parametrize(
    ("comment", "motion", "texts"),
    [
        (MADE, {}, ["motion.bed_velocity: the bed does not move at 1.3 cm/s but as p.csv says, 1 cm/s"]),
        ("# by hand\n", {}, ["motion.bed_velocity: ", "does not say under which vibration it was made"]),
        (MADE, {"gamma": 0.4}, ["motion.bed_velocity: ", "made at gamma 0.3, the reactor vibrates at 0.4"]),
        (MADE, {"angle": "45 deg"}, ["motion.bed_velocity: ", "made at 60 deg from the horizontal, the reactor vibrates at 45 deg"]),
        (MADE, {"angle": "30 deg", "angle_from": "vertical"}, ["motion.bed_velocity: "]),
        (MADE.replace("sine", "sawtooth"), {"gamma": 0.4}, ["motion.bed_velocity: ", "made with a sawtooth waveform"]),
        (MADE, {"gamma": 0.0}, ["motion.profile: the bed does not move as p.csv says but steadily"]),
    ],
)  # fmt: skip
def test_a_profile_that_does_not_belong_is_said(
    tmp_path: Path, comment: str, motion: dict[str, object], texts: list[str]
) -> None:
    """Fails when a profile of another vibration, or a bed speed without effect, passes without a word, or one that belongs does not."""
    found = check_case(profile_case(tmp_path / "p.csv", 0.01, comment, **motion))["warnings"]
    assert len(found) == len(texts)
    assert all(text in warning for text, warning in zip(texts, found, strict=True))


def test_dose_ratio_of_water_counts_three_molecules_for_two_sites() -> None:
    cycle = load_case("single_cycle")
    found = {i.name: inlet_excess(cycle, i) for i in cycle.geometry.inlets}
    assert found["purge1"] is None and found["purge2"] is None
    tma, water = found["tma"], found["water"]
    assert tma is not None and water is not None and tma[2] is not None and water[2] is not None
    assert water[1] / water[2] == 1.5
    assert water[2] == pytest.approx(tma[2], rel=1e-3)  # the stoichiometric pair


def test_gas_spreads_in_the_plenum(case: Case) -> None:
    """Spreading length 3.7 m against a strip of 0.14 m: gas rises evenly. A tight plenum keeps it over the port."""
    even = (2 * 0.035 * 4e-3) / 0.1397
    path = case.gas.mean_free_path
    assert spreading_length(case.geometry, path) == pytest.approx(3.654, rel=1e-3)
    assert rising_velocity(case.geometry, case.gas, 0.1048) == pytest.approx(even, rel=1e-3)
    tight = case.with_({"geometry.layer.plenum.height": "0.1 mm"}).geometry
    decay = spreading_length(tight, path)
    assert decay == pytest.approx(math.sqrt(1e-12 * flow_resistance(tight, path) / 12.0), rel=1e-12)
    assert rising_velocity(tight, case.gas, 0.1048) == pytest.approx(0.035 * 4e-3 / (2 * decay), rel=0.01)
    assert rising_velocity(tight, case.gas, 0.07) < 0.2 * rising_velocity(tight, case.gas, 0.1048)


@pytest.mark.parametrize("periodic", [True, False])
def test_rising_gas_is_all_the_gas_that_is_fed(case: Case, periodic: bool) -> None:
    """Integrated over the strip the estimate returns the inlets' flow, whatever the spreading length."""
    changed = case.with_({"geometry.periodic": periodic, "geometry.layer.plenum.height": "0.5 mm"})
    n = 4000
    points = [(i + 0.5) * 0.1397 / n for i in range(n)]
    flow = sum(rising_velocity(changed.geometry, changed.gas, x) for x in points) * 0.1397 / n
    assert flow == pytest.approx(2 * 0.035 * 4e-3, rel=1e-5)


def test_numbers_of_the_base_case(case: Case) -> None:
    report = check_case(case)
    motion, bed, tma = report["motion"], report["bed"], report["inlets"]["tma"]
    assert motion["amplitude_x"] == pytest.approx(0.168e-3, abs=5e-7)
    assert motion["amplitude_y"] == pytest.approx(0.291e-3, abs=5e-7)
    assert motion["peak_velocity_y"] == pytest.approx(0.0293, abs=5e-5)
    assert motion["perfect_flight"] == pytest.approx(0.0169, abs=5e-5)
    assert motion["straight_drop"] == pytest.approx(2 * 16 * motion["amplitude_x"], rel=1e-12)
    assert tma["front_thickness"] == pytest.approx(13e-6, rel=0.02)
    assert tma["gas_lifetime"] == pytest.approx(8.5e-6, rel=0.05)
    assert tma["site_lifetime"] == pytest.approx(37e-6, rel=0.05)
    assert tma["excess_number"] == pytest.approx(1.791, abs=1e-3)
    assert bed["residence_time"] == pytest.approx(10.7, abs=0.05)
    assert 0.5 < bed["gas_over_minimum_fluidisation"] < 0.7
    assert report["mesh"]["cells"] == 28359 and report["run"]["steps"] == 2296  # 8.7 ms, three to a column
    assert report["warnings"] == []


def test_expected_steps(case: Case) -> None:
    resolved = case.with_({"fidelity": "resolved"})
    assert eng.expected_steps(resolved) == math.ceil(0.05 * 512) + math.ceil(19.95 * 512)
    assert eng.expected_steps(case.with_({"fidelity": "steady"})) == 0


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"motion.bed_velocity": "3 cm/s"}, "above perfect flight"),
        ({"geometry.inlet.tma.velocity": "10 cm/s"}, "minimum fluidisation"),
        ({"geometry.inlet.tma.mass_fractions.TMA": 0.021}, "not dilute"),
        ({"fidelity": "resolved", "time.steps_per_cycle": 4, "output.phases": 4}, "CFL above 1"),
        (
            {"time.step": "0.1 s"},
            "columns in a step, which leaves stripes of single columns in the coverage: lower time.step to 26.2 ms",
        ),
        (
            {"fidelity": "resolved", "geometry.cell_width": "2 mm", "output.every": "0.23 s"},
            "per cent to diffusion",
        ),
        ({"fidelity": "steady", "geometry.inlet.tma.stop": "5 s"}, "inlet tma stops dosing at 5 s"),
    ],
)
def test_what_is_questionable_is_said(case: Case, change: dict[str, object], text: str) -> None:
    (warning,) = [w for w in check_case(case.with_(change))["warnings"] if "the flight of" not in w]
    assert text in warning


def test_no_advice_to_change_a_key_that_nothing_reads(case: Case) -> None:
    """Fails when a run whose flow is the mean of the cycle is told to take more steps per cycle."""
    averaged = case.with_({"time.steps_per_cycle": 4})
    assert not any("CFL" in warning for warning in check_case(averaged)["warnings"])
    followed = check_case(averaged.with_({"transport.vibrational_dispersion": True}))
    assert any("CFL above 1" in warning for warning in followed["warnings"])
    assert not any("steps_per_cycle" in sentence for sentence in followed["without_effect"])


def test_the_step_that_the_warning_advises(case: Case) -> None:
    """Fails when the step that the warning names still slides more than a column, or needs two steps for one."""
    assert eng.expected_steps(case.with_({"time.step": "26.2 ms"})) == 2 + math.ceil(
        19.95 / (0.1397 / 411 / 0.013)
    )
    assert check_case(case.with_({"time.step": "26.2 ms"}))["warnings"] == []


def test_memory_grows_with_cells_fields_and_ranks(case: Case) -> None:
    """Fails when the cells, the fields of a resolved cycle or the ranks are not in the memory that a run will take."""
    whole = eng.expected_memory(case, 28359)
    assert whole == pytest.approx(0.6e9, rel=0.05)
    per_cell = (eng.expected_memory(case, 48359) - whole) / 20000
    assert 10e3 < per_cell < 30e3
    resolved = eng.expected_memory(case.with_({"fidelity": "resolved"}), 28359)
    assert resolved - whole == pytest.approx(28359 * case.time.steps_per_cycle * 250.0, rel=0.1)
    assert eng.expected_memory(case, 28359, ranks=2) - whole == whole - 28359 * per_cell


def test_numerical_diffusion(case: Case) -> None:
    """(Pe/2) coth(Pe/2) - 1 at the bed's and the reactor's speed: small in the zone's columns, Pe^2/12, and steeper in wider ones."""
    fine = case.with_({"fidelity": "resolved"})
    speed = 0.013 + 0.168e-3 * 2.0 * math.pi * 16.0
    bed = case.geometry.moving_layer
    assert bed is not None and bed.material is not None
    pe = speed * bed.material.tortuosity_factor[0] * 0.34e-3 / 2.88e-5
    grid = Grid.from_case(fine)
    assert eng.numerical_diffusion(fine, grid) == pytest.approx(pe**2 / 12.0, rel=0.01)
    assert eng.numerical_diffusion(case, grid) < 0.25 * eng.numerical_diffusion(fine, grid)
    still = case.with_({"motion.gamma": 0.0, "motion.bed_velocity": "0 m/s"})
    assert eng.numerical_diffusion(still, grid) == 0.0


@pytest.mark.parametrize(("width", "central"), [("0.34 mm", 0.0), ("5 mm", None)])
def test_numerical_diffusion_of_the_other_schemes(case: Case, width: str, central: float | None) -> None:
    """Fails when upwinding is not said to add Pe/2, or central differences nothing up to Pe = 2 and Pe/2 - 1 beyond."""
    bed = case.geometry.moving_layer
    assert bed is not None
    for law, left in (("effective", 0.46 / bed.solid.tortuosity_factor[0]), ("free", 1.0)):
        changes = {"geometry.cell_width": width, "porous.diffusion": law}
        upwind, hybrid = (case.with_({**changes, "transport.scheme": s}) for s in ("upwind", "central"))
        grid = Grid.from_case(upwind)
        half = 0.5 * 0.46 * 0.013 * grid.dx / (left * 2.88e-5)
        assert eng.numerical_diffusion(upwind, grid) == pytest.approx(half, rel=1e-9)
        expected = max(half - 1.0, 0.0) if central is None else central
        assert eng.numerical_diffusion(hybrid, grid) == pytest.approx(expected, rel=1e-9)


def test_numbers_that_do_not_exist_are_absent() -> None:
    """No bed, no flow, no vibration: nothing is zero or NaN for want of a value."""
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    case = load_case({"geometry": {"length": "10 mm", "layer": layer}, "motion": {"gamma": 0}})
    report = check_case(case)
    assert "bed" not in report and report["inlets"] == {} and report["warnings"] == []
    json.dumps(report, allow_nan=False)


def test_check_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(EXAMPLE), "--json", "--set", "motion.gamma=0.4"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["motion"]["gamma"] == 0.4
    assert load_case(report["case"]).motion.gamma == 0.4


def test_check_prints_tables_and_warnings(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    assert main(["check", str(EXAMPLE), "--set", "motion.bed_velocity='3 cm/s'"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    for part in (
        "28,359 cells",
        "glass_beads",
        "mass fraction 0.0002",
        "molecules per passing site",
        "perfect flight",
        "OH + TMA -> CH4",
    ):
        assert part in text
    assert "warning: the bed is conveyed at 3 cm/s" in text


def test_schema_and_versions(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out)["properties"]["geometry"]
    assert main(["--version"]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in ("mpm", "python", "numpy", "dolfinx"))


def vacuum(changes: dict[str, object] | None = None, gas: dict[str, object] | None = None) -> Case:
    """The coarse steady zone with a gas of which nothing is typed but these."""
    return load_case("single_zone", {**COARSE, "fidelity": "steady", "gas": gas or {}, **(changes or {})})


def test_knudsen_number_of_the_pores(case: Case) -> None:
    """l = mu/p sqrt(pi R T/(2 M)) over sqrt(32 tau2 K/eps); fails when a bed in vacuum passes as a continuum, or one at 1 atm does not."""
    report = check_case(case)
    assert report["gas"]["mean_free_path"] == pytest.approx(7.97e-8, rel=1e-3)
    assert report["pores"]["bed"]["diameter"] == pytest.approx(
        math.sqrt(32 * 1.48 * 4.25e-12 / 0.46), rel=1e-9
    )
    assert report["pores"]["bed"]["Knudsen"] == pytest.approx(3.81e-3, rel=2e-3)
    found = check_case(vacuum(gas={"pressure": "1 torr"}))["warnings"]
    assert sum("outside the continuum" in warning for warning in found) == 2  # bed and frit
    assert any(
        "layer bed: Kn = 4.2, mean free path 88 um over pores of 20.9 um" in warning for warning in found
    )
    assert not any("continuum" in w for w in check_case(vacuum(gas={"pressure": "626 torr"}))["warnings"])


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            {"chemistry.species.TMA.molar_mass": "72.09 kg/mol"},
            "chemistry.species.TMA.molar_mass is 72090 g/mol, its formula has 72.087 g/mol: 1000 times",
        ),
        ({"chemistry.site.OH.molar_mass": "17 kg/mol"}, "chemistry.site.OH.molar_mass"),
        ({"chemistry.film.Al2O3.molar_mass": "26.98 g/mol"}, "chemistry.film.Al2O3.molar_mass"),
        ({"gas.molar_mass": "28.01 kg/mol"}, "gas.molar_mass is 28010 g/mol"),
        ({"gas.carrier": "H2", "gas.molar_mass": "2.016 kg/mol", "gas.viscosity": "1e-5 Pa s"}, "gas.molar_mass is 2016 g/mol"),
        ({"gas.density": "0.7 g/m^3"}, "gas.density is 0.0007 kg/m3"),
        ({"gas.viscosity": "1.72e-5 g/cm/s"}, "gas.viscosity is 1.72e-06 Pa s"),
        ({"gas.diffusivity": "0.288 m^2/s"}, "gas.diffusivity of TMA, H2O, CH4, Al(OH)3 is 0.288 m2/s, in N2 at 473 K"),
        ({"geometry.inlet.tma.mass_fractions.H2O": 1e-4}, "inlet tma feeds several precursors, TMA, H2O: its excess number"),
        ({"gas.carrier": "Q", "gas.molar_mass": "30 g/mol", "gas.viscosity": "2e-5 Pa s"}, "nothing is known of it in Q"),
    ],
)  # fmt: skip
def test_contradictions_are_said(change: dict[str, object], text: str) -> None:
    """Fails when a molar mass off its formula, or a property off by a unit, passes without a word."""
    base = vacuum()
    assert not any(text in warning for warning in check_case(base)["warnings"])
    assert any(text in warning for warning in check_case(base.with_(change))["warnings"])


def test_a_run_says_what_check_warns_of(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Fails when the screen or the log of a run keeps quiet about what `mpm check` would have said."""
    arguments = ["--set", "chemistry.species.TMA.molar_mass='72.09 kg/mol'", "--set", "fidelity=steady"]
    for key, value in COARSE.items():
        arguments += ["--set", f"{key}={value!r}"]
    assert main(["run", "single_zone", "-o", str(tmp_path / "run"), *arguments]) == 0
    assert "warning: chemistry.species.TMA.molar_mass is 72090 g/mol" in capfd.readouterr().err
    assert (
        "warning: chemistry.species.TMA.molar_mass is 72090 g/mol"
        in (tmp_path / "run" / "run.log").read_text()
    )
