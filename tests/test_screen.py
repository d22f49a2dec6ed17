"""What people read: whole numbers in pipes and on narrow terminals, names as written, on terminals of any encoding."""

import io
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from mpm.case import load_case
from mpm.checks import check_case
from mpm.cli import main
from mpm.errors import InputError
from mpm.screen import Listing, screen
from mpm.tables import print_mesh, print_report, print_summary

EXAMPLE = (Path(__file__).parent / "example_case.toml").read_text(encoding="utf-8")


def text_of(width: int, show: Any, *arguments: Any) -> str:
    """What a terminal `width` columns wide shows."""
    stream = io.StringIO()
    show(*arguments, Console(file=stream, width=width, force_terminal=True, color_system=None, markup=False))
    return stream.getvalue()


@pytest.mark.parametrize("width", [40, 80, 99, 140])
def test_no_terminal_cuts_a_number(width: int) -> None:
    """Fails when a cell is shortened or a number broken into two lines."""
    case = load_case("single_zone", {"material.glass_beads.site_density": "6.9212e-8 mol/m^2"})
    summary = {
        "excess_number": {"tma": 1.7923},
        "flow": {"bed_superficial_velocity": [1.0], "inflow": 1.234e-10},
    }
    for show, arguments, wanted in (
        (print_report, (case, check_case(case)), ("6.92e-08", "2.85 / 2.68", "sintered_powder", "104.775", "headspace")),
        (print_mesh, (case,), ("headspace", "139.7", "28,359", "102.775")),
        (print_summary, (summary,), ("1.792", "1.234e-10", "m^2/s")),
    ):  # fmt: skip
        text = text_of(width, show, *arguments)
        assert "…" not in text and "..." not in text
        words = text.replace("\n", " ")
        assert [one for one in wanted if one not in words] == []


@pytest.mark.parametrize("verb", ["check", "mesh"])
def test_a_pipe_gets_whole_tables(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when the 80 columns that a pipe pretends to have cut the tables."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    assert main([verb, "single_zone", "--set", "geometry.cell_width=5 mm"]) == 0
    text = capsys.readouterr().out
    assert "…" not in text and "headspace" in text
    assert not re.search(r"^│ +│", text, re.MULTILINE), "a row in two lines"


def test_a_listing_that_does_not_fit_is_a_list() -> None:
    listing = Listing("port", "v [cm/s]", "excess")
    listing.add_row("tma", "3.5", "1.79")
    listing.add_row("purge", "3.5")
    lines = text_of(24, listing.print).splitlines()
    assert lines == ["port tma: v [cm/s] 3.5, ", "excess 1.79", "port purge: v [cm/s] 3.5"]
    assert text_of(60, listing.print).count("│") == 8


NAMES = [
    "Run 3 [/scratch/anna/zone]",
    "dose [low]",
    "[red]",
    "a\nb",
    "\x1b[2J wiped",
    "µ → ∞",
    ":smile:",
    "$x_1$",
]


@pytest.mark.parametrize("title", NAMES)
def test_titles_are_shown_as_written(title: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a bracket is read as markup, a colon as a picture, or a control character reaches the terminal."""
    case = load_case("single_zone", {"title": title})
    print_report(case, check_case(case), screen())
    first = capsys.readouterr().out.splitlines()[0]
    shown = title.replace("\n", " ").replace("\x1b", "\\x1b")
    assert first == f"{shown}: averaged, to 20 s"


def test_sites_and_materials_keep_their_brackets(capsys: pytest.CaptureFixture[str]) -> None:
    tables = {
        "geometry": {
            "length": "10 mm",
            "cell_width": "1 mm",
            "layer": [{"name": "bed", "height": "1 mm", "cells": 2, "material": "glass[/a]", "moving": True}],
        },
        "material": {"glass[/a]": {"porosity": 0.4, "permeability": "4 um^2", "surface_to_volume": "1e4 1/m"}},
        "chemistry": {
            "mechanism": "inline",
            "species": {"TMA": {"formula": "Al(CH3)3", "molar_mass": "72 g/mol"}, "CH4": {"molar_mass": "16 g/mol"}},
            "site": {"OH[s]": {"formula": "OH"}, "OAl(CH3)2[s]": {"formula": "OAl(CH3)2"}},
            "reaction": {"tma": {"equation": "OH[s] + TMA -> CH4 + OAl(CH3)2[s]", "sticking": 0.01}},
        },
    }  # fmt: skip
    case = load_case(tables)
    print_report(case, check_case(case), screen())
    text = capsys.readouterr().out
    assert "glass[/a]" in text and "OH[s] + TMA -> CH4 + OAl(CH3)2[s]" in text


def test_a_message_is_one_line_without_control_characters() -> None:
    """Fails when a key or a value of a file can steer the terminal that shows the message."""
    line = str(InputError.at("case\x1b[2J.toml", "a\rb", "x\ny", "z\x00"))
    assert line == "case\\x1b[2J.toml: a b: found x y; accepted: z\\x00"


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "latin-1"},
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
)
def test_terminals_that_are_not_utf8(environment: dict[str, str], tmp_path: Path) -> None:
    """Fails when a character that the terminal lacks ends the program, or a file is read in the locale's encoding."""
    case = EXAMPLE.replace('height = "3 mm"', 'height = "3000 µm"')
    (tmp_path / "case.toml").write_text(
        case.replace('title = "', 'title = "Łódź, 3 µm → 4, '), encoding="utf-8"
    )
    command = [sys.executable, "-m", "mpm", "check", "case.toml"]
    settings = {**os.environ, **environment}
    done = subprocess.run(command, cwd=tmp_path, env=settings, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert b"\\u017a, 3 " in done.stdout and b"28,359 cells" in done.stdout
    wrong = subprocess.run(
        [*command, "--set", "title=1", "--set", "motion.gämma=1"], cwd=tmp_path, env=settings,
        capture_output=True, timeout=120,
    )  # fmt: skip
    assert wrong.returncode == 2 and wrong.stderr.count(b"\n") == 1, wrong.stderr
