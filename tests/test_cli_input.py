"""Bad input through the command line: one line on stderr that names file, key, finding and what is accepted; status 2;
nothing written. A case fails when the line is missing, is more than one, names another key, or comes with a traceback."""

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from mpm.case.settings import parse_settings
from mpm.case.sources import built_in_files
from mpm.cli import main
from mpm.dem.case import load_case as load_powder
from mpm.sweep.sweepfile import read_sweep

PROFILE = "phase_deg,u_x_m/s,u_y_m/s,contact\n0,0.01,0,1\n90,0.02,0,1\n180,0.01,0,0\n270,0.0,0,0\n"
ALUMINA = '[chemistry]\nmechanism = "alumina"\n'
EXAMPLE = (Path(__file__).parent / "example_case.toml").read_text()
EXTRA_INLET = '[[geometry.inlet]]\nname = "{}"\ncenter = "{}"\nwidth = "4 mm"\n{}\n\n[[geometry.outlet]]'


Edits = list[tuple[str, str]]


def swap(old: str, new: str) -> Edits:
    return [(old, new)]


def inlet(name: str, center: str, more: str = "") -> Edits:
    """A third inlet."""
    return [("[[geometry.outlet]]", EXTRA_INLET.format(name, center, more))]


BROKEN: dict[str, tuple[Edits, str, str]] = {
    # name: what is changed in the example, the key that the line names, another part of it
    "wrong dimension": (swap('"139.7 mm"\ncell', '"139.7 s"\ncell'), "geometry.length", "dimension [time]"),
    "bare number": (swap('height = "3 mm"', "height = 3"), "geometry.layer.bed.height", "without a unit"),
    "string without unit": (
        swap('"3.5 cm/s"\nmass', '"3.5"\nmass'),
        "geometry.inlet.tma.velocity",
        "no unit",
    ),
    "unknown unit": (swap('"1.59 mm"', '"1.59 mmm"'), "geometry.layer.frit.height", "unknown unit 'mmm'"),
    "no number": (swap('"16 Hz"', '"fast"'), "motion.frequency", 'e.g. "16 Hz"'),
    "revolutions are no frequency": (swap('"16 Hz"', '"960 rpm"'), "motion.frequency", "angular"),
    "angle without unit": (swap('"60 deg"', "60"), "motion.angle", "without a unit"),
    "unit on a pure number": (swap("gamma = 0.30", 'gamma = "0.3 m"'), "motion.gamma", "e.g. 0.30"),
    "unknown section": (swap("[output]", "[outputs]"), "outputs", "did you mean output?"),
    "unknown key": (swap("gamma = 0.30", "gama = 0.30"), "motion.gama", "did you mean gamma?"),
    "unknown key in a layer": (
        swap("moving = true", "mooving = true"),
        "geometry.layer.bed.mooving",
        "moving?",
    ),
    "unknown key in a material": (
        swap("porosity =", "porosty ="),
        "material.glass_beads.porosty",
        "porosity?",
    ),
    "plural key": (swap("[[geometry.zone]]", "[[geometry.zones]]"), "geometry.zones", "did you mean zone?"),
    "missing length": (swap('length = "139.7 mm"\n', ""), "geometry.length", "found nothing"),
    "missing height": (swap('height = "5 mm"\n', ""), "geometry.layer.plenum.height", "a length above 0 m"),
    "missing cells": (swap("cells = 15\n", ""), "geometry.layer.plenum.cells", "a whole number"),
    "missing name": (swap('name = "plenum"\n', ""), "geometry.layer.1.name", "found nothing"),
    "missing centre": (swap('center = "34.9 mm"\n', ""), "geometry.inlet.purge.center", "a position"),
    "no layers": (swap("[[geometry.layer]]", "[[geometry.lair]]"), "geometry.lair", "did you mean layer?"),
    "negative height": (swap('"12.7 mm"', '"-12.7 mm"'), "geometry.layer.headspace.height", "above 0 m"),
    "zero length": (swap('"139.7 mm"\ncell', '"0 mm"\ncell'), "geometry.length", "above 0 m"),
    "no rows": (
        swap("cells = 38", "cells = 0"),
        "geometry.layer.headspace.cells",
        "greater than or equal to 1",
    ),
    "fractional rows": (
        swap("cells = 38", "cells = 3.5"),
        "geometry.layer.headspace.cells",
        "a whole number",
    ),
    "grading of zero": (swap("cells = 38", "cells = 38\ngrading = 0"), "headspace.grading", "above 0"),
    "grading that no mesh has": (
        swap("cells = 38", "cells = 38\ngrading = 1000"),
        "geometry.layer.headspace.grading",
        "0.01 to 100",
    ),
    "rows too thin for a mesh": (
        swap('"12.7 mm"', '"1 nm"'),
        "geometry.layer.headspace.height",
        "rows above",
    ),
    "text for a switch": (swap("periodic = true", 'periodic = "yes"'), "geometry.periodic", "true or false"),
    "number for text": (swap('"N2"', "28"), "gas.carrier", "text in quotes"),
    "text for a section": (swap("[geometry]", 'transport = "slow"\n[geometry]'), "transport", "a table"),
    "table for a list": (swap("[[geometry.zone]]", "[geometry.zone]"), "geometry.zone", "a list of tables"),
    "two layers of one name": (swap('"plenum"', '"bed"'), "geometry.layer.bed.name", "twice"),
    "two ports of one name": (inlet("tma", "60 mm"), "geometry.inlet.tma.name", "twice"),
    "inlet named as an outlet": (inlet("zone1", "60 mm"), "geometry.outlet.zone1.name", "twice"),
    "dot in a name": (swap('name = "purge"', 'name = "purge.1"'), "geometry.inlet.purge.1.name", "letters"),
    "overlapping ports": (inlet("second", "37 mm"), "geometry.inlet.second.center", "next to purge"),
    "port beyond the end": (inlet("late", "139 mm"), "geometry.inlet.late", "inside the strip"),
    "port before the start": (inlet("early", "1 mm"), "geometry.inlet.early", "inside the strip"),
    "inlet and outlet share a facet": (
        inlet("top", "111.9 mm", 'side = "top"'),
        "geometry.inlet.top.center",
        "at least one column",
    ),
    "inlets without an outlet": (
        swap('[[geometry.outlet]]\nname = "zone1"\ncenter = "104.8 mm"\nwidth = "10 mm"\n', ""),
        "geometry.outlet",
        "at least one outlet",
    ),
    "unknown side": (
        swap('width = "10 mm"', 'width = "10 mm"\nside = "left"'),
        "outlet.zone1.side",
        "bottom, top",
    ),
    "negative velocity": (
        swap('"3.5 cm/s"\nmass', '"-1 cm/s"\nmass'),
        "geometry.inlet.tma.velocity",
        "from 0 m/s",
    ),
    "infinite velocity": (
        swap('"3.5 cm/s"\nmass', '"inf m/s"\nmass'),
        "geometry.inlet.tma.velocity",
        "inf m/s",
    ),
    "not a number": (swap("gamma = 0.30", "gamma = nan"), "motion.gamma", "nan"),
    "zone backwards": (
        swap('start = "0 mm"', 'start = "139.7 mm"'),
        "geometry.zone.zone1.end",
        "after the start",
    ),
    "zone beyond the end": (
        swap('end = "139.7 mm"', 'end = "150 mm"'),
        "geometry.zone.zone1",
        "inside the strip",
    ),
    "zone of an unknown inlet": (
        swap('inlet = "tma"', 'inlet = "tna"'),
        "geometry.zone.zone1.inlet",
        "mean tma?",
    ),
    "zone without its inlet": (
        swap('end = "139.7 mm"', 'end = "90 mm"'),
        "geometry.zone.zone1.inlet",
        "104.8 mm",
    ),
    "overlapping zones": (
        swap(
            "[[geometry.zone]]",
            '[[geometry.zone]]\nname = "a"\nstart = "0 mm"\nend = "9 mm"\n[[geometry.zone]]',
        ),
        "geometry.zone",
        "do not overlap",
    ),
    "periodic with two columns": (swap('"0.34 mm"', '"60 mm"'), "geometry.cell_width", "at least 3 columns"),
    "column of a nanometre": (swap('"0.34 mm"', '"0.34 nm"'), "geometry.cell_width", "at most 1e+08 cells"),
    "two moving layers": (
        swap("cells = 6", "cells = 6\nmoving = true"),
        "geometry.layer.bed.moving",
        "at most one",
    ),
    "moving gas": (
        swap("cells = 38", "cells = 38\nmoving = true"),
        "geometry.layer.headspace.moving",
        "at most one",
    ),
    "unknown material": (
        swap('"sintered_powder"', '"sinterd_powder"'),
        "frit.material",
        "mean sintered_powder?",
    ),
    "incomplete material": (
        swap(
            '"sintered_powder"',
            '"x"\n[material.x]\nporosity = 0.5\n[[geometry.layer]]\nname = "y"\nheight = "1 mm"\ncells = 1',
        ),
        "material.x.permeability",
        "kozeny_constant",
    ),
    "porosity above one": (
        swap("porosity = 0.46", "porosity = 1.2"),
        "material.glass_beads.porosity",
        "below 1",
    ),
    "coverage that does not sum to one": (
        swap("{ OH = 1.0 }", "{ OH = 0.8 }"),
        "initial_coverage",
        "sum to 0.8",
    ),
    "coverage of an unknown site": (
        swap("{ OH = 1.0 }", "{ O = 1.0, OH = 0.0 }"),
        "initial_coverage.O",
        "site",
    ),
    "unknown site density": (
        swap('"6.92e-8 mol/m^2"', '"thesi"'),
        "glass_beads.site_density",
        "did you mean thesis?",
    ),
    "three permeabilities": (
        swap('"4.25 um^2"', '["1 um^2", "1 um^2", "1 um^2"]'),
        "permeability",
        "two of them",
    ),
    "unknown species": (swap("{ TMA = 2e-4 }", "{ TMB = 2e-4 }"), "mass_fractions.TMB", "did you mean TMA?"),
    "mass fraction above one": (swap("{ TMA = 2e-4 }", "{ TMA = 1.2 }"), "mass_fractions.TMA", "up to 1"),
    "mass fractions above one in all": (
        swap("{ TMA = 2e-4 }", "{ TMA = 0.6, H2O = 0.6 }"),
        "mass_fractions",
        "1.2",
    ),
    "dose that stops before it starts": (
        swap('start = "0 s"', 'start = "5 s"\nstop = "2 s"'),
        "inlet.tma.stop",
        "after",
    ),
    "overlapping windows": (
        swap('start = "0 s"', 'windows = [["0 s", "5 s"], ["4 s", "9 s"]]'),
        "geometry.inlet.tma.windows",
        "in order and apart",
    ),
    "half a window": (
        swap('start = "0 s"', 'windows = [["0 s"]]'),
        "geometry.inlet.tma.windows",
        "dose windows",
    ),
    "windows beside start": (
        swap('start = "0 s"', 'start = "0 s"\nwindows = [["0 s", "5 s"]]'),
        "tma.windows",
        "either",
    ),
    "unknown carrier": (swap('"N2"', '"N3"'), "gas.carrier", "one of N2, Ar, He"),
    "carrier that reacts": (swap('"N2"', '"H2O"\nmolar_mass = "18 g/mol"'), "gas.carrier", "takes no part"),
    "carrier with a dot": (swap('"N2"', '"N2 5.0"\nmolar_mass = "28 g/mol"'), "gas.carrier", "without dots"),
    "port named like a wall of the mesh": (
        swap('name = "purge"', 'name = "left"'),
        "geometry.inlet.left.name",
        "the name of a wall in mesh files",
    ),
    "port named like a layer": (
        swap('name = "purge"', 'name = "frit"'),
        "geometry.inlet.frit.name",
        "the name of a layer in mesh files",
    ),
    "layer named like a number of the results": (
        swap('name = "plenum"', 'name = "height"'),
        "geometry.layer.height.name",
        "front.INLET.height",
    ),
    "species named like another balance": (
        swap(ALUMINA, ALUMINA + '[chemistry.species.sites]\nmolar_mass = "18 g/mol"\nformula = "H2O"\n'),
        "chemistry.species.sites",
        "balance.sites",
    ),
    "element with a dot": (
        swap(ALUMINA, ALUMINA + '[chemistry.species.X]\nmolar_mass = "18 g/mol"\nelements = { "A.b" = 1 }\n'),
        "chemistry.species.X.elements",
        "symbols of elements",
    ),
    "temperature below zero": (swap('"473 K"', '"-300 degC"'), "gas.temperature", "above 0 K"),
    "diffusivity of an unknown species": (
        swap('"2.88e-5 m^2/s"', '{ TMA = "2e-5 m^2/s", Xe = "1e-5 m^2/s" }'),
        "gas.diffusivity.Xe",
        "one of TMA",
    ),
    "unknown mechanism": (swap('"alumina"', '"alumna"'), "chemistry.mechanism", "did you mean alumina?"),
    "unknown reaction key": (
        swap(ALUMINA, ALUMINA + "[chemistry.reaction.tma]\nstiking = 0.1\n"),
        "stiking",
        "sticking?",
    ),
    "new reaction without an equation": (
        swap(ALUMINA, ALUMINA + "[chemistry.reaction.x]\nb = 1\n"),
        "reaction.x.equation",
        "nothing",
    ),
    "unbalanced reaction": (
        swap(ALUMINA, ALUMINA + '[chemistry.reaction.cvd]\nequation = "TMA + 2 H2O -> 3 CH4 + Al(OH)3"\n'),
        "chemistry.reaction.cvd.equation",
        "-> 3 CH4 + Al(OH)3', which is off by",
    ),
    "reaction that loses sites": (
        swap(
            ALUMINA,
            ALUMINA
            + '[chemistry.site.X]\nelements = { }\n[chemistry.reaction.tma]\nequation = "OH + TMA -> CH4 + OAl(CH3)2 + X"\n',
        ),
        "chemistry.reaction.tma.equation",
        "keeps the number of sites",
    ),
    "reaction with an unknown species": (
        swap(ALUMINA, ALUMINA + '[chemistry.reaction.cvd]\nequation = "TMA + H20 -> CH4"\n'),
        "chemistry.reaction.cvd.equation",
        "did you mean H2O?",
    ),
    "sticking above one": (
        swap(ALUMINA, ALUMINA + "[chemistry.reaction.tma]\nsticking = 2\n"),
        "tma.sticking",
        "up to 1",
    ),
    "rate constant of the wrong order": (
        swap(ALUMINA, ALUMINA + '[chemistry.reaction.cvd]\nA = "1 m/s"\n'),
        "chemistry.reaction.cvd.A",
        "order 1 in TMA, 1 in H2O",
    ),
    "flat angle": (swap('"60 deg"', '"0 deg"'), "motion.angle", "vertical component"),
    "unknown fidelity": (swap('"averaged"', '"average"'), "fidelity", "did you mean averaged?"),
    "lift-off faster than the reactor": (
        swap("gamma = 0.30", "gamma = 0.01"),
        "motion.liftoff_velocity",
        "peak",
    ),
    "phases not given": (swap('"thesis"', '"phases"'), "motion.liftoff_phase", "found nothing"),
    "unknown profile": (swap('"thesis"', '"thesys"'), "motion.profile", "did you mean thesis?"),
    "port flow that reverses": (
        [("gamma = 0.30", "gamma = 0.40"), ('inlet_frame = "reactor"', 'inlet_frame = "lab"')],
        "motion.inlet_frame",
        "reverses within a cycle",
    ),
    "end at zero": (swap('end = "20 s"', 'end = "0 s"'), "time.end", "above 0 s"),
    "too few steps": (
        swap("steps_per_cycle = 32", "steps_per_cycle = 2"),
        "time.steps_per_cycle",
        "equal to 4",
    ),
    "no shared geometry": (
        swap("periodic = true", 'base = "single_zoo"'),
        "geometry.base",
        "did you mean single_zone?",
    ),
    "TOML syntax": (swap("cells = 15", "cells = "), "", "TOML syntax error"),
    "quantity without quotes": (swap('height = "5 mm"', "height = 5 mm"), "", 'quotes, "5 mm"'),
    "word without quotes": (
        swap('fidelity = "averaged"', "fidelity = steady  # now"),
        "",
        'quotes, "steady"',
    ),
    "switch in capitals": (swap("periodic = true", "periodic = True"), "", "true, in small letters"),
    "key twice": (swap("cells = 15", "cells = 15\ncells = 16"), "", "TOML syntax error"),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *arguments: str) -> str:
    """Run the command line, expect status 2, one line and no new file; return the line."""
    before = sorted(folder.rglob("*"))
    status = main(arguments)
    out, err = capsys.readouterr()
    assert status == 2, err
    assert out == ""
    assert err.count("\n") == 1 and err.endswith("\n"), err
    assert "Traceback" not in err and "pydantic" not in err
    assert sorted(folder.rglob("*")) == before
    return err.strip()


@pytest.mark.parametrize("what", BROKEN)
def test_broken_case_is_refused_in_one_line(
    what: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edits, key, text = BROKEN[what]
    case = EXAMPLE
    for old, new in edits:
        assert old in case, "the edit does not apply"
        case = case.replace(old, new, 1)
    (folder / "case.toml").write_text(case)
    line = refused(capsys, folder, "run", "case.toml", "-o", "out")
    assert line.startswith("case.toml: ")
    assert key in line.split(": found ")[0], line
    assert ": found " in line and "; accepted: " in line
    assert text in line, line
    assert ("quotes" in line) == ("without quotes" in what or "quotes" in text), line


@pytest.mark.parametrize(
    ("profile", "text"),
    [
        (None, "no such file"),
        ("", "columns"),
        ("angle,speed\n0,1\n", "columns angle, speed"),
        (PROFILE.replace("0.02", "fast"), "row 3"),
        (PROFILE.replace("0.02", "nan"), "row 3"),
        (PROFILE.replace("180,", ""), "row 4"),
        (PROFILE.replace("180", "80"), "rises"),
        (PROFILE.replace("270", "370"), "rises"),
        ("\n".join(PROFILE.splitlines()[:4]), "at least 4 rows"),
    ],
)
def test_broken_profile_is_refused(
    profile: str | None, text: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "case.toml").write_text(EXAMPLE.replace('"thesis"', '"profile.csv"'))
    if profile is not None:
        (folder / "profile.csv").write_text(profile)
    line = refused(capsys, folder, "run", "case.toml")
    assert line.startswith("case.toml: motion.profile: found ") and text in line


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["run", "nowhere.toml"], "nowhere.toml: found no such file"),
        (["run", "."], "found the directory of a run"),
        (["run", "--name", "wide"], "CASE is missing"),
        (["runn", "case.toml"], "No such command"),
        (["run", "case.toml", "--reusme"], "No such option"),
        (["run", "case.toml", "--resume", "--overwrite"], "one of them"),
        (["run", "case.toml", "--set", "motion.gamma"], "KEY=VALUE"),
        (["run", "case.toml", "--set", "motion.gama=0.3"], "motion.gama: found an unknown key"),
        (["run", "case.toml", "--set", "geometry.inlet.tna.velocity=4 cm/s"], "did you mean tma?"),
        (["run", "case.toml", "--set", "geometry.inlet.tma.velocity=4"], "without a unit"),
        (["run", "case.toml", "--set", "time.end.x=4"], "time.end has no parts"),
        (["check", "case.toml", "--set", "geometry.inlet.tma.mass_fractions.TMA=2"], "mass_fractions.TMA"),
        (["check", "nowhere.toml"], "no such file"),
        (["mesh", "case.toml", "--set", "geometry.layer.bed.height='3 s'"], "dimension [time]"),
        (["plot", "nowhere"], "nowhere"),
        (["sweep", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(
    arguments: list[str], text: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "case.toml").write_text(EXAMPLE)
    assert text in refused(capsys, folder, *arguments)


BOM = "\ufeff"


def test_a_byte_order_mark_is_read_over_in_every_file(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a file that a Windows editor saved as "UTF-8 with BOM", line ends of Windows included, is refused."""
    case = EXAMPLE.replace('"thesis"', '"profile.csv"').replace('"alumina"', '"own.toml"')
    own = built_in_files("mechanisms")["alumina"].read_text(encoding="utf-8")
    sweep = '[sweep]\ncase = "case.toml"\n[[sweep.axis]]\nkey = "motion.gamma"\nvalues = [0.3]\n'
    record = "t,a_y,a_z\n" + "".join(f"{i / 160},{i % 10 - 4.5},{(i + 3) % 10 - 4.5}\n" for i in range(64))
    powder = 'powder = "GL50"\n[waveform]\nkind = "accelerometer"\nfile = "record.csv"\n'
    files = {
        "case.toml": case,
        "own.toml": own,
        "profile.csv": PROFILE,
        "sweep.toml": sweep,
        "record.csv": record,
    }
    for name, text in {**files, "powder.toml": powder}.items():
        (folder / name).write_bytes((BOM + text).replace("\n", "\r\n").encode())
    assert main(["check", "case.toml"]) == 0
    assert read_sweep(folder / "sweep.toml").base.mechanism.name == "alumina"
    assert load_powder(folder / "powder.toml").build_waveform().frequency > 0.0
    capsys.readouterr()
    for name in ("case.toml", "own.toml", "profile.csv", "sweep.toml", "powder.toml"):
        kept = (folder / name).read_bytes()
        (folder / name).write_bytes(kept.decode().encode("utf-16"))
        verb = {"sweep.toml": "sweep", "powder.toml": "dem"}.get(name, "check")
        said = refused(capsys, folder, verb, {"check": "case.toml"}.get(verb, name))
        assert name in said and "UTF-16 text, save it as UTF-8" in said
        (folder / name).write_bytes(kept + b"# 3 \xb5m\n")
        assert "byte 0xB5 in line " in refused(capsys, folder, verb, {"check": "case.toml"}.get(verb, name))
        (folder / name).write_bytes(kept)


def test_layers_without_cells_name_the_key(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a list whose entries are all wrong is called empty."""
    (folder / "case.toml").write_text(
        '[geometry]\nlength = "9 mm"\nlayer = [ { name = "a", height = "1 mm" } ]\n'
    )
    assert "geometry.layer.a.cells: found nothing" in refused(capsys, folder, "check", "case.toml")


def test_every_rank_refuses_and_one_speaks(folder: Path, mpirun: Any) -> None:
    """Fails when a second rank prints, or when one of the three is left behind."""
    (folder / "case.toml").write_text(EXAMPLE.replace("gamma = 0.30", "gamma = -1"))
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "MPI", "HYDRA"))}
    done = subprocess.run(
        [*mpirun(3), "-m", "mpm", "run", "case.toml", "-o", "out"],
        capture_output=True, text=True, timeout=120, env=environment,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.splitlines() == [
        "case.toml: motion.gamma: found -1; accepted: a number from 0, e.g. 0.30"
    ]
    assert sorted(path.name for path in folder.iterdir()) == ["case.toml"]


def test_the_example_itself_is_accepted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The table above means something only if what it starts from is right."""
    (folder / "case.toml").write_text(EXAMPLE)
    assert main(["check", "case.toml"]) == 0
    assert "28,359 cells" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["[" * 3000, "9" * 5000, "1\nx = 2", "\x1b[2J", "=", "{a=1"])
def test_settings_that_are_no_toml_are_text(text: str) -> None:
    """Fails when a value of --set ends in a traceback, or sets a second key."""
    assert parse_settings([f"motion.gamma={text}"]) == {"motion.gamma": text}


def test_settings_in_another_encoding_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the bytes of a Latin-1 shell reach a file, which is UTF-8."""
    assert "can be written as UTF-8" in refused(
        capsys, folder, "check", "single_zone", "--set", "title=caf\udce9"
    )
