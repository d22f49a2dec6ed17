"""The grid of a case: edges, layers, zones, and what a port covers of each wall facet."""

import numpy as np
import pytest

from mpm.mesh.grid import Grid, row_heights

from .cases import strip_case, zone


@pytest.fixture(scope="module")
def grid() -> Grid:
    return Grid.from_case(zone())


def test_columns_are_equal_and_fill_the_length() -> None:
    """Fails when the cell width is cut instead of rounded (a last narrow column), or the length is not kept."""
    for width, columns in (("0.34 mm", 411), ("2.33 mm", 60), ("50 mm", 3), ("46 mm", 3)):
        grid = Grid.from_case(zone({"geometry.cell_width": width}))
        assert grid.columns == columns
        np.testing.assert_allclose(np.diff(grid.x), 139.7e-3 / columns, rtol=1e-12)
        assert grid.x[-1] == pytest.approx(139.7e-3, rel=1e-15) and grid.dx == pytest.approx(
            139.7e-3 / columns
        )


def test_y_is_zero_at_the_top_of_the_moving_layer(grid: Grid) -> None:
    """Fails when y = 0 lies elsewhere, or a layer's edges are not exactly at its height."""
    bed = grid.layer_rows("bed")
    assert abs(grid.y[bed.stop]) < 1e-15
    assert grid.y[bed.start] == pytest.approx(-3e-3) and grid.y[0] == pytest.approx(-9.59e-3)
    assert grid.y[-1] == pytest.approx(12.7e-3)
    still = Grid.from_case(zone({"geometry.layer.bed.moving": False}))
    assert still.y[0] == 0.0


def test_layers_zones_and_lengths(grid: Grid) -> None:
    """Fails when rows or columns are attributed to the wrong layer or zone, or cells do not add up to the strip."""
    assert [grid.layer_rows(n) for n in grid.layer_names] == [
        slice(0, 4),
        slice(4, 7),
        slice(7, 11),
        slice(11, 19),
    ]
    assert grid.dx * grid.columns == pytest.approx(139.7e-3, rel=1e-12)
    assert grid.dy.sum() == pytest.approx(22.29e-3, rel=1e-12)
    assert grid.cells == len(grid.dy) * grid.columns
    assert set(grid.zone_of_column) == {1}
    two = Grid.from_case(zone({"geometry.zone.zone1.start": "70 mm", "geometry.zone.zone1.end": "120 mm"}))
    assert np.array_equal(two.zone_of_column == 1, two.columns_between(70e-3, 120e-3))
    assert (two.zone_of_column == 0).any()


@pytest.mark.parametrize("grading", [0.05, 1.0, 20.0])
def test_graded_rows(grading: float) -> None:
    """Fails when the top row is not `grading` times the bottom row, the growth is not geometric, or the height is lost."""
    case = strip_case([{"name": "gas", "height": "7 mm", "cells": 9, "grading": grading}])
    heights = row_heights(case.geometry.layers[0])
    assert heights[-1] / heights[0] == pytest.approx(grading)
    np.testing.assert_allclose(heights[1:] / heights[:-1], grading ** (1 / 8), rtol=1e-12)
    assert heights.sum() == pytest.approx(7e-3, rel=1e-14)
    np.testing.assert_allclose(Grid.from_case(case).dy, heights, rtol=1e-12)


def test_single_row_ignores_its_grading() -> None:
    """Fails when one row with a grading divides by zero or changes height."""
    case = strip_case([{"name": "gas", "height": "7 mm", "cells": 1, "grading": 3.0}])
    np.testing.assert_allclose(Grid.from_case(case).dy, [7e-3])


def test_overlap_sums_to_the_width_of_any_port(grid: Grid) -> None:
    """Fails when a port that does not end on columns feeds another width than its own: its dose would depend on the mesh."""
    rng = np.random.default_rng(5)
    for _ in range(100):
        width = rng.uniform(0.05, 60.0)
        center = rng.uniform(width / 2, 139.7 - width / 2)
        case = zone(
            {
                "geometry.inlet.tma.center": f"{center!r} mm",
                "geometry.inlet.tma.width": f"{width!r} mm",
                "geometry.inlet.purge.side": "top",
                "geometry.outlet.zone1.side": "top",
                "geometry.zone.zone1.inlet": "tma",
                "geometry.inlet.purge.center": "5 mm",
            }
        )
        overlap = Grid.from_case(case).overlap(case.geometry.inlets[1])
        assert overlap.sum() == pytest.approx(width * 1e-3, rel=1e-10)
        assert overlap.min() >= 0.0 and overlap.max() <= grid.dx * (1 + 1e-12)


def test_an_outlet_opens_at_least_one_facet(grid: Grid) -> None:
    """Fails when a narrow outlet closes altogether, or a facet opens that is covered by less than half."""

    class Port:
        x0, x1 = 2.4 * grid.dx, 2.7 * grid.dx

    assert np.flatnonzero(grid.opening(Port())).tolist() == [2]
    Port.x0, Port.x1 = 1.4 * grid.dx, 4.4 * grid.dx
    assert np.flatnonzero(grid.opening(Port())).tolist() == [1, 2, 3]
