"""Runs points' commands, one after the other, and sees to their end. A program of its own, standard library only.

Orders come as lines of JSON on standard input, see `mpm.sweep.point.attempt`; for each the exit status goes to
standard output: the command's, 128 + signal when it was killed, 75 when its lock stayed taken. A line "stop", or the
end of standard input because the driver (or the Dask worker) was killed, sends SIGINT to the command's process
group, so that a run can save its restart state, and SIGKILL after the order's `grace` seconds: nothing is left
computing on its own. `prctl(PR_SET_PDEATHSIG)` covers the death of this guard itself.

The exclusive lock on the order's `lock` is inherited by the command. Two processes therefore never write to one
point's directory, even when a scheduler hands the point of a dead worker to the next one at once.

The verdict is written here and not by the driver: a driver killed between the end of a point and its own next
step loses nothing.
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
import time
from typing import Any, TextIO

LOCK_TAKEN = 75
"""Exit status (EX_TEMPFAIL): another process held the point's lock for too long; no verdict is written."""
OURS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ignored by the guard, whose end comes through the pipe; the command gets their defaults back."""
PR_SET_PDEATHSIG = 1
STOP = b"stop"


class Orders:
    """Standard input by lines, without a buffer that select() could not see."""

    def __init__(self) -> None:
        self.ended = False
        """Nobody is at the other end any more."""
        self._text = b""

    def next(self) -> dict[str, Any] | None:
        """The next order; None at the end. A "stop" that came too late for its point is passed over."""
        while True:
            line, newline, rest = self._text.partition(b"\n")
            if newline:
                self._text = rest
                if line != STOP:
                    order: dict[str, Any] = json.loads(line)
                    return order
            elif self.ended:
                return None
            else:
                self._read()

    def stopped(self) -> bool:
        """To be called when standard input is readable: whether the present point is to stop."""
        self._read()
        return self.ended or STOP in self._text

    def _read(self) -> None:
        content = os.read(0, 65536)
        self.ended = not content
        self._text += content


def take_lock(path: str, patience: float, orders: Orders) -> TextIO | None:
    """The open, locked file; None when it stays taken for `patience` seconds or nobody waits for us any more."""
    stream = open(path, "a")  # noqa: SIM115 (held until the point has ended)
    deadline = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            ready, _, _ = select.select([0], [], [], 0.1)
            if (ready and orders.stopped()) or time.monotonic() > deadline:
                stream.close()
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


def supervise(order: dict[str, Any], lock: TextIO, orders: Orders, child_ended: int) -> int:
    """Run the command to its end, or to ours; returns its exit status (128 + signal when it was killed)."""
    with open(order["log"], "wb") as stream:
        child = subprocess.Popen(
            order["command"],
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=stream,
            start_new_session=True,
            pass_fds=(lock.fileno(),),
            preexec_fn=prepare_child,
        )
    deadline = float("inf")
    while child.poll() is None:
        stopping = deadline < float("inf")
        ready, _, _ = select.select(
            [child_ended] if stopping else [0, child_ended], [], [], 0.1 if stopping else None
        )
        if child_ended in ready:
            os.read(child_ended, 4096)
        if 0 in ready and orders.stopped():
            deadline = time.monotonic() + order["grace"]
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
    with open(path + ".tmp", "w", encoding="utf-8") as stream:
        json.dump(record, stream, indent=1)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(path + ".tmp", path)


def carry_out(order: dict[str, Any], orders: Orders, child_ended: int) -> int:
    """Lock, run, record."""
    lock = take_lock(order["lock"], order["patience"], orders)
    if lock is None:
        return LOCK_TAKEN
    with lock:
        started, clock = time.time(), time.monotonic()
        status = supervise(order, lock, orders, child_ended)
        if order["about"]["ranks"] > 1:
            status = killed_rank(order["log"], status)
        record = {
            "exit_status": status,
            "started": started,
            "seconds": time.monotonic() - clock,
            "host": socket.gethostname(),
        }
        write_record(order["record"], order["about"] | record)
    return status


def main() -> None:
    """Orders until there are no more."""
    for number in OURS:
        signal.signal(number, signal.SIG_IGN)
    child_ended, writable = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(writable, warn_on_full_buffer=False)  # wakes select() when a command ends
    orders = Orders()
    while (order := orders.next()) is not None:
        status = carry_out(order, orders, child_ended)
        with contextlib.suppress(BrokenPipeError):
            os.write(1, f"{status}\n".encode())


if __name__ == "__main__":
    main()
