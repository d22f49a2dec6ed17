"""Small linear systems in many cells at once."""

from __future__ import annotations

import numpy as np

from mpm.arrays import Floats

SLIGHTEST = 1e-20  # pivot of a singular matrix whose rows are of size one
FEW = 4  # unknowns up to which all cells at once are faster than LAPACK cell by cell: of 5,000 cells five times for 2, twice for 4


def solve_cells(matrix: Floats, rhs: Floats) -> Floats:
    """x (k, m, n) of `matrix` (k, k, n) x = `rhs` (k, m, n) in every one of n cells; where one is singular, of one that hardly differs.

    Rows are scaled first: rates of sites are decades apart.
    """
    scale = np.abs(matrix).max(axis=1)
    scale = 1.0 / np.where(scale > 0.0, scale, 1.0)
    a, b = matrix * scale[:, None], rhs * scale[:, None]
    if len(a) <= FEW:
        return _eliminated(a, b)
    try:
        x = np.linalg.solve(np.moveaxis(a, 2, 0), np.moveaxis(b, 2, 0))
        return np.ascontiguousarray(np.moveaxis(x, 0, 2))
    except np.linalg.LinAlgError:  # one cell's is singular, and LAPACK then gives none of the others
        return _eliminated(a, b)


def _eliminated(a: Floats, b: Floats) -> Floats:
    """The same by elimination with pivots from the column, in all cells at once, in place."""
    k = len(a)
    for i in range(k):
        for row in range(i + 1, k):  # the largest one comes up
            larger = np.abs(a[row, i]) > np.abs(a[i, i])
            for rows in (a, b):
                rows[i], rows[row] = (
                    np.where(larger, rows[row], rows[i]),
                    np.where(larger, rows[i], rows[row]),
                )
        pivot = a[i, i]
        pivot[np.abs(pivot) < SLIGHTEST] = SLIGHTEST
        for j in range(i + 1, k):
            factor = a[j, i] / pivot
            a[j, i + 1 :] -= factor * a[i, i + 1 :]
            b[j] -= factor * b[i]
    for i in reversed(range(k)):
        for j in range(i + 1, k):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]
    return b


def invariants(changes: Floats) -> tuple[Floats, list[int]]:
    """Sums (sums, kinds) that no row of `changes` (events, kinds) changes, and for each a kind that no other of them counts."""
    rows = np.array(changes, dtype=float)
    kinds = rows.shape[1]
    nothing = 1e-9 * np.abs(rows).max(initial=1.0)
    pivots: list[int] = []
    for column in range(kinds):
        left = rows[len(pivots) :]
        if not len(left) or np.abs(left[:, column]).max() < nothing:
            continue
        best = len(pivots) + int(np.argmax(np.abs(left[:, column])))
        rows[[len(pivots), best]] = rows[[best, len(pivots)]]
        rows[len(pivots)] /= rows[len(pivots), column]
        for other in range(len(rows)):
            if other != len(pivots):
                rows[other] -= rows[other, column] * rows[len(pivots)]
        pivots.append(column)
    free = [k for k in range(kinds) if k not in pivots]
    sums = np.zeros((len(free), kinds))
    for i, k in enumerate(free):
        sums[i, k] = 1.0
        sums[i, pivots] = -rows[: len(pivots), k]
    return sums, free
