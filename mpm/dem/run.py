"""All seeds of a powder file: side by side in processes, or over groups of MPI ranks; then the report."""

import faulthandler
import multiprocessing
import os
import queue
import shutil
import signal
import time
import traceback
from contextlib import ExitStack
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from mpm.errors import ConvergenceError, InputError, Interrupted, storage_error
from mpm.files import lock, write_atomically

from .analysis import analyse
from .box import load_lammps
from .case import DemCase, load_case
from .report import draw, write_summary, write_tables
from .screen import Report, cycles_done, silent
from .simulate import Simulation, stored_particles
from .summary import summarise

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

LOCK = "lock"  # the file in a directory that says that a run is at work


def prepare(case: DemCase, directory: Path, resume: bool, overwrite: bool) -> IO[bytes]:
    """Make the directory and write case.toml; refuse one with something in it unless told what to do, or that another run works in.

    Others are kept out until the file that is returned, `lock` in the directory, is closed.
    """
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory}: is a file, not a directory")
    used = directory.exists() and any(path.name != LOCK for path in directory.iterdir())
    if used and not resume and not overwrite:
        raise InputError(
            f"{directory}: is not empty; use --resume to go on or --overwrite to replace the run"
        )
    directory.mkdir(parents=True, exist_ok=True)
    try:
        held = lock(directory / LOCK)
    except BlockingIOError:
        raise InputError(f"{directory}: another mpm dem is at work in this directory") from None
    if used and not resume:
        for old in directory.glob("seed_*"):
            shutil.rmtree(old)
        (directory / "summary.json").unlink(missing_ok=True)
    write_atomically(directory / "case.toml", case.to_toml())
    return held


def seed_directory(directory: Path, seed: int) -> Path:
    return directory / f"seed_{seed}"


def run_case(
    case: DemCase,
    directory: Path,
    *,
    jobs: int = 1,
    resume: bool = False,
    overwrite: bool = False,
    report: Report = silent,
) -> dict[str, Any]:
    """Run the seeds that are not finished, `jobs` at a time, analyse all and write the report; returns the summary.

    Under MPI the ranks form as many groups as there are seeds (at most), each group taking its share of seeds.
    """
    load_lammps()
    began = time.monotonic()
    from mpi4py import MPI

    from mpm.parallel import on_root

    world = MPI.COMM_WORLD
    with ExitStack() as stack:

        def begin() -> None:
            held = stack.enter_context(prepare(case, directory, resume, overwrite))
            stack.callback(Path(held.name).unlink, missing_ok=True)

        on_root(world, begin)
        if world.size > 1:
            _over_ranks(case, directory, resume, report, world)
        elif jobs > 1 and len(case.run.seeds) > 1:
            _side_by_side(case, directory, jobs, resume, report)
        else:
            for seed in case.run.seeds:
                Simulation(case, seed, seed_directory(directory, seed)).run(resume, partial(report, seed))
        workers = world.size if world.size > 1 else jobs
        return on_root(world, lambda: finish(case, directory, time.monotonic() - began, workers))


def finish(case: DemCase, directory: Path, seconds: float, workers: int) -> dict[str, Any]:
    """Analyse what the seeds left and write profile.csv, summary.json, tables and pictures."""
    simulations = [Simulation(case, seed, seed_directory(directory, seed)) for seed in case.run.seeds]
    records = [s.load_arrays() for s in simulations]
    masses = [s.spec.masses()[s.filling.classes] for s in simulations]
    results = analyse(case, simulations[0].spec, masses, records)
    first = simulations[0]
    with np.load(first.state_file) as state:
        last = stored_particles(state)
    write_tables(directory, case, results, first.waveform)
    draw(directory, case, results, (first.spec, last))
    summary = {
        "status": "done",
        "title": case.title,
        "powder": first.spec.powder.name,
        "seeds": list(case.run.seeds),
        "cycles": case.run.cycles,
        "discarded_cycles": case.run.discard,
        "frequency": first.waveform.frequency,
        "particles": len(masses[0]),
        "box": {
            "length": first.spec.length,
            "depth": first.spec.depth,
            "stiffness": first.spec.stiffness,
            "timestep": first.timestep,
            "steps_per_cycle": first.steps * case.run.updates_per_cycle,
        },
        **summarise(case, first.spec, results, records),
        "wall_seconds": seconds,
        "workers": workers,
        "versions": {name: version(name) for name in ("mpm", "lammps", "numpy", "scipy")},
    }
    write_summary(directory, summary)
    return summary


# Several seeds at a time -------------------------------------------------------------------------------


def process_log(directory: Path, seed: int) -> Path:
    """What a seed's own process printed: LAMMPS' last words, a traceback, the stack of a crash. Removed when it is empty."""
    return seed_directory(directory, seed) / "process.log"


def _work(toml_path: Path, seed: int, resume: bool, messages: Any) -> None:
    """One seed in its own process; reports progress and the outcome through the queue, prints into its log."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    last = 0.0

    def progress(done: float, doing: str) -> None:
        nonlocal last
        if time.monotonic() - last > 0.3:
            last = time.monotonic()
            messages.put((seed, "cycles", (done, doing)))

    try:
        directory = seed_directory(toml_path.parent, seed)
        directory.mkdir(parents=True, exist_ok=True)
        with open(process_log(toml_path.parent, seed), "w", encoding="utf-8") as log:
            for number in (1, 2):
                os.dup2(log.fileno(), number)
            faulthandler.enable(log)
            try:
                Simulation(load_case(toml_path), seed, directory).run(resume, progress)
            except (InputError, ConvergenceError):
                raise
            except Exception:  # a defect, whose traceback nobody else would keep
                traceback.print_exc(file=log)
                raise
            finally:
                faulthandler.disable()
    except (InputError, ConvergenceError) as error:
        messages.put((seed, "failed", error))
    except Exception as error:
        said = storage_error(error) if isinstance(error, OSError) else None
        messages.put(
            (seed, "failed", said) if said else (seed, "crashed", f"{type(error).__name__}: {error}")
        )
    else:
        messages.put((seed, "done", None))


def last_words(log: Path, exit_code: int | None) -> str:
    """How a process ended that could not say so itself, with the last line of its log."""
    how = f"ended with exit code {exit_code}"
    if exit_code is not None and exit_code < 0:
        how = f"was killed by {signal.Signals(-exit_code).name}"
        if -exit_code == signal.SIGKILL:
            how += " (out of memory?)"
    text = log.read_text(encoding="utf-8", errors="replace") if log.exists() else ""
    lines = [line for line in text.splitlines() if line.strip()]
    return f"its process {how}" + (
        f": {lines[-1].strip()[:200]} (see {log})" if lines else " and without a word"
    )


def _side_by_side(case: DemCase, directory: Path, jobs: int, resume: bool, report: Report) -> None:
    context = multiprocessing.get_context("spawn")
    messages = context.Queue()
    waiting = list(case.run.seeds)
    active: dict[int, Any] = {}
    ended: dict[
        int, float
    ] = {}  # when a process was first seen to have ended: its last message may be under way
    try:
        while waiting or active:
            while waiting and len(active) < jobs:
                seed = waiting.pop(0)
                active[seed] = context.Process(
                    target=_work, args=(directory / "case.toml", seed, resume, messages), daemon=True
                )
                active[seed].start()
            for seed, process in active.items():
                if (
                    not process.is_alive()
                    and time.monotonic() > ended.setdefault(seed, time.monotonic()) + 2.0
                ):
                    words = last_words(process_log(directory, seed), process.exitcode)
                    raise ConvergenceError(f"seed {seed}: {words}")
            try:
                seed, kind, content = messages.get(timeout=0.5)
            except queue.Empty:
                continue
            if kind == "cycles":
                report(seed, *content)
            elif kind == "failed":
                raise type(content)(f"seed {seed}: {content}")
            elif kind == "crashed":
                raise ConvergenceError(
                    f"seed {seed}: {content} (traceback in {process_log(directory, seed)})"
                )
            else:
                report(seed, float(case.run.cycles), cycles_done(case.run.cycles, case.run.cycles))
                active.pop(seed).join()
                log = process_log(directory, seed)
                if log.exists() and not log.stat().st_size:
                    log.unlink()
    finally:
        for process in active.values():
            process.terminate()
            process.join()


def _over_ranks(case: DemCase, directory: Path, resume: bool, report: Report, world: "Intracomm") -> None:
    """Groups of ranks, each with its share of the seeds; a failure in one is raised by all."""
    seeds = case.run.seeds
    groups = min(len(seeds), world.size)
    mine = world.rank * groups // world.size
    comm = world.Split(mine, world.rank)
    failure: ConvergenceError | InputError | None = None
    try:
        for seed in seeds[mine::groups]:
            where = seed_directory(directory, seed)
            simulation = Simulation(case, seed, where, comm)
            if world.rank == 0:
                simulation.run(resume, partial(report, seed))
            else:
                simulation.run(resume)
    except (ConvergenceError, InputError) as error:
        failure = type(error)(f"seed {seed}: {error}")
        if comm.size > 1:
            # LAMMPS may have failed on this rank alone and left its partners in a call: the command line waits
            # for them a while and then ends the job
            raise failure from None
    comm.Free()
    failures = [f for f in world.allgather(failure) if f is not None]
    if failures:
        raise failures[0]


def interrupted(directory: Path) -> Interrupted:
    return Interrupted(
        f"interrupted; whole cycles are kept, go on with: mpm dem {directory / 'case.toml'} -o {directory} --resume"
    )
