"""Where points run: threads of the driver (each waiting for one process), a Dask cluster, or Slurm through Dask.

All three are `concurrent.futures.Executor`s, so that the driver knows no difference. A point is one task of one
thread of a worker: start workers with `--nthreads` = the number of points that their machine should run at a time.
The sweep's directory must be on storage that the workers share, and they need the same mpm; both are checked.
"""

import contextlib
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.errors import InputError

CONNECT_SECONDS = 10.0
SLURM_OWN = ("points_per_job", "workers")
"""Keys of [sweep.slurm] that are ours; all others go to dask_jobqueue.SLURMCluster as they are."""


class PoolLost(Exception):
    """Nobody runs points any more."""


@dataclass(frozen=True)
class Pool:
    """An executor, the number of points it runs at a time (it may change; PoolLost), and its name for people."""

    executor: Executor
    slots: Callable[[], int]
    label: str


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise InputError("--scheduler needs Dask: pip install 'mpm[sweep]'") from None
    return distributed


@contextlib.contextmanager
def local_pool(jobs: int) -> Iterator[Pool]:
    """`jobs` points at a time on this machine; needs nothing installed and no server."""
    with ThreadPoolExecutor(jobs, thread_name_prefix="point") as executor:
        yield Pool(executor, lambda: jobs, f"{jobs} at a time on this machine")


@contextlib.contextmanager
def dask_pool(address: Any, label: str) -> Iterator[Pool]:
    """The workers of a running Dask scheduler (`tcp://host:8786`, or a cluster object)."""
    distributed = _distributed()
    logging.getLogger("distributed.client").setLevel(
        logging.CRITICAL
    )  # tracebacks of a lost scheduler: PoolLost says it
    try:
        client = distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError.at(
            None,
            "--scheduler",
            f"{address!r} ({reason})",
            "the address of a running Dask scheduler, or slurm",
        ) from None

    def slots() -> int:
        try:
            return sum(client.nthreads().values())
        except (OSError, TimeoutError) as error:
            raise PoolLost(f"{label} does not answer any more") from error

    with client:
        # pure=False: the driver, not Dask's cache, knows which points are finished
        executor = client.get_executor(pure=False)
        yield Pool(executor, slots, label)


def slurm_options(options: Mapping[str, Any], ranks: int, log: Path) -> dict[str, Any]:
    """Arguments of SLURMCluster for [sweep.slurm]: one Dask worker per job, `points_per_job` points at a time in it.

    `cores` is what Dask calls the worker's threads; Slurm is asked for points_per_job x ranks processors.
    """
    points = options.get("points_per_job", 1)
    return {
        "cores": points,
        "processes": 1,
        "job_cpu": points * ranks,
        "memory": f"{4 * points * ranks} GB",
        "walltime": "08:00:00",
        "python": sys.executable,
        "log_directory": str(log),
    } | {key: value for key, value in options.items() if key not in SLURM_OWN}


@contextlib.contextmanager
def slurm_pool(options: Mapping[str, Any], ranks: int, log: Path) -> Iterator[Pool]:
    """Submits `workers` Slurm jobs, each a Dask worker, for as long as the sweep lasts."""
    _distributed()
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise InputError("--scheduler slurm needs dask-jobqueue: pip install 'mpm[sweep]'") from None
    workers = options.get("workers", 1)
    try:
        cluster = SLURMCluster(**slurm_options(options, ranks, log))
    except (TypeError, ValueError) as error:
        raise InputError.at(
            None,
            "sweep.slurm",
            str(error),
            "workers, points_per_job and arguments of dask_jobqueue.SLURMCluster",
        ) from None
    with cluster:
        try:
            cluster.scale(jobs=workers)
        except (OSError, RuntimeError) as error:
            raise InputError(f"--scheduler slurm: jobs cannot be submitted: {error}") from None
        with dask_pool(cluster, f"{workers} Slurm jobs") as pool:
            yield pool


def open_pool(
    scheduler: str | None, jobs: int, ranks: int, slurm: Mapping[str, Any], log: Path
) -> contextlib.AbstractContextManager[Pool]:
    """The pool that the command line asked for."""
    if scheduler is None:
        return local_pool(jobs)
    if scheduler == "slurm":
        return slurm_pool(slurm, ranks, log)
    return dask_pool(scheduler, f"the Dask cluster at {scheduler}")
