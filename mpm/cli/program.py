"""The command line, `mpm` or `python -m mpm`, serially or under mpirun.

Exit status: 0 done, 2 bad input, 3 numerical failure or a full disk, 130 interrupted; 1 for a defect of mpm, with a traceback.
Input is checked by every rank before MPI is loaded, so that bad input ends all of them alike; only one speaks.
"""

from __future__ import annotations

import atexit
import gc
import logging
import os
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from typing import Any, NoReturn

import typer

from mpm.cli.base import app
from mpm.errors import InputError, Interrupted, MpmError, printable, storage_error
from mpm.help import missing
from mpm.launcher import rank
from mpm.screen import say, screen, spell_out
from mpm.signals import stop_signals

_PATIENCE = 30.0
"""Seconds that a failing rank waits for the others to fail as well before it ends the whole job."""
_FORWARDED = 0.5
"""Seconds that a launcher needs to pass on what a rank has printed: it drops the rest when the job is aborted."""

# a process that ends gives all memory back at once: to look for cycles first takes 0.13 s
atexit.register(gc.freeze)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status; no MpmError leaves a traceback."""
    spell_out()
    logging.getLogger("matplotlib").setLevel(
        logging.ERROR
    )  # a read-only home is said by us, where it matters
    words = list(sys.argv[1:] if arguments is None else arguments)
    with stop_signals(_interrupt, (signal.SIGTERM,)):
        try:
            result = typer.main.get_command(app).main(words, prog_name="mpm", standalone_mode=False)
            if result == Interrupted.exit_status:  # typer makes this of a KeyboardInterrupt
                return _end(Interrupted.exit_status, "interrupted")
            return result if isinstance(result, int) else 0
        except MpmError as error:
            return _end(error.exit_status, str(error))
        except (KeyboardInterrupt, typer.Abort):
            return _end(Interrupted.exit_status, "interrupted")
        except _USAGE_ERROR as error:
            if (
                len(words) == 1 and missing(error) and rank() == 0
            ):  # a bare verb: somebody who looks for its help
                print(error.ctx.get_help(), flush=True)
            line = missing(error) or f"mpm: {error.format_message()} ({_where(error)} -h lists what there is)"
            return _end(InputError.exit_status, line)
        except BrokenPipeError:  # the reader of our output has gone; let nothing more reach the pipe
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except Exception as error:
            said = storage_error(error) if isinstance(error, OSError) else None
            if said is None:
                _crash()
            return _end(said.exit_status, str(said))


_USAGE_ERROR: Any = typer.BadParameter.__base__


def _where(error: Any) -> str:
    """The verb that somebody misused."""
    return "mpm" if error.ctx is None else str(error.ctx.command_path)


def _interrupt() -> NoReturn:
    """SIGTERM ends the program in the same orderly way as Ctrl-C."""
    raise Interrupted("interrupted")


def _end(status: int, line: str) -> int:
    """Say `line` once, wait for the other ranks to fail too, and return the status."""
    if rank() == 0:
        say(screen(stderr=True), printable(line))
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is None or not mpi.Is_initialized() or mpi.Is_finalized() or mpi.COMM_WORLD.size == 1:
        return status
    arrived = mpi.COMM_WORLD.Ibarrier()
    deadline = time.monotonic() + _PATIENCE
    while not arrived.Test():
        if time.monotonic() > deadline:  # the others are in a call that this rank will never join
            if rank() != 0:
                print(f"[rank {rank()}] {line}", file=sys.stderr, flush=True)
                time.sleep(_FORWARDED)
            mpi.COMM_WORLD.Abort(status)
        time.sleep(0.01)
    return status


def _crash() -> NoReturn:
    """A defect: show where, and take the other ranks down instead of leaving them in a call."""
    traceback.print_exc()
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None and mpi.Is_initialized() and not mpi.Is_finalized() and mpi.COMM_WORLD.size > 1:
        sys.stderr.flush()
        time.sleep(_FORWARDED)
        mpi.COMM_WORLD.Abort(1)
    raise SystemExit(1)
