"""The first session of a newcomer: from `mpm --help` and an empty folder to a case of their own, checked, run and found again.

Every command is one that the screen before has named. Nothing is read but what mpm prints and the file that it writes.
"""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from mpm.cli import main

Shell = Callable[..., str]


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    """Type a command in an empty folder; returns what it prints, as one line of words."""
    monkeypatch.chdir(tmp_path)

    def typed(*arguments: str, status: int = 0) -> str:
        assert main(arguments) == status, capsys.readouterr()
        out, err = capsys.readouterr()
        assert not (out and status), "a refusal is one line and nothing else"
        return " ".join((err if status else out).split())

    return typed


def take_away(text: str, key: str, value: str, after: str) -> str:
    """What a person does in an editor: below `after`, the # before `key` goes and its value is typed over."""
    head, mark, tail = text.partition(after)
    changed, times = re.subn(rf"^#?{key} = .*$", f"{key} = {value}", tail, count=1, flags=re.MULTILINE)
    assert mark and times == 1, key
    return head + mark + changed


def test_from_an_empty_folder_to_a_run_of_ones_own_powder(shell: Shell, tmp_path: Path) -> None:
    """Fails when a step is not named by the one before, does not work as it says, or needs a file of the program to be read."""
    # What is there?
    out = shell("--help")
    for verb in ("new", "list", "explain", "check", "run"):
        assert f" {verb} " in out
    out = shell("list")
    assert "single_cycle Single cycle of TMA and water" in out and "mpm new FILE --from NAME" in out
    assert "of your own: a table [material.NAME]" in out

    # What does a powder of one's own need?
    out = shell("explain", "material")
    assert (
        "porosity share of the layer's volume between the particles" in out
        and "[required for a material of your own]" in out
    )
    assert "worked out: Kozeny-Carman from porosity, particle_diameter" in out
    out = shell("explain", "particle_diameter")
    assert "56 um" in out and "--set material.glass_beads.particle_diameter=" in out

    # A file to edit: two precursors
    out = shell("new", "powder.toml", "--from", "single_cycle")
    assert "mpm check powder.toml" in out and "mpm run powder.toml" in out
    text = (tmp_path / "powder.toml").read_text(encoding="utf-8")
    assert "#[material.my_powder]" in text and "A powder of your own" in text

    # One purge goes, the powder comes, the mesh is made coarse
    text, times = re.subn(r'\[\[geometry\.inlet\]\]\nname = "purge2"\n(.+\n)+\n', "", text)
    assert times == 1
    text = text.replace("#[material.my_powder]", "[material.my_powder]").replace(
        '"glass_beads"\nmoving', '"my_powder"\nmoving'
    )
    for key, value in (("porosity", "0.42"), ("density", '"2200 kg/m^3"'), ("particle_diameter", '"80 um"')):
        text = take_away(text, key, value, "[material.my_powder]")
    text = take_away(text, "title", '"My powder"', "#:schema")
    text = take_away(text, "cell_width", '"5 mm"', "[geometry]")
    for layer, cells in (("plenum", 3), ("frit", 2), ("bed", 3), ("headspace", 4)):
        text = take_away(text, "cells", str(cells), f'name = "{layer}"')
    (tmp_path / "powder.toml").write_text(text, encoding="utf-8")

    # A slip is one line that says what to do
    out = shell("check", "powder.toml", "--set", "material.my_powder.porosty=0.4", status=2)
    assert "did you mean porosity?" in out
    out = shell("check", "powder", status=2)
    assert "did you mean powder.toml?" in out

    # Is it what was meant?
    out = shell("check", "powder.toml")
    assert "My powder" in out and "bed: my_powder" in out
    assert (
        "porosity 0.42" in out
        and "particle diameter 80 um" in out
        and "density of the solid 2200 kg/m^3" in out
    )
    assert "permeability 7.83" in out and "um^2 (worked out)" in out
    assert "purge1" in out and "purge2" not in out and "tma (TMA)" in out and "water (H2O)" in out
    assert "minimum fluidisation" in out and "mpm run powder.toml" in out

    # Run it, shortly
    out = shell("run", "powder.toml", "--set", "time.end=1 s", "--set", "output.every=0.5 s")
    assert "Results: results/powder" in out and "mpm plot results/powder" in out
    assert (
        "coverage where solids leave the zone of tma" in out
        and "coverage where solids leave the zone of water" in out
    )
    assert (tmp_path / "results" / "powder" / "summary.json").exists()

    # Find it again, and know what a number means
    out = shell("list", "runs")
    assert "results/powder My powder; done" in out
    assert "share of the sites that this inlet's half-reaction has made" in shell(
        "explain", "titration.tma.exit_mean"
    )
