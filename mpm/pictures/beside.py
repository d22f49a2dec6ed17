"""Runs beside each other: one field of each on the same colour scale, and of two on the same grid the difference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure, SubFigure

from mpm.labels import literal
from mpm.mesh.grid import Grid
from mpm.output.results import Run
from mpm.output.vtu import Snapshot
from mpm.pictures.maps import (
    draw_streamlines,
    draw_strip,
    drawn_how,
    ends_of,
    name_of,
    scale_bar,
    stretch_of,
    values_of,
    when,
)
from mpm.pictures.outline import LINE, WIDTH, way
from mpm.report.fieldnames import FieldName, Limits, colour_limits, field_name

Shown = tuple[Run, Snapshot]


def beside_figure(
    shown: Sequence[Shown], name: str, limits: Limits | None = None, streamlines: bool = False
) -> Figure:
    """A strip for each run at its instant, on one scale; below two strips of one grid the second minus the first."""
    entry = field_name(name)
    everything = [values_of(run, snapshot, name) for run, snapshot in shown]
    if limits is None:
        ends = [ends_of(run, [snapshot], name) for run, snapshot in shown]
        limits = colour_limits(entry, min(low for low, _ in ends), max(high for _, high in ends))
    both = len(shown) == 2 and same_grid(shown[0][0].grid, shown[1][0].grid)
    heights = [_height(run.grid) for run, _ in shown]
    parts = [sum(heights) + 0.9, heights[0] + 0.9] if both else [sum(heights) + 0.9]
    figure = Figure(figsize=(WIDTH + 1.6, sum(parts)), layout="constrained")
    blocks = figure.subfigures(len(parts), 1, height_ratios=parts, squeeze=False)[:, 0]
    instants = [when(run, snapshot) for run, snapshot in shown]
    titles = [f"{name_of(run)}, {instant}" for (run, _), instant in zip(shown, instants, strict=True)]
    _strips(blocks[0], shown, everything, entry, limits, titles, streamlines)
    if both:
        difference = everything[1] - everything[0]
        signed = replace(entry, signed=True, colours="PuOr_r", scale="linear", limits=None)
        found = colour_limits(signed, float(difference.min()), float(difference.max()))
        one, other = (
            f"{literal(run.directory.path.resolve().name)} ({instant})"
            for (run, _), instant in zip(shown, instants, strict=True)
        )
        title = f"{other} minus {one}"
        _strips(blocks[1], shown[:1], [difference], signed, found, [title], False, "difference in ")
    return figure


def _strips(
    block: SubFigure, shown: Sequence[Shown], everything: Sequence[np.ma.MaskedArray], entry: FieldName, limits: Limits,
    titles: Sequence[str], streamlines: bool, prefix: str = "",
) -> None:  # fmt: skip
    """Strips below each other with the colour bar that they share."""
    grid = block.add_gridspec(len(shown), 1, height_ratios=[_height(run.grid) for run, _ in shown])
    panels = [block.add_subplot(grid[k, 0]) for k in range(len(shown))]
    meshes = []
    for panel, (run, snapshot), values, title in zip(panels, shown, everything, titles, strict=True):
        stretch = stretch_of(run.grid)
        meshes.append(draw_strip(panel, run, values / entry.factor, entry, limits, stretch))
        if streamlines:
            draw_streamlines([panel], run.grid, snapshot, stretch)
        panel.set_title(f"{title} ({drawn_how(run, stretch, streamlines)})", pad=13 + LINE, fontsize=8)
        panel.set_xlabel(f"x [mm]{way(run.case)}", labelpad=10 + LINE)
    joined = np.ma.concatenate([(values / entry.factor).ravel() for values in everything])
    scale_bar(block, meshes[0], panels, entry, limits, joined, prefix)


def _height(grid: Grid) -> float:
    """Of a strip with the names of its ports, title and label [inch]."""
    return grid.height / grid.length * WIDTH * stretch_of(grid) + 1.2


def same_grid(one: Grid, other: Grid) -> bool:
    """Whether two runs have their values at the same places."""
    return (
        (one.rows, one.columns) == (other.rows, other.columns)
        and np.allclose(one.x, other.x)
        and np.allclose(one.y, other.y)
    )
