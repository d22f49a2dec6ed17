"""How the columns of a strip are shared out among ranks, and in which order each goes through its own.

Every rank has a box: all rows of some columns. Ranks with even numbers go through theirs from left to right, odd ones from right to left,
so that at most seams both begin or both end: work that must be done cell after cell (a triangular solve) then goes on at the same time on
all of them, and across a seam waits for one column, not for a whole box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpm.arrays import Ints

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

START, END = 0, 1


@dataclass(frozen=True)
class Seam:
    """Where a box meets that of another rank, or its own other side: its `rank`, which `side` of its box, and whether that is `earlier`."""

    rank: int
    side: int
    earlier: bool


class Box:
    """This rank's box of a strip with `rows` and `all_columns`, `closed` where its last column is next to its first.

    `columns` (n,) are its columns of the strip in the order in which it goes through them, `leftwards` or to the right, its cells column
    after column from the bottom. `seams` are those at its START and END, None where nobody is. Ranks beyond the number of columns have no
    cells.
    """

    def __init__(self, comm: MPI.Comm, rows: int, all_columns: int, closed: bool):
        self.comm, self.rows = comm, rows
        owners = column_owners(all_columns, comm.size)
        self.leftwards = bool(comm.rank % 2)
        self.columns: Ints = np.flatnonzero(owners == comm.rank)[:: -1 if self.leftwards else 1]
        self.seams: tuple[Seam | None, Seam | None] = (None, None)
        if len(self.columns):
            busy, rank = min(comm.size, all_columns), comm.rank
            left, right = rank - 1, rank + 1
            if closed and all_columns > 1:  # one column has none beside it, not even itself
                left, right = left % busy, right % busy
            there = [
                self._seam(side, neighbour, (side + 1) % 2) if 0 <= neighbour < busy else None
                for side, neighbour in ((0, left), (1, right))  # left and right
            ]
            self.seams = (there[1], there[0]) if self.leftwards else (there[0], there[1])

    def _seam(self, side: int, neighbour: int, facing: int) -> Seam:
        """That at the left (0) or right (1) `side`, which its `neighbour` has at its other one, `facing` it.

        Where one begins and the other ends, the beginning is earlier; else ranks with even numbers are.
        """
        rank = self.comm.rank
        here, there = side ^ rank % 2, facing ^ neighbour % 2
        return Seam(neighbour, there, (there, neighbour % 2) < (here, rank % 2))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of this rank."""
        return self.rows, len(self.columns)

    @property
    def cells(self) -> int:
        """Of this rank."""
        return self.rows * len(self.columns)


def column_owners(columns: int, ranks: int) -> Ints:
    """The rank of each column, (columns,): neighbours together, none with more than one column more than another."""
    busy = min(columns, ranks)
    return np.repeat(np.arange(busy), np.diff(np.arange(busy + 1) * columns // max(busy, 1)))
