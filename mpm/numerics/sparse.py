"""Sparse matrices from lists of entries."""

from __future__ import annotations

from mpm.arrays import Ints
from mpm.numerics.fem import PETSc

from mpi4py import MPI  # isort: skip  (after fem)


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
