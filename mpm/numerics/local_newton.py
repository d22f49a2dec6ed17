"""Newton's method in every cell by itself (nonlinear elimination): concentrations at which reactions balance a given inflow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mpm.arrays import Floats, Ints

TRIES = 15  # Newton iterations in a cell
TIGHT = 1e-12  # residual of a cell over what passes through it
SHRINK = 0.05  # smallest factor on a concentration per iteration, which keeps it positive
LOWEST = 1e-40  # mol/m3; zero itself is a kink of the rates


def balance_locally(
    concentration: Floats,
    diagonal: Floats,
    inflow: Floats,
    sources: Callable[[Floats, Ints], tuple[Floats, Floats]],
    idle: float,
    tries: int = TRIES,
) -> Floats:
    """Concentrations (coupled, n) [mol/m3] at which every cell balances: diagonal C - source(C) = inflow.

    Newton's method in all cells at once from positive `concentration`, on fewer and fewer of them; `diagonal` [m2/s] and `inflow`
    [mol/m/s] are (coupled, n). `sources(c, active)` gives what reactions make in the cells `active` at concentrations `c` (coupled,
    active) [mol/m/s] and its derivatives (active, coupled, coupled) [m2/s]. Residuals below `idle` [mol/m/s] need no work.
    """
    b = len(concentration)
    c, active = concentration.copy(), np.arange(concentration.shape[1])
    for _ in range(tries):
        now, came = c.take(active, axis=1), inflow.take(active, axis=1)
        source, slope = sources(now, active)
        held = diagonal.take(active, axis=1) * now
        residual = held - came - source
        # cells whose reactions were not found keep what they have
        loose = (np.abs(residual) > TIGHT * (held + came) + idle).any(axis=0)
        active = active[loose]
        if not len(active):
            break
        matrix = -slope[loose]
        for i in range(b):
            matrix[:, i, i] += diagonal[i, active]
        change = _solved(matrix, residual[:, loose])
        found = np.isfinite(change).all(axis=0)
        active, change = active[found], change[:, found]
        c[:, active] = np.maximum(np.maximum(c[:, active] - change, SHRINK * c[:, active]), LOWEST)
    return c


def _solved(matrix: Floats, rhs: Floats) -> Floats:
    """x (b, n) of `matrix` (n, b, b) x = `rhs` (b, n) in every cell; of one unknown it is a division. No numbers where one is singular."""
    if len(rhs) == 1:
        return rhs / matrix[:, 0, 0]
    try:
        return np.asarray(np.linalg.solve(matrix, rhs.T[:, :, None])[:, :, 0].T)
    except np.linalg.LinAlgError:  # of one cell, which then stops all
        singular = np.abs(np.linalg.slogdet(matrix)[0]) == 0.0
        matrix[singular] = np.eye(len(rhs))
        x = np.linalg.solve(matrix, rhs.T[:, :, None])[:, :, 0].T
        return np.where(singular, np.nan, x)
