"""Linear solvers that are kept: they follow their matrix, on any number of ranks."""

from __future__ import annotations

import numpy as np
import pytest

from mpm.numerics.linear import DirectSolver
from mpm.numerics.sparse import sparse_matrix

from mpi4py import MPI  # isort: skip  (after fem)

COMM = MPI.COMM_WORLD
SIZE = 30


@pytest.mark.parallel
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("spread", [0.0, 8.0, 30.0])
def test_factors_in_single_precision_solve_as_well(single: bool, spread: float) -> None:
    """Fails when FGMRES leaves what a factor in single precision lacks, when rows or columns of very different size are lost in it, or when
    it outlives its matrix."""
    mine = np.array_split(np.arange(SIZE), COMM.size)[COMM.rank]
    entries = np.concatenate([mine, mine, mine]), np.concatenate([mine, (mine + 1) % SIZE, (mine + 7) % SIZE])
    matrix = sparse_matrix(COMM, len(mine), len(mine), entries)
    solver = DirectSolver(matrix, "test", single=single)
    found, rhs = matrix.createVecs()
    size = 10.0 ** (
        spread * (np.sin(3.0 * np.arange(SIZE)) - 0.5)
    )  # of the rows; their inverses are those of the columns
    expected = np.sin(1.0 + np.arange(SIZE)) * size
    for diagonal in (2.5, 4.0):
        parts = [(diagonal, mine), (-1.0, (mine + 1) % SIZE), (0.3, (mine + 7) % SIZE)]
        values = [value * size[mine] / size[at] for value, at in parts]
        matrix.setValuesCOO(np.concatenate(values))
        rhs.array[:] = sum(value * expected[at] for value, (_, at) in zip(values, parts, strict=True))
        solver.solve(rhs, found)
        np.testing.assert_allclose(found.array, expected[mine], rtol=1e-8)


@pytest.mark.parallel
def test_what_is_singular_in_single_precision_is_solved_in_double() -> None:
    """Fails when a factor that single precision cannot make, or that FGMRES makes nothing of, is the end."""
    mine = np.array_split(np.arange(SIZE), COMM.size)[COMM.rank]
    rows = np.concatenate([mine, mine])
    columns = np.concatenate([mine, (mine + 1) % SIZE])
    matrix = sparse_matrix(COMM, len(mine), len(mine), (rows, columns))
    matrix.setValuesCOO(np.repeat([1.0, -1.0 + 1e-13], len(mine)))
    solver = DirectSolver(matrix, "test", single=True)
    found, rhs = matrix.createVecs()
    rhs.array[:] = 1e-13
    solver.solve(rhs, found)
    np.testing.assert_allclose(found.array, 1.0, rtol=1e-2)
