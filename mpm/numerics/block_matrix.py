"""Sparse matrices of several kinds of unknowns: numbers for the unknowns, and families of equal dense blocks that couple them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.numerics.sparse import sparse_matrix

from mpi4py import MPI  # isort: skip  (after the finite-element stack)


class Unknowns:
    """Kinds of unknowns, one after the other on every rank, `sizes` of each by name on this one.

    `local` is their number on this rank, `first` the global number of this rank's first of each kind, `firsts` (ranks,) those of all ranks.
    """

    def __init__(self, comm: MPI.Comm, sizes: Mapping[str, int]):
        self.comm, self.sizes = comm, dict(sizes)
        self.local = sum(sizes.values())
        start = int(comm.scan(self.local)) - self.local
        offsets = np.cumsum([0, *sizes.values()])[:-1]
        self.first = {name: start + int(offset) for name, offset in zip(sizes, offsets, strict=True)}
        everyone = comm.allgather(self.first)
        self.firsts = {name: np.array([one[name] for one in everyone], dtype=np.int64) for name in sizes}

    def join(self, parts: Mapping[str, Floats]) -> Floats:
        """One vector (local,) of all kinds, of zeros for those without a part."""
        whole = [
            parts[name].ravel() if name in parts else np.zeros(size) for name, size in self.sizes.items()
        ]
        return np.concatenate(whole)

    def split(self, vector: Floats) -> dict[str, Floats]:
        """The inverse of `join`."""
        ends = np.cumsum(list(self.sizes.values()))[:-1]
        return dict(zip(self.sizes, np.split(vector, ends), strict=True))


@dataclass(frozen=True, eq=False)
class Coupling:
    """Equal dense blocks of `height` by `width` entries; `rows` and `columns` (blocks,) are the global numbers of their first unknowns."""

    rows: Ints
    columns: Ints
    height: int = 1
    width: int = 1

    def entries(self) -> tuple[Ints, Ints]:
        """Row and column of every entry, block by block, each row by row."""
        i, j = np.divmod(np.arange(self.height * self.width), self.width)
        return (self.rows[:, None] + i).ravel(), (self.columns[:, None] + j).ravel()


class BlockMatrix:
    """A matrix over `unknowns` that is the sum of `couplings`, by name."""

    def __init__(self, unknowns: Unknowns, couplings: Mapping[str, Coupling]):
        self.names = list(couplings)
        entries = [coupling.entries() for coupling in couplings.values()]
        rows, columns = (np.concatenate(side) for side in zip(*entries, strict=True))
        self.matrix = sparse_matrix(unknowns.comm, unknowns.local, unknowns.local, (rows, columns))

    def fill(self, values: Mapping[str, Floats]) -> None:
        """Enter all blocks anew, (blocks, height, width) by name; collective."""
        self.matrix.setValuesCOO(np.concatenate([values[name].ravel() for name in self.names]))
