"""Which of several processes this one is, before MPI is loaded: only a start that MPI itself would take for a job counts. And how they
share the machine.

A batch system numbers its tasks whether they form one MPI job or not: `srun -n 8 mpm check` without an MPI plugin are eight serial
programs, each with its own SLURM_PROCID. So a number counts only beside what MPI_Init would use to find the other processes.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, MutableMapping
from pathlib import Path

_LAUNCHERS = (
    # number of this process, number of processes, what shows that the launcher is there
    ("PMI_RANK", "PMI_SIZE", "PMI_FD"),  # MPICH's and Intel's mpirun, srun --mpi=pmi2
    ("PMI_RANK", "PMI_SIZE", "PMI_PORT"),  # the same across hosts
    ("PMI_RANK", "PMI_SIZE", "PMI_CONTROL_PORT"),  # Cray PALS
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "PMIX_NAMESPACE"),  # Open MPI's mpirun
    ("PMIX_RANK", "SLURM_STEP_NUM_TASKS", "PMIX_NAMESPACE"),  # srun --mpi=pmix
)
SCHEDULER = Path("/proc/self/schedstat")
"""Nanoseconds on a core, nanoseconds waiting for one, time slices of this process (Linux: Documentation/scheduler/sched-stats.rst)."""
CROWDED = 1.5
"""Waiting for a core over having one, from which ranks do not poll: sleeping was measured better at 2 to 4; below, one sample says not."""


def rank() -> int:
    """This process's rank: from MPI once it is loaded, else from the MPI launcher that started it; 0 in a serial run."""
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None and mpi.Is_initialized() and not mpi.Is_finalized():
        return int(mpi.COMM_WORLD.rank)
    return launched_rank(os.environ)


def launched_rank(environment: Mapping[str, str]) -> int:
    """Rank that an MPI launcher gave to this process; 0 without one, and in a job of one process."""
    return _place(environment)[0]


def share_cores(environment: MutableMapping[str, str], statistics: Path = SCHEDULER) -> None:
    """How the ranks of a job use the cores, where the user has not said it; to be called before MPI and PETSc are loaded.

    One thread each: the ranks are the parallelism. A rank of MPICH polls while it waits for another, which is quickest where each has a
    core, and takes from the others the time that they need where cores are short: where this process has waited far longer than it has
    run during its start, it sleeps between two looks instead. That costs 0.15 ms per reduction on a free machine; on a crowded one, 0.7 ms
    of work and a reduction took 4.3 instead of 5.0 ms, and 0.85 instead of 1.1 ms of processor time (two ranks, nine busy processes on
    two cores, medians of six).
    """
    if _place(environment)[1] == 1:
        return
    environment.setdefault("OMP_NUM_THREADS", "1")
    if _kept_waiting(statistics) > CROWDED:
        environment.setdefault("MPIR_CVAR_ENABLE_HEAVY_YIELD", "1")


def _kept_waiting(statistics: Path) -> float:
    """Time that this process has waited for a core over the time that it has had one: 0 on a free machine, 1 where two share each core."""
    try:
        had, waited, *_ = map(int, statistics.read_text(encoding="ascii").split())
    except (OSError, ValueError):  # not Linux, or a kernel that does not count
        return 0.0
    return waited / max(had, 1)


def _place(environment: Mapping[str, str]) -> tuple[int, int]:
    """Rank and number of processes that an MPI launcher gave; (0, 1) without one."""
    for number, size, sign in _LAUNCHERS:
        rank, processes = _whole(environment.get(number)), _whole(environment.get(size))
        if processes > 1 and 0 <= rank < processes and _is_there(sign, environment.get(sign)):
            return rank, processes
    return 0, 1


def _whole(text: str | None) -> int:
    return int(text) if text is not None and text.isascii() and text.isdigit() else -1


def _is_there(sign: str, value: str | None) -> bool:
    """A descriptor must be open: what a rank starts inherits the number in the environment, but not the connection."""
    if sign != "PMI_FD":
        return bool(value)
    try:
        os.fstat(_whole(value))
    except (OSError, OverflowError):
        return False
    return True
