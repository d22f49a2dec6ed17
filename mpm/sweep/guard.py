"""Runs one point's command and sees to its end. A program of its own, standard library only:

    python -I -S guard.py '{"command": [...], "lock": ..., "log": ..., "record": ..., ...}'

Whoever starts it holds the other end of its standard input. When that pipe closes, because the driver (or the
Dask worker) was killed or asked for it, the command's whole process group gets SIGINT, so that a run can save its
restart state, and SIGKILL after `grace` seconds: nothing is left computing on its own. `prctl(PR_SET_PDEATHSIG)`
covers the death of this guard itself.

The exclusive lock on `lock` is inherited by the command. Two processes therefore never write to one point's
directory, even when a scheduler hands the point of a dead worker to the next one at once.

The verdict is written here and not by the driver: a driver killed between the end of a point and its own next
step loses nothing. Exit status: the command's, 128 + signal when it was killed, 75 when the lock stayed taken.
"""

import contextlib
import ctypes
import fcntl
import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from typing import Any, TextIO

LOCK_TAKEN = 75
"""Exit status (EX_TEMPFAIL): another process held the point's lock for too long; no verdict is written."""
OURS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ignored by the guard, whose end comes through the pipe; the command gets their defaults back."""
PR_SET_PDEATHSIG = 1


def abandoned(timeout: float) -> bool:
    """Wait up to `timeout` seconds; true when the other end of standard input is gone."""
    ready, _, _ = select.select([0], [], [], timeout)
    return bool(ready) and os.read(0, 1) == b""


def take_lock(path: str, patience: float) -> TextIO | None:
    """The open, locked file; None when it stays taken for `patience` seconds or nobody waits for us any more."""
    stream = open(path, "a")  # noqa: SIM115 (held until this process ends)
    deadline = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if abandoned(0.1) or time.monotonic() > deadline:
                return None
        except OSError:  # a file system without locks
            return stream
        else:
            return stream


def prepare_child() -> None:
    """In the child: ordinary signals again, and SIGKILL when this guard ends (Linux; elsewhere the pipe has to do)."""
    for number in OURS:
        signal.signal(number, signal.SIG_DFL)
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def signal_group(group: int, number: signal.Signals) -> None:
    """Send a signal to what is left of a process group."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, number)


def supervise(command: list[str], log: str, lock: TextIO, grace: float) -> int:
    """Run `command` to its end, or to ours; returns its exit status (128 + signal when it was killed)."""
    readable, writable = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(writable)  # wakes select() below when the child ends
    with open(log, "wb") as stream:
        child = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=stream,
            start_new_session=True,
            pass_fds=(lock.fileno(),),
            preexec_fn=prepare_child,
        )
    deadline = float("inf")
    while child.poll() is None:
        waiting = deadline == float("inf")
        ready, _, _ = select.select(
            [0, readable] if waiting else [readable], [], [], None if waiting else 0.1
        )
        if readable in ready:
            os.read(readable, 4096)
        elif waiting and os.read(0, 1) == b"":
            deadline = time.monotonic() + grace
            signal_group(child.pid, signal.SIGINT)
        if time.monotonic() > deadline:
            signal_group(child.pid, signal.SIGKILL)
    signal_group(child.pid, signal.SIGKILL)  # ranks that an aborted mpirun left behind
    status = child.returncode
    return status if status >= 0 else 128 - status


def killed_rank(log: str, status: int) -> int:
    """Status of a run under mpirun: MPICH's, for a rank that a signal ended, is the bare number of the signal."""
    with open(log, "rb") as stream:
        stream.seek(max(0, os.path.getsize(log) - 10_000))
        found = re.search(rb"EXIT STRING: .*\(signal (\d+)\)", stream.read())
    return 128 + int(found.group(1)) if found and status else status


def write_record(path: str, record: dict[str, Any]) -> None:
    """Replace the point's verdict in one step (`mpm.files` is out of reach here: no package is imported)."""
    with open(path + ".tmp", "w") as stream:
        json.dump(record, stream, indent=1)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(path + ".tmp", path)


def main(order: dict[str, Any]) -> int:
    """Lock, run, record; `order` is described in `mpm.sweep.point.start`."""
    for number in OURS:
        signal.signal(number, signal.SIG_IGN)
    lock = take_lock(order["lock"], order["patience"])
    if lock is None:
        return LOCK_TAKEN
    started = time.time()
    clock = time.monotonic()
    status = supervise(order["command"], order["log"], lock, order["grace"])
    if order["about"]["ranks"] > 1:
        status = killed_rank(order["log"], status)
    seconds = time.monotonic() - clock
    record = {"exit_status": status, "started": started, "seconds": seconds, "host": socket.gethostname()}
    write_record(order["record"], order["about"] | record)
    return status


if __name__ == "__main__":
    sys.exit(main(json.loads(sys.argv[1])))
