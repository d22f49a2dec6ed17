"""Small linear systems in many cells at once."""

from __future__ import annotations

import numpy as np

from mpm.arrays import Floats


def solve_cells(matrix: Floats, rhs: Floats) -> Floats:
    """x (k, m, n) of `matrix` (k, k, n) x = `rhs` (k, m, n) in every one of n cells; not numbers where one of them is singular.

    Rows are scaled first: rates of sites are decades apart.
    """
    scale = np.abs(matrix).max(axis=1)
    scale = 1.0 / np.where(scale > 0.0, scale, 1.0)
    a = np.moveaxis(matrix * scale[:, None], 2, 0)
    b = np.moveaxis(rhs * scale[:, None], 2, 0)
    try:
        return np.ascontiguousarray(np.moveaxis(np.linalg.solve(a, b), 0, 2))
    except np.linalg.LinAlgError:
        return np.full_like(rhs, np.nan)


def invariants(changes: Floats) -> tuple[Floats, list[int]]:
    """Sums (sums, kinds) that no row of `changes` (events, kinds) changes, and for each a kind that no other of them counts."""
    rows = np.array(changes, dtype=float)
    kinds = rows.shape[1]
    pivots: list[int] = []
    for column in range(kinds):
        left = rows[len(pivots) :]
        if not len(left) or np.abs(left[:, column]).max() < 1e-9 * max(np.abs(changes).max(), 1.0):
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
