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
        """The global array on every rank; `local` has shape (..., n) with n own values."""
        send, width = self._sent(local)
        received = np.empty(self.size * width)
        self.comm.Allgatherv(send, [received, self.counts * width])
        return self._ordered(received, np.shape(local)[:-1], width)

    def to_root(self, local: Floats) -> Floats | None:
        """The global array on rank 0, None elsewhere."""
        send, width = self._sent(local)
        received = np.empty(self.size * width) if is_root(self.comm) else None
        self.comm.Gatherv(send, None if received is None else [received, self.counts * width], root=0)
        return None if received is None else self._ordered(received, np.shape(local)[:-1], width)

    @staticmethod
    def _sent(local: Floats) -> tuple[Floats, int]:
        """What a rank sends, and how many arrays of its values that is."""
        send = np.ascontiguousarray(local, dtype=np.float64)
        return send, int(np.prod(send.shape[:-1], dtype=np.int64))

    def _ordered(self, received: Floats, lead: tuple[int, ...], width: int) -> Floats:
        """Array by array in the grid's order: rows of values stay rows, which is many times as fast as turning them about."""
        blocks = np.split(received, np.cumsum(self.counts * width)[:-1])
        by_rank = [block.reshape(width, n) for block, n in zip(blocks, self.counts, strict=True)]
        whole = by_rank[0] if len(by_rank) == 1 else np.concatenate(by_rank, axis=1)
        return np.take(whole, self._order, axis=1).reshape(*lead, self.size)

    def to_local(self, whole: Floats) -> Floats:
        """This rank's values of a global array that every rank has, shape (..., size)."""
        return np.take(whole, self.places, axis=-1)
