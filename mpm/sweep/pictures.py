"""Pictures of a sweep: lines over one axis, a heat map with contours over two, parallel coordinates beyond.

One PNG per chosen number in plots/. Axes carry the unit that the sweep file writes, numbers their SI unit. Points
without a result leave a gap: a cross at the foot of a line, a hatched cell of a map, no line among the coordinates.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.files import file_name, write_picture
from mpm.labels import literal
from mpm.sweep.quantities import factor
from mpm.sweep.results import Results
from mpm.sweep.sweepfile import Axis
from mpm.sweep.table import choose

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOGARITHMIC_FROM = 20.0
"""Ratio of the largest to the smallest level from which a positive axis is drawn logarithmically."""


@dataclass(frozen=True)
class Scale:
    """One axis of the sweep, ready to be drawn: positions of the points, words as 0, 1, 2, ..."""

    label: str
    positions: np.ndarray
    words: tuple[str, ...]
    logarithmic: bool


def scale(axis: Axis, numbers: Sequence[float | str]) -> Scale:
    """The points' values on one axis in the unit of the sweep file."""
    name = axis.name if "." not in axis.name else ".".join(axis.name.split(".")[-2:])
    if any(isinstance(number, str) for number in numbers):
        words = tuple(dict.fromkeys(map(str, numbers)))
        places = np.array([words.index(str(number)) for number in numbers], float)
        return Scale(literal(name), places, tuple(map(literal, words)), False)
    positions = np.array(numbers, float) / factor(axis.unit)
    wide = positions.min() > 0 and positions.max() / positions.min() >= LOGARITHMIC_FROM
    label = literal(f"{name} [{axis.unit}]" if axis.unit else name)
    return Scale(label, positions, (), bool(positions.min() > 0 and (axis.logarithmic or wide)))


def dress(axes: "Axes", which: str, scale: Scale) -> None:
    """Label, scale and ticks of the x or y direction."""
    getattr(axes, f"set_{which}label")(scale.label)
    if scale.words:
        getattr(axes, f"set_{which}ticks")(range(len(scale.words)), scale.words)
    elif scale.logarithmic:
        getattr(axes, f"set_{which}scale")("log")


def line(figure: "Figure", x: Scale, values: np.ndarray, label: str) -> None:
    """One number over one axis."""
    axes = figure.add_subplot()
    order = np.argsort(x.positions, kind="stable")
    axes.plot(x.positions[order], values[order], "o-", color="tab:blue")
    missing = ~np.isfinite(values)
    if missing.any():
        foot = axes.get_xaxis_transform()
        axes.plot(
            x.positions[missing],
            np.full(missing.sum(), 0.02),
            "x",
            color="tab:red",
            transform=foot,
            label="no result",
        )
        axes.legend()
    dress(axes, "x", x)
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)


def edges(levels: np.ndarray, logarithmic: bool) -> np.ndarray:
    """Borders of the cells around sorted levels (n + 1), halfway between neighbours on the axis's scale."""
    levels = np.log(levels) if logarithmic else levels
    middle = (levels[1:] + levels[:-1]) / 2
    borders = np.concatenate([[2 * levels[0] - middle[0]], middle, [2 * levels[-1] - middle[-1]]])
    return np.exp(borders) if logarithmic else borders


def heat_map(figure: "Figure", x: Scale, y: Scale, values: np.ndarray, label: str) -> None:
    """One number over two axes, with contour lines where there are enough neighbours."""
    from matplotlib.patheffects import AbstractPathEffect, withStroke

    columns, rows = np.unique(x.positions), np.unique(y.positions)
    field = np.full((len(rows), len(columns)), np.nan)
    field[np.searchsorted(rows, y.positions), np.searchsorted(columns, x.positions)] = values
    axes = figure.add_subplot()
    dress(axes, "x", x)
    dress(axes, "y", y)
    axes.patch.set(hatch="////", facecolor="0.85", edgecolor="0.6")
    field = np.ma.masked_invalid(field)
    across, up = edges(columns, x.logarithmic), edges(rows, y.logarithmic)
    mesh = axes.pcolormesh(across, up, field, cmap="viridis")
    figure.colorbar(mesh, ax=axes, label=label)
    if not (x.words or y.words) and np.ptp(field.compressed()) > 0:
        lines = axes.contour(columns, rows, field, colors="white", linewidths=0.8)
        # legible on the light end of the map, too
        outline: list[AbstractPathEffect] = [withStroke(linewidth=2, foreground="0.2")]
        lines.set_path_effects(outline)
        for text in axes.clabel(lines, fontsize="small"):
            text.set_path_effects(outline)
    axes.set(xlim=across[[0, -1]], ylim=up[[0, -1]])


def parallel_coordinates(figure: "Figure", scales: Sequence[Scale], values: np.ndarray, label: str) -> None:
    """A line per point through all axes, coloured by one number; every axis runs from its least to its largest level."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    heights = []
    axes = figure.add_subplot()
    for place, one in enumerate(scales):
        at = np.log(one.positions) if one.logarithmic else one.positions
        low, high = at.min(), at.max()
        heights.append((at - low) / (high - low) if high > low else np.full(len(at), 0.5))
        axes.axvline(place, color="0.4", linewidth=0.8)
        for height, level in ((-0.03, one.positions.min()), (1.03, one.positions.max())):
            text = one.words[int(level)] if one.words else f"{level:.4g}"
            axes.text(
                place, height, text, ha="center", va="top" if height < 0 else "bottom", fontsize="small"
            )
    present = np.flatnonzero(np.isfinite(values))
    order = present[np.argsort(values[present])]
    paths = [
        np.column_stack([np.arange(len(scales)), [height[index] for height in heights]]) for index in order
    ]
    norm = Normalize(values[order[0]], values[order[-1]])
    colours = colormaps["viridis"](norm(values[order]))
    axes.add_collection(LineCollection(paths, colors=colours, linewidths=1.2, alpha=0.8))
    figure.colorbar(ScalarMappable(norm, "viridis"), ax=axes, label=label)
    axes.set(xlim=(-0.3, len(scales) - 0.7), ylim=(-0.12, 1.12), yticks=[])
    axes.set_xticks(range(len(scales)), [one.label.replace(" [", "\n[") for one in scales])
    axes.spines[:].set_visible(False)


def draw(results: Results) -> list[Path]:
    """Write plots/<number>.png for every chosen number that a finished point has; returns the files."""
    rows, units, sweep = results.rows(), results.columns(), results.sweep
    names = [
        name
        for name in choose(sweep.pictures, units)
        if name in units
        and any(isinstance(row.get(name), int | float) for row in rows)
        and name not in {axis.name for axis in sweep.axes}
    ]
    if not names:
        return []
    from matplotlib.figure import Figure

    scales = [
        scale(axis, [point.numbers[index] for point in results.points])
        for index, axis in enumerate(sweep.axes)
    ]
    free = [one for one in scales if len(np.unique(one.positions)) > 1] or scales[:1]
    directory = results.layout.root / "plots"
    directory.mkdir(exist_ok=True)
    files = []
    for name in names:
        values = np.array([number(row.get(name)) for row in rows])
        label = literal(f"{name} [{units[name]}]" if units[name] not in ("", "1") else name)
        figure = Figure(figsize=(6.4, 4.8), layout="constrained")
        if len(free) == 1 or sweep.mode == "zip":
            line(figure, free[0], values, label)
        elif len(free) == 2 and sweep.mode == "grid":
            heat_map(figure, free[0], free[1], values, label)
        else:
            parallel_coordinates(figure, free, values, label)
        figure.suptitle(literal(sweep.title), fontsize="medium")
        file = directory / f"{file_name(name)}.png"
        write_picture(file, figure, dpi=150)
        files.append(file)
    return files


def number(value: Any) -> float:
    """A cell of the table as a float; NaN when it is empty."""
    return float(value) if isinstance(value, int | float) else math.nan
