"""`mpm sweep`: plans, runs what has no verdict yet, and keeps the table. Never imports MPI or the solver.

Everything that must survive is in files when it happens: the guard writes a point's verdict, the driver only reads
verdicts. Killing the driver at any moment therefore loses nothing, and the next call goes on from the files.
"""

import contextlib
import os
import queue
import shlex
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import Any, NoReturn

from mpm.advice.checks import check_case
from mpm.errors import InputError
from mpm.files import lock, write_atomically
from mpm.screen import print_steps, screen
from mpm.signals import stop_signals
from mpm.sweep.board import Board, now, say
from mpm.sweep.cluster import Pool, PoolLost, open_pool
from mpm.sweep.layout import Layout, read_json
from mpm.sweep.lease import Lease
from mpm.sweep.pictures import draw
from mpm.sweep.plan import Point, plan
from mpm.sweep.point import GRACE, Task, finished, mpirun, program, run_point
from mpm.sweep.results import Results
from mpm.sweep.sweepfile import read_sweep
from mpm.sweep.table import write_csv

SAVE_EVERY = 2.0
"""Least seconds between two writes of results.csv while points run."""
SAVE_SHARE = 0.05
"""Most of the driver's time that these writes, whose cost grows with the table, may take."""
INCOMPLETE = 3
INTERRUPTED = 130


def run_sweep(
    path: str | Path,
    output: str | Path | None = None,
    jobs: int | None = None,
    ranks: int | None = None,
    scheduler: str | None = None,
    *,
    command: Sequence[str] = (),
    live: bool | None = None,
) -> int:
    """Run or go on with the sweep that the file `path` describes; returns the exit status.

    output: the sweep's directory (default results/<stem of path>); jobs: points at a time on this machine (default:
    processors / ranks); ranks: MPI ranks per point (default: the file's, else 1); scheduler: None, the address of a
    Dask scheduler, or "slurm"; command: instead of `python -m mpm run`; live: a live line instead of a line per
    point (default: when standard error is a terminal).

    0: every point has a verdict, be it failure; 3: points were killed or crashed, or none is done: the same call
    tries them again; 130: interrupted. InputError for a broken sweep file, before anything is written.
    """
    sweep = read_sweep(path)
    ranks = sweep.ranks if ranks is None else ranks
    for option, number in (("--jobs", jobs), ("--ranks", ranks)):
        if number is not None and number < 1:
            raise InputError.at(None, option, str(number), "a whole number of at least 1")
    if jobs is not None and scheduler is not None:
        say("-j does not apply with --scheduler: the workers' threads say how many points run at a time")
    jobs = jobs or max(1, len(os.sched_getaffinity(0)) // ranks)
    if ranks > 1 and not command:
        mpirun()
    if sweep.idle:
        say(f"has no effect in mode {sweep.mode}: {', '.join(sweep.idle)}")
    points = plan(sweep)
    layout = Layout(Path(output or Path("results") / sweep.path.stem).absolute())
    if layout.root.exists() and not layout.driver.exists() and any(layout.root.iterdir()):
        raise InputError.at(
            None, "--output", f"{layout.root}, not empty and no sweep", "a new or a sweep's directory"
        )
    layout.driver.mkdir(parents=True, exist_ok=True)
    with sole_driver(layout), stop_signals(_interrupt, (signal.SIGTERM, signal.SIGHUP)):
        earlier = read_json(layout.root / "sweep.json")
        results = Results(sweep, points, layout)
        for sentence in changes(results, earlier):
            say(sentence)
        for sentence in warnings_of(points):
            say(sentence)
        opening = open_pool(scheduler, jobs, ranks, sweep.slurm, layout.driver)
        return _drive(results, opening, ranks, command, sys.stderr.isatty() if live is None else live)


def warnings_of(points: Sequence[Point]) -> list[str]:
    """What `mpm check` warns of at the first point that has a case: the others have most of it in common."""
    case = next(point.case for point in points if point.case is not None)
    return [f"warning, at the first point: {sentence}" for sentence in check_case(case)["warnings"]]


@contextlib.contextmanager
def sole_driver(layout: Layout) -> Iterator[None]:
    """Hold the directory's lock; InputError when another driver does. It goes with the process, however that ends."""
    try:
        stream = lock(layout.driver / "lock")
    except BlockingIOError:
        raise InputError(f"{layout.root}: another mpm sweep is at work in this directory") from None
    with stream:
        yield


def _interrupt() -> NoReturn:
    """SIGTERM and SIGHUP stop the sweep like Ctrl-C."""
    raise KeyboardInterrupt


def changes(results: Results, earlier: dict[str, Any]) -> list[str]:
    """What differs from the last call in this directory, in sentences: case, sweep, program."""
    layout, names = results.layout, {point.name for point in results.points}
    sentences = []
    if earlier and earlier.get("base_hash") != results.sweep.base.content_hash():
        sentences.append("the base case or its fixed overrides have changed since the last call")
    runs = layout.root / "points"
    foreign = [run for run in (runs.iterdir() if runs.exists() else ()) if run.name not in names]
    if foreign:
        sentences.append(
            f"{len(foreign)} earlier points in {runs} do not belong to this sweep any more; they are kept"
        )
    done = {name: record for name, record in results.records.items() if results.states[name] == "done"}
    old = {name: record for name, record in done.items() if record.get("program") != program()}
    if old:
        versions = ", ".join(sorted({str(record.get("program")) for record in old.values()}))
        sentences.append(
            f"the program has changed: {len(old)} finished points were computed by {versions}, this is {program()}; "
            "they are kept (another output directory computes them again)"
        )
    if done:
        sentences.append(f"{len(done)} of {len(names)} points are finished already")
    return sentences


def tasks_to_run(results: Results, lease: Lease, ranks: int, command: Sequence[str]) -> list[Task]:
    """A task for every distinct point without a verdict, its resolved case written for it."""
    layout = results.layout
    tasks: dict[str, Task] = {}
    for point in results.points:
        if point.case is None or finished(results.records[point.name], layout.run(point.name), program()):
            continue
        if point.name not in tasks:
            write_atomically(layout.case(point.name), point.case.to_toml())
            tasks[point.name] = Task(
                root=str(layout.root),
                name=point.name,
                program=program(),
                lease=lease.token,
                ranks=ranks,
                command=tuple(command),
            )
    return list(tasks.values())


def _drive(
    results: Results,
    opening: contextlib.AbstractContextManager[Pool],
    ranks: int,
    command: Sequence[str],
    live: bool,
) -> int:
    """Run the tasks on the pool, keep the table, and write everything at the end, interrupted or not."""
    layout = results.layout
    about: dict[str, Any] = {"started": now(), "ranks": ranks}
    clock, processor = time.monotonic(), time.process_time()
    # The lease is left before the pool, whose end waits for the points that the lease stops.
    with opening as pool, Lease(layout.driver / "lease") as lease:
        about["where"] = pool.label
        tasks = tasks_to_run(results, lease, ranks, command)
        results.save(about)
        say(f"{results.sweep.title}: {len(results.points)} points, {len(tasks)} to run, {pool.label}")
        collector = Collector(results, pool, live)
        interrupted = collector.run(tasks, lease)
    about |= {
        "ended": now(),
        "wall_seconds": time.monotonic() - clock,
        "points_seconds": collector.seconds,
        "driver_processor_seconds": time.process_time() - processor,
    }
    results.save(about)
    if not results.save_parquet():
        say("results.parquet is not written: pyarrow is not installed (pip install 'mpm[sweep]')")
    counts = results.counts()
    say(
        ", ".join(f"{number} {status}" for status, number in counts.items())
        + f"; table in {layout.root}/results.csv"
    )
    if interrupted:
        return INTERRUPTED
    for name in results.missing_columns():
        say(f"no finished point reports {name}")
    draw(layout.root)
    if counts["done"]:
        root = layout.root
        shown = root.relative_to(Path.cwd()) if root.is_relative_to(Path.cwd()) else root
        steps = [(f"mpm report {shlex.quote(str(shown))}", "maps on one page, whose points open their runs")]
        print_steps(steps, screen(stderr=True))
    settled = counts["done"] + counts["failed"] + counts["bad_input"]
    return 0 if counts["done"] and settled == len(results.points) else INCOMPLETE


class Collector:
    """Hands tasks to a pool and takes their ends as they come, in whatever order."""

    def __init__(self, results: Results, pool: Pool, live: bool) -> None:
        self.results = results
        self.pool = pool
        self.live = live
        self.seconds = 0.0
        """Sum of the points' own times in this call."""
        self._ended: queue.SimpleQueue[Future[dict[str, Any]]] = queue.SimpleQueue()
        self._names: dict[Future[dict[str, Any]], str] = {}
        self._next_save = 0.0

    def run(self, tasks: Sequence[Task], lease: Lease) -> bool:
        """Until every task has ended; True when a signal put an earlier end to it."""
        ours = {task.name for task in tasks}
        counts = Counter(state for name, state in self.results.states.items() if name not in ours)
        with Board(self.results.sweep.title, counts, len(tasks), self.pool.slots, self.live) as board:
            try:
                for task in tasks:
                    future = self.pool.executor.submit(run_point, task)
                    self._names[future] = task.name
                    future.add_done_callback(self._ended.put)
                while self._names:
                    self._take(board)
            except PoolLost as loss:
                say(f"{loss}; what is finished is kept")
            except KeyboardInterrupt:
                say(f"interrupted; running points get {GRACE:g} s to save their restart state")
                lease.revoke()
                deadline = time.monotonic() + GRACE + 5.0
                while self._names and time.monotonic() < deadline:
                    self._take(board)
                return True
        return False

    def _take(self, board: Board) -> None:
        """Take one end, or let a second pass."""
        try:
            future = self._ended.get(timeout=1.0)
        except queue.Empty:
            board.refresh()
            return
        name = self._names.pop(future)
        try:
            record = future.result()
        except InputError:  # this worker can run none of the points
            raise
        except CancelledError as error:  # we cancel nothing: Dask does when its scheduler is lost
            raise PoolLost(f"{self.pool.label} is lost") from error
        except (
            Exception
        ) as error:  # Dask gave up on a point that took its workers with it, in many classes of error
            say(f"{name}: {type(error).__name__}: {error}".splitlines()[0])
            record = {"exit_status": 128 + signal.SIGKILL}
        self.results.note(name, record)
        took = float(record.get("seconds", 0.0))
        self.seconds += took
        board.update(name, status=self.results.states[name], error=self.results.errors[name], seconds=took)
        if time.monotonic() >= self._next_save:
            self._save()

    def _save(self) -> None:
        """Write results.csv for those who look on. A full disk is no reason to stop points that have room: the verdicts are theirs."""
        began = time.monotonic()
        try:
            write_csv(self.results.layout.root / "results.csv", self.results.columns(), self.results.rows())
        except OSError as error:
            say(f"results.csv cannot be written now ({error.strerror})")
        took = time.monotonic() - began
        self._next_save = time.monotonic() + max(SAVE_EVERY, took / SAVE_SHARE)
