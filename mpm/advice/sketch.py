"""The strip as text: layers from top to bottom, ports where they are and which way gas passes them, ends, the way of the bed.

To scale along the strip, not across it. Lines of characters only, for a terminal, a log or a docstring.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpm.case.layers import Layer
from mpm.case.ports import Inlet, Outlet
from mpm.screen import lines_of, together

if TYPE_CHECKING:
    from mpm.case.case import Case

PAGE = 80
"""Columns of a page where there is no edge of a terminal to go by."""
NARROWEST = 40
"""Columns that a sketch takes at least."""
MOST_ROWS = 3
"""Rows of names above or below the strip; where ports are too dense for that they are numbered."""


@dataclass(frozen=True, kw_only=True)
class Pen:
    """The characters of a sketch."""

    across: str
    wall: str
    open_end: str
    leader: str
    corners: str  # top left, top right, bottom left, bottom right
    tees: str  # left, right
    up: str
    down: str
    left: str
    right: str
    heated: str  # a wall that gives or takes heat


BOXES = Pen(
    across="─",
    wall="│",
    open_end="┆",
    leader="│",
    corners="┌┐└┘",
    tees="├┤",
    up="↑",
    down="↓",
    left="←",
    right="→",
    heated="━",
)
ASCII = Pen(
    across="-",
    wall="|",
    open_end=":",
    leader="|",
    corners="++++",
    tees="++",
    up="^",
    down="v",
    left="<",
    right=">",
    heated="=",
)


def pen_for(encoding: str) -> Pen:
    """BOXES where the terminal's encoding has its characters, else ASCII."""
    try:
        "".join(vars(BOXES).values()).encode(encoding)
    except (UnicodeEncodeError, LookupError):
        return ASCII
    return BOXES


def sketch(case: Case, width: int, pen: Pen = BOXES) -> list[str]:
    """The lines of the sketch, none longer than `width` (or NARROWEST) columns."""
    inner = max(width, NARROWEST) - 2
    geometry = case.geometry
    ports: tuple[Inlet | Outlet, ...] = (*geometry.inlets, *geometry.outlets)
    top, bottom = _side(case, "top", ports, inner, pen), _side(case, "bottom", ports, inner, pen)
    side = pen.open_end if geometry.periodic else pen.wall
    lines = [*reversed(top.names), pen.corners[0] + top.wall + pen.corners[1]]
    for index, layer in enumerate(reversed(geometry.layers)):
        if index:
            lines.append(pen.tees[0] + pen.across * inner + pen.tees[1])
        lines += [side + text + side for text in _layer(case, layer, inner, pen)]
    lines += [pen.corners[2] + bottom.wall + pen.corners[3], *bottom.names, _scale(case, inner)]
    lines += _zones(case, inner)
    for text in (top.legend, bottom.legend, _ends(case), _heated(case, pen)):
        lines += lines_of(text, inner + 2, indent=1)
    return [line.rstrip() for line in lines]


def _ends(case: Case) -> str:
    """What the left and right ends are."""
    if not case.geometry.periodic:
        return "ends: walls"
    return "ends (dotted): periodic, gas leaving at the right comes back at the left"


def _heated(case: Case, pen: Pen) -> str:
    """What the lines of heated walls are, and such walls at the ends."""
    sides = {wall.side: wall.horizontal for wall in case.geometry.walls}
    lines = f"{pen.heated * 3}: walls that give or take heat" if any(sides.values()) else ""
    ends = " and ".join(side for side, across in sides.items() if not across)
    return "; ".join(text for text in (lines, f"heat passes the {ends}" if ends else "") if text)


@dataclass(frozen=True)
class _Side:
    """A wall with its ports: the wall's line, the rows of names counted from the wall, what numbers stand for."""

    wall: str
    names: list[str]
    legend: str = ""


def _side(case: Case, side: str, all_ports: Sequence[Inlet | Outlet], inner: int, pen: Pen) -> _Side:
    wall = [pen.across] * inner
    for heated in (w for w in case.geometry.walls if w.side == side):
        first, last = _columns(case, heated.start, heated.end, inner)
        wall[first : last + 1] = [pen.heated] * (last + 1 - first)
    ports = sorted((port for port in all_ports if port.side == side), key=lambda port: port.center)
    for port in ports:
        inwards = pen.up if port.side == "bottom" else pen.down
        outwards = pen.down if port.side == "bottom" else pen.up
        first, last = _columns(case, port.x0, port.x1, inner)
        wall[first : last + 1] = [inwards if isinstance(port, Inlet) else outwards] * (last + 1 - first)
    places = [sum(_columns(case, port.x0, port.x1, inner)) // 2 for port in ports]
    texts = [_port_text(case, port) for port in ports]
    names = _names(places, texts, inner, pen)
    if names is not None:
        return _Side("".join(wall), names)
    numbers = [str(index) for index in range(1, len(ports) + 1)]
    legend = ", ".join(together(f"{index} {text}") for index, text in zip(numbers, texts, strict=True))
    where = "above" if ports[0].side == "top" else "below"
    return _Side("".join(wall), _row_of_numbers(places, numbers, inner), f"ports {where}: {legend}")


def _columns(case: Case, x0: float, x1: float, inner: int) -> tuple[int, int]:
    """First and last character of a port or wall from `x0` to `x1` [m], at least one."""
    scale = inner / case.geometry.length
    first = min(max(int(x0 * scale), 0), inner - 1)
    return first, min(max(round(x1 * scale) - 1, first), inner - 1)


def _port_text(case: Case, port: Inlet | Outlet) -> str:
    if isinstance(port, Outlet):
        return f"{port.name} (out)"
    return f"{port.name} ({', '.join(port.mass_fractions) or case.gas.carrier})"


def _names(places: Sequence[int], texts: Sequence[str], inner: int, pen: Pen) -> list[str] | None:
    """Rows of names counted from the wall, each under (or over) a leader to its port; a name that would meet another goes a row further.

    A name begins at its port, or where it would pass the end of the strip ends there. None where that takes more than MOST_ROWS, or a
    leader would cross a name.
    """
    row_of: dict[int, int] = {}
    spans: dict[int, tuple[int, int]] = {}
    for index in reversed(range(len(places))):
        start = max(min(places[index], inner - len(texts[index])), 0)
        spans[index] = (start, start + len(texts[index]))
        met = [
            row_of[other]
            for other in row_of
            if spans[other][0] <= spans[index][1] and spans[index][0] <= spans[other][1]
        ]
        row_of[index] = 1 + max(met, default=-1)
    depth = 1 + max(row_of.values(), default=-1)
    crossed = any(
        spans[index][0] <= places[other] < spans[index][1] and row_of[other] > row_of[index]
        for index in row_of
        for other in row_of
    )
    if crossed or depth > MOST_ROWS or any(len(text) > inner for text in texts):
        return None
    rows = [[" "] * (inner + 2) for _ in range(2 * depth)]
    for index, text in enumerate(texts):
        for row in range(2 * row_of[index] + 1):
            rows[row][places[index] + 1] = pen.leader
        start, stop = spans[index]
        rows[2 * row_of[index] + 1][start + 1 : stop + 1] = text
    return ["".join(row) for row in rows]


def _row_of_numbers(places: Sequence[int], numbers: Sequence[str], inner: int) -> list[str]:
    """Numbers under their ports, in a further row where the first is taken."""
    rows: list[list[str]] = []
    for place, text in zip(places, numbers, strict=True):
        start = min(place, inner - len(text)) + 1
        around = slice(start - 1, start + len(text) + 1)
        row = next((row for row in rows if set(row[around]) <= {" "}), None)
        if row is None:
            row = [" "] * (inner + 2)
            rows.append(row)
        row[start : start + len(text)] = text
    return ["".join(row) for row in rows]


def _layer(case: Case, layer: Layer, inner: int, pen: Pen) -> list[str]:
    """Name, height, material and motion of a layer, in as many lines as that takes."""
    text = f"{layer.name}: {layer.height * 1e3:.6g} mm, {layer.material_name or 'gas'}"
    speed = case.conveying_velocity
    if layer.moving and speed == 0.0:
        text += ", does not move"
    elif layer.moving:
        arrow = pen.right if speed > 0.0 else pen.left
        text += f", moves {'right' if speed > 0.0 else 'left'} at {abs(speed) * 1e2:.4g} cm/s {arrow * 3}"
    return [line.ljust(inner) for line in lines_of(text, inner, indent=1, hang=2)]


def _scale(case: Case, inner: int) -> str:
    """Where the strip begins and ends."""
    return " 0 mm" + f"{case.geometry.length * 1e3:.6g} mm".rjust(inner - 4)


def _zones(case: Case, inner: int) -> list[str]:
    """A line with the zones' names between their ends; none where a name does not fit into its zone."""
    row = [" "] * (inner + 2)
    scale = inner / case.geometry.length
    for zone in case.geometry.zones:
        first, last = 1 + round(zone.start * scale), round(zone.end * scale)
        room = last - first - 1
        if len(zone.name) > room:
            return []
        row[first : last + 1] = "|" + zone.name.center(room) + "|"
    return ["".join(row)]
