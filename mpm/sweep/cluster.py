"""Where points run: threads of the driver (each waiting for one process), a Dask cluster, or Slurm through Dask.

All three are `concurrent.futures.Executor`s, so that the driver knows no difference. A point is one task of one
thread of a worker: start workers with `--nthreads` = the number of points that their machine should run at a time.
The sweep's directory must be on storage that the workers share, and they need the same mpm; both are checked.
"""

import asyncio
import contextlib
import logging
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from mpm.errors import InputError, MpmError
from mpm.sweep.board import say
from mpm.sweep.point import last_line

CONNECT_SECONDS = 10.0
SUBMIT_SECONDS = 120.0
"""Patience with one sbatch; a controller that is busy makes it wait."""
QUEUE_SECONDS = 15.0
"""Between two looks into Slurm's queue while no worker is connected, and before the first."""
REMIND_SECONDS = 600.0
"""Between two sentences that say what is waited for."""
SLURM_OWN = ("points_per_job", "workers")
"""Keys of [sweep.slurm] that are ours; all others go to dask_jobqueue.SLURMCluster as they are."""


class PoolLost(MpmError):
    """Nobody runs points any more, or ever did; the points keep what they have."""

    exit_status = 3


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


def greet(address: str) -> None:
    """Raise an error of some class unless a Dask scheduler answers at `address` within `CONNECT_SECONDS`.

    In a thread of its own, which is left alone when it hangs: against a listener that never says a word (a port of
    something else) neither `distributed.Client` nor its `connect` keeps to the timeout it is given.
    """
    from distributed.comm import connect

    outcome: queue.SimpleQueue[Exception | None] = queue.SimpleQueue()

    async def shake_hands() -> None:
        (await connect(address, timeout=CONNECT_SECONDS)).abort()

    def run() -> None:
        try:
            asyncio.run(shake_hands())
        except Exception as error:
            outcome.put(error)
        else:
            outcome.put(None)

    threading.Thread(target=run, name="greeting", daemon=True).start()
    try:
        error = outcome.get(timeout=CONNECT_SECONDS + 2.0)
    except queue.Empty:
        raise TimeoutError(f"nothing answers within {CONNECT_SECONDS:g} s") from None
    if error is not None:
        raise error


class Waiting:
    """Says what is waited for while no worker is connected; `look` returns it, or raises PoolLost when none will come."""

    def __init__(self, look: Callable[[], str]) -> None:
        self._look = look
        self._next = time.monotonic() + QUEUE_SECONDS
        self._said = ("", 0.0)

    def update(self, slots: int) -> None:
        """To be called every second or so with the number of points that can run."""
        now = time.monotonic()
        if slots > 0:
            self._next, self._said = now + QUEUE_SECONDS, ("", 0.0)
        elif now >= self._next:
            self._next, text = now + QUEUE_SECONDS, self._look()
            last, when = self._said
            if text != last or now > when + REMIND_SECONDS:
                say(
                    f"no worker is connected: waiting for {text}; Ctrl-C ends the sweep and keeps what is finished"
                )
                self._said = (text, now)


@contextlib.contextmanager
def dask_pool(address: Any, label: str, look: Callable[[], str] | None = None) -> Iterator[Pool]:
    """The workers of a running Dask scheduler (`tcp://host:8786`, or a cluster object); `look` as for `Waiting`."""
    distributed = _distributed()
    logging.getLogger("distributed.client").setLevel(
        logging.CRITICAL
    )  # tracebacks of a lost scheduler: PoolLost says it
    try:
        if isinstance(address, str):
            greet(address)
        client = distributed.Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except Exception as error:  # of many classes: no host, no port, no TLS, another program's port
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError.at(
            None,
            "--scheduler",
            f"{address!r} ({reason})",
            "the address of a running Dask scheduler, or slurm",
        ) from None
    waiting = Waiting(look or (lambda: f"workers of {label}"))

    def slots() -> int:
        try:
            number: int = sum(client.nthreads().values())
        except (OSError, TimeoutError) as error:
            raise PoolLost(f"{label} does not answer any more") from error
        waiting.update(number)
        return number

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


def submit(command: list[str]) -> str:
    """What a submitting command prints; RuntimeError with what it says when it fails, OSError when there is none."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SUBMIT_SECONDS)
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"{command[0]} does not answer within {SUBMIT_SECONDS:g} s") from None
    except OSError as error:
        raise RuntimeError(f"{command[0]} cannot be started ({error.strerror})") from None
    if done.returncode:
        said = " ".join((done.stderr.strip() or done.stdout.strip()).split())
        raise RuntimeError(said or f"{command[0]} ended with status {done.returncode} and without a word")
    return done.stdout


def watched_job() -> Any:
    """A class of Slurm jobs that keeps the refusals of sbatch, instead of raising them in a task that nobody awaits.

    A job that was refused counts as started, so that the cluster can be closed in the ordinary way.
    """
    from dask_jobqueue.slurm import SLURMJob
    from distributed.core import Status

    class Job(SLURMJob):
        submitted: ClassVar[list[str]] = []
        refused: ClassVar[list[str]] = []

        async def _submit_job(self, script_filename: str) -> str:
            return await asyncio.to_thread(submit, [self.submit_command, script_filename])

        async def start(self) -> None:
            try:
                await super().start()
            except (
                RuntimeError,
                ValueError,
                OSError,
            ) as error:  # sbatch printed no number; no room for its script
                self.refused.append(" ".join(str(error).split()))
                self.status = Status.running
            else:
                self.submitted.append(str(self.job_id))

        @classmethod
        async def _close_job(cls, job_id: str, cancel_command: str) -> None:
            with contextlib.suppress(OSError):  # no scancel: the job ends with its scheduler
                await super()._close_job(job_id, cancel_command)

    return Job


def queue_states(jobs: list[str]) -> dict[str, str] | None:
    """State and reason of those of the `jobs` that Slurm still has, e.g. {"7": "PENDING (Resources)"}; None: not known."""
    try:
        answer = subprocess.run(
            ["squeue", "--noheader", f"--jobs={','.join(jobs)}", "--format=%i|%T (%r)"],
            capture_output=True,
            text=True,
            timeout=CONNECT_SECONDS,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    if answer.returncode and "Invalid job id" not in answer.stderr:
        return None
    lines = (line.strip().partition("|") for line in answer.stdout.splitlines())
    return {job: state for job, _, state in lines if state}


def look_at_queue(jobs: list[str], log: Path) -> str:
    """What the jobs are waiting for; PoolLost when Slurm has none of them any more."""
    states = queue_states(jobs)
    if states is None:
        return f"Slurm jobs {', '.join(jobs)} (squeue does not tell their state)"
    if states:
        return "Slurm: " + ", ".join(f"job {job} is {state}" for job, state in states.items())
    logs = sorted(log.glob("*.err"), key=lambda file: file.stat().st_mtime)
    hint = f"; the last lines of {logs[-1]} are: {last_line(logs[-1])}" if logs else ""
    raise PoolLost(f"all Slurm jobs ({', '.join(jobs)}) have ended{hint}")


@contextlib.contextmanager
def slurm_pool(options: Mapping[str, Any], ranks: int, log: Path) -> Iterator[Pool]:
    """Submits `workers` Slurm jobs, each a Dask worker, for as long as the sweep lasts.

    PoolLost when Slurm takes none of them, or when all have ended and points remain.
    """
    _distributed()
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise InputError("--scheduler slurm needs dask-jobqueue: pip install 'mpm[sweep]'") from None
    workers = options.get("workers", 1)
    job = watched_job()
    try:
        cluster = SLURMCluster(**slurm_options(options, ranks, log), job_cls=job)
    except (TypeError, ValueError, RuntimeError) as error:
        raise InputError.at(
            None,
            "sweep.slurm",
            str(error),
            "workers, points_per_job and arguments of dask_jobqueue.SLURMCluster",
        ) from None
    with cluster:
        cluster.scale(jobs=workers)
        while len(job.submitted) + len(job.refused) < workers:
            time.sleep(0.05)
        if not job.submitted:
            raise PoolLost(f"--scheduler slurm: no job could be submitted: {job.refused[0]}")
        if job.refused:
            say(f"{len(job.refused)} of {workers} Slurm jobs could not be submitted: {job.refused[0]}")
        label = f"{len(job.submitted)} Slurm jobs"
        with dask_pool(cluster, label, lambda: look_at_queue(job.submitted, log)) as pool:
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
