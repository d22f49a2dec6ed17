"""Fronts, walks and amounts of `mpm.report.fronts` against profiles whose answer is known on paper; no solver."""

import numpy as np
import pytest

from mpm.case.case import load_case
from mpm.mesh.grid import Grid
from mpm.report.fronts import coverage_front, crossing, front, walk

COARSE = {
    "geometry.cell_width": "2 mm",
    "geometry.layer.plenum.cells": 2,
    "geometry.layer.frit.cells": 2,
    "geometry.layer.bed.cells": 2,
    "geometry.layer.headspace.cells": 2,
}


@pytest.fixture(scope="module")
def grid() -> Grid:
    return Grid.from_case(load_case("single_zone", COARSE))


def centres(grid: Grid) -> np.ndarray:
    return 0.5 * (grid.x[1:] + grid.x[:-1])


def test_crossing_is_linear_between_points() -> None:
    """Fails when the position is that of a point, or when a profile that starts below the level gives a front."""
    distance = np.array([0.0, 1.0, 2.0])
    assert crossing(distance, np.array([1.0, 0.75, 0.25]), 0.5) == pytest.approx(1.5)
    assert crossing(distance, np.array([0.4, 0.2, 0.1]), 0.5) is None
    assert crossing(distance, np.array([1.0, 0.9, 0.8]), 0.5) is None


@pytest.mark.parametrize("direction", [-1, 1])
def test_walk_goes_once_around_a_periodic_strip(grid: Grid, direction: int) -> None:
    """Fails when a column is missed or met twice, or when the distances are not those of the centres."""
    start = 0.1048
    distance, columns = walk(grid, start, direction)
    assert sorted(columns) == list(range(grid.columns))
    offset = direction * (centres(grid)[columns] - start)
    around = distance - offset
    assert np.allclose(around, grid.length * np.round(around / grid.length))
    assert np.allclose(np.diff(distance), grid.dx)


def test_walk_ends_at_the_wall_of_a_closed_strip() -> None:
    """Fails when a walk goes through a wall, or stops before it."""
    closed = Grid.from_case(load_case("single_zone", {**COARSE, "geometry.periodic": False}))
    _, right = walk(closed, centres(closed)[50], 1)
    _, left = walk(closed, centres(closed)[50], -1)
    assert list(right) == list(range(50, closed.columns)) and list(left) == list(range(50, -1, -1))


def test_front_of_a_ramp(grid: Grid) -> None:
    """A concentration that falls linearly upstream from the port: half the feed, and 10 to 90 %, lie where the ramp says."""
    center, reach, feed = 0.1048, 0.05, 2.0
    behind = np.clip(center - centres(grid), 0.0, None)
    profile = feed * np.clip(1.0 - behind / reach, 0.0, 1.0)
    found = front(grid, profile, feed=feed, center=center)
    assert found["upstream"] == pytest.approx(0.5 * reach, rel=0.05)
    assert found["upstream_width"] == pytest.approx(0.8 * reach, rel=0.05)
    assert "downstream" not in front(grid, np.full(grid.columns, feed), feed=feed, center=center)
    assert (
        front(grid, 1e-9 * profile, feed=feed, center=center) == {}
    )  # the far end of a front has no width of its own


@pytest.mark.parametrize("place", [0.06, 0.12])
def test_coverage_front_is_signed(grid: Grid, place: float) -> None:
    """Covered solids begin at `place`: upstream of the inlet the distance is positive, downstream negative."""
    profile = np.where(centres(grid) > place, 1.0, 0.0)
    found = coverage_front(grid, profile, center=0.1048, incoming=0.0)
    assert found == pytest.approx(0.1048 - place, abs=grid.dx)


@pytest.mark.parametrize("place", [0.09, 0.12])
def test_coverage_front_is_linear_between_columns(grid: Grid, place: float) -> None:
    """Fails when the coverage of a ramp passes another value than 1/2 there, upstream or downstream of the inlet."""
    ramp = np.clip(0.5 + (centres(grid) - place) / 0.04, 0.0, 1.0)
    assert coverage_front(grid, ramp, center=0.1048, incoming=0.0) == pytest.approx(0.1048 - place, abs=1e-12)


def test_solids_do_not_come_round_the_seam(grid: Grid) -> None:
    """A bed covered throughout whose solids come in bare has its front at the left end; one that comes in covered has none."""
    covered = np.ones(grid.columns)
    assert coverage_front(grid, covered, center=0.1048, incoming=0.0) == pytest.approx(0.1048, abs=grid.dx)
    assert coverage_front(grid, covered, center=0.1048, incoming=1.0) is None
    assert coverage_front(grid, 0.0 * covered, center=0.1048, incoming=0.0) is None
