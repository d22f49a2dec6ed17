"""Writing files so that a reader, or a run killed at any moment, never meets half a file."""

import os
from pathlib import Path


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
