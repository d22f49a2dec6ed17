"""Names that are typed: a misspelt one lists the right ones and guesses, a thing of another kind says what it is and what to do."""

from pathlib import Path

import pytest

from mpm.case.case import load_case
from mpm.cli import main
from mpm.errors import nearest

OVER_BASE = '[geometry]\nbase = "single_zone"\n'
SWEEP = '[sweep]\ncase = "{}"\n[[sweep.axis]]\nkey = "motion.gamma"\nvalues = [0.3]\n'
PROFILE = "phase_deg,u_x_m/s,u_y_m/s,contact\n0,0.01,0,1\n90,0.02,0,1\n180,0.01,0,0\n270,0.0,0,0\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    status = main(arguments)
    out, err = capsys.readouterr()
    assert (status, out, err.count("\n")) == (2, "", 1), err
    return err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["check", "singel_zone"], ["a built-in case: ", "single_cycle, single_zone", "did you mean single_zone?"]),
        (["run", "Single_Zone"], ["did you mean single_zone?"]),
        (["check", "four_cycles"], ["the name of a geometry", 'base = "four_cycles"', "mpm mesh four_cycles"]),
        (["check", "single_zone", "--set", "geometry.base=four_cycle"], ["did you mean four_cycles?"]),
        (["check", "single_zone", "--set", "gas.carrier=Argon"], ["one of N2, Ar, He", "did you mean Ar?"]),
        (["check", "single_zone", "--set", "gas.carrier=nitrogen"], ["did you mean N2?"]),
        (["check", "single_zone", "--set", "chemistry.mechanism=Alumna"], ["did you mean alumina?"]),
        (["check", "single_zone", "--set", "chemistry.reaction.TMA.sticking=0.1"], ["reaction.TMA.equation", "did you mean tma?"]),
        (["check", "single_zone", "--set", "motion.profile=theses"], ["thesis, phases", "did you mean thesis?"]),
        (["check", "single_zone", "--set", "geometry.layer.bed.material=glas"], ["did you mean glass_beads?"]),
        (["check", "single_zone", "--set", "material.glas_beads.porosity=0.5"], ["did you mean glass_beads?"]),
        (["check", "single_zone", "--set", "geometry.inlet.TMA.velocity=1 cm/s"], ["purge, tma", "did you mean tma?"]),
        (["check", "single_zone", "--set", "velocity=1 cm/s"], ["velocity belongs elsewhere: geometry.inlet.<name>.velocity"]),
        (["check", "single_zone", "--set", "motion.temperature=1 K"], ["temperature belongs elsewhere: ", ", gas.temperature"]),
        (["sweep", "dsoe"], ["a built-in one: dose, force_balance, gamma, heating, port_bed, tma_speed", "did you mean dose?"]),
        (["dem", "gl56_ari"], ["a built-in one: demo, gl223_sawtooth, gl56_air", "did you mean gl56_air?"]),
        (["dem", "gl56_air", "--set", "powder=GL65"], ["GL50, GL29, GL56", "did you mean GL56?"]),
    ],
)  # fmt: skip
def test_a_misspelt_name_lists_the_names_and_guesses(
    arguments: list[str], said: list[str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(capsys, *arguments)
    assert [part for part in said if part not in line] == [], line


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('[[geometry.inlet]]\nname = "TMA"\nmass_fractions = { TMA = 1e-4 }\n', "geometry.inlet.TMA.center: found nothing"),
        ('[[geometry.layer]]\nname = "beds"\nheight = "4 mm"\n', "did you mean bed?"),
        ('[[geometry.outlet]]\nname = "zone"\nwidth = "4 mm"\n', "did you mean zone1?"),
    ],
)  # fmt: skip
def test_a_misspelt_entry_over_a_base_is_no_new_one(
    table: str, said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when `TMA` for the `tma` of the shared geometry only says that a centre is missing."""
    (folder / "case.toml").write_text(OVER_BASE + table)
    line = refused(capsys, "check", "case.toml")
    assert said in line and "did you mean " in line and "in place of" in line


def test_files_beside_and_cases_of_sweeps(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "sweep.toml").write_text(SWEEP.format("singel_zone"))
    (folder / "case.toml").write_text(OVER_BASE)
    assert "did you mean case.toml?" in refused(capsys, "check", "csae.toml")
    assert "sweep.case: singel_zone: found no such file" in refused(capsys, "sweep", "sweep.toml")


def test_a_shared_geometry_is_meshed_by_name(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    coarse = ["--set", "geometry.cell_width='5 mm'"]
    assert main(["mesh", "four_cycles", *coarse]) == 0
    assert (folder / "four_cycles.msh").exists()
    assert "zone8" in capsys.readouterr().out


def test_paths_of_settings_are_relative_to_where_the_user_stands(folder: Path) -> None:
    """Fails when a profile, base or mechanism that shell completion has offered is looked for beside the case file."""
    from mpm.case.settings import parse_settings

    (folder / "cases").mkdir()
    (folder / "here").mkdir()
    mechanism = Path(__file__).parents[1] / "mpm" / "mechanisms" / "alumina.toml"
    for name, speed, length in (("cases", "0.02", "139.7 mm"), ("here", "0.05", "150 mm")):
        (folder / name / "x.csv").write_text(PROFILE.replace("0.02", speed))
        (folder / name / "base.toml").write_text(
            f'{OVER_BASE}length = "{length}"\n[[geometry.zone]]\nname = "zone1"\nend = "{length}"\n'
        )
        (folder / name / "own.toml").write_text(
            mechanism.read_text().replace("72.09", "72.08" if name == "here" else "72.07")
        )
    (folder / "cases" / "case.toml").write_text(
        '[geometry]\nbase = "base.toml"\n[motion]\nprofile = "x.csv"\n[chemistry]\nmechanism = "own.toml"\n'
    )
    plain = load_case("cases/case.toml")
    typed = load_case(
        "cases/case.toml",
        parse_settings(
            [
                "motion.profile=here/x.csv",
                "geometry.base='here/base.toml'",
                "chemistry.mechanism=here/own.toml",
            ]
        ),
    )
    for case, fastest, long, mass in ((plain, 0.02, 0.1397, 72.07e-3), (typed, 0.05, 0.15, 72.08e-3)):
        assert case.motion.table is not None and max(case.motion.table.velocity) == fastest
        assert case.geometry.length == long
        assert case.mechanism.get("TMA").molar_mass == mass
    assert parse_settings(["motion.profile=thesis", "geometry.base=single_zone", "chemistry.mechanism=alumina"]) == {
        "motion.profile": "thesis", "geometry.base": "single_zone", "chemistry.mechanism": "alumina",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("given", "known", "found"),
    [
        ("glas", ["glass_beads", "frit_felt"], "glass_beads"),
        ("gla", ["glass_beads", "glass_plate"], None),
        ("xy", ["xylophone"], None),
        ("TMA", ["tma", "purge"], "tma"),
    ],
)
def test_the_nearest_name(given: str, known: list[str], found: str | None) -> None:
    assert nearest(given, known) == found
