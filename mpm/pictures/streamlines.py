"""Streamlines of the gas from the velocities that a run has stored, as contour lines of its stream function.

The discrete flow has no divergence: the fluxes through the faces of every cell add up to nothing. It therefore has a stream function
whose values at the corners of the cells give those fluxes as differences, and its contour lines are the streamlines, with no path to
integrate and none that ends inside the strip. Between two neighbouring lines passes the same flow of gas. Where the density follows the
temperature it is the flux of mass that has no divergence, but for what gas gives off that warms just then.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.mesh.grid import Grid


def carried(cell_data: Mapping[str, NDArray[np.generic]]) -> Floats:
    """Superficial velocity of the gas (cells, 2 or 3) [m/s], where the file has a density the flux of mass over the mean density."""
    velocity = np.asarray(cell_data["velocity"], dtype=float)
    density = cell_data.get("density")
    if density is None:
        return velocity
    rho = np.asarray(density, dtype=float)
    return velocity * (rho / rho.mean())[:, None]


def stream_function(grid: Grid, velocity: NDArray[np.generic]) -> Floats:
    """psi [m2/s] at the corners of the cells, (rows + 1, columns + 1) from the bottom left, where it is 0.

        u = d psi / dy,   v = -d psi / dx

    so that gas flows with the larger psi on its left hand, and psi at one point minus psi at another is the flow between the two.
    `velocity` are the superficial velocities (u, v) of the cells [m/s], means of their opposite faces as a run stores them:
    (cells, 2 or 3) or (rows, columns, 2 or 3). With the fluxes through the faces written as differences of psi they say in each cell

        psi_top_right - psi_bottom_left  = u dy - v dx
        psi_top_left  - psi_bottom_right = u dy + v dx

    which is summed up from row to row. That links corners along diagonals alone, like the squares of one colour on a chessboard; the
    constant between the two colours follows from walls, along which psi is constant or (under an inlet of even velocity) a straight
    line. A periodic strip needs no special care, but psi is not periodic: from the left end to the right it falls by what flows upwards.
    """
    uv = np.asarray(velocity, dtype=float).reshape(grid.rows, grid.columns, -1)
    along, up = uv[..., 0] * grid.dy[:, None], uv[..., 1] * grid.dx
    rising, falling = along - up, along + up
    psi = np.zeros((grid.rows + 1, grid.columns + 1))
    for j in range(2, grid.columns + 1):  # zigzag through the lowest row
        psi[0, j] = psi[0, j - 2] + rising[0, j - 2] - falling[0, j - 1]
    for i in range(grid.rows):
        from_left, from_right = psi[i, :-1] + rising[i], psi[i, 1:] + falling[i]
        psi[i + 1, 0], psi[i + 1, -1] = from_right[0], from_left[-1]
        psi[i + 1, 1:-1] = 0.5 * (from_left[:-1] + from_right[1:])
    colour = np.indices(psi.shape).sum(axis=0) % 2
    return psi - colour * _between_colours(grid, psi)


def _between_colours(grid: Grid, psi: Floats) -> float:
    """By how much psi is too large at every second corner: the median along walls of what bends it there, up and down in turn.

    Walls are the bottom and the top; in a single column the ends.
    """
    lines = psi[[0, -1]] if grid.columns > 1 else psi[:, [0, -1]].T
    bends = (2.0 * lines[:, 1:-1] - lines[:, :-2] - lines[:, 2:]) / 2.0
    row, column = np.indices(bends.shape)
    start = row * (grid.rows if grid.columns > 1 else grid.columns)
    sign = np.where((start + column + 1) % 2 == 1, 1.0, -1.0)
    return float(np.median(sign * bends)) if bends.size else 0.0


LINES = 24
"""Streamlines in a strip of one or two zones; in longer ones half as many in each."""


def stream_levels(grid: Grid, psi: Floats) -> Floats:
    """About `LINES` evenly spaced values of psi to draw lines of; none where the gas stands still.

    They keep half a spacing from the bottom wall's psi, and in a periodic strip they divide what flows upwards evenly, so that a line
    that leaves at one end enters at the other.
    """
    low, high = float(psi.min()), float(psi.max())
    through = abs(float(psi[0, -1] - psi[0, 0])) if grid.periodic else 0.0
    if high - low <= 0.0:
        return np.empty(0)
    spacing = (high - low) / (LINES * max(1.0, 0.5 * float(grid.zone_of_column.max())))
    if through > spacing:
        spacing = through / (2 * max(1, round(through / spacing / 2)))
    first, last = np.ceil(low / spacing - 0.5), np.floor(high / spacing - 0.5)
    return (np.arange(first, last + 1) + 0.5) * spacing
