"""Every screen of every verb, on a terminal of 80 columns, on a narrower one and in a pipe: no cut word, no long line, no bare number."""

import fcntl
import io
import os
import pty
import re
import shutil
import struct
import subprocess
import sys
import termios
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from mpm.cli import main
from mpm.cli.base import app

from .cases import SHORT, TINY

ROOT = Path(__file__).parents[1]
SWEEP = """
[sweep]
case = "single_zone"
[[sweep.axis]]
key = "geometry.inlet.tma.mass_fractions.TMA"
values = [1e-4, 2e-4]
[sweep.set]
"""


class Terminal(io.TextIOWrapper):
    """Standard output that says it is a terminal."""

    def __init__(self, is_terminal: bool) -> None:
        super().__init__(io.BytesIO(), encoding="utf-8", write_through=True)
        self.is_terminal = is_terminal

    def isatty(self) -> bool:
        return self.is_terminal

    def text(self) -> str:
        """What has been shown, without colours and with what redraws itself gone."""
        shown = self.buffer.getvalue().decode()  # type: ignore[attr-defined]
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown).replace("\r", "")


def called(arguments: list[str], columns: int | None, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """What a verb prints on a terminal of so many `columns`, or into a pipe (None), and what it says meanwhile, into a pipe."""
    stream, other = Terminal(columns is not None), Terminal(False)
    if arguments[0] == "resume" and arguments[1] != "--help":  # always the same run
        shutil.rmtree(arguments[1], ignore_errors=True)
        shutil.copytree("run", arguments[1])
    elif arguments[0] == "new":  # which writes over nothing
        Path(arguments[1]).unlink(missing_ok=True)
    with monkeypatch.context() as patch:
        patch.setenv("COLUMNS", str(columns or 80))
        patch.setenv("TERM", "xterm")
        patch.setattr(sys, "stdout", stream)
        patch.setattr(sys, "stderr", other)
        assert main(arguments) == 0, other.text()
    return stream.text(), other.text()


def shown(arguments: list[str], columns: int | None, monkeypatch: pytest.MonkeyPatch) -> str:
    """The first of the two."""
    return called(arguments, columns, monkeypatch)[0]


# The walk


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a run, a sweep and their inputs, in which the screens are shown."""
    folder = tmp_path_factory.mktemp("screens")
    before = Path.cwd()
    os.chdir(folder)
    tiny = [part for key, value in {**TINY, **SHORT}.items() for part in ("--set", f"{key}={value}")]
    assert (
        main(["run", "single_cycle", "-o", "run", "--quiet", *tiny, "--set", "geometry.cell_width=9 mm"]) == 0
    )
    assert (
        main(["run", "single_cycle", "-o", "run2", "--quiet", *tiny, "--set", "geometry.cell_width=12 mm"])
        == 0
    )
    pairs = "".join(f'"{key}" = {value!r}\n' for key, value in {**TINY, **SHORT}.items())
    (folder / "sweep.toml").write_text(SWEEP + pairs, encoding="utf-8")
    yield folder
    os.chdir(before)


SCREENS: dict[str, list[str]] = {
    "check": ["check", "single_cycle"],
    "check, idle and warned": ["check", "single_zone", "--set", "motion.gamma=0.4", "--set", "geometry.inlet.tma.velocity=12 cm/s"],
    "check, no bed": ["check", "single_zone", "--set", "geometry.layer.bed.moving=false"],
    "check, steady": ["check", "single_zone", "--set", "fidelity=steady", "--set", "gas.pressure=1 torr"],
    "check, resolved": ["check", "single_zone", "--set", "fidelity=resolved", "--set", "motion.inlet_frame=lab"],
    "check, closed code": ["check", "single_zone", "--set", "conventions=closed-code", "--set", "porous.inertia=interstitial"],
    "check, many ports": ["check", str(ROOT / "meshes" / "four_cycles.toml")],
    "check --full": ["check", "single_zone", "--full"],
    "mechanism": ["mechanism", "single_cycle"],
    "mechanism, any law": ["mechanism", "zirconia", "--temperature", "180 degC"],
    "check, any law": ["check", "single_zone", "--set", "chemistry.mechanism=silicon", "--set",
        "geometry.inlet.tma.mass_fractions={ SiH4 = 2e-4 }"],
    "mesh": ["mesh", "single_zone", "--set", "geometry.cell_width=5 mm"],
    "run": ["run", "single_cycle", "-o", "again", "--overwrite", "--set", "geometry.cell_width=9 mm"],
    "run, steady": ["run", "single_zone", "-o", "still", "--no-report", "--overwrite", "--set", "fidelity=steady"],
    "resume": ["resume", "longer", "--end", "1.1 s"],
    "watch": ["watch", "run"],
    "new": ["new", "mine.toml"],
    "list": ["list"],
    "list materials": ["list", "materials"],
    "list gases": ["list", "gases"],
    "explain": ["explain"],
    "explain, a table": ["explain", "material"],
    "explain, a key": ["explain", "geometry.inlet.tma.velocity"],
    "explain, a number": ["explain", "flow"],
    "compare": ["compare", "run", "run2"],
    "plot": ["plot", "run"],
    "report": ["report", "run"],
    "report of two": ["report", "run", "run2"],
    "paraview": ["paraview", "run"],
    "optimise": ["optimise", "single_zone", "-o", "best", "--target", "0.5", "--limit", "12", "--set", "geometry.cell_width=9 mm"],
    "sweep": ["sweep", "sweep.toml", "-o", "sweep"],
    "--version": ["--version"],
}  # fmt: skip
"""Calls whose screens are for people; those that compute do so on the tiny mesh."""
PROSE = {"list", "explain", "explain, a table", "explain, a key", "explain, a number"}
"""Those that explain: definitions such as `0: closed`, and titles that people have given."""
LINES = {"plot", "report", "report of two", "optimise", "sweep"}
"""Those that print paths and progress alone, which have no layout."""
for _name in ("run", "run, steady", "optimise"):
    for _key, _value in {**SHORT, **TINY}.items():
        if _key.startswith("geometry.layer") or (_name != "optimise" and _key != "geometry.cell_width"):
            SCREENS[_name] += ["--set", f"{_key}={_value}"]


def commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every verb and every verb of a verb."""
    yield path
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))


HELPS = {" ".join([*path, "--help"]): [*path, "--help"] for path in commands(typer.main.get_command(app))}


# What is wrong with a screen

CUT = re.compile("\u2026|[^\\].A-Z ]\\.\\.\\.$", re.MULTILINE)
"""An ellipsis, or three points at the end of a line that close no list of arguments such as `[ARGS]...`."""
BOXES = str.maketrans(dict.fromkeys("│┃┆|┏┓┗┛┡┩┳╇┴└┘┌┐├┤─━┬┼:,;()[]'\"#", " "))
NUMBER = r"(?<![\w.^/)-])-?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.^/(]|\+\d)"
UNIT = (
    r"(?:(?:Pa s|mol|[mcunk]?m|[mu]?s|min|h|%|K|Pa|Hz|deg|degC|GB|kJ/mol|g/mol|1/m|1/s|sccm/m|mol/m|umol/m|steps/s|square angstrom)(?![\w])"
    r"|(?:cm|mm|um|nm|m|kg|Pa|[mu]?mol|J|W|sites per|per)[ /^][\w/^ ]*)"
)
NO_NUMBERS = re.compile(r"^\d+: |(?<![\w.])[0-9a-f]{8,}(?!\w)|\b\d+:\d\d:\d\d\b")
"""An enumeration, the name of a point or a revision, a time on the clock."""
RATIOS = re.compile(
    r"\b(?:porosity|tortuosity[ _]factor|sphericity|fractions?|mass_fractions\.\w+|Knudsen|Reynolds|Re|Peclet|Damkoehler|Courant|Kn|over|"
    r"share|coverage|ratio|times|molecules|molecule|error|error of|particles of|balances|gamma|drawn back in|continuum|grading|"
    r"viscosity_ratio|initial_coverage\.\S+|dilute|b|order|coverages|sticking|equilibrium|theta)\b"
)
COUNTS = re.compile(
    r"\b(?:cells|columns|places|reactions|rows|facets|steps?|processes|points|phases|steps_per_cycle|ports|done|running|to run|at a time|"
    r"backflow_rows|states)\b"
)


def bare_numbers(text: str) -> list[str]:
    """Clauses with a number that has no unit and is neither a ratio nor a count by its label or the words around it."""
    found = []
    for line in text.splitlines():
        if (
            re.search(r"\+.*->|->.*\+", line)
            or line.startswith(("  mpm ", "  #"))
            or set(line) <= set("0123456789 ")
        ):
            continue  # equations, commands, the numbers of ports in a sketch
        line = NO_NUMBERS.sub("", line)
        label = re.split(r"(?<=\S)(?::|  )", line.strip(), maxsplit=1)[0]
        for clause in re.split(r"[,;:] | \(|\)(?=$|[ ,;:])|  +# ", line):
            after = [clause[match.end() :] for match in re.finditer(NUMBER, clause)]
            bare = [rest for rest in after if not re.match(rf"(?: (?:to|and|/|->) {NUMBER})*\s+{UNIT}", rest)]
            told = f"{label} {clause}"
            if re.fullmatch(r" *\d\d? [A-Za-z][\w-]*", clause):
                continue  # what the number of a port in a sketch stands for
            if bare and not RATIOS.search(told) and not COUNTS.search(told):
                found.append(clause.strip())
    return found


def words(text: str) -> list[str]:
    """The words of a screen without frames, punctuation and times on the clock, sorted: narrow screens have some of them elsewhere."""
    text = re.sub(r"computing time:? +\S+ \S+", "", text)
    return sorted(word for word in text.translate(BOXES).split() if any(map(str.isalnum, word)))


@pytest.mark.parametrize("name", SCREENS)
def test_screens(name: str, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a screen has a line longer than the terminal, a cut or broken word, or a number without unit that is no ratio or count."""
    piped, said = called(SCREENS[name], None, monkeypatch)
    assert piped.strip() or said.strip(), "nothing on the screen"
    assert CUT.findall(piped + said) == []
    assert name in PROSE or bare_numbers(piped + said) == []
    if name in LINES:
        return
    narrow = shown(SCREENS[name], 80, monkeypatch)
    assert [line for line in narrow.splitlines() if len(line) > 80 and " " in line.strip()] == []
    assert CUT.findall(narrow) == []
    one, other = words(piped), words(narrow)
    assert one == other, sorted(set(one) ^ set(other))


@pytest.mark.parametrize("name", HELPS)
def test_helps(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a verb, old or new, has a help that is cut or does not fit, or that has no sentence."""
    for columns in (60, 80, 140):
        text = shown(HELPS[name], columns, monkeypatch)
        assert columns < 80 or [line for line in text.splitlines() if len(line) > columns] == [], columns
        assert CUT.findall(text) == [], columns
        assert len(text.splitlines()) > 5


@pytest.mark.parametrize("columns", [60, 100, 140])
@pytest.mark.parametrize("name", ["check", "mesh", "check, many ports"])
def test_other_widths(name: str, columns: int, monkeypatch: pytest.MonkeyPatch, place: Path) -> None:
    """Fails when a word is broken, or a line too long, on a narrow terminal or where there is room for tables."""
    text = shown(SCREENS[name], columns, monkeypatch)
    assert [line for line in text.splitlines() if len(line) > columns and " " in line.strip()] == []
    extra = set(words(text)) - set(words(shown(SCREENS[name], None, monkeypatch)))
    assert extra <= (
        {"layer", "region", "port"} if columns >= 100 else set()
    )  # first headings: only tables have them
    assert ("┏" in text) == (columns >= 100)


def test_the_rules_find_what_they_are_for(monkeypatch: pytest.MonkeyPatch, place: Path) -> None:
    """Fails when a unit can be taken from a line, or a word cut, without the tests above noticing."""
    text = shown(SCREENS["check, idle and warned"], None, monkeypatch)
    lines = [line for line in text.splitlines() if re.search(rf"{NUMBER}\s+{UNIT}", line)]
    assert len(lines) > 40
    unseen = []
    for line in lines:
        naked = re.sub(rf"({NUMBER})\s+{UNIT}", r"\1 ", line)
        if not (bare_numbers(naked) or RATIOS.search(line) or COUNTS.search(line)):
            unseen.append(line)
    assert unseen == []
    assert CUT.search(
        "  mesh   Write the gmsh mesh of a case or of a shared geometry, and..."
    ) and CUT.search("a name…")
    assert not CUT.search("Usage: mpm [OPTIONS] COMMAND [ARGS]...")
    assert words("one bro\nken word") != words("one broken word")


def on_a_terminal(arguments: list[str], columns: int) -> str:
    """Everything that a process of its own writes to a real pseudo-terminal."""
    keyboard, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    environment = {key: value for key, value in os.environ.items() if key not in ("COLUMNS", "LINES")} | {
        "TERM": "xterm"
    }
    process = subprocess.Popen(
        [sys.executable, "-m", "mpm", *arguments],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        env=environment,
    )
    os.close(terminal)
    parts = []
    while True:
        try:
            part = os.read(keyboard, 65536)
        except OSError:  # the other end has been closed
            break
        if not part:
            break
        parts.append(part)
    os.close(keyboard)
    assert process.wait() == 0
    return b"".join(parts).decode()


def test_a_long_message_breaks_between_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the one line that says what is wrong with an input is broken within a word on a terminal, or broken at all in a pipe."""
    said = {}
    for columns in (None, 60):
        stream = Terminal(columns is not None)
        with monkeypatch.context() as patch:
            patch.setenv("COLUMNS", str(columns or 80))
            patch.setenv("TERM", "xterm")
            patch.setattr(sys, "stderr", stream)
            assert main(["check", "single_zone", "--set", "gas.carrier=Xenon and more"]) == 2
        said[columns] = stream.text().splitlines()
    assert len(said[None]) == 1 and len(said[None][0]) > 60
    assert len(said[60]) > 1 and max(map(len, said[60])) <= 60
    assert " ".join(line.strip() for line in said[60]) == said[None][0]


def test_a_real_terminal(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the live line of a run, a warning or the numbers do not fit 80 columns, or a terminal is not recognised as one."""
    arguments = [*SCREENS["run"], "--set", "time.end=3 s"]
    text = on_a_terminal(arguments, 80)
    frames = re.split(r"\r\n|\r|\n|\x1b\[2K", text)
    plain = [re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", frame) for frame in frames]
    assert [line for line in plain if len(line) > 80] == []
    assert any(
        re.fullmatch(r"\S 3\.00 of 3 s, step \d+, [\d.]+ steps/s, done, balances to \de-\d\d", line)
        for line in plain
    )
    assert any(line.startswith("warning: upwinding in columns") for line in plain)
    assert "mpm resume again --end '6 s'" in text
