"""Temperatures that no reactor has: what heats or cools a strip without end ends a run in one line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.mesh.strip import Strip
from mpm.parallel import largest

if TYPE_CHECKING:
    from mpm.case.case import Case

COLDEST, HOTTEST = 50.0, 1e4  # K: below, carriers are liquid or about to be; above, none is what it was
BEYOND = 2.0  # times the temperatures that a case gives, where these are as far out


def plausible(case: Case, strip: Strip, temperature: Floats) -> bool:
    """Whether all temperatures of own cells [K] are between COLDEST and HOTTEST; collective."""
    low, high = _limits(case)
    inside = bool(np.all((temperature > low) & (temperature < high)))  # not where one is no number
    return not largest(strip.comm, [float(not inside)])[0]


def require_plausible(case: Case, strip: Strip, temperature: Floats) -> None:
    """Raise ConvergenceError where a temperature of own cells [K] is not; collective."""
    if plausible(case, strip, temperature):
        return
    low, high = _limits(case)
    grid = strip.grid
    whole = strip.scatter.to_all(temperature)
    off = np.where(np.isfinite(whole), np.maximum(low - whole, whole - high), np.inf)
    row, column = divmod(int(np.argmax(off)), grid.columns)
    here = whole[row * grid.columns + column]
    if here < low:
        why = "more heat is taken away than there is (geometry.wall.NAME.heat_flux below 0)"
    else:
        why = "nothing takes away as much heat as is brought in (heating of layers, heat_flux of walls, reactions)"
    raise ConvergenceError(
        f"heat: a temperature of {here:.4g} K at x = {1e3 * grid.centres[column]:.2f} mm, "
        f"y = {1e3 * grid.row_centres[row]:.2f} mm: {why}"
    )


def _limits(case: Case) -> tuple[float, float]:
    given = case.temperatures
    return min(COLDEST, given[0] / BEYOND), max(HOTTEST, given[-1] * BEYOND)
