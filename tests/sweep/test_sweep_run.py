"""Sweeps at work: how many at a time, failures as rows, what a point inherits, mpirun, refusals."""

import json
import sys
from typing import Any

import numpy as np

from .conftest import Bench

SPEEDS = ("0.5 cm/s", "1.3 cm/s", "2 cm/s", "3 cm/s")


def test_forty_points_two_at_a_time(bench: Bench) -> None:
    """Fails when points run alone, in threes, twice, or the table misses one or their order."""
    gammas = [round(0.10 + 0.01 * index, 2) for index in range(10)]
    bench.sweep(str(gammas), SPEEDS)
    status, messages = bench.run()
    assert status == 0, messages
    assert set(bench.names("start").values()) == {1} and len(bench.names("stop")) == 40
    changes = sorted(
        [(float(event[2]), 1) for event in bench.events("start")]
        + [(float(event[2]), -1) for event in bench.events("stop")]
    )
    assert max(np.cumsum([change for _, change in changes])) == 2
    table = bench.table()
    assert list(table.status) == ["done"] * 40
    assert list(table.gamma) == [gamma for gamma in gammas for _ in SPEEDS]
    assert np.array_equal(table["titration.tma.exit_mean"], table.gamma * table.speed)
    assert "0 running" in messages and "40 done" in messages and " left" in messages
    assert messages.splitlines()[-2] == "Next:" and "mpm report" in messages.splitlines()[-1]


def test_failures_are_rows_and_stop_nothing(bench: Bench) -> None:
    """Fails when a failing point stops the sweep, or its status or last error line is not in the table."""
    bench.sweep("[0.3, 0.77, 0.66, 0.88, 0.55, -1.0, 0.4]", more='columns = ["cvd.rate_mean"]')
    status, messages = bench.run()
    assert status == 3, messages  # one was killed and one crashed: calling again could help
    table = bench.table().set_index("gamma")
    assert list(table.columns) == ["speed", "status", "cvd.rate_mean", "error", "point"]
    assert table.status.to_dict() == {
        0.3: "done",
        0.77: "failed",
        0.66: "bad_input",
        0.88: "killed",
        0.55: "crashed",
        -1.0: "bad_input",
        0.4: "done",
    }
    errors = table.error.dropna().to_dict()
    assert errors[0.77] == "error: step 3: the coverage's Newton iteration stalls at residual 1e-2"
    assert errors[0.66] == "error: this input only the solver can refuse"
    assert errors[0.88] == "killed by SIGKILL"
    assert errors[0.55] == "ValueError: a defect of the program"
    assert "motion.gamma: found -1.0" in errors[-1.0]
    assert table["cvd.rate_mean"].notna().sum() == 2
    bench.run()
    again = {table.point[gamma] for gamma in (0.88, 0.55)}  # verdicts stay, accidents are tried again
    assert {name for name, times in bench.names("start").items() if times == 2} == again


def test_failures_alone_are_a_verdict(bench: Bench) -> None:
    """Fails when a sweep whose every point has a verdict asks to be called again."""
    bench.sweep("[0.3, 0.77]")
    assert bench.run()[0] == 0
    bench.sweep("[0.77]")
    assert bench.run("other")[0] == 3  # nothing at all came out


def test_points_inherit_no_launcher_and_one_thread(bench: Bench) -> None:
    """Fails when a point could take itself for a rank of the driver's MPI job, or use the neighbours' cores."""
    bench.environment = {"PMI_RANK": "1", "PMI_SIZE": "4", "PMIX_RANK": "1", "SLURM_JOB_ID": "7"}
    bench.environment |= {"OMP_NUM_THREADS": "8", "MY_OWN": "kept"}
    bench.sweep("[0.1]")
    assert bench.run()[0] == 0
    (file,) = (bench.path / "out" / "points").glob("*/environment.json")
    seen = {name: value for name, value in json.loads(file.read_text()).items() if value is not None}
    assert seen == {"OMP_NUM_THREADS": "1", "MY_OWN": "kept"}


RANKS = """
import json, os, signal, sys, time
from pathlib import Path
from mpi4py import MPI

world = MPI.COMM_WORLD
time.sleep(0.5 if world.size == 2 else 0.0)
out = Path(sys.argv[3])
if world.rank == 0:
    out.mkdir(parents=True, exist_ok=True)
    (out / "summary.json").write_text(json.dumps({"status": "done", "ranks": world.size}))
if "0.77" in Path(sys.argv[1]).read_text():
    if world.rank == 0:
        print("error: Newton stalls", file=sys.stderr, flush=True)
    sys.exit(3)
if "0.88" in Path(sys.argv[1]).read_text() and world.rank == 1:
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_points_under_mpirun(bench: Bench, mpirun: Any) -> None:
    """Fails when ranks do not find each other (inherited PMI variables), or mpirun's chatter hides status or error."""
    (bench.path / "ranks.py").write_text(RANKS)
    bench.environment = {"PMI_RANK": "0", "PMI_SIZE": "1", "PMI_FD": "7"}
    bench.sweep("[0.1, 0.77, 0.88]", more='columns = ["ranks"]')
    status, messages = bench.run(jobs=1, ranks=2, command=[sys.executable, str(bench.path / "ranks.py")])
    assert status == 3, messages
    table = bench.table()
    assert table.ranks[0] == 2
    assert list(table.status) == ["done", "failed", "killed"]
    assert table.error[1] == "error: Newton stalls"


def test_a_second_driver_and_a_foreign_directory_are_refused(bench: Bench) -> None:
    """Fails when two drivers share a directory, or a sweep writes among somebody's files."""
    bench.delay = 60.0
    bench.sweep("[0.1]")
    first = bench.start()
    bench.wait_for(lambda: len(bench.events("start")) == 1)
    status, messages = bench.run()
    assert status == 2 and "another mpm sweep is at work in this directory" in messages
    first.terminate()
    assert first.wait(timeout=30) == 130
    (bench.path / "mine").mkdir()
    (bench.path / "mine" / "thesis.txt").write_text("years of work")
    status, messages = bench.run("mine")
    assert status == 2 and "not empty and no sweep" in messages
    assert [file.name for file in (bench.path / "mine").iterdir()] == ["thesis.txt"]


def test_a_broken_sweep_file_writes_nothing(bench: Bench) -> None:
    """Fails when a typo costs more than its one line: exit status 2, no directory."""
    bench.sweep("[0.1]", more='mod = "grid"')
    status, messages = bench.run()
    assert status == 2 and messages.count("\n") == 1 and "mean mode" in messages
    assert not (bench.path / "out").exists()
