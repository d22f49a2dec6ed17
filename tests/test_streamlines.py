"""The stream function gives back the flow it is made from."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpm.case.case import load_case
from mpm.mesh.grid import Grid
from mpm.pictures.streamlines import LINES, stream_function, stream_levels


def grid(**changes: object) -> Grid:
    """The strip of a shipped zone on a coarse mesh with rows of several heights; y = 0 is the top of its bed."""
    return Grid.from_case(load_case("single_zone", {"geometry.cell_width": "3 mm", **changes}))


def velocities(grid: Grid, psi: np.ndarray) -> np.ndarray:
    """Cell velocities (rows, columns, 2) as a run stores them: means of the flow through opposite faces."""
    along, up = np.diff(psi, axis=0) / grid.dy[:, None], -np.diff(psi, axis=1) / grid.dx
    return np.stack([0.5 * (along[:, 1:] + along[:, :-1]), 0.5 * (up[1:] + up[:-1])], axis=-1)


def height(y: np.ndarray) -> np.ndarray:
    """0 at the bottom wall, 1 at the top."""
    return (y - y.min()) / np.ptp(y)


def uniform(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Along and upwards through both walls."""
    return 0.02 * y - 0.01 * x


def channel(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Plane Poiseuille flow between the walls."""
    s = height(y)
    return 1e-4 * (3 * s**2 - 2 * s**3) + 0.0 * x


def loop(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """One closed roll."""
    return 1e-4 * np.sin(np.pi * x / x.max()) * np.sin(np.pi * height(y))


def through_ports(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """In through a slot in the bottom, out through another in the top, while as much again circulates along the periodic strip."""
    s = height(y)
    ramp = [-1e-4 * np.clip((x / x.max() - place) / 0.05, 0.0, 1.0) for place in (0.3, 0.7)]
    return (1 - s) * ramp[0] + s * ramp[1] + 1e-4 * s


@pytest.mark.parametrize("flow", [uniform, channel, loop, through_ports])
@pytest.mark.parametrize("cell_width", ["3 mm", "3.1 mm"])
@pytest.mark.parametrize("stored", [np.float64, np.float32])
def test_stream_function_is_that_of_the_flow(flow: Any, cell_width: str, stored: type) -> None:
    """Fails when a sign, a row height or the constant between neighbouring corners is wrong (for even and odd numbers of columns)."""
    strip = grid(**{"geometry.cell_width": cell_width})
    exact = flow(strip.x[None, :], strip.y[:, None])
    exact = exact - exact[0, 0]
    given: np.ndarray = velocities(strip, exact).astype(stored)
    for shaped in (given, given.reshape(-1, 2), np.pad(given.reshape(-1, 2), ((0, 0), (0, 1)))):
        psi = stream_function(strip, shaped)
        assert psi.shape == (strip.rows + 1, strip.columns + 1) and psi[0, 0] == 0.0
        close = 1e-12 if stored is np.float64 else 1e-5
        assert np.abs(psi - exact).max() <= close * np.abs(exact).max()


def test_sign() -> None:
    """Fails when gas does not have the larger values on its left: along x they are above, upwards they are to the left."""
    strip = grid()
    along = stream_function(strip, np.full((strip.cells, 2), (0.01, 0.0)))
    upwards = stream_function(strip, np.full((strip.cells, 2), (0.0, 0.01)))
    assert np.all(np.diff(along, axis=0) > 0.0) and np.all(np.diff(upwards, axis=1) < 0.0)
    assert along[-1, 0] == pytest.approx(0.01 * (strip.y[-1] - strip.y[0]))
    assert upwards[0, -1] == pytest.approx(-0.01 * strip.length)


def test_one_column() -> None:
    """Fails when a plug-flow column, which has no corner between its ends, breaks the search for the constant."""
    whole = grid()
    strip = replace(whole, x=whole.x[[0, -1]])
    psi = stream_function(strip, np.full((strip.cells, 2), (0.0, 0.02)))
    assert strip.columns == 1 and np.allclose(psi, np.array([0.0, -0.02 * strip.length]))


def test_levels_divide_the_flow_and_keep_off_the_walls() -> None:
    """Fails when lines end at the seam of a periodic strip, lie on a wall, are drawn where nothing flows, or get rare in a long strip."""
    strip = grid()
    psi = through_ports(strip.x[None, :], strip.y[:, None])
    levels = stream_levels(strip, psi)
    spacing = np.diff(levels)
    assert 15 <= len(levels) <= 40 and np.allclose(spacing, spacing[0])
    assert (1e-4 / spacing[0]) == pytest.approx(round(1e-4 / spacing[0]))
    on_walls = np.array([0.0, -1e-4])  # of the bottom wall, left and right of the slot
    assert np.abs(levels[:, None] - on_walls).min() > 0.4 * spacing[0]
    assert len(stream_levels(strip, np.zeros_like(psi))) == 0
    closed = replace(strip, periodic=False)  # nothing has to meet at the ends
    assert np.diff(stream_levels(closed, psi))[0] == pytest.approx(np.ptp(psi) / LINES)
    eight_zones = replace(strip, zone_of_column=np.full(strip.columns, 8))
    assert len(stream_levels(eight_zones, psi)) == pytest.approx(4 * len(levels), rel=0.1)
