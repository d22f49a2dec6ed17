"""Maps of the strip: a field with the layers, ports and zones drawn to scale."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mpm.case import Case, Inlet
from mpm.geometry import Grid
from mpm.labels import literal
from mpm.results import Run, fed_by
from mpm.vtu import Snapshot

Floats = NDArray[np.float64]

OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
WIDTH = 9.0
"""Width of a map without its margins [inch]."""
DECADES = 4
"""Range of the logarithmic maps below their maximum."""
LINE = 8.5
"""Height of a line of small text [points]."""
MM = 1e3


def formula(name: str) -> str:
    """A chemical formula with its numbers as subscripts; other names unchanged."""
    return re.sub(r"(?<=[A-Za-z)])(\d+)", r"$_{\1}$", literal(name))


def coverage_figure(run: Run, snapshot: Snapshot, site: str) -> Figure:
    """Coverage `theta_<site>`: the whole strip, and the moving layer stretched to be read."""
    label = f"coverage of {formula(site)}, $\\theta$"
    theta = run.field(snapshot, f"theta_{site}")
    porous = np.array([layer.material is not None for layer in run.case.geometry.layers])[run.grid.row_layer]
    shown = np.ma.masked_where(np.broadcast_to(~porous[:, None], theta.shape), theta)
    return map_figure(run, snapshot, shown, label, "cividis", Normalize(0.0, 1.0), bed=True)


def species_figure(run: Run, snapshot: Snapshot, species: str) -> Figure:
    """Mole fraction `x_<species>` on a logarithmic scale."""
    values = run.field(snapshot, f"x_{species}")
    return map_figure(
        run, snapshot, values, f"mole fraction of {formula(species)}", "viridis", decades(values)
    )


def cvd_figure(run: Run, snapshot: Snapshot) -> Figure:
    """Rate of the parasitic gas-phase reaction per total volume, on a logarithmic scale."""
    values = run.field(snapshot, "cvd_rate")
    return map_figure(run, snapshot, values, "CVD rate [mol m$^{-3}$ s$^{-1}$]", "viridis", decades(values))


def decades(values: Floats) -> LogNorm:
    top = float(values.max())
    top = top if top > 0.0 else 1.0
    return LogNorm(top * 10.0**-DECADES, top, clip=True)


def map_figure(
    run: Run, snapshot: Snapshot, values: Floats, label: str, colours: str, norm: Normalize, bed: bool = False
) -> Figure:
    """A map of the strip with layers, ports and zones; `bed` adds the moving layer, stretched."""
    grid = run.grid
    height = (grid.y[-1] - grid.y[0]) / grid.length * WIDTH
    stretch = max(1, int(np.ceil(0.7 / height)))  # at least 0.7 inch high
    moving = [layer.name for layer in run.case.geometry.layers if layer.moving] if bed else []
    heights = [height * stretch] + [1.3] * len(moving)
    figure = Figure(figsize=(WIDTH + 2.4, sum(heights) + 1.15 * len(heights) + 0.35), layout="constrained")
    axes = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    strip = axes[0]
    mesh = strip.pcolormesh(
        grid.x * MM, grid.y * MM, values, cmap=colours, norm=norm, shading="flat", rasterized=True
    )
    strip.set_aspect(stretch)
    scale = "to scale" if stretch == 1 else f"height stretched {stretch} times"
    title = run.case.title or run.directory.path.resolve().name
    when = "steady state" if run.case.fidelity == "steady" else f"t = {snapshot.time:.4g} s"
    strip.set_title(f"{literal(title)}, {when} ({scale})", pad=22 + LINE, fontsize=10)
    strip.set_facecolor("#f2f2f2")
    draw_layers(strip, run.case, grid, height * stretch)
    draw_ports(strip, run.case)
    draw_zones(strip, run.case)
    strip.set_ylabel("y [mm]")
    for name, panel in zip(moving, axes[1:], strict=True):
        rows = grid.layer_rows(name)
        y = grid.y[rows.start : rows.stop + 1] * MM
        panel.pcolormesh(
            grid.x * MM, y, values[rows], cmap=colours, norm=norm, shading="flat", rasterized=True
        )
        draw_zones(panel, run.case)
        panel.set_ylabel(f"{literal(name)}: y [mm]")
    for panel in axes:
        panel.set_xlim(grid.x[0] * MM, grid.x[-1] * MM)
    axes[-1].set_xlabel(
        f"x [mm]{way(run.case)}",
        labelpad=4 if len(moving) else 14 + LINE,  # below the names of the inlets
    )
    extend = "min" if isinstance(norm, LogNorm) else "neither"
    figure.colorbar(
        mesh,
        ax=list(axes),
        label=label,
        fraction=0.03,
        pad=0.01,
        aspect=12 if len(axes) == 1 else 25,
        extend=extend,
    )
    return figure


def way(case: Case) -> str:
    """Which way the bed moves, in words; nothing when it does not."""
    if case.conveying_velocity == 0.0:
        return ""
    return f" (the bed moves to the {'right' if case.direction > 0 else 'left'})"


def draw_layers(axes: Axes, case: Case, grid: Grid, inches: float) -> None:
    """Boundaries of the layers, and their names at the right edge, kept apart where layers are thin."""
    edges = [grid.y[grid.layer_rows(layer.name).stop] * MM for layer in case.geometry.layers]
    for edge in edges[:-1]:
        axes.axhline(edge, color="black", linewidth=0.6)
    starts = [grid.y[0] * MM, *edges[:-1]]
    middles = [0.5 * (a + b) for a, b in zip(starts, edges, strict=True)]
    line = LINE / 72.0 * (edges[-1] - starts[0]) / inches  # height of a line of text [mm]
    for layer, at in zip(case.geometry.layers, spread(middles, line), strict=True):
        made_of = f" ({layer.material_name.replace('_', ' ')})" if layer.material_name else ""
        text = layer.name + made_of
        axes.annotate(
            literal(text),
            (1.008, at),
            xycoords=("axes fraction", "data"),
            va="center",
            fontsize=7,
            annotation_clip=False,
        )


def spread(positions: Sequence[float], distance: float) -> list[float]:
    """Move sorted positions apart to at least `distance`, each as little as a sweep up and a sweep down allow."""
    up = list(positions)
    for i in range(1, len(up)):
        up[i] = max(up[i], up[i - 1] + distance)
    down = list(positions)
    for i in range(len(down) - 2, -1, -1):
        down[i] = min(down[i], down[i + 1] - distance)
    return [0.5 * (a + b) for a, b in zip(up, down, strict=True)]


def draw_ports(axes: Axes, case: Case) -> None:
    """Inlets and outlets as thick lines on their wall, with their names outside and the direction of the gas."""
    species = case.mechanism.species_names
    fed = {inlet.name: fed_by(inlet, species) for inlet in case.geometry.inlets}
    inlets, outlets = list(case.geometry.inlets), list(case.geometry.outlets)
    for side in ("bottom", "top"):
        on_wall = sorted(
            (port for port in [*inlets, *outlets] if port.side == side), key=lambda port: port.x0
        )
        gaps = [b.x0 - a.x0 for a, b in pairwise(on_wall)]
        room = min(gaps, default=case.geometry.length) / case.geometry.length * WIDTH
        longest = max((len(port.name) for port in on_wall), default=0)
        crowded = room < 0.065 * (
            3 + longest
        )  # inches that a name takes; else every second goes one line further out
        for index, port in enumerate(on_wall):
            if isinstance(port, Inlet):
                colour = OKABE_ITO[species.index(fed[port.name][0]) % 6] if fed[port.name] else "#777777"
            else:
                colour = "black"
            upwards = (side == "bottom") == isinstance(port, Inlet)
            text = ("\u2191 " if upwards else "\u2193 ") + port.name
            draw_port(axes, text, port.x0, port.x1, side, colour, line=index % 2 if crowded else 0)


def draw_port(axes: Axes, text: str, x0: float, x1: float, side: str, colour: str, line: int) -> None:
    """One port from x0 to x1 [m]; its name stands `line` lines further out."""
    at, way = (0.0, -1) if side == "bottom" else (1.0, 1)
    transform = axes.get_xaxis_transform()
    axes.plot(
        [x0 * MM, x1 * MM], [at, at], color=colour, linewidth=5, solid_capstyle="butt",
        transform=transform, clip_on=False, gid="port", zorder=5,
    )  # fmt: skip
    offset = (5 if way > 0 else 17) + line * LINE  # at the bottom below the tick labels
    axes.annotate(
        literal(text), (0.5 * (x0 + x1) * MM, at), xycoords=transform, xytext=(0, way * offset),
        textcoords="offset points", ha="center", va="bottom" if way > 0 else "top", fontsize=7.5, color=colour,
    )  # fmt: skip


def draw_zones(axes: Axes, case: Case) -> None:
    """Boundaries between zones."""
    for zone in case.geometry.zones:
        for x in (zone.start, zone.end):
            if 0.0 < x < case.geometry.length:
                axes.axvline(x * MM, color="white", linewidth=1.6)
                axes.axvline(x * MM, color="black", linewidth=0.8, linestyle=(0, (4, 3)))
