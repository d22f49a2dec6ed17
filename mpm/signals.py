"""Signals as a request to stop, instead of an end in the middle of something."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

STOP = (signal.SIGINT, signal.SIGTERM)
"""Ctrl-C, and what batch systems send before they kill."""


@contextmanager
def stop_signals(request: Callable[[], None], numbers: Sequence[signal.Signals] = STOP) -> Iterator[None]:
    """Call `request` at every one of these signals inside the block.

    Outside the main thread Python does not allow handlers; signals are then left to the caller.
    """
    before = {}
    try:
        for number in numbers:
            before[number] = signal.signal(number, lambda *_: request())
    except ValueError:
        pass
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
