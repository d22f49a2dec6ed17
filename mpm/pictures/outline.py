"""The outline of the strip in pictures: layers, ports and zones drawn to scale, with their names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from mpm.case.case import Case
from mpm.case.ports import Inlet
from mpm.labels import literal
from mpm.mesh.grid import Grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
WIDTH = 9.0
"""Width of a map without its margins [inch]."""
WARM = "#B2182B"
"""Colour of walls that give or take heat."""
LINE = 8.5
"""Height of a line of small text [points]."""
MM = 1e3


def formula(name: str) -> str:
    """A chemical formula with its numbers as subscripts; other names unchanged."""
    return re.sub(r"(?<=[A-Za-z)])(\d+)", r"$_{\1}$", literal(name))


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


def draw_walls(axes: Axes, case: Case) -> None:
    """Walls that give or take heat as red lines on their side."""
    for wall in case.geometry.walls:
        ends = [wall.start, wall.end]
        at = float(wall.side in ("top", "right"))
        if wall.horizontal:
            places = ([x * MM for x in ends], [at, at])
        else:
            places = ([at, at], [y / case.geometry.height for y in ends])
        axes.plot(
            *places, color=WARM, linewidth=3, solid_capstyle="butt", clip_on=False, gid="wall", zorder=4,
            transform=axes.get_xaxis_transform() if wall.horizontal else axes.transAxes,
        )  # fmt: skip


def draw_ports(axes: Axes, case: Case) -> None:
    """Inlets and outlets as thick lines on their wall, with their names outside and the direction of the gas."""
    species = case.mechanism.species_names
    fed = {inlet.name: case.fed_by(inlet) for inlet in case.geometry.inlets}
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
            line = index % 2 if crowded else 0
            draw_port(axes, text, x0=port.x0, x1=port.x1, side=side, colour=colour, line=line)


def draw_port(axes: Axes, text: str, *, x0: float, x1: float, side: str, colour: str, line: int) -> None:
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
