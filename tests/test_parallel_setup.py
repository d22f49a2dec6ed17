"""The test set-up itself: a failure on one rank fails the whole run, and a rank left waiting does not hang it."""

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

TESTS = """
import pytest
from mpi4py import MPI

RANK = MPI.COMM_WORLD.rank

def test_passes(tmp_path):
    assert len(set(MPI.COMM_WORLD.allgather(str(tmp_path)))) == 1

def test_fails_on_the_second_rank():
    assert RANK != 1, "only here"

@pytest.fixture
def broken():
    assert RANK != 1

def test_set_up_fails_on_the_second_rank(broken):
    MPI.COMM_WORLD.barrier()
"""
HANGS = """
from mpi4py import MPI

def test_leaves_the_first_rank_waiting():
    assert MPI.COMM_WORLD.rank != 1, "not coming"
    MPI.COMM_WORLD.barrier()
"""


def run(mpirun: Callable[[int], list[str]], folder: Path, tests: str) -> subprocess.CompletedProcess[str]:
    shutil.copy(Path(__file__).with_name("conftest.py"), folder)
    (folder / "pytest.ini").write_text("[pytest]\n")
    (folder / "test_inner.py").write_text(tests)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    return subprocess.run(
        [*mpirun(2), "-m", "pytest", str(folder)],
        env=environment | {"MPM_TEST_GRACE": "1"}, cwd=folder, capture_output=True, text=True, timeout=120,
    )  # fmt: skip


def test_failure_on_one_rank_is_everyones(mpirun: Callable[[int], list[str]], tmp_path: Path) -> None:
    """Fails when rank 0 reports success though another rank failed, or when more than one rank prints."""
    done = run(mpirun, tmp_path, TESTS)
    assert done.returncode != 0
    assert done.stdout.count("test session starts") == 1
    assert re.search(r"1 failed, 1 passed, (\d+ warnings?, )?1 error", done.stdout)
    assert "rank 1 of 2" in done.stdout and "only here" in done.stdout


def test_waiting_rank_does_not_hang_the_run(mpirun: Callable[[int], list[str]], tmp_path: Path) -> None:
    """Fails (by its time limit) when ranks wait for one that has left the test, or its message is lost."""
    try:
        done = run(mpirun, tmp_path, HANGS)
    except subprocess.TimeoutExpired:
        pytest.fail("the run hangs")
    assert done.returncode != 0
    assert "other ranks did not finish, aborting" in done.stderr and "not coming" in done.stderr
