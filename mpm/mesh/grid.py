"""The strip as a rectangular grid: edges, layers, zones and the share of each boundary facet that a port covers.

The reactor is a two-dimensional strip, `x` along the reactor and `y` upwards. `y = 0` lies at the top of the moving layer
(at the bottom of the strip when no layer moves). Cells are numbered row by row from the bottom: `cell = row * columns + column`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats, Ints

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.layers import Layer
    from mpm.case.materials import Material

ON_EDGE = 1e-6  # of a column: places as close to each other are one
HALF = 0.5 * (1.0 - 1e-9)  # of a facet, less what rounding may take of it


class Span(Protocol):
    """Anything that covers the wall from `x0` to `x1` [m]: an inlet or an outlet."""

    @property
    def x0(self) -> float: ...
    @property
    def x1(self) -> float: ...


@dataclass(frozen=True, eq=False)
class Grid:
    """Equal columns of width `dx`, rows graded within each layer.

    `x` (columns + 1) and `y` (rows + 1) are edges [m], `row_layer` the index of each row's layer, `zone_of_column` the number of
    the zone that holds a column's centre (1, 2, ... in the order of the case; 0 where there is none). `materials` are those of the
    layers, None for gas; `moving` (rows,) tells which rows belong to the moving layer.
    """

    x: Floats
    y: Floats
    row_layer: Ints
    zone_of_column: Ints
    layer_names: tuple[str, ...]
    materials: tuple[Material | None, ...]
    moving: NDArray[np.bool_]
    periodic: bool

    @classmethod
    def from_case(cls, case: Case) -> Grid:
        """Lay out the grid of a case; the cell width is rounded so that all columns are equal."""
        geometry = case.geometry
        x = np.linspace(0.0, geometry.length, geometry.columns + 1)
        y = [0.0]
        row_layer = []
        reference = 0.0
        for index, layer in enumerate(geometry.layers):
            base = y[-1]
            y.extend(base + np.cumsum(row_heights(layer)))
            y[-1] = base + layer.height
            row_layer += [index] * layer.cells
            if layer.moving:
                reference = y[-1]
        centres = 0.5 * (x[1:] + x[:-1])
        zone = np.zeros(len(centres), dtype=np.int64)
        for number, z in enumerate(geometry.zones, start=1):
            zone[(centres >= z.start) & (centres < z.end)] = number
        return cls(
            x=x,
            y=np.asarray(y) - reference,
            row_layer=np.asarray(row_layer, dtype=np.int64),
            zone_of_column=zone,
            layer_names=tuple(layer.name for layer in geometry.layers),
            materials=tuple(layer.material for layer in geometry.layers),
            moving=np.repeat(
                [layer.moving for layer in geometry.layers], [layer.cells for layer in geometry.layers]
            ),
            periodic=geometry.periodic,
        )

    @property
    def columns(self) -> int:
        return len(self.x) - 1

    @property
    def rows(self) -> int:
        return len(self.y) - 1

    @property
    def cells(self) -> int:
        return self.rows * self.columns

    @property
    def dx(self) -> float:
        """Width of a column [m]."""
        return float((self.x[-1] - self.x[0]) / self.columns)

    @property
    def dy(self) -> Floats:
        """Heights of the rows [m]."""
        return np.diff(self.y)

    @property
    def length(self) -> float:
        return float(self.x[-1] - self.x[0])

    @property
    def height(self) -> float:
        return float(self.y[-1] - self.y[0])

    def per_row(self, value: Callable[[Material], float], gas: float) -> Floats:
        """What `value` says of the material of each row, (rows,); `gas` in rows without one."""
        by_layer = [gas if material is None else value(material) for material in self.materials]
        return np.asarray(by_layer, dtype=float)[self.row_layer]

    def layer_rows(self, name: str) -> slice:
        """Rows of the layer `name`."""
        rows = np.flatnonzero(self.row_layer == self.layer_names.index(name))
        return slice(int(rows[0]), int(rows[-1]) + 1)

    def overlap(self, port: Span) -> Floats:
        """Length of each column's wall facet that `port` covers [m]; sums to the width of the port."""
        return np.asarray(
            np.clip(np.minimum(self.x[1:], port.x1) - np.maximum(self.x[:-1], port.x0), 0.0, None)
        )

    def opening(self, port: Span) -> NDArray[np.bool_]:
        """Columns whose wall facet is open: at least half of it covered by the port, or the one it covers most."""
        overlap = self.overlap(port)
        is_open = overlap >= HALF * self.dx
        if not is_open.any():
            is_open[np.argmax(overlap)] = True
        return is_open

    @property
    def row_centres(self) -> Floats:
        """Heights of the rows' centres (rows,) [m]."""
        return 0.5 * (self.y[1:] + self.y[:-1])

    @property
    def centres(self) -> Floats:
        """Middle of each column [m]."""
        return 0.5 * (self.x[1:] + self.x[:-1])

    def columns_between(self, start: float, end: float) -> NDArray[np.bool_]:
        """Columns whose centre lies in [start, end) [m]."""
        return (self.centres >= start) & (self.centres < end)


def row_heights(layer: Layer) -> Floats:
    """Heights of a layer's rows from the bottom [m]: geometric, the top one `grading` times the bottom one."""
    n = layer.cells
    ratio = layer.grading ** (1.0 / (n - 1)) if n > 1 else 1.0
    weights = ratio ** np.arange(n)
    return layer.height * weights / weights.sum()
