"""Where the fronts of precursors and of the coverage stand.

A number that does not exist, such as a front in a layer that the precursor has not reached, is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.mesh.grid import ON_EDGE, Grid
from mpm.report.balances import FLOOR
from mpm.report.coating import titrated, within
from mpm.report.records import State

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.ports import Inlet


def crossing(distance: Floats, values: Floats, level: float) -> float | None:
    """First distance at which `values`, which begin above `level`, fall to it (linear between points); None when they do not.

    Also None when the first value lies below the level already: then there is no front to follow from there.
    """
    below = np.flatnonzero(values < level)
    if len(below) == 0 or below[0] == 0:
        return None
    i = int(below[0])
    share = (values[i - 1] - level) / (values[i - 1] - values[i])
    return float(distance[i - 1] + share * (distance[i] - distance[i - 1]))


def column_of(grid: Grid, x: float, towards: int) -> int:
    """The column that holds `x` [m]; on the edge of two the right (`towards` +1) or the left (-1) one, whatever rounding says."""
    place = (x - grid.x[0]) / grid.dx
    edge = round(place)
    column = int(place) if abs(place - edge) > ON_EDGE else edge - (towards < 0)
    return min(max(column, 0), grid.columns - 1)


def walk(grid: Grid, start: float, direction: int) -> tuple[Floats, NDArray[np.int64]]:
    """Distances from `start` [m] and columns met when walking along the strip to the right (+1) or left (-1).

    Once around a periodic strip, to the wall of a closed one. The first is the column that holds `start`, or ends there.
    """
    first = column_of(grid, start, -direction)
    count = grid.columns if grid.periodic else (grid.columns - first if direction > 0 else first + 1)
    steps = np.arange(count)
    centre = grid.x[0] + (first + 0.5) * grid.dx
    distance = direction * (centre - start) + steps * grid.dx
    return distance, (first + direction * steps) % grid.columns


def layer_mean(grid: Grid, field: Floats, layer: str) -> Floats:
    """Mean over the height of a layer of a field (rows, columns); (columns,)."""
    rows = grid.layer_rows(layer)
    heights = grid.dy[rows]
    return np.asarray(heights @ field[rows] / heights.sum())


def front(grid: Grid, profile: Floats, *, feed: float, center: float, along: int = 1) -> dict[str, float]:
    """Fronts of a concentration profile (columns,) around an inlet at `center` [m] that feeds `feed` [mol/m3]; solids go `along` +x or -x.

    `upstream`, `downstream`: distance [m] from the inlet's centreline against and along the conveying direction at which the
    profile falls to half the feed; `upstream_width`: distance between 90 and 10 % of its largest value, upstream of that value, where that
    is at least FLOOR of the feed: less is no front but the far end of one.
    """
    result: dict[str, float] = {}
    for name, direction in (("upstream", -along), ("downstream", along)):
        distance, columns = walk(grid, center, direction)
        at = crossing(distance, profile[columns], 0.5 * feed)
        if at is not None:
            result[name] = at
    top = int(np.argmax(profile))
    if profile[top] > FLOOR * feed:
        distance, columns = walk(grid, grid.x[top] + 0.5 * grid.dx, -along)
        values = profile[columns] / profile[top]
        high, low = crossing(distance, values, 0.9), crossing(distance, values, 0.1)
        if high is not None and low is not None:
            result["upstream_width"] = low - high
    return result


def fronts(case: Case, grid: Grid, state: State) -> dict[str, dict[str, Any]]:
    """Per dosing inlet and layer: the fronts of its precursor's height-averaged concentration (see `front`).

    In layers with reactive surface also `coverage` [m], see `coverage_front`, of the site species that its half-reactions make.
    With heat, concentrations are those that the same mole fractions have at the temperature of `[gas]`.
    `height`: the y [m] at which the precursor in the column of the centreline, seen from the inlet, falls to half its feed.
    """
    result: dict[str, dict[str, Any]] = {}
    for inlet in case.geometry.inlets:
        species = case.precursor(inlet)
        if species is None or species not in state.concentration:
            continue
        field = state.concentration[species]
        if state.temperature is not None:  # hot gas holds less, but that is no front
            field = field * (state.temperature / case.gas.temperature)
        feed = case.feed_concentrations(inlet.mass_fractions)[species]
        made = titrated(case, species, state.theta) if case.sites_made_by(inlet) else None
        entry: dict[str, Any] = {}
        for layer in case.geometry.layers:
            numbers = front(
                grid,
                layer_mean(grid, field, layer.name),
                feed=feed,
                center=inlet.center,
                along=case.direction,
            )
            coverage = None if made is None else _layer_coverage(grid, state, made, layer.name)
            if coverage is not None:
                incoming = None
                if layer.moving and case.geometry.bed_inflow == "fresh":
                    fresh = layer.solid.initial_coverage
                    incoming = sum(fresh.get(site, 0.0) for site in case.mechanism.titrated_sites(species))
                at = coverage_front(
                    grid, coverage, center=inlet.center, incoming=incoming, along=case.direction
                )
                if at is not None:
                    numbers["coverage"] = at
            if numbers:
                entry[layer.name] = numbers
        height = _height(grid, field, 0.5 * feed, inlet, case.direction)
        if height is not None:
            entry["height"] = height
        if entry:
            result[inlet.name] = entry
    return result


def coverage_front(
    grid: Grid, profile: Floats, *, center: float, incoming: float | None = None, along: int = 1
) -> float | None:
    """Distance [m] upstream of an inlet's centreline at which a height-averaged coverage (columns,) passes 1/2; solids go `along` +x or -x.

    Negative when the coverage at the centreline is below 1/2 already: the front then lies that far downstream. `incoming` is the
    coverage with which solids enter at the end they come from; they do not come round from the other then. None where there is no front.
    """
    upstream = _half(grid, profile, center, -along, incoming)
    if upstream is not None:
        return upstream
    downstream = _half(grid, 1.0 - profile, center, along, None if incoming is None else 1.0)
    return None if downstream is None else -downstream


def _half(grid: Grid, profile: Floats, center: float, direction: int, edge: float | None) -> float | None:
    """Distance from `center` at which `profile` falls to 1/2; with `edge`, its value at that end of the strip, the walk stops there."""
    distance, columns = walk(grid, center, direction)
    values = profile[columns]
    if edge is not None:
        end = center - grid.x[0] if direction < 0 else grid.x[-1] - center
        inside = distance < end
        distance, values = np.append(distance[inside], end), np.append(values[inside], edge)
    return crossing(distance, values, 0.5)


def _layer_coverage(grid: Grid, state: State, theta: Floats, layer: str) -> Floats | None:
    """Height mean of a coverage (reactive rows, columns) over a layer; None when the layer has no reactive surface."""
    inside = within(grid, layer, state.reactive_rows)
    if not inside.any():
        return None
    heights = grid.dy[state.reactive_rows[inside]]
    return np.asarray(heights @ theta[inside] / heights.sum())


def _height(grid: Grid, field: Floats, level: float, inlet: Inlet, along: int) -> float | None:
    """y at which the column above (or below) an inlet's centre crosses `level`, seen from the inlet."""
    column = column_of(grid, inlet.center, along)
    y = grid.row_centres
    values = field[:, column]
    at = crossing(y, values, level) if inlet.side == "bottom" else crossing(-y[::-1], values[::-1], level)
    return at if at is None or inlet.side == "bottom" else -at
