"""Reading text in whatever way an editor saved it; writing files so that nobody, killed run or reader, meets half a file."""

import codecs
import hashlib
import os
import re
from pathlib import Path

LONGEST_NAME = 200
"""Bytes of a part of a file's name; file systems take 255 in all."""
_OTHER_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32",  # begins like UTF-16, so it comes first
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}


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


def write_atomically(path: str | os.PathLike[str], content: bytes | str, *, sync: bool = False) -> None:
    """Replace `path` by `content` (text is UTF-8) in one step.

    The content goes to `<name>.tmp` in the same directory, which then takes the name by `os.replace`: other
    processes see the old file or the new one, whatever happens to this process. `sync` also flushes to the disk
    before the name changes, so that the file survives a power failure; that costs some milliseconds.
    """
    path = Path(path)
    temporary = path.with_name(path.name + ".tmp")
    with open(temporary, "wb") as stream:
        stream.write(content.encode() if isinstance(content, str) else content)
        if sync:
            stream.flush()
            os.fsync(stream.fileno())
    os.replace(temporary, path)


def file_name(text: str) -> str:
    """`text` as part of a file's name: what is no letter, digit or one of ._()+- becomes %XX, so that different texts stay apart."""
    name = re.sub(r"[^\w.()+-]", lambda found: f"%{ord(found[0]):02X}", text)
    if len(name.encode()) <= LONGEST_NAME:
        return name
    return f"{name[: LONGEST_NAME // 4]}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"
