"""How the columns of a strip are shared out among ranks, and in which order each goes through its own.

Every rank has a box: all rows of some columns. Ranks with even numbers go through theirs from left to right, odd ones from right to left,
so that at most seams both begin or both end: work that must be done cell after cell (a triangular solve) then goes on at the same time on
all of them, and across a seam waits for one column, not for a whole box.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mpm.arrays import Floats, Ints

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

START, END = 0, 1


@dataclass(frozen=True)
class Seam:
    """Where a box meets that of another rank, or its own other side: its `rank`, which `side` of its box, and whether that is `earlier`."""

    rank: int
    side: int
    earlier: bool


class Piece(NamedTuple):
    """Columns from `first` to before `end` that are done in one go, and the sides with a seam that they are at: where the neighbour is
    `earlier`, and where it is later."""

    first: int
    end: int
    earlier: tuple[int, ...]
    later: tuple[int, ...]


class Box:
    """This rank's box of a strip with `rows` and `all_columns`, `closed` where its last column is next to its first.

    `columns` (n,) are its columns of the strip in the order in which it goes through them, `leftwards` or to the right, its cells column
    after column from the bottom. `seams` are those at its START and END, None where nobody is. `pieces` are its columns in order, those at
    seams by themselves, the others between them in one. Ranks beyond the number of columns have none.
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
        self.pieces = self._pieces()
        self._sent: list[MPI.Request] = []
        self._kept: dict[int, Floats] = {}

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

    @property
    def sides(self) -> list[int]:
        """Those with a seam."""
        return [side for side in (START, END) if self.seams[side] is not None]

    def seam(self, side: int) -> Seam:
        """That at a `side` which has one."""
        seam = self.seams[side]
        if seam is None:
            raise ValueError("nobody is there")
        return seam

    def _pieces(self) -> list[Piece]:
        count = len(self.columns)
        cuts = {0, count}
        if START in self.sides:
            cuts.add(min(1, count))
        if END in self.sides:
            cuts.add(max(count - 1, 0))
        pieces = []
        for first, end in pairwise(sorted(cuts)):
            at = [side for side in self.sides if (first == 0, end == count)[side]]
            earlier = tuple(side for side in at if self.seam(side).earlier)
            pieces.append(Piece(first, end, earlier, tuple(side for side in at if side not in earlier)))
        return pieces

    # --- messages, which do not wait for each other ---

    def give(self, side: int, values: Floats) -> None:
        """Send what belongs to the column at `side` across its seam."""
        seam = self.seam(side)
        message = np.array(values)
        if seam.rank == self.comm.rank:
            self._kept[seam.side] = message
        else:
            self._sent.append(self.comm.Isend(message, dest=seam.rank, tag=seam.side))

    def take(self, side: int, into: Floats) -> None:
        """Receive what comes across the seam at `side`, in the order in which it was given."""
        seam = self.seam(side)
        if seam.rank == self.comm.rank:
            into[:] = self._kept.pop(side)
            return
        if into.flags.c_contiguous:
            self.comm.Recv(into, source=seam.rank, tag=side)
            return
        message = np.empty(into.shape)
        self.comm.Recv(message, source=seam.rank, tag=side)
        into[:] = message

    def finish(self) -> None:
        """Wait until all that was given has gone."""
        if self._sent:
            MPI.Request.Waitall(self._sent)
            self._sent.clear()


def column_owners(columns: int, ranks: int) -> Ints:
    """The rank of each column, (columns,): neighbours together, none with more than one column more than another."""
    busy = min(columns, ranks)
    return np.repeat(np.arange(busy), np.diff(np.arange(busy + 1) * columns // max(busy, 1)))
