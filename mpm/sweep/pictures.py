"""Pictures of a sweep, drawn from its results.csv and sweep.json alone.

Lines over one axis, a map of coloured cells over two, parallel coordinates beyond: one PNG per chosen number in plots/. Axes carry the
unit that the sweep file writes, numbers their words and unit of `mpm.report.quantities`. Points without a result leave a gap that a legend
explains: a cross at the foot of a line, a hatched cell of a map; they are counted below parallel coordinates.
"""

import math
import textwrap
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.files import file_name, write_picture
from mpm.labels import literal
from mpm.report.fieldnames import superscript
from mpm.report.quantities import quantity
from mpm.report.quantity import Quantity
from mpm.sweep.sweepfile import DEFAULT_PICTURES
from mpm.sweep.table import WORDS, choose, read_results
from mpm.sweep.values import factor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOGARITHMIC_FROM = 20.0
"""Ratio of the largest to the smallest level from which a positive axis is drawn logarithmically."""
ROOM = {"x": 0.14, "y": 0.06}
"""Part of an axis that the label of a tick takes."""
NUMBERS_UP_TO = 150
"""Cells of a map that still have room for their values."""


@dataclass(frozen=True)
class Scale:
    """One axis of the sweep, ready to be drawn: positions of the points, words as 0, 1, 2, ..."""

    label: str
    positions: np.ndarray
    words: tuple[str, ...]
    logarithmic: bool


def scale(axis: Mapping[str, Any], values: Sequence[str]) -> Scale:
    """One axis of sweep.json with the points' values of results.csv, in the unit of the sweep file."""
    name, unit = words_of(axis), axis["written_unit"]
    if axis["kind"] == "word":
        words = tuple(dict.fromkeys(values))
        places = np.array([words.index(value) for value in values], float)
        return Scale(literal(name), places, tuple(map(literal, words)), False)
    positions = np.array(values, float) / factor(unit)
    wide = positions.min() > 0 and positions.max() / positions.min() >= LOGARITHMIC_FROM
    label = literal(f"{name} [{unit}]" if unit else name)
    return Scale(label, positions, (), bool(positions.min() > 0 and (axis["logarithmic"] or wide)))


def words_of(axis: Mapping[str, Any]) -> str:
    """An axis as people say it: its key without the table (`inlet tma velocity`), after the name that the sweep file chose."""
    key = " ".join(axis["keys"][0].split(".")[1:]).replace("_", " ") or axis["keys"][0]
    return key if axis["name"] in axis["keys"] else f"{axis['name']} ({key})"


def dress(axes: "Axes", which: str, scale: Scale) -> None:
    """Label, scale and ticks of the x or y direction: ticks at levels of the sweep, as many as have room for their labels."""
    from matplotlib.ticker import FixedLocator, NullLocator

    getattr(axes, f"set_{which}label")(scale.label)
    if scale.words:
        getattr(axes, f"set_{which}ticks")(range(len(scale.words)), scale.words)
        return
    if scale.logarithmic:
        getattr(axes, f"set_{which}scale")("log")
    levels = np.unique(scale.positions)
    shown = spaced(np.log(levels) if scale.logarithmic else levels, ROOM[which])
    direction = getattr(axes, f"{which}axis")
    direction.set_major_locator(FixedLocator(list(levels[shown])))
    direction.set_minor_locator(NullLocator())
    direction.set_major_formatter(lambda value, _: f"{value:.4g}")


def spaced(places: np.ndarray, part: float) -> list[int]:
    """Which of the sorted places get a label: the first, the last, and those between that keep this part of the axis from each other."""
    room = part * (places[-1] - places[0])
    shown = [0]
    for index in range(1, len(places) - 1):
        if places[index] - places[shown[-1]] >= room and places[-1] - places[index] >= room:
            shown.append(index)
    return [*shown, len(places) - 1] if len(places) > 1 else shown


def line(figure: "Figure", x: Scale, values: np.ndarray, label: str) -> None:
    """One number over one axis."""
    axes = figure.add_subplot()
    order = np.argsort(x.positions, kind="stable")
    axes.plot(x.positions[order], values[order], "o-", color="tab:blue")
    missing = ~np.isfinite(values)
    if missing.any():
        foot = axes.get_xaxis_transform()
        height = np.full(missing.sum(), 0.02)
        axes.plot(x.positions[missing], height, "x", color="tab:red", transform=foot, label="no result")
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
    """One number over two axes: a cell for each point in the colour of its value, which is written into it where there is room."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    from mpm.pictures.maps import PLAIN

    columns, rows = np.unique(x.positions), np.unique(y.positions)
    field = np.full((len(rows), len(columns)), np.nan)
    field[np.searchsorted(rows, y.positions), np.searchsorted(columns, x.positions)] = values
    axes = figure.add_subplot()
    dress(axes, "x", x)
    dress(axes, "y", y)
    hatched: dict[str, Any] = {"hatch": "////", "facecolor": "0.85", "edgecolor": "0.6"}
    axes.patch.set(**hatched)
    shown = np.ma.masked_invalid(field)
    across, up = edges(columns, x.logarithmic), edges(rows, y.logarithmic)
    constant = np.ptp(shown.compressed()) == 0.0
    colours = ListedColormap([PLAIN]) if constant else "viridis"
    mesh = axes.pcolormesh(across, up, shown, cmap=colours, edgecolors="white", linewidth=0.3)
    if constant:
        axes.set_title(f"{label}: {shown.compressed()[0]:.4g} everywhere", fontsize="medium")
    else:
        figure.colorbar(mesh, ax=axes, label=label)
    if shown.mask.any():
        key = Patch(label="no result (failed, not finished, or not in the sweep)", **hatched)
        figure.legend(handles=[key], loc="outside lower center", fontsize="small", frameon=False)
    if field.size <= NUMBERS_UP_TO and not constant:
        for row, column in zip(*np.nonzero(np.isfinite(field)), strict=True):
            bright = float(np.asarray(mesh.norm(field[row, column]))) > 0.6
            axes.text(
                columns[column], rows[row], f"{field[row, column]:.3g}", ha="center", va="center",
                color="black" if bright else "white", fontsize=8 if len(columns) <= 8 else 6,
            )  # fmt: skip
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
    if norm.vmin == norm.vmax:
        axes.set_title(f"{label}: {norm.vmin:.4g} everywhere", fontsize="medium")
    else:
        figure.colorbar(ScalarMappable(norm, "viridis"), ax=axes, label=label)
    if len(present) < len(values):
        figure.supxlabel(f"not drawn: {len(values) - len(present)} points without a result", fontsize="small")
    axes.set(xlim=(-0.3, len(scales) - 0.7), ylim=(-0.12, 1.12), yticks=[])
    axes.set_xticks(range(len(scales)), [textwrap.fill(one.label.replace(" [", "\n["), 18) for one in scales])
    axes.spines[:].set_visible(False)


def draw(directory: Path) -> dict[Path, str]:
    """Write plots/<number>.png for every chosen number that a finished point has; returns what each file shows.

    Raises InputError when `directory` holds no table of a sweep.
    """
    about, rows = read_results(directory)
    columns = {name: item["unit"] for name, item in about["columns"].items()}
    taken = {*WORDS, *(axis["name"] for axis in about["axes"])}
    names = [
        name
        for name in choose(chosen(about), columns)
        if name in columns and name not in taken and any(row[name] for row in rows)
    ]
    if not names:
        return {}
    from matplotlib.figure import Figure

    scales = [scale(axis, [row[axis["name"]] for row in rows]) for axis in about["axes"]]
    free = [one for one in scales if len(np.unique(one.positions)) > 1] or scales[:1]
    folder = Path(directory) / "plots"
    folder.mkdir(exist_ok=True)
    drawn = {}
    for name in names:
        found = with_unit(name, columns[name])
        values = np.array([found.of(float(row[name])) if row[name] else math.nan for row in rows])
        unit = f" [{superscript(found.unit_shown)}]" if found.unit_shown else ""
        label = "\n".join(textwrap.wrap(literal(found.label + unit), 52))
        figure = Figure(figsize=(6.8, 5.0), layout="constrained")
        if len(free) == 1 or about["mode"] == "zip":
            line(figure, free[0], values, label)
        elif len(free) == 2 and about["mode"] == "grid":
            heat_map(figure, free[0], free[1], values, label)
        else:
            parallel_coordinates(figure, free, values, label)
        figure.suptitle(literal(f"{about['title']} [{Path(directory).resolve().name}]"), fontsize="medium")
        path = folder / f"{file_name(name)}.png"
        write_picture(path, figure, dpi=150)
        drawn[path] = f"{found.label}{unit} over {', '.join(words_of(axis) for axis in about['axes'])}"
    return drawn


def chosen(about: Mapping[str, Any]) -> Sequence[str]:
    """Which numbers the sweep file wants drawn."""
    table = tomllib.loads(about["text"])["sweep"]
    found = table.get("pictures", table.get("columns", DEFAULT_PICTURES))
    return [found] if isinstance(found, str) else list(found)


def with_unit(name: str, unit: str) -> Quantity:
    """The quantity of a column whose unit in sweep.json is `unit`: that of a steady state where amounts are per second."""
    found = quantity(name)
    return found if found.unit == unit else quantity(name, steady=True)
