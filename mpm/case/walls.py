"""Walls that give or take heat: stretches of a side of the strip; the rest of each side lets none through."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import ConfigDict, Field, model_validator

from mpm.case.model import Frozen, Name, nothing_required
from mpm.case.ports import Port, span
from mpm.units import Dimension, HeatFlux, HeatTransfer, Temperature, reject, worked_out

Side = Literal["bottom", "top", "left", "right"]
SIDES: tuple[str, ...] = get_args(Side)
CONDITIONS = ("temperature", "heat_flux", "heat_transfer_coefficient")
"""Keys of which a wall has one."""


class Wall(Frozen):
    """A stretch of a side with a temperature, a heat flux, or heat transfer to surroundings."""

    model_config = ConfigDict(json_schema_extra=nothing_required)

    name: Annotated[Name, Field(examples=["bottom"])] = worked_out(
        "its side, with a number for the second and later ones", example="bottom"
    )
    """what the wall is called in results and in keys: letters, digits, _ and -"""
    side: Side
    """the side of the strip that the wall is on; left and right where geometry.periodic = false"""
    start: Annotated[float, Dimension("m", "a position", "10 mm", at_least=0.0)] = 0.0
    """where the wall begins: x from the left end of the strip, or (left and right) height above its bottom"""
    end: Annotated[float, Dimension("m", "a position", "30 mm", above=0.0)] = worked_out(
        "the end of its side", 0.0
    )
    """where the wall ends, counted as start is"""
    temperature: Temperature | None = None
    """temperature that the wall is held at"""
    heat_flux: HeatFlux | None = None
    """heat that the wall gives to the strip, by area; below 0: takes"""
    heat_transfer_coefficient: HeatTransfer | None = None
    """heat that passes the wall, by area and by degree between the surroundings (ambient) and the strip beside the wall"""
    ambient: Temperature | None = None
    """temperature of the surroundings beyond heat_transfer_coefficient"""

    @property
    def key(self) -> str:
        """Its table in `geometry`."""
        return f"wall.{self.name}"

    @property
    def horizontal(self) -> bool:
        """Whether the wall lies along x, at the bottom or the top."""
        return self.side in ("bottom", "top")

    def complete(self, *, length: float, height: float) -> None:
        """Fill in the end of the side; the geometry does this."""
        if "end" not in self.model_fields_set:
            self._fill(end=length if self.horizontal else height)

    @model_validator(mode="after")
    def _one_condition(self) -> Self:
        given = [key for key in CONDITIONS if getattr(self, key) is not None]
        one_of = "one of temperature, heat_flux, and heat_transfer_coefficient with ambient"
        if len(given) > 1:
            found = f"{' and '.join(given)}, {len(given)} conditions at one place"
            raise reject(found, one_of, key=given[1], given="")
        if not given and self.ambient is None:
            raise reject("a wall without a condition", one_of)
        if (self.heat_transfer_coefficient is None) != (self.ambient is None):
            have, lack = (
                ("heat_transfer_coefficient", "ambient")
                if self.ambient is None
                else ("ambient", "heat_transfer_coefficient")
            )
            raise reject(f"{have} without {lack}", one_of, key=have, given="")
        return self


def name_walls(geometry: Any) -> Any:
    """The table `geometry` with a name at each of its walls: its side, with a number where that is taken."""
    walls = geometry.get("wall") if isinstance(geometry, Mapping) else None
    if not isinstance(walls, list) or all(not isinstance(w, Mapping) or "name" in w for w in walls):
        return geometry
    taken = {str(wall.get("name")) for wall in walls if isinstance(wall, Mapping)}
    named = []
    for wall in walls:
        if isinstance(wall, Mapping) and "name" not in wall:
            side = str(wall.get("side"))
            name = next(n for n in _numbered(side if side in SIDES else "wall") if n not in taken)
            taken.add(name)
            wall = {"name": name, **wall}
        named.append(wall)
    return {**geometry, "wall": named}


def named_walls(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of a case, or overrides by dotted key, with a name at each wall of theirs."""
    named = {key: name_walls(value) if key == "geometry" else value for key, value in tables.items()}
    if "geometry.wall" in tables:
        named["geometry.wall"] = name_walls({"wall": tables["geometry.wall"]})["wall"]
    return named


def _numbered(name: str) -> Iterator[str]:
    yield name
    number = 2
    while True:
        yield f"{name}{number}"
        number += 1


def check_walls(
    walls: Sequence[Wall], ports: Sequence[Port], *, length: float, height: float, periodic: bool
) -> None:
    """Walls lie on their side, apart from each other and from ports."""
    for wall in walls:
        whole = length if wall.horizontal else height
        if periodic and not wall.horizontal:
            raise reject(
                f"{wall.side}, an end that is open (geometry.periodic = true)",
                "bottom or top, or geometry.periodic = false",
                key=f"{wall.key}.side",
                given="",
            )
        if wall.end <= wall.start or wall.end > whole * (1.0 + 1e-9):
            raise reject(
                span(wall.start, wall.end),
                f"a stretch of the {wall.side}, 0 mm to {whole * 1e3:g} mm",
                key=f"{wall.key}.{'start' if wall.end <= wall.start else 'end'}",
            )
        for port in ports:
            if port.side == wall.side and _overlap(wall.start, wall.end, port.x0, port.x1, whole):
                free = ", ".join(span(a, b) for a, b in _free(wall, ports, length))
                raise reject(
                    f"{span(wall.start, wall.end)}, which overlaps port {port.name} at {span(port.x0, port.x1)}",
                    f"walls between the ports of this side: {free or 'there is no room'}",
                    key=wall.key,
                    given="",
                )
    for side in SIDES:
        ordered = sorted((wall for wall in walls if wall.side == side), key=lambda wall: wall.start)
        for one, other in pairwise(ordered):
            if _overlap(one.start, one.end, other.start, other.end, max(length, height)):
                raise reject(
                    f"{span(other.start, other.end)}, which overlaps wall {one.name} at {span(one.start, one.end)}: "
                    "two conditions at one place",
                    "walls that do not overlap",
                    key=other.key,
                    given="",
                )


def _overlap(start: float, end: float, other_start: float, other_end: float, whole: float) -> bool:
    return min(end, other_end) - max(start, other_start) > 1e-9 * whole


def _free(wall: Wall, ports: Sequence[Port], length: float) -> Iterator[tuple[float, float]]:
    """Stretches of the wall that no port of its side takes."""
    taken = sorted((port.x0, port.x1) for port in ports if port.side == wall.side)
    at = wall.start
    for begin, end in [*taken, (length, length)]:
        if min(begin, wall.end) - at > 1e-9 * length:
            yield at, min(begin, wall.end)
        at = max(at, end)
