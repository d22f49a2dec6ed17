"""Which of several processes this one is, before MPI is loaded: only a start that MPI itself would take for a job counts.

A batch system numbers its tasks whether they form one MPI job or not: `srun -n 8 mpm check` without an MPI plugin are eight serial
programs, each with its own SLURM_PROCID. So a number counts only beside what MPI_Init would use to find the other processes.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping

_LAUNCHERS = (
    # number of this process, number of processes, what shows that the launcher is there
    ("PMI_RANK", "PMI_SIZE", "PMI_FD"),  # MPICH's and Intel's mpirun, srun --mpi=pmi2
    ("PMI_RANK", "PMI_SIZE", "PMI_PORT"),  # the same across hosts
    ("PMI_RANK", "PMI_SIZE", "PMI_CONTROL_PORT"),  # Cray PALS
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE", "PMIX_NAMESPACE"),  # Open MPI's mpirun
    ("PMIX_RANK", "SLURM_STEP_NUM_TASKS", "PMIX_NAMESPACE"),  # srun --mpi=pmix
)


def rank() -> int:
    """This process's rank: from MPI once it is loaded, else from the MPI launcher that started it; 0 in a serial run."""
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None and mpi.Is_initialized() and not mpi.Is_finalized():
        return int(mpi.COMM_WORLD.rank)
    return launched_rank(os.environ)


def launched_rank(environment: Mapping[str, str]) -> int:
    """Rank that an MPI launcher gave to this process; 0 without one, and in a job of one process."""
    for number, size, sign in _LAUNCHERS:
        rank, processes = _whole(environment.get(number)), _whole(environment.get(size))
        if processes > 1 and 0 <= rank < processes and _is_there(sign, environment.get(sign)):
            return rank
    return 0


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
