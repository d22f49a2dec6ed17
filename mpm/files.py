"""Reading text in whatever way an editor saved it; files that nobody, killed run or reader, meets by half; one process at a time."""

from __future__ import annotations

import codecs
import fcntl
import hashlib
import io
import json
import logging
import os
import re
import time
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from mpm.errors import InputError

LATELY = 120.0
"""Seconds after its last words for which a log without locks counts as one that is being written."""
LONGEST_NAME = 200
"""Bytes of a part of a file's name; file systems take 255 in all."""
_OTHER_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32",  # begins like UTF-16, so it comes first
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}
log = logging.getLogger("mpm")
UNREADABLE = (
    ValueError,
    KeyError,
    EOFError,
    zipfile.BadZipFile,
    zlib.error,
)  # what numpy says of a damaged archive


def is_file(path: Path) -> bool:
    """Whether there is a file of this name; False too for what cannot be a name (too long, with a NUL, a loop of links)."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a UTF-8 file, whatever the locale, without the byte order mark that Windows editors put first.

    Raises OSError, and ValueError whose text says how the file is encoded instead, or that its name cannot be one.
    """
    content = Path(path).read_bytes().removeprefix(codecs.BOM_UTF8)
    for mark, encoding in _OTHER_MARKS.items():
        if content.startswith(mark):
            raise ValueError(f"{encoding} text, save it as UTF-8")
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"byte 0x{content[error.start]:02X} in line {line} is not UTF-8, save it as UTF-8"
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


@contextmanager
def replacing(path: str | os.PathLike[str], ending: str = ".tmp") -> Iterator[Path]:
    """A temporary name beside `path`, whose file takes the place of `path` in one step when the block is left.

    After an error it is removed and the old file stays; an OSError then names `path`.
    """
    path = Path(path)
    temporary = path.with_name(path.name + ending)
    try:
        yield temporary
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


@contextmanager
def writing(path: str | os.PathLike[str], *, sync: bool = False) -> Iterator[IO[bytes]]:
    """A stream whose content takes the place of `path` in one step when the block is left.

    Other processes see the old file or the new one, whatever happens to this process. `sync` also flushes to the disk before the name
    changes, so that the file survives a power failure; that costs some milliseconds.
    """
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        yield stream
        if sync:
            stream.flush()
            os.fsync(stream.fileno())


def write_atomically(path: str | os.PathLike[str], content: bytes | str, *, sync: bool = False) -> None:
    """Replace `path` by `content` (text is UTF-8) in one step, as `writing` does."""
    with writing(path, sync=sync) as stream:
        stream.write(content.encode() if isinstance(content, str) else content)


def file_name(text: str) -> str:
    """`text` as part of a file's name: what is no letter, digit or one of ._()+- becomes %XX, so that different texts stay apart."""
    name = re.sub(r"[^\w.()+-]", lambda found: f"%{ord(found[0]):02X}", text)
    if len(name.encode()) <= LONGEST_NAME:
        return name
    return f"{name[: LONGEST_NAME // 4]}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"


def flush(path: Path) -> None:
    """Wait until what has been written to `path` is on the disk."""
    with open(path, "rb") as stream:
        os.fsync(stream.fileno())


def write_picture(path: str | os.PathLike[str], figure: Any, **options: Any) -> None:
    """Replace `path` by a matplotlib figure, in the format that its ending names, in one step."""
    content = io.BytesIO()
    figure.savefig(content, format=Path(path).suffix[1:].lower(), **options)
    write_atomically(path, content.getvalue())


def write_in_place(path: Path, content: bytes, start: int) -> None:
    """Write `content` at byte `start`, where the file ends with it: at once, or not at all when the disk has no room left for it."""
    handle = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
    size = os.fstat(handle).st_size
    kept = b""
    try:
        if start < size:
            with open(path, "rb") as stream:
                stream.seek(start)
                kept = stream.read()
        done = 0
        while done < len(content):
            done += os.pwrite(handle, content[done:], start + done)
    except OSError as error:
        with suppress(OSError):
            os.pwrite(handle, kept, start)
            os.ftruncate(handle, size)
        error.filename = str(path)
        raise
    finally:
        os.close(handle)


def load_arrays(path: Path, what: str) -> dict[str, NDArray[Any]]:
    """The arrays of an .npz file. Raises InputError when it is not `what`: empty, cut, or something else."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except UNREADABLE as error:
        raise InputError(f"{path}: not {what} ({error or 'it is empty'})") from error


def load_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file. Raises InputError when it is damaged."""
    try:
        found = json.loads(read_text(path))
    except ValueError as error:
        raise InputError(f"{path}: not readable as JSON ({error})") from error
    if not isinstance(found, dict):
        raise InputError.at(path, "", f"a {type(found).__name__}", "a JSON object")
    return found


def lock(path: Path, patience: float = 0.0) -> IO[bytes]:
    """Open `path` for appending and keep others out until it is closed; BlockingIOError when another process has it for `patience` seconds.

    The lock goes with the process, however that ends, and holds for all machines that share the file system.
    """
    deadline = time.monotonic() + patience
    while True:
        stream = open(path, "ab")  # noqa: SIM115 (held by the caller)
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.exists(path) and os.path.samestat(os.fstat(stream.fileno()), os.stat(path)):
                return stream  # and not a file that its last owner has removed meanwhile
            stream.close()
        except BlockingIOError:
            stream.close()
            if time.monotonic() >= deadline:
                raise
            time.sleep(0.05)
        except OSError:
            log.warning("%s: no locks on this file system; take care that one process works here", path)
            return stream


def locked(path: Path) -> bool:
    """Whether a process has the `lock` on `path`; without locks on the file system, whether it has been written to lately."""
    try:
        with open(path, "rb") as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    except OSError:
        return time.time() - path.stat().st_mtime < LATELY
    return False
