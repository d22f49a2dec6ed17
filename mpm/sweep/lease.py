"""The driver's sign of life, by which points on other machines learn that nobody waits for them any more.

A killed local driver closes the pipes of its guards, and the points stop at once. A Dask worker does not notice: it
would finish the point it is at. So the driver keeps counting in `driver/lease`; a point whose lease says "stop", or
has not moved for `EXPIRY` seconds, is stopped and leaves its restart state.
"""

import contextlib
import itertools
import threading
import uuid
from pathlib import Path

from mpm.files import write_atomically

BEAT = 5.0
"""Seconds between two counts of the driver."""
POLL = 0.5
"""Seconds between two looks of a point."""
EXPIRY = 60.0
"""Seconds without a new count after which the driver is taken for dead."""
STOP = "stop"


class Lease:
    """Driver's side: `with Lease(path) as lease: ...`; leaving the block, or `revoke()`, stops every point."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.token = uuid.uuid4().hex[:8]
        """Tells this driver's count from its predecessor's, whose points must not take it for their own."""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._count, name="lease", daemon=True)

    def __enter__(self) -> "Lease":
        write_atomically(self.path, f"{self.token} 0")
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.revoke()

    def revoke(self) -> None:
        """Say "stop" once and for all; on a full disk the points find out by our silence."""
        self._ended.set()
        self._thread.join()
        with contextlib.suppress(OSError):
            write_atomically(self.path, STOP)

    def _count(self) -> None:
        for number in itertools.count(1):
            if self._ended.wait(BEAT):
                return
            with contextlib.suppress(OSError):  # a full disk now is no reason to stop points that have room
                write_atomically(self.path, f"{self.token} {number}")


class Watch:
    """Point's side. `expiry` counts looks, not wall time: a laptop asleep has stopped nobody's driver."""

    def __init__(self, path: Path, token: str, expiry: float = EXPIRY) -> None:
        self.path = path
        self.token = token
        self.patience = max(1, round(expiry / POLL))
        self._last = token
        self._same = 0

    def ended(self) -> bool:
        """Look once; whether the driver said stop, fell silent, or has a successor. To be called every `POLL` seconds."""
        try:
            content = self.path.read_text(encoding="utf-8")
        except OSError:
            content = self._last  # being replaced, or a network file system catching its breath
        self._same = 0 if content != self._last else self._same + 1
        self._last = content
        return not content.startswith(self.token) or self._same > self.patience

    def wait(self, finished: threading.Event) -> bool:
        """Until `finished` is set (False) or the lease has ended (True)."""
        while not finished.wait(POLL):
            if self.ended():
                return True
        return False
