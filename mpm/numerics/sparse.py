"""Sparse matrices from lists of entries."""

from __future__ import annotations

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.numerics.fem import PETSc

from mpi4py import MPI  # isort: skip  (after fem)

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

    Assembled forms hold what adds up to nothing, more than half of all entries here.
    """
    starts, columns, values = matrix.getValuesCSR()
    diagonal = matrix.getDiagonal()
    needed, place = np.unique(columns, return_inverse=True)
    others = PETSc.Vec().createSeq(len(needed))
    scatter = PETSc.Scatter().create(
        diagonal, PETSc.IS().createGeneral(needed, comm=MPI.COMM_SELF), others, None
    )
    scatter.scatter(diagonal, others)
    rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    kept = np.abs(values) > ROUNDING * np.sqrt(diagonal.array[rows] * others.array[place])
    counted = np.concatenate([[0], np.cumsum(kept)])[starts].astype(PETSc.IntType)
    csr = counted, columns[kept], values[kept]
    thin = PETSc.Mat().createAIJ(matrix.getSizes(), csr=csr, comm=matrix.comm)
    for done in (matrix, diagonal, others, scatter):
        done.destroy()
    return thin
