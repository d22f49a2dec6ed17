"""Curves of temperature: along the strip at one instant, and over time; of runs with `[energy]`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mpm.arrays import Floats
from mpm.labels import literal
from mpm.output.results import Run
from mpm.output.vtu import Snapshot
from mpm.pictures.curves import shared_legend, title_of
from mpm.pictures.maps import name_of, values_of, when
from mpm.pictures.outline import MM, OKABE_ITO, way
from mpm.report.heat import heating_length

FIELD = "temperature"
EXIT = "temperature.bed_exit"
LEAST = 1.0
"""Height of an axis of temperatures, at least [K]: rounding is no profile."""


@dataclass(frozen=True, eq=False)
class LayerWarmth:
    """A layer's temperature along the strip (columns,) [K]: mean over its height, lowest, highest."""

    name: str
    moving: bool
    mean: Floats
    low: Floats
    high: Floats


def along_strip(run: Run, snapshot: Snapshot) -> list[LayerWarmth]:
    """Of every layer, from the bottom."""
    values, grid = np.asarray(values_of(run, snapshot, FIELD)), run.grid
    found = []
    for layer in run.case.geometry.layers:
        rows = grid.layer_rows(layer.name)
        inside, heights = values[rows], grid.dy[rows]
        mean = np.asarray(heights @ inside / heights.sum())
        found.append(LayerWarmth(layer.name, layer.moving, mean, inside.min(axis=0), inside.max(axis=0)))
    return found


def over_time(run: Run) -> dict[str, Floats]:
    """Columns of the history by what they are of: each layer's mean, and the powder that leaves."""
    columns = {layer.name: f"temperature.{layer.name}.mean" for layer in run.case.geometry.layers}
    found = {name: run.history[column] for name, column in columns.items() if column in run.history}
    return found | ({"powder that leaves": run.history[EXIT]} if EXIT in run.history else {})


def warm_length(run: Run, snapshot: Snapshot) -> float | None:
    """The place [m] along x up to which the powder has made 95 % of its way, from whichever end it enters."""
    length = heating_length(run.case, run.grid, np.asarray(values_of(run, snapshot, FIELD))).get("length")
    if length is None:
        return None
    return float(run.grid.x[0] + length if run.case.direction > 0 else run.grid.x[-1] - length)


def warmth_figure(run: Run, snapshot: Snapshot | None) -> Figure:
    """Each layer's mean along the strip at one instant, with the spread over the height of the bed; below it means over time."""
    times = over_time(run) if len(run.history.get("time", ())) > 1 else {}
    panels = int(snapshot is not None) + int(bool(times))
    figure = Figure(figsize=(9.0, 3.0 * panels + 0.4), layout="constrained")
    title_of(figure, f"{name_of(run)}: temperature of gas and solids")
    axes = list(figure.subplots(panels, 1, squeeze=False)[:, 0])
    if snapshot is not None:
        _along(axes[0], run, snapshot)
    if times:
        for index, (name, values) in enumerate(times.items()):
            leaves = name not in run.grid.layer_names
            axes[-1].plot(
                run.history["time"],
                values,
                "--" if leaves else "-",
                color="black" if leaves else colour(index),
                label=literal(name),
            )
        axes[-1].set(xlabel="time [s]", ylabel="temperature [K]")
        axes[-1].set_title("mean of each layer over time; dashed: powder that leaves", fontsize=9)
    for panel in axes:
        panel.grid(alpha=0.25)
        low, high = panel.get_ylim()
        middle, half = 0.5 * (low + high), 0.5 * max(high - low, LEAST)
        panel.set_ylim(middle - half, middle + half)
    shared_legend(figure)
    return figure


def colour(layer: int) -> str:
    """Of a layer's curves, by its number from the bottom."""
    return OKABE_ITO[layer % (len(OKABE_ITO) - 1)]


def _along(axes: Axes, run: Run, snapshot: Snapshot) -> None:
    x = run.grid.centres * MM
    for index, layer in enumerate(along_strip(run, snapshot)):
        width = 2.2 if layer.moving else 1.2
        axes.plot(x, layer.mean, color=colour(index), linewidth=width, label=literal(layer.name))
        if layer.moving:
            axes.fill_between(
                x,
                layer.low,
                layer.high,
                color=colour(index),
                alpha=0.18,
                linewidth=0,
            )
    notes = [f"mean of each layer, {when(run, snapshot)}"]
    if run.case.geometry.moving_layer is not None:
        notes.append("shaded: all rows of the bed")
    at = warm_length(run, snapshot)
    if at is not None and math.isfinite(at):
        axes.vlines(
            at * MM,
            0.0,
            1.0,
            transform=axes.get_xaxis_transform(),
            color="0.3",
            linewidth=1.0,
            linestyle=(0, (4, 3)),
        )
        notes.append("dashed: 95 % of the powder's way to its exit")
    axes.set_title("; ".join(notes), fontsize=9)
    axes.set(
        xlabel=f"x [mm]{way(run.case)}",
        ylabel="temperature [K]",
        xlim=(run.grid.x[0] * MM, run.grid.x[-1] * MM),
    )
