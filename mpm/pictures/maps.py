"""Maps of the strip: a field of a run with layers, ports and zones drawn to scale, in the unit and colours of `mpm.report.fieldnames`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import ScalarFormatter

from mpm.arrays import Floats
from mpm.labels import literal
from mpm.mesh.grid import Grid
from mpm.output.results import Run
from mpm.output.vtu import Snapshot
from mpm.pictures.outline import (
    LINE,
    MM,
    WIDTH,
    draw_layers,
    draw_ports,
    draw_walls,
    draw_zones,
    formula,
    way,
)
from mpm.pictures.streamlines import carried, stream_function, stream_levels
from mpm.report.fieldnames import FieldName, Limits, colour_limits, field_name, field_values

PLAIN = "#d9e3ea"
"""Colour of a field that is the same everywhere."""
OUTLINE: list[AbstractPathEffect] = [withStroke(linewidth=1.7, foreground="0.25", alpha=0.6)]


def values_of(run: Run, snapshot: Snapshot, name: str) -> np.ma.MaskedArray:
    """A field as (rows, columns) in SI units; coverages are masked where there is no reactive surface. Raises InputError (unknown name)."""
    grid = run.grid
    found = field_values(snapshot.cell_data, name, run.directory.pvd).reshape(grid.rows, grid.columns)
    if not field_name(name).porous:
        return np.ma.masked_array(found)
    reactive = grid.per_row(lambda material: material.surface_to_volume, gas=0.0) > 0.0
    return np.ma.masked_where(np.broadcast_to(~reactive[:, None], found.shape), found)


def ends_of(run: Run, snapshots: Iterable[Snapshot], name: str) -> tuple[float, float]:
    """The least and the largest value of a field in all these snapshots [SI]."""
    values = (values_of(run, snapshot, name) for snapshot in snapshots)
    ends = [(float(one.min()), float(one.max())) for one in values if one.count()]
    return (min(low for low, _ in ends), max(high for _, high in ends)) if ends else (0.0, 0.0)


def limits_of(run: Run, snapshots: Iterable[Snapshot], name: str) -> Limits:
    """The scale that holds a field of all these snapshots."""
    return colour_limits(field_name(name), *ends_of(run, snapshots, name))


def colours(entry: FieldName, limits: Limits) -> tuple[Colormap | str, Normalize]:
    """Colour map and scale for values in `entry.unit_shown`."""
    if limits.constant:
        return ListedColormap([PLAIN]), Normalize(0.0, 1.0)
    low, high = limits.low / entry.factor, limits.high / entry.factor
    return entry.colours, LogNorm(low, high, clip=True) if limits.log else Normalize(low, high)


def words_of(entry: FieldName) -> str:
    """What a field is called, chemical formulas with subscripts."""
    return literal(entry.words).format(formula(entry.subject))


def in_unit(entry: FieldName, text: str, brackets: str = "{}") -> str:
    """`text` followed by the unit shown, if there is one."""
    return f"{text} {brackets.format(entry.unit_shown)}" if entry.unit_shown else text


def name_of(run: Run) -> str:
    """A run in the title of its pictures: what the case calls it, and its directory."""
    where = run.directory.path.resolve().name
    return literal(f"{run.case.title} [{where}]" if run.case.title else where)


def when(run: Run, snapshot: Snapshot) -> str:
    """The instant that a picture shows."""
    return "steady state" if run.case.fidelity == "steady" else f"t = {snapshot.time:.4g} s"


class Map:
    """A picture of one field that can be turned to any instant with `show`: the strip, and for coverages the moving layer again, stretched.

    With `streamlines`, lines of the gas lie over it: contour lines of its stream function, see `mpm.pictures.streamlines`.
    """

    def __init__(self, run: Run, name: str, limits: Limits, streamlines: bool = False):
        self.run, self.entry, self.limits, self.streamlines = run, field_name(name), limits, streamlines
        self.stretch = stretch_of(run.grid)
        self.rows = [slice(0, run.grid.rows)]
        if self.entry.porous:
            self.rows += [
                run.grid.layer_rows(layer.name) for layer in run.case.geometry.layers if layer.moving
            ]
        height = run.grid.y[-1] - run.grid.y[0]
        heights = [height / run.grid.length * WIDTH * self.stretch] + [1.3] * (len(self.rows) - 1)
        self.figure = Figure(
            figsize=(WIDTH + 1.6, sum(heights) + 0.9 * len(heights) + 1.2), layout="constrained"
        )
        grid = self.figure.add_gridspec(len(heights), 1, height_ratios=heights)
        self.panels = [self.figure.add_subplot(grid[k, 0]) for k in range(len(heights))]
        empty = np.zeros((run.grid.rows, run.grid.columns))
        self.meshes = [
            draw_strip(self.panels[0], run, empty, self.entry, limits, self.stretch),
            *(
                draw_layer(panel, run, rows, empty, self.entry, limits)
                for panel, rows in zip(self.panels[1:], self.rows[1:], strict=True)
            ),
        ]
        self.panels[-1].set_xlabel(f"x [mm]{way(run.case)}", labelpad=4 if len(heights) > 1 else 14 + LINE)
        self.panels[0].set_title(
            drawn_how(run, self.stretch, streamlines), pad=18 + LINE, fontsize=7.5, color="0.35"
        )
        self.lines: list[ContourSet | Line2D] = []

    def show(self, snapshot: Snapshot) -> Figure:
        """The picture of one instant."""
        run = self.run
        values = values_of(run, snapshot, self.entry.name) / self.entry.factor
        for mesh, rows in zip(self.meshes, self.rows, strict=True):
            mesh.set_array(values[rows])
        self.figure.suptitle(f"{name_of(run)}, {when(run, snapshot)}", fontsize=10)
        for line in self.lines:
            line.remove()
        self.lines = (
            draw_streamlines(self.panels, run.grid, snapshot, self.stretch) if self.streamlines else []
        )
        if len(self.figure.axes) == len(self.panels):
            scale_bar(self.figure, self.meshes[0], self.panels, self.entry, self.limits, values)
        return self.figure


def map_figure(
    run: Run, snapshot: Snapshot, name: str, limits: Limits | None = None, streamlines: bool = False
) -> Figure:
    """A field at one instant, on a scale that fits it unless `limits` are given."""
    return Map(run, name, limits or limits_of(run, [snapshot], name), streamlines).show(snapshot)


def stretch_of(grid: Grid) -> int:
    """By how much heights are stretched, so that the strip is at least 0.7 inch high."""
    return max(1, int(np.ceil(0.7 / (grid.height / grid.length * WIDTH))))


def drawn_how(run: Run, stretch: int, streamlines: bool = False) -> str:
    """What a reader must know to read a map right."""
    notes = ["to scale" if stretch == 1 else f"height stretched {stretch} times"]
    if any(0.0 < zone.end < run.case.geometry.length for zone in run.case.geometry.zones):
        notes.append("dashed: borders of zones")
    if run.case.geometry.walls:
        notes.append("red: walls that give or take heat")
    if streamlines:
        notes.append("lines: streamlines of the gas, the same flow between any two")
    return "; ".join(notes)


def draw_strip(
    axes: Axes, run: Run, values: Floats, entry: FieldName, limits: Limits, stretch: int
) -> QuadMesh:
    """The strip with values [entry.unit_shown], its layers, ports and zones."""
    grid = run.grid
    mesh = draw_layer(axes, run, slice(0, grid.rows), values, entry, limits)
    axes.set_aspect(stretch)
    axes.set_facecolor("#f2f2f2")
    draw_layers(axes, run.case, grid, grid.height / grid.length * WIDTH * stretch)
    draw_walls(axes, run.case)
    draw_ports(axes, run.case)
    axes.set_ylabel("y [mm]")
    return mesh


def draw_layer(
    axes: Axes, run: Run, rows: slice, values: Floats, entry: FieldName, limits: Limits
) -> QuadMesh:
    """Some rows of the strip alone, with the borders of zones."""
    grid = run.grid
    cmap, norm = colours(entry, limits)
    y = grid.y[rows.start : rows.stop + 1] * MM
    mesh = axes.pcolormesh(
        grid.x * MM, y, values[rows], cmap=cmap, norm=norm, shading="flat", rasterized=True
    )
    draw_zones(axes, run.case)
    axes.set(xlim=(grid.x[0] * MM, grid.x[-1] * MM), ylim=(y[0], y[-1]))
    axes.set_ylabel(f"{literal(grid.layer_names[grid.row_layer[rows.start]])}: y [mm]")
    return mesh


def scale_bar(
    figure: FigureBase,
    mesh: QuadMesh,
    panels: Sequence[Axes],
    entry: FieldName,
    limits: Limits,
    values: Floats,
    prefix: str = "",
) -> None:
    """The colour bar below the panels, or a sentence where the field is constant. Pointed ends say that values lie beyond.

    `values` are in `entry.unit_shown`; `prefix` comes before the words.
    """
    words = prefix + words_of(entry)
    if limits.constant:
        value = f"{0.5 * (limits.low + limits.high) / entry.factor:.4g}"
        figure.supxlabel(f"{words}, constant: {in_unit(entry, value)}", fontsize=9)
        return
    low, high = (end / entry.factor for end in (limits.low, limits.high))
    rounding = 1e-9 * (high - low)
    below, above = values.min() < low - rounding, values.max() > high + rounding
    extend = ("both" if above else "min") if below else "max" if above else "neither"
    bar = figure.colorbar(
        mesh,
        ax=list(panels),
        label=in_unit(entry, words, "[{}]"),
        location="bottom",
        extend=extend,
        shrink=0.6,
        aspect=45,
        pad=0.03,
    )
    if not limits.log:
        bar.ax.xaxis.set_major_formatter(ScalarFormatter(useOffset=False))


def draw_streamlines(
    panels: Sequence[Axes], grid: Grid, snapshot: Snapshot, stretch: float
) -> list[ContourSet | Line2D]:
    """Streamlines on every panel; on the first, whose heights are drawn `stretch` times, with the direction of the gas."""
    psi = stream_function(grid, carried(snapshot.cell_data))
    levels = stream_levels(grid, psi)
    if not len(levels):
        return []
    places = (grid.x * MM, grid.y * MM)
    lines = [
        panel.contour(*places, psi, levels, colors="white", linewidths=0.7, linestyles="solid")
        for panel in panels
    ]
    for contours in lines:
        contours.set_path_effects(OUTLINE)
    look: dict[str, Any] = {
        "markersize": 4.5,
        "color": "white",
        "markeredgecolor": "0.25",
        "markeredgewidth": 0.4,
    }
    heads = [
        panels[0].plot(x, y, marker=(3, 0, angle - 90.0), **look)[0]
        for x, y, angle in arrows(lines[0], grid, snapshot, stretch)
    ]
    return [*lines, *heads]


def arrows(
    lines: ContourSet, grid: Grid, snapshot: Snapshot, stretch: float
) -> list[tuple[float, float, float]]:
    """Place [mm] and direction on the page [deg] of an arrow or more on every streamline of some length."""
    spacing = 0.25 * grid.length * MM
    uv = snapshot.cell_data["velocity"].astype(float).reshape(grid.rows, grid.columns, -1)
    found = []
    for path in (path for level in lines.allsegs for path in level):
        steps = np.hypot(np.diff(path[:, 0]), stretch * np.diff(path[:, 1]))
        along = np.concatenate([[0.0], np.cumsum(steps)])
        count = int(along[-1] / spacing + 0.7)
        for place in along[-1] * (np.arange(count) + 0.5) / max(count, 1):
            k = min(int(np.searchsorted(along, place)), len(path) - 1)
            (x, y), (dx, dy) = path[k], path[k] - path[max(k - 1, 0)]
            i = min(int(np.searchsorted(grid.y * MM, y, side="right")) - 1, grid.rows - 1)
            j = min(int(np.searchsorted(grid.x * MM, x, side="right")) - 1, grid.columns - 1)
            sign = 1.0 if uv[i, j, 0] * dx + uv[i, j, 1] * dy >= 0.0 else -1.0
            found.append((float(x), float(y), float(np.degrees(np.arctan2(sign * dy * stretch, sign * dx)))))
    return found
