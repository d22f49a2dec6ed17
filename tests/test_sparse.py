"""Sparse matrices from entries, and without those that are rounding."""

from __future__ import annotations

import numpy as np
import pytest

from mpm.numerics.fem import PETSc
from mpm.numerics.sparse import ROUNDING, local_matrix, sparse_matrix, thinned

from mpi4py import MPI  # isort: skip  (after fem)

COMM = MPI.COMM_WORLD
SIZE = 12


def test_entries_of_one_place_add_up_in_a_local_matrix() -> None:
    """Fails when an entry is lost, doubled or lies in another row than it was given."""
    rng = np.random.default_rng(1)
    row, column, values = rng.integers(0, 7, 60), rng.integers(0, 5, 60), rng.normal(size=60)
    expected = np.zeros((7, 5))
    np.add.at(expected, (row, column), values)
    assert np.allclose(local_matrix(7, 5, row, column, values)[:, :], expected, rtol=0.0, atol=1e-15)
    assert not local_matrix(3, 4, row[:0], column[:0], values[:0])[:, :].any()


@pytest.mark.parallel
def test_thinning_takes_rounding_alone() -> None:
    """Fails when an entry goes that matters to its row, however much larger the other row's diagonal is, or when rounding stays."""
    diagonal = 10.0 ** np.linspace(-6.0, 6.0, SIZE)
    whole = np.diag(diagonal)
    scale = np.sqrt(np.outer(diagonal, diagonal))
    for k, size in ((1, 100.0 * ROUNDING), (2, 0.01 * ROUNDING), (5, 0.3)):
        for i in range(SIZE - k):
            whole[i, i + k] = whole[i + k, i] = size * scale[i, i + k]
    mine = np.array_split(np.arange(SIZE), COMM.size)[COMM.rank]
    rows, columns = (a.ravel() for a in np.meshgrid(mine, np.arange(SIZE), indexing="ij"))
    matrix = sparse_matrix(COMM, len(mine), len(mine), (rows, columns))
    matrix.setValuesCOO(whole[rows, columns])
    thin = thinned(matrix)
    expected = np.where(np.abs(np.subtract.outer(np.arange(SIZE), np.arange(SIZE))) == 2, 0.0, whole)
    assert np.array_equal(thin[mine[0] : mine[-1] + 1, :], expected[mine])
    assert thin.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"] == np.count_nonzero(expected)
