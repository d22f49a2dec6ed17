"""What people read: whole numbers in pipes and on narrow terminals, names as written, on terminals of any encoding."""

import io
import json
import os
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from mpm.advice.checks import check_case
from mpm.advice.screen import print_report
from mpm.case.case import load_case
from mpm.cli import main
from mpm.cli.nextsteps import how_to_go_on
from mpm.errors import BalanceError, ConvergenceError, InputError, Interrupted
from mpm.reactor.clock import Clock
from mpm.reactor.progress import FLOW, Progress
from mpm.report.tables import print_mesh, print_summary
from mpm.screen import Listing, duration, screen

from .cases import SHORT, TINY

from mpi4py import MPI  # isort: skip  (after mpm.numerics.fem)

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
        (print_report, (case, check_case(case)), ("6.9212e-8", "2.85 / 2.68", "sintered_powder", "104.775", "headspace")),
        (print_mesh, (case,), ("headspace", "139.7", "28,359", "102.775")),
        (print_summary, (summary,), ("1.792", "1.234e-6", "cm^2/s")),
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


def test_a_listing_is_a_table_on_a_wide_terminal_only() -> None:
    """Fails when a narrow terminal is shown a table, or a number in the list lacks its unit or is parted from it."""
    listing = Listing("port", "v [cm/s]", "excess")
    listing.add_row("tma", "3.5", "1.79")
    listing.add_row("purge", "3.5")
    lines = text_of(24, listing.print).splitlines()
    assert lines == ["  tma: v 3.5 cm/s,", "    excess 1.79", "  purge: v 3.5 cm/s"]
    assert text_of(99, listing.print).count("│") == 0
    assert text_of(100, listing.print).count("│") == 8


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
    assert first == shown


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


def numbers_of_a_run(**changes: float) -> dict[str, Any]:
    """A summary with a number of every group."""
    return {
        "fidelity": "averaged",
        "simulated_seconds": 20.0,
        "cells": 100,
        "titration": {"tma": {"box_mean": 0.4, "exit_mean": 0.98, "exit_min": 0.9, "exit_profile": [0.9, 1.0]}},
        "utilisation": {"tma": 0.5},
        "cvd": {"rate_mean": 1e-30, "total": changes.get("cvd", 2.5e-9)},
        "flow": {"inflow": 4e-4, "bed_superficial_velocity": [1e-21, 2e-3], "bed_pressure_drop": 50.0, "pressure_drop": {"bed": 50.0}},
        "outlets": {"zone1": {"x": {"TMA": 1.1e-32, "H2O": 2e-6}}},
        "species": {"TMA": {"fed": 1e-5, "left": 1e-25, "reacted": 1e-5, "balance_error": 3e-14}},
    }  # fmt: skip


def test_the_numbers_of_a_run() -> None:
    """Fails when what is below rounding is printed as a result, a unit is missing, the coating is not first or the balance not last."""
    text = " ".join(text_of(80, print_summary, numbers_of_a_run()).split())
    for part in (
        "coverage where solids leave the zone of tma, worst row 0.9",
        "parasitic CVD, mean rate 0 mol/m^3/s",
        "parasitic CVD, total 0.0025 umol/m",
        "superficial gas velocity in the bed, along 0 cm/s",
        "superficial gas velocity in the bed, upwards 0.2 cm/s",
        "mole fraction of TMA in zone1 0",
        "mole fraction of H2O in zone1 2e-6",
        "TMA: fed 10 umol/m, reacted 10 umol/m, left 0 umol/m",
        "largest relative error of a balance: 3.0e-14 (balance error of TMA)",
    ):
        assert part in text
    assert text.count("pressure drop of") == 1
    order = [
        text.index(word) for word in ("leave the zone", "precursor used", "CVD", "fed by all", "balance")
    ]
    assert order == sorted(order)
    assert "parasitic CVD, total 0 umol/m" in " ".join(
        text_of(80, print_summary, numbers_of_a_run(cvd=1e-18)).split()
    )


def test_a_steady_summary_is_per_second() -> None:
    text = " ".join(text_of(120, print_summary, {**numbers_of_a_run(), "fidelity": "steady"}).split())
    assert "parasitic CVD, total 0.0025 umol/m/s" in text and "Balances per second" in text
    assert "simulated time" not in text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.4, "0 s"),
        (59.4, "59 s"),
        (60, "1 min"),
        (200, "3 min 20 s"),
        (7500, "2 h 5 min"),
        (273600, "3 d 4 h"),
    ],
)
def test_time_to_wait(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_the_live_line_fits() -> None:
    """Fails when the line of a long run, with its spinner, takes more than 80 columns, or the time left is a row of seconds."""
    clock = Clock(end=20000.0, all_steps=9_999_999, time=1234.567, steps=114_812, worst_balance=3.2e-13)
    progress = Progress(clock, MPI.COMM_SELF, False)
    progress.first = (time.monotonic() - 1000.0, 100_000)
    line = progress.line()
    assert line.startswith("1234.6 of 20000 s, step 114812, 14.8 steps/s, 7 d 17 h left, balances to 3e-13")
    assert len(line) <= 78


def test_a_log_is_not_filled_before_the_first_step(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when every cycle of a flow that is being found takes a line of a log, or the beginning of it none."""
    progress = Progress(Clock(end=1.0, all_steps=1), MPI.COMM_SELF, True)
    for text in (FLOW, "cycle 1", "cycle 2"):
        progress.say(text)
    assert capsys.readouterr().err == f"{FLOW}\n"
    progress.interval = 0.0
    progress.say("cycle 3")
    assert capsys.readouterr().err == "cycle 3\n"


def test_a_finished_run_names_the_next_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Fails when the end of a run does not say what to type next, forgets the warnings, or the command that it names does not work."""
    monkeypatch.chdir(tmp_path)
    tiny = [
        part
        for key, value in {**TINY, **SHORT, "time.end": "0.1 s"}.items()
        for part in ("--set", f"{key}={value}")
    ]
    assert main(["run", "single_zone", "-o", "a run", *tiny]) == 0
    out = capfd.readouterr().out
    assert "warning: upwinding in columns" in out
    *commands, last = out[out.index("Next:") :].splitlines()[1:]
    assert last == f"Report: {Path('a run', 'report.html')}"
    steps = [shlex.split(line, comments=True) for line in commands]
    assert [step[:2] for step in steps] == [["mpm", "plot"], ["mpm", "resume"]]
    assert all("a run" in step for step in steps)
    assert main(steps[-1][1:]) == 0
    assert json.loads(Path("a run", "summary.json").read_text())["simulated_seconds"] == 0.2


def test_a_run_that_stops_says_how_to_go_on(tmp_path: Path) -> None:
    """Fails when the line after Ctrl-C or a failure forgets what is kept and what resumes it, or promises what is not there."""
    for error in (Interrupted("interrupted at t = 3 s"), ConvergenceError("step 3: no"), BalanceError("TMA")):
        directory = tmp_path / type(error).__name__
        directory.mkdir()
        with pytest.raises(type(error)) as caught, how_to_go_on(directory):
            raise error
        assert str(caught.value) == str(error)
        (directory / "checkpoint.npz").touch()
        with pytest.raises(type(error)) as caught, how_to_go_on(directory):
            raise error
        assert str(caught.value).startswith(str(error)) and f"mpm resume {directory} goes on" in str(
            caught.value
        )
        assert "\n" not in str(caught.value)
