"""The doors of a newcomer: `mpm new` writes a case that is the one it starts from, `mpm list` and `mpm explain` know everything."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from mpm.case.case import load_case
from mpm.case.keys import all_keys
from mpm.case.materials import BUILT_IN
from mpm.case.names import POWDER_FILES, SWEEP_FILES
from mpm.case.sources import built_in_files
from mpm.cli import main
from mpm.dem.case import load_case as load_powder
from mpm.guide.newcase import SCHEMA_FILE, WIDTH, new_case
from mpm.physics.gases import CARRIERS
from mpm.report.quantities import QUANTITIES
from mpm.sweep.sweepfile import read_sweep

ROOT = Path(__file__).parent.parent
PROFILE = "phase_deg,u_x_m/s,u_y_m/s,contact\n0,0.01,0,1\n90,0.02,0,1\n180,0.01,0,0\n270,0.0,0,0\n"
STARTS = [
    *built_in_files("cases"),
    *(
        str(path)
        for path in sorted((ROOT / "cases").glob("*/*.toml"))
        if "geometry" in tomllib.loads(path.read_text())
    ),
    str(ROOT / "tests" / "example_case.toml"),
    str(ROOT / "meshes" / "four_cycles.toml"),
]
ODD = """
[geometry]
base = "single_zone"
periodic = false
[[geometry.layer]]
name = "bed"
grading = 0.5
material = "silica"
[[geometry.inlet]]
name = "tma"
mass_fractions = { TMA = 1.2345678901234567e-4, H2O = 0.0 }
windows = [["1 s", "2.5 s"]]
[[geometry.inlet]]
name = "purge"
windows = [["1 s", "2 s"], ["3 s", "inf s"]]
[material.silica]
porosity = 0.4
particle_diameter = "30 um"
permeability = ["1 um^2", "2.000000000000001 um^2"]
initial_coverage = { OH = 0.25, "OAl(CH3)2" = 0.75 }
site_density = "one-per-24-square-angstrom"
[material.unused]
porosity = 0.5
permeability = "1 um^2"
surface_to_volume = "1e5 1/m"
[gas]
carrier = "SF6"
molar_mass = "146.06 g/mol"
viscosity = "2.2e-5 Pa s"
diffusivity = { TMA = "1e-5 m^2/s" }
[chemistry]
mechanism = "own.toml"
[chemistry.reaction.tma]
sticking = 0.02
Ea = "5 kJ/mol"
[motion]
profile = "profile.csv"
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "start", STARTS, ids=lambda start: str(Path(start).relative_to(ROOT)) if "/" in start else start
)
def test_a_new_case_is_the_one_it_starts_from(
    start: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a value is lost, rounded, or left to a default; when a line is longer than people read; or when check refuses the file."""
    assert main(["new", "mine.toml", "--from", start]) == 0
    assert "mpm check mine.toml" in capsys.readouterr().out
    assert load_case("mine.toml") == load_case(start)
    lines = (folder / "mine.toml").read_text(encoding="utf-8").splitlines()
    assert lines[0] == f"#:schema ./{SCHEMA_FILE}" and (folder / SCHEMA_FILE).exists()
    assert [line for line in lines if line.startswith("# ") and len(line) > WIDTH] == []
    assert main(["check", "mine.toml"]) == 0


def test_a_new_case_from_an_odd_one(folder: Path) -> None:
    """Windows, pairs, numbers with all digits, materials and a mechanism of one's own, paths from another directory."""
    (folder / "old").mkdir()
    (folder / "new").mkdir()
    (folder / "old" / "case.toml").write_text(ODD)
    (folder / "old" / "profile.csv").write_text(PROFILE)
    (folder / "old" / "own.toml").write_text((ROOT / "mpm" / "mechanisms" / "alumina.toml").read_text())
    assert main(["new", "new/mine.toml", "--from", "old/case.toml"]) == 0
    text = (folder / "new" / "mine.toml").read_text()
    assert load_case("new/mine.toml") == load_case("old/case.toml")
    assert 'mechanism = "../old/own.toml"' in text and 'profile = "../old/profile.csv"' in text
    assert str(folder) not in text


def test_a_new_case_has_every_key() -> None:
    """Fails when a key of the case cannot be found in the file, active or behind a #."""
    text = new_case(load_case("first_case"), ROOT)
    lines = [line.lstrip("#") for line in text.splitlines()]
    missing = [
        key.name
        for key in all_keys()
        if not key.is_table
        and "<" not in key.last
        and not any(line.startswith(f"{key.last} = ") for line in lines)
    ]
    assert missing == []
    assert all(
        " ".join(key.description.split()) in " ".join(text.replace("# ", "").split())
        for key in all_keys()
        if key.table == "motion"
    )


def test_a_default_may_be_made_active(folder: Path) -> None:
    """Fails when taking the # away from a line with a default breaks the case or changes it."""
    start = load_case("first_case")
    lines = new_case(start, folder).splitlines()
    tried = 0
    for place, line in enumerate(lines):
        if (
            not line.startswith("#")
            or line.startswith(("# ", "##", "#:", "#["))
            or "default " not in lines[place - 1]
        ):
            continue
        header = next((i for i in range(place, -1, -1) if lines[i].lstrip("#").startswith("[")), place)
        single = any(table in lines[header] for table in ("transport", "porous"))
        if lines[header].startswith("#[") and not single:
            continue  # an example of an entry that the case does not have
        active = [
            text[1:] if i in (place, header) and text.startswith("#") else text
            for i, text in enumerate(lines)
        ]
        (folder / "case.toml").write_text("\n".join(active))
        assert load_case("case.toml") == start, line
        tried += 1
    assert tried > 12


def test_new_replaces_nothing_and_names_what_is_wrong(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "mine.toml").write_text("mine")
    for arguments, said in (
        (["mine.toml"], "mine.toml: found a file that is there already"),
        (["a/b.toml"], "found no directory a"),
        (["b.toml", "--from", "singel_zone"], "did you mean single_zone?"),
        (["b.toml", "--from", "four_cycles"], "the name of a geometry"),
    ):
        assert main(["new", *arguments]) == 2
        assert said in capsys.readouterr().err
    assert (folder / "mine.toml").read_text() == "mine"
    assert [path.name for path in folder.iterdir()] == ["mine.toml"]


def test_list_names_everything_that_has_a_name(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    out = capsys.readouterr().out
    names = [
        *built_in_files("cases"), *built_in_files("meshes"), *built_in_files("mechanisms"), *built_in_files(POWDER_FILES),
        *built_in_files(SWEEP_FILES), *BUILT_IN, *CARRIERS, "GL50", "SS231",
    ]  # fmt: skip
    assert [name for name in names if f"\n  {name} " not in out] == []
    assert "Single cycle of TMA and water" in out and "OH + TMA -> CH4 + OAl(CH3)2" in out
    assert out.rstrip().endswith("none")
    assert main(["list", "gases"]) == 0
    assert "Ar  39.95 g/mol" in capsys.readouterr().out
    assert main(["list", "material"]) == 2
    assert "did you mean materials?" in capsys.readouterr().err


def test_list_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Finished, stopped and damaged runs; points of a sweep and directories of other kinds are none."""
    case = load_case("first_case").to_toml()
    for name, summary in (
        ("done", '{"status": "done", "title": "A title", "titration": {"tma": {"exit_mean": 0.91234}}}'),
        ("stopped", ""),
        ("sweep/points/abc", '{"status": "done"}'),
    ):
        run = folder / "results" / name
        run.mkdir(parents=True)
        (run / "case.toml").write_text(case)
        (run / "run.log").write_text("")
        if summary:
            (run / "summary.json").write_text(summary)
    (folder / "results" / "sweep" / "sweep.json").write_text("{}")
    assert main(["list", "runs"]) == 0
    done, stopped, sweep = sorted(capsys.readouterr().out.splitlines()[1:])
    assert "results/sweep" in sweep and "the directory of a sweep, 20" in sweep
    assert (
        done.strip().startswith("results/done")
        and "A title; done, 20" in done
        and done.endswith("mean 0.9123")
    )
    assert "A first case" in stopped and "not finished: mpm resume results/stopped" in stopped


def test_built_in_powders_and_sweeps_are_found_by_name() -> None:
    for name, path in built_in_files(POWDER_FILES).items():
        assert load_powder(name) == load_powder(path)
    for name, path in built_in_files(SWEEP_FILES).items():
        assert read_sweep(name).path == path


@pytest.mark.parametrize("key", all_keys(), ids=lambda key: key.name)
def test_every_key_is_explained(key: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", key.name]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert key.name in out and key.description in out
    assert key.is_table or ("default" in out and "fidelity " in out)


@pytest.mark.parametrize("number", QUANTITIES, ids=lambda number: number.name)
def test_every_reported_number_is_explained(number: Any, capsys: pytest.CaptureFixture[str]) -> None:
    name = number.name.replace("<inlet>", "tma")
    assert main(["explain", name]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert f"{name}: a number that a run reports" in out
    assert number.meaning.partition("{")[0] in out and "unit" in out


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["velocity"], 0, ["geometry.inlet.<name>.velocity", "default     3.5 cm/s", "--set geometry.inlet.tma.velocity='3.5 cm/s'"]),
        (["motion.startup"], 0, ["developed, impulsive", "read by     fidelity resolved"]),
        (["geometry.inlet"], 0, ["[[geometry.inlet]]", "mass_fractions", "mpm explain geometry.inlet.tma.name"]),
        (["cells"], 0, ["geometry.layer.<name>.cells", "cells: a number that a run reports"]),
        (["exit_mean"], 0, ["titration.<inlet>.exit_mean", "a ratio"]),
        (["titration"], 0, ["titration.<inlet>.exit_mean", "titration.<inlet>.box_mean"]),
        ([], 0, ["geometry.inlet: name, side, center", "titration: <inlet>.exit_mean"]),
        (["motion.gama"], 2, ["did you mean motion.gamma?", "mpm explain alone"]),
        (["titration.tma.exit_maen"], 2, ["did you mean titration.<inlet>.exit_mean?"]),
        (["glass_beads"], 0, ["one of the materials", "porosity 0.46"]),
        (["x_TMA"], 0, ["x_TMA: a field", "mole fraction of TMA", "a ratio", "mpm plot DIR --field x_TMA"]),
        (["theta_OAl(CH3)2"], 0, ["coverage of OAl(CH3)2", "mpm plot DIR --field 'theta_OAl(CH3)2'"]),
        (["velocity_lab"], 0, ["unit        m/s, shown in cm/s", "found in    phases.pvd (output.phases)"]),
        (["nonsense"], 2, ["a dotted key such as motion.gamma, or a table: geometry"]),
    ],
)  # fmt: skip
def test_explain(
    arguments: list[str], status: int, said: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explain", *arguments]) == status
    out, err = capsys.readouterr()
    assert [text for text in said if text not in (err if status else out)] == [], out + err
    assert not status or (out, err.count("\n")) == ("", 1)


def test_settings_in_the_explanations_are_accepted(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when `in a shell` shows a --set that the shell or a case would not take."""
    import shlex

    from mpm.case.settings import parse_settings

    wall = {"name": "bottom", "side": "top", "end": "20 mm", "temperature": "400 K"}
    tried, phases = (
        0,
        {
            "motion.profile": "phases",
            "motion.liftoff_phase": "90 deg",
            "motion.contact_phase": "10 deg",
            "energy": {},
            "geometry.wall": [wall],
        },
    )
    needs_another = (
        "geometry.base",
        "output.phases",
        *(f"geometry.wall.<name>.{key}" for key in ("heat_transfer_coefficient", "ambient")),
    )
    for key in (key for key in all_keys() if not key.is_table):
        assert main(["explain", key.name]) == 0
        line = next((x for x in capsys.readouterr().out.splitlines() if x.startswith("  in a shell")), None)
        if line is None:
            continue
        option, setting = shlex.split(line.removeprefix("  in a shell"))
        assert option == "--set"
        if key.name not in needs_another and "chemistry." not in key.name:
            load_case("single_zone", phases | parse_settings([setting]))
        tried += 1
    assert tried > 50
