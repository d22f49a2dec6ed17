"""One point of a sweep: its process, its environment, its verdict. Runs in the driver's threads or on a Dask worker.

Every point is a process of its own (loops over solves inside one process exhaust MPI's communicators) with an
environment of its own: no variable by which MPI would take it for a rank of the driver's job, and one thread per
rank. The compiled forms are shared by all points through the user's cache of dolfinx.
"""

import contextlib
import json
import os
import re
import shutil
import signal
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.case.case import load_case
from mpm.errors import FULL, InputError, StorageError
from mpm.files import write_atomically
from mpm.revision import release
from mpm.sweep import guard
from mpm.sweep.layout import Layout, read_json
from mpm.sweep.lease import Watch
from mpm.sweep.watchman import Watchman

INHERITED = re.compile(
    r"(PMI_|PMI2_|PMIX_|HYDRA_|HYDI_|MPI_LOCAL|OMPI_|OPAL_|ORTE_|PRTE_|SLURM_|SLURMD_|"
    r"SRUN_|PALS_|PALSD_|ALPS_|FLUX_|PBS_|LSB_|COBALT_|GFORKER|MV2_)"
)
"""Variables of launchers and batch systems. A child that saw them would join the driver's MPI job, or hand its ranks
to another job step."""
THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
STATUS = {0: "done", 2: "bad_input", 3: "failed", 130: "interrupted", guard.LOCK_TAKEN: "pending"}
"""By exit status; above 128: "killed"; anything else: "crashed"."""
VERDICTS = ("done", "failed", "bad_input")
"""Final for one version of the program; every other point is run again by the next call."""
GRACE = 10.0
"""Seconds that a point gets to save its restart state when it is told to stop."""
PATIENCE = 60.0
"""Seconds to wait for a point's lock: its last owner may be within its grace."""
LAUNCHER_LINE = re.compile(
    r"=|\[(proxy|mpiexec)|Abort\(|application called MPI_Abort|YOUR APPLICATION|This typically|Please see the FAQ"
)
NO_ROOM = 74
"""Exit status (EX_IOERR) in the record of a point that met a full disk."""
ANSI = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


@dataclass(frozen=True, kw_only=True)
class Task:
    """What a worker has to know; small, and made of plain values so that it travels."""

    root: str
    name: str
    program: str
    lease: str
    """The driver's token, see `mpm.sweep.lease`."""
    ranks: int = 1
    command: tuple[str, ...] = ()
    """Replaces `python -m mpm run`; then come CASE -o DIR and --resume or --overwrite."""


def program() -> str:
    """Version of mpm and a digest of the sources that decide a point's numbers, e.g. "mpm 0.1.0 (3f2a9c01)"."""
    return f"mpm {release()}"


def clean_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """The environment of a point: as the driver's, without launchers, one thread per rank."""
    kept = {key: value for key, value in environment.items() if not INHERITED.match(key)}
    return kept | dict.fromkeys(THREADS, "1")


def mpirun() -> str:
    """The launcher that belongs to this Python: the one beside it, else the one on the PATH."""
    beside = Path(sys.executable).with_name("mpirun")
    found = str(beside) if beside.exists() else shutil.which("mpirun")
    if found is None:
        raise InputError("sweep with more than one rank: no mpirun beside this Python or on the PATH")
    return found


def command(task: Task, resume: bool) -> list[str]:
    """The full command of a point."""
    layout = Layout(Path(task.root))
    launcher = [mpirun(), "-n", str(task.ranks)] if task.ranks > 1 else []
    what = task.command or (sys.executable, "-m", "mpm", "run", "--quiet", "--no-report")
    where = [str(layout.case(task.name)), "-o", str(layout.run(task.name))]
    return [*launcher, *what, *where, "--resume" if resume else "--overwrite"]


def status_of(record: Mapping[str, Any], run: Path) -> str:
    """One word for a verdict: done, failed, bad_input, interrupted, killed, crashed, or pending without one."""
    if not record:
        return "pending"
    code = record["exit_status"]
    if code == 0 and not read_json(run / "summary.json"):
        return "crashed"
    return STATUS.get(code, "killed" if code > 128 else "crashed")


def finished(record: Mapping[str, Any], run: Path, version: str) -> bool:
    """Whether a point needs no further run. What failed is tried again once the program has changed."""
    status = status_of(record, run)
    return status == "done" or (status in VERDICTS and record.get("program") == version)


def last_line(log: Path) -> str:
    """The last line that the point itself printed: the error, by mpm's rule as by Python's."""
    with contextlib.suppress(OSError):
        text = ANSI.sub("", log.read_bytes()[-20_000:].decode(errors="replace"))
        for line in reversed(re.split(r"[\r\n]+", text)):
            if line.strip() and not LAUNCHER_LINE.match(line):
                return " ".join(line.split())
    return ""


def error_of(record: Mapping[str, Any], layout: Layout, name: str) -> str:
    """What the table says of a point that is not done."""
    status = status_of(record, layout.run(name))
    if status in ("done", "pending"):
        return ""
    if status == "killed":
        number = record["exit_status"] - 128
        names = {item.value: item.name for item in signal.Signals}
        return f"killed by {names.get(number, f'signal {number}')}"
    if record["exit_status"] == 0:
        return "ended without a readable summary.json"
    return last_line(layout.log(name)) or f"exit status {record['exit_status']} without a message"


def is_full(line: str) -> bool:
    """Whether a point's last line tells of a full or failing disk, or there is none, as when the log is on that disk."""
    return not line or any(os.strerror(number) in line for number in FULL)


_slot = threading.local()
"""Each thread that runs points keeps a guard."""


def attempt(task: Task, number: int, resume: bool, watch: Watch) -> int:
    """Run the point once under its guard; returns the guard's exit status."""
    layout = Layout(Path(task.root))
    layout.run(task.name).parent.mkdir(exist_ok=True)
    order = {
        "command": command(task, resume),
        "lock": str(layout.lock(task.name)),
        "log": str(layout.log(task.name)),
        "record": str(layout.record(task.name)),
        "grace": GRACE,
        "patience": PATIENCE,
        "about": {
            "point": task.name,
            "program": task.program,
            "ranks": task.ranks,
            "attempt": number,
            "resumed": resume,
        },
    }
    watchman = getattr(_slot, "watchman", None)
    if watchman is None or not watchman.ready():
        watchman = _slot.watchman = Watchman(clean_environment(os.environ))
    ended = threading.Event()

    def stop_when_abandoned() -> None:
        if watch.wait(ended):
            watchman.stop()

    watcher = threading.Thread(target=stop_when_abandoned, daemon=True)
    watcher.start()
    try:
        return watchman.run(order)
    finally:
        ended.set()
        watcher.join()


def refuse_changed_profile(path: Path, name: str) -> None:
    """InputError when the profile file of a point is no longer the one that gave the point its name."""
    case = load_case(path)
    if case.motion.table is not None and case.content_hash()[: len(name)] != name:
        raise InputError(
            f"{case.motion.profile} has changed since this sweep was planned; start it again: its points are then those of the new profile"
        )


def run_point(task: Task) -> dict[str, Any]:
    """Bring one point to a verdict and return its record; at once when it has one, or when the driver has gone.

    A scheduler may hand out a point twice (the worker that knew its result died): finished points are only read.
    A restart state is used when there is one and given up when the program refuses it.
    """
    layout = Layout(Path(task.root))
    if not layout.case(task.name).exists():
        raise InputError(
            f"worker {os.uname().nodename}: {layout.root} is not the driver's directory; shared storage is needed"
        )
    if program() != task.program:
        raise InputError(f"worker {os.uname().nodename} has {program()}, the driver has {task.program}")
    refuse_changed_profile(layout.case(task.name), task.name)
    run, record = layout.run(task.name), layout.record(task.name)
    watch = Watch(layout.driver / "lease", task.lease)
    before = read_json(record)
    if finished(before, run, task.program) or watch.ended():
        return before
    record.unlink(missing_ok=True)
    number = int(before.get("attempt", 0)) + 1
    resume = any(run.glob("checkpoint.*"))
    status = attempt(task, number, resume, watch)
    if status == 2 and resume:
        status = attempt(task, number, False, watch)
    if status == StorageError.exit_status and is_full(last_line(layout.log(task.name))):
        # The point is not to blame: no verdict, and the next call tries it again.
        write_atomically(record, json.dumps(read_json(record) | {"exit_status": NO_ROOM}))
    return read_json(record) or {"exit_status": status}
