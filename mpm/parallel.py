"""Reductions and gathers over the ranks: whatever all of them take part in. What neighbours tell each other while they solve, and
the sums that this takes, are in `numerics/box.c`."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm.arrays import Floats
from mpm.errors import MpmError
from mpm.launcher import share_cores

share_cores(os.environ)

from mpi4py import MPI  # noqa: E402  isort: skip  (reads the environment)

AT_ONCE = 250_000
"""Numbers of the global array that ranks gather at once: 2 MB."""
LARGE = 8192
"""Bytes of each rank, from which they pass them round: in a fifth of the time that MPICH 5.0 takes to gather them everywhere (100 kB on
each of two ranks of one machine: 0.015 instead of 0.08 ms)."""
TAG = 1305
"""Of these messages; any number that no other exchange has."""


def is_root(comm: MPI.Comm) -> bool:
    return bool(comm.rank == 0)


def total(comm: MPI.Comm, values: ArrayLike) -> Floats:
    """Sum over ranks, elementwise; every rank gets the result."""
    local = np.ascontiguousarray(values, dtype=np.float64)
    result = np.empty_like(local)
    comm.Allreduce(local, result, op=MPI.SUM)
    return result


def largest(comm: MPI.Comm, values: ArrayLike) -> Floats:
    """Maximum over ranks, elementwise; every rank gets the result, the same one: what is no number counts as infinite."""
    local = np.asarray(values, dtype=np.float64)
    local = np.where(np.isnan(local), np.inf, local)
    result = np.empty_like(local)
    comm.Allreduce(local, result, op=MPI.MAX)
    return result


def total_and_largest(comm: MPI.Comm, sums: ArrayLike, sizes: ArrayLike) -> tuple[Floats, Floats]:
    """`total` of the `sums` and `largest` of the `sizes`, (n,) each, in one exchange: sums in the order of the ranks."""
    added, compared = np.asarray(sums, dtype=np.float64), np.asarray(sizes, dtype=np.float64)
    local = np.concatenate([added, compared])
    everybody = np.empty((comm.size, len(local)))
    comm.Allgather(local, everybody)
    found = everybody[:, len(added) :].max(axis=0)  # which a NaN is
    return everybody[:, : len(added)].sum(axis=0), np.where(np.isnan(found), np.inf, found)


def any_rank(comm: MPI.Comm, flag: bool) -> bool:
    """True on every rank as soon as it is true on one."""
    return bool(comm.allreduce(bool(flag), op=MPI.LOR))


def on_root[T](comm: MPI.Comm, action: Callable[[], T]) -> T:
    """Run `action` on rank 0 and give its result, or its error, to every rank."""
    outcome: tuple[bool, Any] = (True, None)
    if is_root(comm):
        try:
            outcome = (True, action())
        except (MpmError, OSError) as error:
            outcome = (False, error)
    good, value = comm.bcast(outcome, root=0)
    if not good:
        raise value
    result: T = value
    return result


class Scatter:
    """Moves cell values between their owners and one array in the grid's order.

    `places` are the positions, in the global array of length `size`, of this rank's values. Every position has one owner.
    """

    def __init__(self, comm: MPI.Comm, places: NDArray[np.integer], size: int):
        self.comm, self.places, self.size = comm, np.asarray(places, dtype=np.int64), size
        self.counts = np.asarray(comm.allgather(len(self.places)))
        all_places = np.concatenate(comm.allgather(self.places)) if size else np.empty(0, np.int64)
        # of each position the place of its value where those of the ranks follow one another
        self._order = np.argsort(all_places)

    def to_all(self, local: Floats) -> Floats:
        """The global array on every rank; `local` has shape (..., n) with n own values, in float64 or float32."""
        return np.asarray(self._gathered(local, everywhere=True))

    def to_root(self, local: Floats) -> Floats | None:
        """The global array on rank 0, None elsewhere."""
        return self._gathered(local, everywhere=False)

    def _gathered(self, local: Floats, everywhere: bool) -> Floats | None:
        """Row of values by row, a few at a time: what is needed beside the result then stays in the processor's cache."""
        kind: type = np.float32 if np.asarray(local).dtype == np.float32 else np.float64
        given: Floats = np.ascontiguousarray(local, dtype=kind)
        rows: Floats = given.reshape(int(np.prod(given.shape[:-1], dtype=np.int64)), len(self.places))
        wanted = everywhere or is_root(self.comm)
        whole: Floats | None = np.empty((len(rows), self.size), kind) if wanted else None
        at_once = max(AT_ONCE // max(self.size, 1), 1)
        for first in range(0, len(rows), at_once):
            some = self._exchanged(rows[first : first + at_once], everywhere)
            if whole is not None and some is not None:
                np.take(some, self._order, axis=1, out=whole[first : first + at_once], mode="clip")
        return None if whole is None else whole.reshape(*given.shape[:-1], self.size)

    def _exchanged(self, rows: Floats, everywhere: bool) -> Floats | None:
        """Some rows with the values of one rank after those of the other."""
        if self.comm.size == 1:
            return rows
        if everywhere and rows.itemsize * self.size * len(rows) > LARGE * self.comm.size:
            return np.concatenate(self._passed_round(rows), axis=1)
        counts = self.counts * len(rows)
        received = np.empty(self.size * len(rows), rows.dtype) if everywhere or is_root(self.comm) else None
        if everywhere:
            self.comm.Allgatherv(rows, [received, counts])
        else:
            self.comm.Gatherv(rows, None if received is None else [received, counts], root=0)
        if received is None:
            return None
        blocks = np.split(received, np.cumsum(counts)[:-1])
        return np.concatenate(
            [block.reshape(len(rows), n) for block, n in zip(blocks, self.counts, strict=True)], axis=1
        )

    def _passed_round(self, rows: Floats) -> list[Floats]:
        """The rows of every rank: each gives its neighbour in a ring what it has got last."""
        rank, ranks = self.comm.rank, self.comm.size
        parts: list[Floats] = [np.empty((len(rows), count), rows.dtype) for count in self.counts]
        parts[rank] = rows
        for turn in range(ranks - 1):
            given, taken = parts[(rank - turn) % ranks], parts[(rank - turn - 1) % ranks]
            to, since = (rank + 1) % ranks, (rank - 1) % ranks
            self.comm.Sendrecv(given, dest=to, sendtag=TAG, recvbuf=taken, source=since, recvtag=TAG)
        return parts

    def to_local(self, whole: Floats) -> Floats:
        """This rank's values of a global array that every rank has, shape (..., size)."""
        return np.take(whole, self.places, axis=-1)
