"""The strip as an SVG: layers with their material, ports with flow and dose, what the ends are, which way the bed goes. To scale along x.

Pure: a case in, the numbers of the drawing out; the template draws them. Lengths of the drawing are CSS pixels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from mpm.case.case import Case
from mpm.case.ports import Inlet, Outlet
from mpm.case.walls import Wall
from mpm.pictures.outline import MM, OKABE_ITO, spread

WIDTH = 860.0
"""Length of the strip."""
LOWEST = 110.0
"""Least height of the strip: a longer one is stretched, and says so."""
LETTER, LINE = 6.6, 15.0
"""Width of a letter and height of a line of the labels."""


@dataclass(frozen=True)
class Band:
    """A layer: from `top` down over `height`; `label_y` keeps the labels of thin layers apart."""

    name: str
    text: str
    top: float
    height: float
    porous: bool
    moving: bool
    label_y: float


@dataclass(frozen=True)
class PortMark:
    """A port on its wall from `x` over `width`; its label stands at `label_x` in line `line` outside."""

    name: str
    x: float
    width: float
    side: str
    colour: str
    inwards: bool
    lines: tuple[str, ...]
    label_x: float
    line: int


@dataclass(frozen=True)
class WallMark:
    """A wall that gives or takes heat, from one end to the other; `text` says what it does."""

    x0: float
    y0: float
    x1: float
    y1: float
    text: str


@dataclass(frozen=True)
class Drawing:
    """Everything that the template needs; `above`, `below` are the lines of labels outside the strip."""

    width: float
    height: float
    scale: str
    bands: Sequence[Band]
    ports: Sequence[PortMark]
    walls: Sequence[WallMark]
    zones: Sequence[tuple[str, float, float]]
    direction: int
    speed: str
    warmth: str
    periodic: bool
    inflow: str
    length: str
    above: int = 0
    below: int = 0
    ticks: Sequence[tuple[float, str]] = field(default=())

    @property
    def right(self) -> float:
        """Width of the names beside the strip."""
        axis = len(f"x [mm], {self.scale}")
        return 34.0 + LETTER * max(axis, *(len(band.text) for band in self.bands))

    @property
    def hidden_zones(self) -> list[str]:
        """All zones from the left, where a name is too long to be written into its zone."""
        fits = all(LETTER * len(name) <= end - start for name, start, end in self.zones)
        return [] if fits or len(self.zones) < 2 else [name for name, _, _ in self.zones]


def drawing(case: Case) -> Drawing:
    """Lay the strip out."""
    geometry = case.geometry
    whole = geometry.height
    per_metre = WIDTH / geometry.length
    stretch = max(1, math.ceil(LOWEST / (whole * per_metre)))
    ports = _ports(case, per_metre)
    moving = geometry.moving_layer is not None
    speed = abs(case.conveying_velocity) * 100.0
    return Drawing(
        width=WIDTH,
        height=whole * per_metre * stretch,
        scale="to scale" if stretch == 1 else f"height stretched {stretch} times",
        bands=_bands(case, per_metre * stretch),
        ports=ports,
        walls=_walls(case, per_metre, per_metre * stretch),
        zones=[(zone.name, zone.start * per_metre, zone.end * per_metre) for zone in geometry.zones],
        direction=case.direction if speed > 0.0 else 0,
        speed=f"{speed:.3g} cm/s" if speed > 0.0 else "at rest" if moving else "",
        warmth=_warmth(case),
        periodic=geometry.periodic,
        inflow=geometry.bed_inflow,
        length=f"{geometry.length * MM:g} mm",
        above=max((p.line + 1 for p in ports if p.side == "top"), default=0),
        below=max((p.line + 1 for p in ports if p.side == "bottom"), default=0),
        ticks=_ticks(geometry.length, per_metre, ports),
    )


def _bands(case: Case, per_metre: float) -> list[Band]:
    layers = list(reversed(case.geometry.layers))
    tops = [0.0]
    for layer in layers:
        tops.append(tops[-1] + layer.height * per_metre)
    middles = spread([0.5 * (a + b) for a, b in pairwise(tops)], LINE)
    above = max(
        0.0, middles[-1] - tops[-1] + 0.5 * LINE
    )  # the names of thin layers must not run into the axis below
    middles = [middle - above for middle in middles]
    bands = []
    for layer, top, middle in zip(layers, tops, middles, strict=False):
        text = f"{layer.name}, {layer.height * MM:g} mm"
        text += f", {layer.material_name.replace('_', ' ')}" if layer.material_name else ", gas"
        bands.append(
            Band(
                layer.name,
                text,
                top,
                layer.height * per_metre,
                layer.material is not None,
                layer.moving,
                middle,
            )
        )
    return bands


def port_lines(case: Case, port: Inlet | Outlet) -> tuple[str, ...]:
    """Name, flow and dose of a port, a line each."""
    if isinstance(port, Outlet):
        return (port.name, "to ambient pressure")
    fed = [f"{name} {port.mass_fractions[name]:.3g}" for name in case.fed_by(port)]
    lines = [port.name, f"{port.velocity * 100.0:.3g} cm/s {case.gas.carrier}"]
    if case.energy is not None:
        lines[-1] += f" at {case.inlet_temperature(port):.4g} K"
    if fed:
        lines[-1] += f" + {', '.join(fed)} (mass)"
        windows = [
            f"{start:g} s to {stop:g} s" if math.isfinite(stop) else f"from {start:g} s"
            for start, stop in port.windows
        ]
        if windows != ["from 0 s"]:
            lines.append("doses " + (", ".join(windows) if len(windows) < 3 else f"{len(windows)} times"))
    return tuple(lines)


def wall_text(wall: Wall) -> str:
    """What a wall does, in words."""
    if wall.temperature is not None:
        what = f"at {wall.temperature:.4g} K"
    elif wall.heat_flux is not None:
        what = f"gives {wall.heat_flux:.4g} W/m\u00b2"
    else:
        what = (
            f"passes {wall.heat_transfer_coefficient:.4g} W/m\u00b2/K to surroundings at {wall.ambient:.4g} K"
        )
    return f"wall {wall.name}, {wall.start * MM:g} to {wall.end * MM:g} mm, {what}"


def _warmth(case: Case) -> str:
    """A sentence on the temperatures of a case with `[energy]`."""
    if case.energy is None:
        return ""
    enters = (
        ""
        if case.geometry.moving_layer is None
        else f"; solids that come in have {case.bed_temperature:.4g} K"
    )
    walls = (
        f" Walls in red: {'; '.join(wall_text(wall) for wall in case.geometry.walls)}."
        if case.geometry.walls
        else ""
    )
    return f"At first all is at {case.energy.initial_temperature:.4g} K{enters}.{walls}"


def _walls(case: Case, along: float, up: float) -> list[WallMark]:
    """Walls at their place; `along`, `up`: pixels per metre."""
    length, height = case.geometry.length * along, case.geometry.height * up
    marks = []
    for wall in case.geometry.walls:
        if wall.horizontal:
            y = 0.0 if wall.side == "top" else height
            ends = (wall.start * along, y, wall.end * along, y)
        else:
            x = 0.0 if wall.side == "left" else length
            ends = (x, height - wall.start * up, x, height - wall.end * up)
        marks.append(WallMark(*ends, wall_text(wall)))
    return marks


def _ports(case: Case, per_metre: float) -> list[PortMark]:
    marks: list[PortMark] = []
    species = case.mechanism.species_names
    for side in ("bottom", "top"):
        taken: list[float] = []  # right end of the labels in each line so far
        every: list[Inlet | Outlet] = [*case.geometry.inlets, *case.geometry.outlets]
        here = [port for port in every if port.side == side]
        for port in sorted(here, key=lambda p: p.center):
            lines = port_lines(case, port)
            half = 0.5 * LETTER * max(map(len, lines))
            at = min(max(port.center * per_metre, half), WIDTH - half)
            line = next((i for i, right in enumerate(taken) if at - half > right + LETTER), len(taken))
            taken[line : line + 1] = [at + half]
            fed = case.fed_by(port) if isinstance(port, Inlet) else ()
            colour = (
                OKABE_ITO[species.index(fed[0]) % 6]
                if fed
                else "#777777"
                if isinstance(port, Inlet)
                else "#000000"
            )
            marks.append(
                PortMark(
                    port.name, port.x0 * per_metre, port.width * per_metre, side, colour,
                    isinstance(port, Inlet), lines, at, line,
                )
            )  # fmt: skip
    return marks


def _ticks(length: float, per_metre: float, ports: Sequence[PortMark]) -> list[tuple[float, str]]:
    """Round positions along x [mm], five to ten of them; no number where an arrow of a port below stands."""
    rough = length * MM / 7.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= rough)
    count = int(length * MM / step + 1e-9)
    arrows = [port.x + 0.5 * port.width for port in ports if port.side == "bottom"]
    places = [(i * step / MM * per_metre, f"{i * step:g}") for i in range(count + 1)]
    return [(x, "" if any(abs(x - at) < 2.5 * LETTER for at in arrows) else text) for x, text in places]
