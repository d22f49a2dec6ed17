"""The errors that mpm raises on purpose, and the exit status each of them means on the command line."""

from __future__ import annotations

import difflib
import errno
from collections.abc import Iterable
from pathlib import Path

LONGEST_LINE = 2000
"""Characters of a message: what was found may be a file in itself."""


class MpmError(Exception):
    """Base of every error that has a message for the user; the command line prints it without a traceback."""

    exit_status = 1


class InputError(MpmError):
    """Input that cannot be used: the message is one line that names file, key, finding and what is accepted.

    `InputError("text")` takes a finished line; `InputError.at(...)` composes one from its parts.
    """

    exit_status = 2

    def __init__(self, line: str):
        line = printable(line)
        super().__init__(
            line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 500]} ... {line[-500:]}"
        )

    @classmethod
    def at(
        cls,
        source: str | Path | None,
        key: str,
        found: str,
        accepted: str,
        *,
        known: Iterable[str] = (),
        given: str = "",
    ) -> InputError:
        """Compose `FILE: key: found X; accepted: Y (did you mean Z?)`.

        `known` are the names that would have been right, `given` the one that was written (default: the
        last part of `key`); the nearest of them is suggested when one is close.
        """
        parts = [str(source)] if source is not None else []
        if key:
            parts.append(key)
        line = ": ".join([*parts, f"found {found}; accepted: {accepted}"]) + suggestion(
            given or key.rpartition(".")[2], known
        )
        return cls(line)


class ConvergenceError(MpmError):
    """A solver gave up; the message says which system, at which step, with which residual."""

    exit_status = 3


class BalanceError(ConvergenceError):
    """What came in, went out, reacted and stayed does not add up; the message says of what and by how much."""


class StorageError(MpmError):
    """The disk is full, or failing. What was written before is whole, and `--resume` works when there is room again."""

    exit_status = 3


class Interrupted(MpmError):
    """The run was asked to stop (Ctrl-C, SIGTERM); what was written is usable and `--resume` continues it."""

    exit_status = 130


def printable(text: str) -> str:
    """`text` on one line: blanks in place of line ends, control characters (which could steer a terminal) spelled out."""
    line = " ".join(text.split())
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in line
    )


FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
_CLOSED = {
    errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOENT, errno.EISDIR, errno.ENOTDIR, errno.ENAMETOOLONG, errno.ELOOP, errno.ESTALE,
}  # fmt: skip


def storage_error(error: OSError) -> MpmError | None:
    """What a user is told of a file that could not be read or written; None where `error` is a defect."""
    line = f"{error.filename}: {error.strerror}" if error.filename else f"mpm: {error.strerror}"
    if error.errno in FULL:
        return StorageError(line)
    return InputError(line) if error.errno in _CLOSED and error.filename else None


def nearest(given: str, known: Iterable[str]) -> str | None:
    """Return the one of `known` that `given` was probably meant to be, or None."""
    by_lower = {name.lower(): name for name in known}
    close = difflib.get_close_matches(given.lower(), by_lower, n=1, cutoff=0.6)
    if not close and len(given) >= 3:  # the beginning of one name only
        begun = [name for name in by_lower if name.startswith(given.lower())]
        close = begun if len(begun) == 1 else []
    return by_lower[close[0]] if close else None


def suggestion(given: str, known: Iterable[str]) -> str:
    """Return ` (did you mean Z?)`, or nothing when no known name is close to the given one."""
    close = nearest(given, known)
    return did_you_mean(close if close != given else None)


def did_you_mean(name: str | None) -> str:
    """Return ` (did you mean NAME?)`, the end of a message; nothing without a name."""
    return f" (did you mean {name}?)" if name else ""
