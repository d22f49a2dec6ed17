"""The `[geometry]` table: a strip of layers with inlets, outlets and zones, as frozen values.

Positions count from the left end of the strip; layers from the bottom. What is checked here needs nothing but the
geometry itself: names, ports inside the strip, no overlaps, no facet that an outlet shares with another port.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    PlainValidator,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    Strict,
    WithJsonSchema,
    model_serializer,
    model_validator,
)

from mpm.case.materials import Material
from mpm.case.model import Frozen, nothing_required, only_name_required
from mpm.units import (
    ColumnWidth,
    Deadline,
    Dimension,
    Fraction,
    Instant,
    Length,
    PortWidth,
    Position,
    Positive,
    Speed,
    StripLength,
    describe,
    reject,
    worked_out,
)

WALLS = ("left", "right", "bottom_wall", "top_wall")
"""Physical groups of a mesh file beside layers and ports. Readers such as meshio know a group by its name alone."""
RESERVED_LAYERS = ("height",)
"""Names beside those of layers under `front.INLET` in the results."""
MOST_CELLS = 100_000_000
"""A mesh beyond this is a slip of the unit, not a plan."""
MOST_ROWS = 100_000
"""The same for the rows of a layer."""
STEEPEST = 100.0
"""Grading, or one over it, up to which gmsh places the rows of a layer where they belong (to 1e-4 of a row)."""
FINEST = 1e-7
"""Smallest side of a cell over the longer side of the strip that coordinates in double precision resolve as well."""

_INSTANT = Dimension("s", "a time", "5 s", at_least=0.0)
_DEADLINE = Dimension("s", "a time", "5 s", above=0.0, infinite=True)


def _name(value: str) -> str:
    if not value or not all(character.isalnum() or character in "_-" for character in value):
        raise reject(repr(value), "a name of letters, digits, _ and -")
    return value


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


Name = Annotated[str, AfterValidator(_name)]
Flag = Annotated[bool, Strict()]
Count = Annotated[int, Strict(), Field(ge=1, le=MOST_ROWS)]
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


class Layer(Frozen):
    """A horizontal layer; `material` (a Material; None: gas) is resolved by the case from the name that the file gives."""

    model_config = ConfigDict(json_schema_extra=only_name_required)

    name: Annotated[Name, Field(examples=["bed"])]
    """what the layer is called in results and in keys: letters, digits, _ and -"""
    height: Length
    """height of the layer"""
    cells: Annotated[Count, Field(examples=[10])]
    """rows of cells in the layer: more resolve steeper fronts and take longer"""
    grading: Positive = 1.0
    """height of the layer's top row over that of its bottom row, 0.01 to 100; 1: equal rows"""
    material_name: str | None = Field(None, alias="material")
    """what fills the layer: the name of a built-in material or of a table [material.NAME]; left out: gas alone"""
    moving: Flag = False
    """whether this is the bed, which the vibration conveys (see motion.bed_velocity); at most one layer"""
    _material: Material | None = PrivateAttr(None)

    @property
    def material(self) -> Material | None:
        return self._material


class _Port(Frozen):
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


class Inlet(_Port):
    """A stretch of wall that blows carrier gas, with `mass_fractions` of precursor in it during its `windows` [s].

    In the file a single window is `start` and `stop`; several are `windows`.
    """

    side: Literal["bottom", "top"] = "bottom"
    """the wall that the inlet is in"""
    velocity: Speed = 0.035
    """speed of the gas through the inlet, at the reactor's temperature and pressure; 0: closed"""
    mass_fractions: dict[str, Fraction] = Field({}, examples=[{"TMA": 2e-4}])
    """mass fraction of each precursor in the gas of this inlet while it doses; left out: carrier gas alone (a purge)"""
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
            self.__dict__["windows"] = ((self.start, self.stop),)
        elif self.model_fields_set & {"start", "stop"}:
            raise reject("windows beside start or stop", "either start and stop, or windows", key="windows")
        else:
            self.__dict__.update(start=self.windows[0][0], stop=self.windows[-1][1])
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
        """Whether this port is there for a precursor (its mass fraction may be zero) or only for carrier gas."""
        return bool(self.mass_fractions)

    @property
    def stays_open(self) -> bool:
        """Whether the last window has no end: what the steady state sees of the windows."""
        return math.isinf(self.windows[-1][1])


class Outlet(_Port):
    """A stretch of wall at ambient pressure."""

    name: Annotated[Name, Field(examples=["zone1"])]
    """what the port is called in results and in keys: letters, digits, _ and -"""
    side: Literal["bottom", "top"] = "top"
    """the wall that the outlet is in"""


class Zone(Frozen):
    """A named stretch of the strip, from `start` to `end` [m], with the inlet that doses it."""

    name: Annotated[Name, Field(examples=["zone1"])]
    """what the zone is called in results and in keys: letters, digits, _ and -"""
    start: Annotated[float, Dimension("m", "a position", "0 mm", at_least=0.0)]
    """left end of the zone, from the left end of the strip"""
    end: StripLength
    """right end of the zone, from the left end of the strip"""
    inlet: Annotated[str | None, Field(examples=["tma"])] = None
    """name of the inlet whose precursor reacts in this zone: its titration is read where solids leave the zone"""


class Geometry(Frozen):
    """The strip: `length` [m], columns about `cell_width` [m] wide, layers bottom to top, ports and zones."""

    model_config = ConfigDict(json_schema_extra=nothing_required)

    base: str | None = Field(None, exclude=True, examples=["single_zone"])
    """a geometry to start from, the name of a built-in one or the path of a file; keys given here lie over it, list entries by name"""
    length: StripLength
    """length of the strip along the reactor"""
    cell_width: ColumnWidth = 0.34e-3
    """width of the columns of cells, rounded so that all are equal: narrower ones smear fronts less and take longer"""
    periodic: Flag = True
    """ends of the strip for the gas. true: what leaves at one end comes in at the other (a stretch of a longer reactor); false: walls"""
    bed_inflow: Literal["fresh", "periodic"] = "fresh"
    """solids that enter the strip: fresh with their initial_coverage, or (periodic) those that have left at the other end"""
    inlet_diffusion: Flag = False
    """whether precursor also diffuses through the face of an inlet; false: an inlet feeds exactly velocity times concentration"""
    layers: tuple[Layer, ...] = Field(alias="layer", min_length=1)
    """the layers of the strip, from the bottom to the top"""
    inlets: tuple[Inlet, ...] = Field((), alias="inlet")
    """the ports that blow gas in"""
    outlets: tuple[Outlet, ...] = Field((), alias="outlet")
    """the ports that let gas out, at ambient pressure"""
    zones: tuple[Zone, ...] = worked_out(
        "as many equal zones as inlets that dose, one in each", (), alias="zone"
    )
    """stretches of the strip that results are given for, each with its inlet"""

    @property
    def columns(self) -> int:
        """Number of equal columns: the nearest to length / cell_width."""
        return max(1, round(self.length / self.cell_width))

    @property
    def dx(self) -> float:
        """Width of a column [m]."""
        return self.length / self.columns

    @property
    def moving_layer(self) -> Layer | None:
        """The layer that is conveyed, if any."""
        return next((layer for layer in self.layers if layer.moving), None)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.periodic and self.columns < 3:
            raise reject(
                f"{self.columns} columns", "at least 3 columns in a periodic strip", key="cell_width"
            )
        cells = self.columns * sum(layer.cells for layer in self.layers)
        if cells > MOST_CELLS:
            raise reject(f"{cells:.2g} cells", f"a mesh of at most {MOST_CELLS:.0e} cells", key="cell_width")
        self._check_sizes()
        _check_names("layer", self.layers)
        _check_names("port", (*self.inlets, *self.outlets))
        _check_names("zone", self.zones)
        _check_reserved(self.layers, (*self.inlets, *self.outlets))
        moving = [layer.name for layer in self.layers if layer.moving]
        if len(moving) > 1:
            raise reject(
                f"moving layers {', '.join(moving)}",
                "at most one moving layer",
                key=f"layer.{moving[1]}.moving",
            )
        for layer in self.layers:
            if layer.moving and layer.material_name is None:
                raise reject(
                    "a moving layer of gas",
                    "a material for the moving layer",
                    key=f"layer.{layer.name}.moving",
                )
        for port in (*self.inlets, *self.outlets):
            _check_inside(f"{_kind(port)}.{port.name}", port.x0, port.x1, self.length)
        for side in ("bottom", "top"):
            self._check_side([port for port in (*self.inlets, *self.outlets) if port.side == side])
        flow = sum(inlet.velocity for inlet in self.inlets)
        if flow > 0.0 and not self.outlets:
            raise reject("inlets but no outlet", "at least one outlet", key="outlet")
        if not self.zones:
            self.__dict__["zones"] = self._default_zones()
        self._check_zones()
        return self

    def _check_sizes(self) -> None:
        """Rows and columns must be such as a mesh can have."""
        longest = max(self.length, sum(layer.height for layer in self.layers))
        for layer in self.layers:
            steepness = max(layer.grading, 1.0 / layer.grading)
            if steepness > STEEPEST:
                raise reject(
                    f"{layer.grading:g}",
                    f"{1.0 / STEEPEST:g} to {STEEPEST:g}",
                    key=f"layer.{layer.name}.grading",
                )
            row = layer.height / layer.cells / steepness
            if row < FINEST * longest:
                raise reject(
                    f"rows of {row:.2g} m in a strip of {longest:.2g} m",
                    f"rows above {FINEST * longest:.2g} m",
                    key=f"layer.{layer.name}.height",
                )
        if self.dx < FINEST * longest:
            raise reject(
                f"columns of {self.dx:.2g} m in a strip of {longest:.2g} m",
                f"columns above {FINEST * longest:.2g} m",
                key="cell_width",
            )

    def _check_side(self, ports: Sequence[_Port]) -> None:
        """Ports on one side may not overlap, and an outlet may not share a facet (a column) with another port."""
        tolerance = 1e-9 * self.length
        ordered = sorted(ports, key=lambda port: port.x0)
        for left, right in pairwise(ordered):
            key = f"{_kind(right)}.{right.name}"
            where = f"{_span(right.x0, right.x1)} next to {left.name} at {_span(left.x0, left.x1)}"
            if right.x0 < left.x1 - tolerance:
                raise reject(where, "ports that do not overlap", key=f"{key}.center")
            last_of_left = math.ceil((left.x1 - tolerance) / self.dx) - 1
            first_of_right = math.floor((right.x0 + tolerance) / self.dx)
            if last_of_left == first_of_right and (isinstance(left, Outlet) or isinstance(right, Outlet)):
                raise reject(
                    where,
                    f"an outlet at least one column ({self.dx * 1e3:.3g} mm) away from other ports",
                    key=f"{key}.center",
                )

    def _default_zones(self) -> tuple[Zone, ...]:
        """As many equal zones as inlets that dose, provided that each contains the centre of one of them."""
        dosing = sorted((inlet for inlet in self.inlets if inlet.doses), key=lambda inlet: inlet.center)
        share = self.length / max(1, len(dosing))
        if any(not i * share <= inlet.center <= (i + 1) * share for i, inlet in enumerate(dosing)):
            raise reject(
                f"no zones, and dosing inlets at {', '.join(f'{inlet.center * 1e3:g} mm' for inlet in dosing)}",
                f"a list of zones, since {len(dosing)} equal zones would not hold one dosing inlet each",
                key="zone",
            )
        edges = [i * share for i in range(len(dosing))] + [self.length]
        return tuple(
            Zone(name=f"zone{i + 1}", start=f"{edges[i]!r} m", end=f"{edges[i + 1]!r} m", inlet=inlet.name)
            for i, inlet in enumerate(dosing)
        )

    def _check_zones(self) -> None:
        tolerance = 1e-9 * self.length
        inlets = {inlet.name: inlet for inlet in self.inlets}
        for zone in self.zones:
            key = f"zone.{zone.name}"
            if zone.end <= zone.start:
                raise reject(_span(zone.start, zone.end), "an end after the start", key=f"{key}.end")
            _check_inside(key, zone.start, zone.end, self.length)
            if zone.end - zone.start < self.dx * (1.0 - 1e-9):
                raise reject(
                    _span(zone.start, zone.end),
                    f"a zone of at least one column ({self.dx * 1e3:.3g} mm)",
                    key=key,
                )
            if zone.inlet is None:
                continue
            if zone.inlet not in inlets:
                raise reject(
                    repr(zone.inlet),
                    f"the name of an inlet: {', '.join(inlets) or 'there is none'}",
                    key=f"{key}.inlet",
                    given=zone.inlet,
                    known=list(inlets),
                )
            if not zone.start - tolerance <= inlets[zone.inlet].center <= zone.end + tolerance:
                raise reject(
                    f"inlet {zone.inlet} at {inlets[zone.inlet].center * 1e3:g} mm",
                    f"an inlet whose centre lies in the zone, {_span(zone.start, zone.end)}",
                    key=f"{key}.inlet",
                )
        ordered = sorted(self.zones, key=lambda zone: zone.start)
        for left, right in pairwise(ordered):
            if right.start < left.end - tolerance:
                raise reject(
                    f"{_span(right.start, right.end)} and {left.name} at {_span(left.start, left.end)}",
                    "zones that do not overlap",
                    key=f"zone.{right.name}.start",
                )
        served = [zone.inlet for zone in self.zones if zone.inlet is not None]
        for inlet in served:
            if served.count(inlet) > 1:
                raise reject(
                    f"inlet {inlet} in {served.count(inlet)} zones",
                    "at most one zone for each inlet",
                    key="zone",
                )


def _kind(port: _Port) -> str:
    return type(port).__name__.lower()


def _span(start: float, end: float) -> str:
    return f"{start * 1e3:g} mm to {end * 1e3:g} mm"


def _check_inside(key: str, start: float, end: float, length: float) -> None:
    tolerance = 1e-9 * length
    if start < -tolerance or end > length + tolerance:
        raise reject(_span(start, end), f"a stretch inside the strip, 0 mm to {length * 1e3:g} mm", key=key)


def _check_reserved(layers: Sequence[Layer], ports: Sequence[_Port]) -> None:
    """Names that mean something else where a mesh file or a table of results says them."""
    for layer in layers:
        if layer.name in RESERVED_LAYERS:
            raise reject(
                f"{layer.name!r}, which front.INLET.{layer.name} of the results names already",
                "another name",
                key=f"layer.{layer.name}.name",
            )
    names = [layer.name for layer in layers]
    for port in ports:
        if port.name in (*WALLS, *names):
            kind = "wall" if port.name in WALLS else "layer"
            raise reject(
                f"{port.name!r}, the name of a {kind} in mesh files",
                f"a name that no wall ({', '.join(WALLS)}) and no layer ({', '.join(names)}) has",
                key=f"{_kind(port)}.{port.name}.name",
            )


def _check_names(kind: str, entries: Iterable[Layer | Inlet | Outlet | Zone]) -> None:
    seen: set[str] = set()
    for entry in entries:
        if entry.name in seen:
            table = type(entry).__name__.lower()
            raise reject(
                f"{kind} name {entry.name!r} twice",
                f"a different name for every {kind}",
                key=f"{table}.{entry.name}.name",
            )
        seen.add(entry.name)
