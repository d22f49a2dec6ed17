"""Doors into a run: resume without a case file, directories with numbers, and what is said to somebody at the wrong one."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from mpm.case.case import load_case
from mpm.cli import main
from mpm.output.rundirs import make_numbered

from .cases import CASES, TINY, assert_same_numbers, zone

PROFILE = "phase_deg,u_x_m/s\n0,0.02\n90,0.02\n180,0.006\n270,0.006\n"
ROOT = Path(__file__).parents[1]


def settings(**more: str) -> list[str]:
    """Options that make the built-in zone small and short."""
    chosen = {**TINY, "time.end": "0.3 s", "output.every": "0.1 s", **more}
    return [part for key, value in chosen.items() for part in ("--set", f"{key}={json.dumps(value)}")]


def numbers(directory: Path) -> dict[str, Any]:
    return json.loads((directory / "summary.json").read_text())


def test_resume_needs_the_directory_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a run that was given by a file with a profile beside it, and by --set, cannot be prolonged from elsewhere by its
    directory alone, or does not end with the numbers of one that was that long from the start."""
    home, elsewhere = tmp_path / "home", tmp_path / "elsewhere"
    home.mkdir()
    elsewhere.mkdir()
    (home / "profile.csv").write_text(PROFILE)
    inlet = '[[geometry.inlet]]\nname = "tma"\nvelocity = "3 cm/s"\n'
    motion = '[motion]\ngamma = 0.3\nprofile = "profile.csv"\n'
    (home / "own.toml").write_text(f'[geometry]\nbase = "single_zone"\n{inlet}{motion}')
    monkeypatch.chdir(home)
    assert main(["run", "own.toml", "-q", *settings()]) == 0
    assert main(["run", "own.toml", "-q", "-o", "long", *settings(**{"time.end": "0.5 s"})]) == 0
    monkeypatch.chdir(elsewhere)
    directory = home / "results" / "own"
    assert main(["resume", str(directory), "-q", "--end", "0.5 s"]) == 0
    assert load_case(directory / "case.toml").motion.profile == str(home / "profile.csv")
    assert numbers(directory)["simulated_seconds"] == 0.5
    assert_same_numbers(numbers(directory), numbers(home / "long"), 1e-9)
    assert list(elsewhere.iterdir()) == []


def test_nothing_to_resume_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when --resume or mpm resume silently begins a run, where there is none, or repeats the end of one that is done."""
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    for arguments in (
        ["resume", "nowhere"],
        ["resume", "empty"],
        ["run", "single_zone", "--resume", "-o", "nowhere"],
        ["run", "single_zone", "--resume", "-o", "empty"],
        ["dem", str(CASES / "dem" / "demo.toml"), "--resume", "-o", "empty"],
    ):
        assert main([*arguments, "-q"]) == 2, arguments
        said = capsys.readouterr().err
        assert "nothing to resume" in said and len(said.splitlines()) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty"] and not any(Path("empty").iterdir())
    assert main(["run", "single_zone", "-o", "done", "-q", *settings()]) == 0
    before = (tmp_path / "done" / "history.csv").stat().st_mtime_ns
    for arguments in (["resume", "done"], ["run", "single_zone", "-o", "done", "--resume", *settings()]):
        assert main([*arguments, "-q"]) == 2
        assert "the run is done, t = 0.3 s; to a later end: mpm resume done --end" in capsys.readouterr().err
    assert (tmp_path / "done" / "history.csv").stat().st_mtime_ns == before
    assert main(["resume", "done", "--end", "3 m"]) == 2
    assert "done/case.toml: time.end: found '3 m'" in capsys.readouterr().err
    (tmp_path / "done" / "checkpoint.npz").unlink()  # as after a kill while the flow is being found
    (tmp_path / "done" / "summary.json").unlink()
    assert main(["resume", "done", "-q"]) == 0
    assert "no restart state yet, so the run begins anew" in capsys.readouterr().err
    assert numbers(tmp_path / "done")["status"] == "done"


@pytest.mark.parallel
def test_numbered_directories(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when two runs of a name share a directory, a number is used again, or the ranks of a run do not agree on one."""
    monkeypatch.chdir(tmp_path)
    arguments = ["run", str(CASES / "single_zone.toml"), "-q", "--set", "fidelity=steady", *settings()]
    assert main([*arguments, "--name", "auto"]) == 0
    assert main([*arguments, "--name", "auto"]) == 0
    assert main([*arguments, "--name", "mine"]) == 0
    results = tmp_path / "results"
    assert sorted(p.name for p in results.iterdir()) == ["mine", "single_zone-001", "single_zone-002"]
    assert all(numbers(path)["status"] == "done" for path in results.iterdir())
    assert main([*arguments, "--name", "../mine"]) == 2
    assert main([*arguments, "--name", "mine", "-o", "mine"]) == 2


def test_programs_that_start_at_once_get_different_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when one takes the directory that another has just made, or a number below an existing one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results" / "x-041").mkdir(parents=True)
    (tmp_path / "results" / "x-1000-old").mkdir()
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(make_numbered, ["x"] * 16))
    assert sorted(path.name for path in made) == [f"x-{number:03d}" for number in range(42, 58)]


@pytest.fixture
def things(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One of each kind of file and directory that somebody may name."""
    monkeypatch.chdir(tmp_path)
    for name, source in {
        "sweep.toml": "cases/sweeps/dose.toml",
        "powder.toml": "cases/dem/demo.toml",
        "mechanism.toml": "mpm/mechanisms/alumina.toml",
        "program.py": "cases/single_zone.py",
    }.items():
        shutil.copy(ROOT / source, name)
    Path("case.toml").write_text(zone(mesh=TINY).to_toml())
    Path("profile.csv").write_text(PROFILE)
    for name, holds in {
        "run": ["case.toml", "run.log"],
        "swept": ["sweep.json"],
        "dem": ["case.toml", "seed_1/x"],
        "best": ["case.toml", "points.csv"],
        "plain": ["own.toml"],
    }.items():
        for file in holds:
            path = Path(name) / file
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy("case.toml", path)
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("run run", "the directory of a run: mpm resume run goes on with it, mpm run run/case.toml"),
        ("check run", "mpm resume run goes on"),
        ("mesh run", "mpm resume run goes on"),
        ("optimise run", "mpm resume run goes on"),
        ("sweep run", "mpm resume run goes on"),
        ("run swept", "the directory of a sweep"),
        ("run dem", "mpm dem dem/case.toml -o dem --resume"),
        ("resume best", "mpm run best/case.toml runs the best doses"),
        ("plot best", "mpm run best/case.toml runs the best doses"),
        ("run plain", "a directory with own.toml"),
        ("run sweep.toml", "a sweep file: mpm sweep sweep.toml"),
        ("check powder.toml", "a powder file: mpm dem powder.toml"),
        ("run mechanism.toml", "a mechanism file: a case names it: chemistry.mechanism = 'mechanism.toml'"),
        ("run profile.csv", "a table: motion.profile"),
        ("run program.py", "python program.py"),
        ("sweep case.toml", "a case file: mpm check case.toml looks at it, mpm run case.toml runs it"),
        ("sweep powder.toml", "mpm dem powder.toml"),
        ("dem case.toml", "mpm run case.toml"),
        ("dem sweep.toml", "mpm sweep sweep.toml"),
        ("dem ./run", "mpm resume run"),
        ("plot case.toml", "mpm run case.toml"),
        ("plot sweep.toml", "mpm sweep sweep.toml"),
        ("resume case.toml", "mpm run case.toml"),
    ],
)
def test_the_wrong_door_names_the_right_one(
    arguments: str, said: str, things: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a verb that is given what another one takes does not say, in one line and with status 2, what it is and which."""
    before = sorted(things.rglob("*"))
    assert main(arguments.split()) == 2
    line = capsys.readouterr().err
    assert said in line and len(line.splitlines()) == 1
    assert sorted(things.rglob("*")) == before
