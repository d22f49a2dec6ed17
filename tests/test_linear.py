"""Linear solvers that are kept: they follow their matrix, on any number of ranks."""

from __future__ import annotations

import numpy as np
import pytest

from mpm.numerics.linear import ServingSolver
from mpm.numerics.sparse import sparse_matrix

from mpi4py import MPI  # isort: skip  (after fem)

COMM = MPI.COMM_WORLD
SIZE = 30


@pytest.mark.parallel
def test_a_kept_factor_is_that_of_the_matrix_as_it_is() -> None:
    """Fails when a factor outlives a change of its matrix, which PETSc does not tell of on several ranks, or a rank gets another's part."""
    mine = np.array_split(np.arange(SIZE), COMM.size)[COMM.rank]
    rows = np.concatenate([mine, mine])
    columns = np.concatenate([mine, (mine + 1) % SIZE])
    matrix = sparse_matrix(COMM, len(mine), len(mine), (rows, columns))
    solver = ServingSolver(matrix, "test")
    found, rhs = matrix.createVecs()
    expected = np.sin(1.0 + np.arange(SIZE))
    for version, diagonal in enumerate((2.0, 2.0, 5.0, 2.0)):
        matrix.setValuesCOO(np.repeat([diagonal, -1.0], len(mine)))
        rhs.array[:] = diagonal * expected[mine] - expected[(mine + 1) % SIZE]
        solver.solve(rhs, found, version)
        np.testing.assert_allclose(found.array, expected[mine], rtol=1e-13)
