"""Ports of the strip: inlets with their dose windows, outlets, and where along a wall they may lie."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import (
    ConfigDict,
    Field,
    PlainSerializer,
    PlainValidator,
    SerializerFunctionWrapHandler,
    WithJsonSchema,
    model_serializer,
    model_validator,
)

from mpm.case.model import Frozen, Name, only_name_required
from mpm.units import (
    Deadline,
    Dimension,
    Fraction,
    Instant,
    PortWidth,
    Position,
    Speed,
    Temperature,
    describe,
    reject,
    worked_out,
)

_INSTANT = Dimension("s", "a time", "5 s", at_least=0.0)
_DEADLINE = Dimension("s", "a time", "5 s", above=0.0, infinite=True)


def _read_windows(value: Any) -> tuple[tuple[float, float], ...]:
    accepted = 'a list of dose windows, e.g. [["0 s", "5 s"], ["10 s", "15 s"]], in order and apart'
    if not isinstance(value, (list, tuple)) or not value:
        raise reject(describe(value), accepted)
    pairs = []
    for pair in value:
        if not isinstance(pair, (list, tuple)) or len(pair) != 2:
            raise reject(f"the window {describe(pair)}", accepted)
        pairs.append((_INSTANT.read(pair[0]), _DEADLINE.read(pair[1])))
    times = [time for pair in pairs for time in pair]
    if any(later <= earlier for earlier, later in pairwise(times)):
        raise reject(" and ".join(f"a window from {a:g} s to {b:g} s" for a, b in pairs), accepted)
    return tuple(pairs)


def _write_windows(pairs: tuple[tuple[float, float], ...]) -> list[list[Any]]:
    return [[_INSTANT.write(start), _DEADLINE.write(stop)] for start, stop in pairs]


Windows = Annotated[
    tuple[tuple[float, float], ...],
    PlainValidator(_read_windows),
    PlainSerializer(_write_windows, when_used="json"),
    WithJsonSchema(
        {
            "type": "array",
            "items": {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2},
            "examples": [[["0 s", "5 s"], ["10 s", "15 s"]]],
        }
    ),
]


class Port(Frozen):
    """An opening in the wall at the bottom or the top of the strip."""

    model_config = ConfigDict(json_schema_extra=only_name_required)

    name: Annotated[Name, Field(examples=["tma"])]
    """what the port is called in results and in keys: letters, digits, _ and -"""
    side: Literal["bottom", "top"]
    """the wall that the port is in"""
    center: Position
    """x of the port's centreline, from the left end of the strip"""
    width: PortWidth
    """width of the port along the strip; a width equal to the length makes a column in plug flow"""

    @property
    def x0(self) -> float:
        """Left end [m]."""
        return self.center - 0.5 * self.width

    @property
    def x1(self) -> float:
        """Right end [m]."""
        return self.center + 0.5 * self.width

    @property
    def key(self) -> str:
        """Its table in `geometry`, such as `inlet.tma`."""
        return f"{type(self).__name__.lower()}.{self.name}"


class Inlet(Port):
    """A stretch of wall that blows carrier gas, with `mass_fractions` of precursor in it during its `windows` [s].

    In the file a single window is `start` and `stop`; several are `windows`.
    """

    side: Literal["bottom", "top"] = "bottom"
    """the wall that the inlet is in"""
    velocity: Speed = 0.035
    """speed of the gas through the inlet, at the temperature of what it blows and the reactor's pressure; 0: closed"""
    mass_fractions: dict[str, Fraction] = Field({}, examples=[{"TMA": 2e-4}])
    """mass fraction of each precursor in the gas of this inlet while it doses; left out: carrier gas alone (a purge)"""
    temperature: Temperature | None = worked_out("gas.temperature", None, example="300 K")
    """temperature of the gas of this inlet; needs a table [energy]"""
    start: Instant = 0.0
    """when the dose begins; before that the inlet blows carrier gas"""
    stop: Deadline = worked_out("never: the inlet doses to the end", math.inf)
    """when the dose ends; after that the inlet blows carrier gas"""
    windows: Windows = worked_out("one window, from start to stop", ())
    """several doses in place of start and stop: pairs of begin and end, in order and apart"""

    @model_validator(mode="after")
    def _one_form_of_windows(self) -> Self:
        if not self.windows:
            if self.stop <= self.start:
                raise reject(
                    f"stop at {self.stop:g} s, start at {self.start:g} s",
                    "a stop after the start",
                    key="stop",
                )
            self._fill(windows=((self.start, self.stop),))
        elif self.model_fields_set & {"start", "stop"}:
            raise reject("windows beside start or stop", "either start and stop, or windows", key="windows")
        else:
            self._fill(start=self.windows[0][0], stop=self.windows[-1][1])
        total = sum(self.mass_fractions.values())
        if total > 1.0:
            raise reject(f"mass fractions that sum to {total:g}", "at most 1 in all", key="mass_fractions")
        return self

    @model_serializer(mode="wrap")
    def _write_one_form(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        table: dict[str, Any] = handler(self)
        single = len(self.windows) == 1
        for key in ("windows", *(["stop"] if self.stop == math.inf else [])) if single else ("start", "stop"):
            table.pop(key, None)
        return table

    @property
    def doses(self) -> bool:
        """Whether this port is there for a precursor (its mass fraction may be zero, as in a sweep) or only for carrier gas."""
        return bool(self.mass_fractions)

    @property
    def feed(self) -> dict[str, float]:
        """Mass fractions of what the inlet feeds: those above zero, in the order of the file. What follows from it says the case."""
        return {name: fraction for name, fraction in self.mass_fractions.items() if fraction > 0.0}

    @property
    def stays_open(self) -> bool:
        """Whether the last window has no end: what the steady state sees of the windows."""
        return math.isinf(self.windows[-1][1])


class Outlet(Port):
    """A stretch of wall at ambient pressure."""

    name: Annotated[Name, Field(examples=["zone1"])]
    """what the port is called in results and in keys: letters, digits, _ and -"""
    side: Literal["bottom", "top"] = "top"
    """the wall that the outlet is in"""


def check_side(ports: Sequence[Port], *, length: float, dx: float) -> None:
    """Ports on one side may not overlap, and an outlet may not share a facet (a column, `dx` wide) with another port."""
    tolerance = 1e-9 * length
    ordered = sorted(ports, key=lambda port: port.x0)
    for left, right in pairwise(ordered):
        where = f"{span(right.x0, right.x1)} next to {left.name} at {span(left.x0, left.x1)}"
        if right.x0 < left.x1 - tolerance:
            raise reject(where, "ports that do not overlap", key=f"{right.key}.center")
        last_of_left = math.ceil((left.x1 - tolerance) / dx) - 1
        first_of_right = math.floor((right.x0 + tolerance) / dx)
        if last_of_left == first_of_right and (isinstance(left, Outlet) or isinstance(right, Outlet)):
            raise reject(
                where,
                f"an outlet at least one column ({dx * 1e3:.3g} mm) away from other ports",
                key=f"{right.key}.center",
            )


def span(start: float, end: float) -> str:
    """A stretch of the strip [m] in words."""
    return f"{start * 1e3:g} mm to {end * 1e3:g} mm"


def check_inside(key: str, start: float, end: float, *, length: float) -> None:
    """Refuse a stretch that leaves the strip."""
    tolerance = 1e-9 * length
    if start < -tolerance or end > length + tolerance:
        raise reject(span(start, end), f"a stretch inside the strip, 0 mm to {length * 1e3:g} mm", key=key)
