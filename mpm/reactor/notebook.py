"""Whether a notebook shows what this process displays, and a line in it that renews itself."""

from __future__ import annotations

import sys
from importlib import import_module


def in_notebook() -> bool:
    """Whether a notebook shows what this process displays: its shell talks to a kernel, not to a terminal."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and hasattr(shell, "kernel")


class LiveLine:
    """A line in the output of a notebook's cell that renews itself."""

    def __init__(self) -> None:
        display = import_module("IPython.display").display
        self.handle = display({"text/plain": "starting"}, raw=True, display_id=True)

    def update(self, line: object) -> None:
        self.handle.update({"text/plain": str(line)}, raw=True)
