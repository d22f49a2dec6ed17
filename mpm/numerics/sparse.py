"""Sparse matrices from lists of entries."""

from __future__ import annotations

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.numerics.fem import PETSc

from mpi4py import MPI  # isort: skip  (after fem)

BLOCK = 20_000  # rows that are looked at together
ROUNDING = 1e-16  # of an entry, relative to the root of the product of the two diagonal ones


def sparse_matrix(comm: MPI.Comm, own_rows: int, own_columns: int, entries: tuple[Ints, Ints]) -> PETSc.Mat:
    """A matrix without values, for entries at the global (rows, columns) `entries`; those of a place that stands there twice add up.

    `setValuesCOO` enters values in the order of `entries`. Collective.
    """
    matrix = PETSc.Mat().create(comm)
    matrix.setSizes(((own_rows, None), (own_columns, None)))
    matrix.setType("aij")
    rows, columns = entries
    matrix.setPreallocationCOO(rows.astype(PETSc.IntType), columns.astype(PETSc.IntType))
    return matrix


def local_matrix(rows: int, columns: int, row: Ints, column: Ints, values: Floats) -> PETSc.Mat:
    """A matrix of this rank alone with `values` at (row, column), whose pattern is not kept for other values.

    Takes a third of the memory of `sparse_matrix`. Entries of a place that stands there twice add up.
    """
    place = row.astype(np.int64) * columns + column
    order = np.argsort(place, kind="stable")
    place = place[order]
    first = np.flatnonzero(np.diff(place, prepend=-1))
    at, across = np.divmod(place[first], columns)
    starts = np.searchsorted(at, np.arange(rows + 1))
    csr = (
        starts.astype(PETSc.IntType),
        across.astype(PETSc.IntType),
        np.add.reduceat(values[order], first) if len(first) else np.zeros(0),
    )
    return PETSc.Mat().createAIJ((rows, columns), csr=csr, comm=MPI.COMM_SELF)


def thinned(matrix: PETSc.Mat) -> PETSc.Mat:
    """`matrix`, symmetric with a positive diagonal, without its entries of rounding; that one is destroyed. Collective.

    Assembled forms hold what adds up to nothing, more than half of all entries here. Rows are looked at in blocks: whole arrays of what is
    looked at would take more memory than the matrix.
    """
    sizes, diagonal = matrix.getSizes(), matrix.getDiagonal()
    starts, columns, values = matrix.getValuesCSR()
    matrix.destroy()
    own, all_roots = np.sqrt(diagonal.array), np.sqrt(_at(diagonal, columns))
    kept, counted = np.empty(len(values), dtype=bool), np.zeros_like(starts)
    for first in range(0, len(own), BLOCK):
        last = min(first + BLOCK, len(own))
        part = slice(starts[first], starts[last])
        limit = np.repeat(ROUNDING * own[first:last], np.diff(starts[first : last + 1]))
        kept[part] = np.abs(values[part]) > limit * all_roots[columns[part]]
        so_far = counted[first] + np.cumsum(kept[part])
        counted[first + 1 : last + 1] = so_far[starts[first + 1 : last + 1] - starts[first] - 1]
    columns, values = columns[kept], values[kept]
    thin = PETSc.Mat().createAIJ(sizes, csr=(counted, columns, values), comm=diagonal.comm)
    diagonal.destroy()
    return thin


def _at(vector: PETSc.Vec, places: Ints) -> Floats:
    """An array of the size of the whole `vector` with its values at these `places`, zero elsewhere. Collective."""
    found = np.zeros(vector.getSize())
    found[places] = 1.0
    wanted = np.flatnonzero(found).astype(PETSc.IntType)
    part = PETSc.Vec().createSeq(len(wanted))
    scatter = PETSc.Scatter().create(vector, PETSc.IS().createGeneral(wanted, comm=MPI.COMM_SELF), part, None)
    scatter.scatter(vector, part)
    found[wanted] = part.array
    part.destroy()
    scatter.destroy()
    return found
