"""Following a run from outside: `mpm watch`."""

import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from mpm.cli import main, watch
from mpm.errors import ConvergenceError
from mpm.files import locked
from mpm.output.directory import RunDirectory
from mpm.output.following import look
from mpm.reactor.reactor import Reactor

from mpi4py import MPI  # isort: skip  (after mpm.reactor.reactor, which loads the finite-element stack)

from .cases import SHORT, TINY, zone


def test_a_run_is_seen_while_it_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the log of a run is not understood, its numbers are not those of the latest output, or watching disturbs it."""
    seen: list[list[str]] = []
    path = tmp_path / "run"

    def callback(reactor: Reactor) -> None:
        assert locked(path / "run.log")
        seen.append(look(path).text())
        assert main(["watch", str(path), "--once"]) == 0

    result = Reactor(zone(SHORT, TINY), MPI.COMM_SELF).run(path, callback=callback)
    assert result.summary["status"] == "done" and not locked(path / "run.log")
    assert seen[0][0].startswith("flow found after ")
    assert seen[2][0].startswith("0.26 of 1 s, step 19, ") and " steps/s" in seen[2][0]
    labels = [line.partition(":")[0] for line in seen[-1][1:]]
    assert labels == [
        "coverage where solids leave the zone of tma, mean",
        "coverage in the bed before tma, mean",
        "parasitic CVD, mean rate",
    ]
    assert seen[-1][3].endswith("mol/m^3/s")
    assert capsys.readouterr().out.splitlines()[0].startswith("flow found after ")
    assert main(["watch", str(path)]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"no run is at work in {path}\n{path}: the run is done\n") and "Next:" in said


@pytest.mark.parametrize(
    ("summary", "status", "says"),
    [
        ({"status": "failed", "simulated_seconds": 0.5}, 3, "the run has failed: Newton stopped"),
        ({"status": "interrupted", "simulated_seconds": 0.5}, 130, "the run was interrupted"),
        (None, 130, "ended from outside; the last word of its log: Newton stopped"),
    ],
)
def test_watching_ends_with_the_run(
    summary: dict[str, Any] | None,
    status: int,
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Fails when a line of a run at work is not passed on in a pipe, the end is not noticed, or it is told wrongly."""
    monkeypatch.setattr(watch, "PIPED", 0.05)
    run = RunDirectory(tmp_path / "run")
    run.prepare()
    run.write_case(zone(mesh=TINY).to_toml())
    told: list[str] = []

    def compute() -> None:
        for words in ("first words", "second words", "Newton stopped"):
            with run.log.open("a") as log:
                log.write(f"2026-01-02 03:04:05,678 {words}\n")
            deadline = time.monotonic() + 30.0
            while words not in "".join(told) and time.monotonic() < deadline:
                told.append(capsys.readouterr().out)  # nothing goes to standard error before the end
                time.sleep(0.02)
        if summary is not None:
            run.write_summary(summary)
        run.release()

    other = threading.Thread(target=compute)
    other.start()
    ended = main(["watch", str(run.path)])
    other.join()
    out, err = capsys.readouterr()
    text = "".join(told) + out
    assert ended == status and says in err and len(err.splitlines()) == 1
    order = [text.index(words) for words in ("first words", "second words", "Newton stopped")]
    assert order == sorted(order)
    assert f"mpm resume {run.path}" in text


@pytest.mark.parametrize("fidelity", ["averaged", "steady"])
def test_a_run_that_fails_before_its_first_step_is_no_killed_one(
    fidelity: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when the end of a run without a flow is told as one from outside, or pictures of nothing are offered."""

    def fail(*_: object) -> None:
        raise ConvergenceError("steady flow: not found")

    monkeypatch.setattr("mpm.reactor.system.find_flow", fail)
    path = tmp_path / "run"
    with pytest.raises(ConvergenceError):
        Reactor(zone({**SHORT, "fidelity": fidelity}, TINY), MPI.COMM_SELF).run(path)
    assert main(["watch", str(path)]) == 3
    out, err = capsys.readouterr()
    assert err == f"{path}: the run has failed: steady flow: not found\n"
    assert f"mpm resume {path}" in out and "mpm plot" not in out


def test_what_is_no_run_is_not_watched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a directory without a run is watched for ever."""
    assert main(["watch", str(tmp_path)]) == 2
    assert "nothing to watch" in capsys.readouterr().err


@pytest.mark.parametrize("module", ["cli.watch", "output.compare", "case.kinds", "output.rundirs"])
def test_what_only_rank_0_loads_starts_no_mpi(module: str) -> None:
    """Fails when a verb that one rank alone carries out would wait in MPI's start for the others, for ever."""
    code = f"import sys, mpm.{module}; sys.exit('mpi4py.MPI' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=120).returncode == 0
