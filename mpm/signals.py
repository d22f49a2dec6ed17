"""SIGINT and SIGTERM as a request to stop, instead of an end in the middle of something."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def stop_signals(request: Callable[[], None]) -> Iterator[None]:
    """Call `request` at every SIGINT or SIGTERM inside the block.

    Outside the main thread Python does not allow handlers; signals are then left to the caller.
    """

    def stop(number: int, frame: object) -> None:
        request()

    previous = {}
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            previous[number] = signal.signal(number, stop)
    except ValueError:
        pass
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
