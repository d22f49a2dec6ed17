"""Columns of the bed that slide over the mesh, whole ones at a time, with what they carry.

Nothing is interpolated: no numerical diffusion, what is carried is conserved exactly, and a position is wrong by less than a column.
Columns that slide out are remembered at either end, because the bed moves back for part of a cycle.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mpm.arrays import Floats

MEMORY = 64  # columns remembered beyond each end; the bed swings back by a few at most
Beyond = tuple[
    list[Floats], list[Floats]
]  # columns (kinds, rows) beyond the left and the right end, nearest last


@dataclass
class SlidingColumns:
    """What solids bring along, `fresh` (kinds, rows), or as they left at the other end where they are `periodic`."""

    fresh: Floats
    periodic: bool
    left: list[Floats] = field(default_factory=list)
    right: list[Floats] = field(default_factory=list)

    def shift(self, whole: Floats, count: int) -> tuple[Floats, Floats]:
        """`whole` (kinds, rows, columns) moved by `count` columns to the right, and what left less what came in, (kinds, rows)."""
        passed = np.zeros_like(self.fresh)
        if self.periodic:
            return np.roll(whole, count, axis=2), passed
        for _ in range(abs(count)):
            whole, exchanged = self._one(whole, 1 if count > 0 else -1)
            passed = passed + exchanged
        return whole, passed

    def _one(self, whole: Floats, direction: int) -> tuple[Floats, Floats]:
        """One column to the right (+1) or left (-1): what leaves is remembered, what enters is remembered or fresh."""
        leaving, entering = (self.right, self.left) if direction > 0 else (self.left, self.right)
        gone = whole[:, :, -1 if direction > 0 else 0].copy()
        leaving.append(gone)
        new = entering.pop() if entering else self.fresh
        shifted = np.roll(whole, direction, axis=2)
        shifted[:, :, 0 if direction > 0 else -1] = new
        del leaving[:-MEMORY]
        return shifted, gone - new

    def memento(self) -> Beyond:
        """What is remembered now, to go back to."""
        return list(self.left), list(self.right)

    def recall(self, memento: Beyond) -> None:
        """Go back to what was remembered then."""
        self.left, self.right = list(memento[0]), list(memento[1])

    def stored(self) -> dict[str, Any]:
        """Arrays of a restart state."""
        return {"left": np.asarray(self.left), "right": np.asarray(self.right)}

    def restore(self, stored: dict[str, Any]) -> None:
        """The inverse of `stored`."""
        self.left, self.right = list(stored["left"]), list(stored["right"])
