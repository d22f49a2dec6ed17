"""The box of a rank, matrices over it and their solver, against dense algebra; on any number of ranks."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mpm.errors import ConvergenceError
from mpm.numerics import box_matrix
from mpm.numerics.box import Box, column_owners
from mpm.numerics.box_matrix import ABOVE, AFTER, BEFORE, BELOW, BoxMatrix, BoxSolver, Factor, kernels
from mpm.numerics.compiled import pointer
from mpm.numerics.messages import Neighbourhood
from mpm.transport.schemes import two_point_flux

from mpi4py import MPI  # isort: skip  (after fem)

WORLD = MPI.COMM_WORLD
SHAPES = [(1, 1), (1, 5), (4, 1), (5, 2), (3, 3), (6, 8)]


@pytest.mark.parametrize("ranks", [1, 2, 3, 7])
@pytest.mark.parametrize("columns", [1, 2, 3, 20])
def test_columns_are_shared_out(ranks: int, columns: int) -> None:
    """Fails when a column has no rank, a rank's columns lie apart, or one has two more than another that has some."""
    owners = column_owners(columns, ranks)
    counts = np.bincount(owners, minlength=ranks)
    assert np.all(np.diff(owners) >= 0)
    assert counts.sum() == columns
    assert np.count_nonzero(counts) == min(columns, ranks)
    assert counts[counts > 0].max() - counts[counts > 0].min() <= 1


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize(("rows", "columns"), SHAPES)
@pytest.mark.parallel
def test_seams_fit(rows: int, columns: int, closed: bool) -> None:
    """Fails when two ranks do not agree on who is at a seam, at which side and who is earlier, or a seam joins what are no neighbours."""
    box = Box(WORLD, rows, columns, closed)
    everyone = WORLD.allgather((box.seams, box.columns))
    for rank, (seams, mine) in enumerate(everyone):
        for side, seam in enumerate(seams):
            if seam is None:
                continue
            there, theirs = everyone[seam.rank]
            back = there[seam.side]
            assert (back.rank, back.side, back.earlier) == (rank, side, not seam.earlier)
            apart = abs(int(mine[(0, -1)[side]]) - int(theirs[(0, -1)[seam.side]]))
            assert apart == 1 or (closed and apart == columns - 1)
    joined = sum(seam is not None for seams, _ in everyone for seam in seams)
    busy = min(WORLD.size, columns)
    assert joined == 2 * (busy - 1) + (2 if closed and columns > 1 else 0)


def random_matrix(
    rows: int, columns: int, unknowns: int, closed: bool, mutual: float, storage: float = 1.0
) -> tuple[BoxMatrix, NDArray[np.float64], NDArray[np.intp]]:
    """An M-matrix of fluxes and storage, the same as a dense one over (unknown, column, row), and where this rank's are in that."""
    draw = np.random.default_rng(5)
    cells = rows * columns
    dense = np.zeros((unknowns, cells, unknowns, cells))
    box = Box(WORLD, rows, columns, closed)
    place = {int(c): k for k, c in enumerate(box.columns)}
    matrix = BoxMatrix(box, unknowns)
    left, right = (AFTER, BEFORE) if box.leftwards else (BEFORE, AFTER)

    def couple(i: int, behind: tuple[int, int], ahead: tuple[int, int], sides: tuple[int, int]) -> None:
        """A flux a C_behind - b C_ahead; `sides` are those at which the cell ahead and the one behind have each other."""
        for here, other, side in ((ahead, behind, sides[0]), (behind, ahead, sides[1])):
            a = draw.random()
            k, m = (c * rows + r for c, r in (here, other))
            dense[i, k, i, m] -= a
            dense[i, m, i, m] += a
            if here[0] in place:
                matrix.couplings[i, side, place[here[0]] * rows + here[1]] = -a

    for i in range(unknowns):
        for c in range(columns):
            for r in range(rows):
                if r + 1 < rows:
                    couple(i, (c, r), (c, r + 1), (BELOW, BELOW + 1))
                if c + 1 < columns:
                    couple(i, (c, r), (c + 1, r), (left, right))
                elif closed and columns > 1:
                    couple(i, (c, r), (0, r), (left, right))
    for k in range(cells):
        dense[:, k, :, k] += mutual * (draw.random((unknowns, unknowns)) - 0.5)
        dense[:, k, :, k] += np.diag(storage * (0.2 + draw.random(unknowns)) + mutual * unknowns)
    own = np.array([c * rows + r for c in box.columns for r in range(rows)], dtype=np.intp)
    matrix.blocks[:] = dense[:, own, :, own]
    return matrix, dense.reshape(unknowns * cells, -1), own


@pytest.mark.parametrize("mutual", [0.0, 2.0])
@pytest.mark.parametrize("unknowns", [1, 2, 3])
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize(("rows", "columns"), SHAPES)
@pytest.mark.parallel
def test_against_dense_algebra(rows: int, columns: int, closed: bool, unknowns: int, mutual: float) -> None:
    """Fails when a product or a solution is not that of the whole matrix, with one factor for all unknowns or one for each."""
    matrix, dense, own = random_matrix(rows, columns, unknowns, closed, mutual)
    x = np.random.default_rng(6).standard_normal((unknowns, rows * columns))
    rhs = (dense @ x.ravel()).reshape(x.shape)
    product = np.empty((unknowns, len(own)))
    matrix.multiply(x[:, own], product)
    np.testing.assert_allclose(product, rhs[:, own], atol=1e-12)
    solver = BoxSolver(matrix, "a test")
    for together in (False, True):
        solver.factorise(together)
        found, iterations = solver.solve(rhs[:, own], 1e-12)
        np.testing.assert_allclose(found, x[:, own], atol=1e-9)
        assert iterations < 40
    exact = np.linalg.norm(x)
    found, _ = solver.solve(rhs[:, own], 0.0, 1e9 * exact)
    np.testing.assert_array_equal(found, 0.0)  # what may be left is more than all


@pytest.mark.parametrize("together", [False, True])
@pytest.mark.parametrize("unknowns", [1, 2, 3])
@pytest.mark.parametrize(("rows", "columns"), SHAPES)
@pytest.mark.parallel
def test_pivots_of_other_blocks(rows: int, columns: int, unknowns: int, together: bool) -> None:
    """Fails when a factor that keeps its pivots solves the matrix that it had before, or has none to keep at first."""
    matrix, dense, own = random_matrix(rows, columns, unknowns, False, 1.0)
    solver, draw = BoxSolver(matrix, "a test"), np.random.default_rng(8)
    x = draw.standard_normal((unknowns, rows * columns))
    for _ in range(3):
        solver.factorise(together, pivots=False)
        rhs = (dense @ x.ravel()).reshape(x.shape)
        found, iterations = solver.solve(rhs[:, own], 1e-12)
        np.testing.assert_allclose(found, x[:, own], atol=1e-9)
        assert iterations < 40
        more = 0.3 * draw.random((rows * columns, unknowns, unknowns))
        cells = np.arange(rows * columns)
        dense.reshape(unknowns, rows * columns, unknowns, -1)[:, cells, :, cells] += more
        matrix.blocks += more[own]


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parallel
def test_the_factor_is_one_of_the_whole_matrix(closed: bool) -> None:
    """Fails when the factor leaves out what couples ranks: of one row it is exact, unless that
    is closed or has a rank that others come before at both sides."""
    matrix, dense, own = random_matrix(1, 11, 2, closed, 1.0)
    x = np.random.default_rng(7).standard_normal((2, 11))
    rhs = (dense @ x.ravel()).reshape(x.shape)[:, own]
    solver = BoxSolver(matrix, "a test")
    solver.factorise(together=True)
    found, iterations = solver.solve(rhs, 1e-11)
    np.testing.assert_allclose(found, x[:, own], atol=1e-8)
    assert iterations <= (6 if closed or WORLD.size > 2 else 1)


@pytest.mark.parallel
def test_pivots_are_positive() -> None:
    """Fails when the relaxed factor of fluxes with next to no storage has a pivot that is not above zero."""
    matrix, _, _ = random_matrix(7, 9, 1, True, 0.0, storage=1e-9)
    factor = Factor(matrix.box, 1, 1)
    factor.renew(matrix.couplings, matrix.blocks)
    assert np.all(factor.inverse > 0.0)


def test_what_does_not_converge() -> None:
    """Fails when a system without a solution ends as solved."""
    matrix = BoxMatrix(Box(MPI.COMM_SELF, 3, 4, True), 1)
    solver = BoxSolver(matrix, "a test")
    with np.errstate(all="ignore"):
        solver.factorise()
    with pytest.raises(ConvergenceError, match="a test: the linear solver stopped"):
        solver.solve(np.ones((1, 12)), 1e-9)


@pytest.mark.parametrize("seed", [231, 360, 401, 806, 808, 901])
def test_overflow_is_no_solution(seed: int) -> None:
    """Fails when numbers beyond all bounds end as solved: these systems have some in the second half of an iteration."""
    draw = np.random.default_rng(seed)
    matrix = BoxMatrix(Box(MPI.COMM_SELF, 2, 2, False), 2)
    couplings = matrix.couplings.reshape(2, 4, 2, 2)
    couplings[:, BEFORE, 1, :], couplings[:, AFTER, 0, :] = -draw.random((2, 2)), -draw.random((2, 2))
    couplings[:, BELOW, :, 1], couplings[:, ABOVE, :, 0] = -draw.random((2, 2)), -draw.random((2, 2))
    matrix.blocks[:] = 10 ** draw.uniform(0, 12) * (draw.random((4, 2, 2)) - 0.5)
    matrix.blocks[:, [0, 1], [0, 1]] = 2 + draw.random((4, 2))
    solver = BoxSolver(matrix, "a test")
    solver.factorise()
    with pytest.raises(ConvergenceError, match=r"after \d+ iterations"):
        solver.solve(10 ** draw.uniform(138, 154) * draw.random((2, 4)), 1e-7)


@pytest.mark.parallel(alone=False)
def test_what_mpi_tells_of_is_raised_once() -> None:
    """Fails when an error of MPI goes unseen, or ends what comes after it."""
    box = Box(WORLD, 3, 4 * WORLD.size, False)
    module = kernels(box, 1)
    neighbours = Neighbourhood(module, box, box.rows)
    known, there = neighbours.known, list(neighbours.known.neighbour)
    couplings, blocks, result = np.ones((1, 4, box.cells)), np.ones((box.cells, 1, 1)), np.empty(box.cells)
    x = np.ones(box.cells + 2 * box.rows)
    arrays = [pointer(array) for array in (couplings, blocks, x, result)]
    known.neighbour = [WORLD.size, WORLD.size]
    module.lib.multiply(known, *arrays)
    with pytest.raises(MPI.Exception):
        neighbours.check()
    known.neighbour = there
    x[:] = 1.0
    module.lib.multiply(known, *arrays)
    neighbours.check()
    np.testing.assert_array_equal(result, 5.0)


def strip_matrix(velocity: float, storage: float) -> BoxMatrix:
    """Fluxes of a closed strip, conductance 1, with random eddies of this `velocity`, and `storage` over the largest outflow of a cell."""
    rows, columns = 24, 40
    psi = np.random.default_rng(8).standard_normal((columns, rows + 1))  # at the lower left corners
    psi[:, [0, -1]] = 0.0
    psi *= velocity
    right = np.roll(psi[:, 1:] - psi[:, :-1], -1, axis=0)  # through the right-hand face of (column, row)
    up = psi - np.roll(psi, -1, axis=0)  # through the lower face
    matrix = BoxMatrix(Box(MPI.COMM_SELF, rows, columns, True), 1)
    couplings, outflow = matrix.couplings.reshape(4, columns, rows), np.zeros((columns, rows))
    a, b = two_point_flux(right, np.ones(1))
    couplings[BEFORE], couplings[AFTER] = -np.roll(a, 1, axis=0), -b
    outflow += a + np.roll(b, 1, axis=0)
    a, b = two_point_flux(up[:, 1:-1], np.ones(1))
    couplings[BELOW, :, 1:], couplings[ABOVE, :, :-1] = -a, -b
    outflow[:, :-1] += a
    outflow[:, 1:] += b
    matrix.blocks[:, 0, 0] = (outflow + storage * outflow.max()).ravel()
    return matrix


def iterations_of(matrix: BoxMatrix) -> int:
    solver = BoxSolver(matrix, "a test")
    solver.factorise()
    rhs = np.random.default_rng(9).random((1, matrix.box.cells))
    found, iterations = solver.solve(rhs, 1e-12)
    product = np.empty_like(rhs)
    matrix.multiply(found, product)
    np.testing.assert_allclose(product, rhs, atol=1e-8)
    return iterations


def test_what_the_factor_makes_up_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the factor makes up for what is carried one way, which takes many times the iterations where gas goes round in circles, or
    no longer for diffusion, which takes many more in long steps."""
    diffusion, eddies = strip_matrix(0.0, 1e-3), strip_matrix(20.0, 1e-3)
    now = iterations_of(diffusion), iterations_of(eddies)
    monkeypatch.setattr(box_matrix, "RELAXED", 0.0)
    without = iterations_of(diffusion), iterations_of(eddies)
    assert now[0] < 0.75 * without[0]
    assert now[1] < 1.25 * without[1]
