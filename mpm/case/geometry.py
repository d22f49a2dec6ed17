"""The `[geometry]` table: a strip of layers with inlets, outlets and zones, as frozen values.

Positions count from the left end of the strip; layers from the bottom. What is checked here needs nothing but the
geometry itself: names, ports inside the strip, no overlaps, no facet that an outlet shares with another port.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, Self

from pydantic import (
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from mpm.case.layers import Layer, check_moving, check_sizes
from mpm.case.materials import Material
from mpm.case.model import Flag, Frozen, nothing_required
from mpm.case.ports import Inlet, Outlet, Port, check_inside, check_side
from mpm.case.walls import Wall, check_walls
from mpm.case.zones import Zone, check_zones, default_zones
from mpm.units import ColumnWidth, StripLength, Temperature, reject, worked_out

WALLS = ("left", "right", "bottom_wall", "top_wall")
"""Physical groups of a mesh file beside layers and ports. Readers such as meshio know a group by its name alone."""
RESERVED_LAYERS = ("height",)
"""Names beside those of layers under `front.INLET` in the results."""
MOST_CELLS = 100_000_000
"""A mesh beyond this is a slip of the unit, not a plan."""


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
    bed_temperature: Temperature | None = worked_out("gas.temperature", None, example="25 degC")
    """temperature of solids that enter the strip fresh; needs a table [energy]"""
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
    walls: tuple[Wall, ...] = Field((), alias="wall")
    """stretches of the sides that give or take heat (all else is insulated); they need a table [energy]"""

    @property
    def columns(self) -> int:
        """Number of equal columns: the nearest to length / cell_width."""
        return max(1, round(self.length / self.cell_width))

    @property
    def dx(self) -> float:
        """Width of a column [m]."""
        return self.length / self.columns

    @property
    def height(self) -> float:
        """Height of the strip [m]."""
        return sum(layer.height for layer in self.layers)

    @property
    def cells(self) -> int:
        """Number of cells of the mesh."""
        return self.columns * sum(layer.cells for layer in self.layers)

    @property
    def moving_layer(self) -> Layer | None:
        """The layer that is conveyed, if any."""
        return next((layer for layer in self.layers if layer.moving), None)

    @property
    def ports(self) -> tuple[Port, ...]:
        """All inlets and outlets."""
        return (*self.inlets, *self.outlets)

    def complete(self, materials: Mapping[str, Material]) -> None:
        """Tell every layer what it is filled with; the case does this once its materials are read."""
        for layer in self.layers:
            layer.complete(materials)

    def complete_temperatures(self, temperature: float) -> None:
        """Fill in temperatures [K] of what comes in, where they are left out; a case with [energy] does this."""
        for inlet in self.inlets:
            if inlet.temperature is None:
                inlet._fill(temperature=temperature)
        if self.bed_temperature is None and self.moving_layer is not None:
            self._fill(bed_temperature=temperature)

    @model_serializer(mode="wrap")
    def _write_walls_where_there_are_some(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        table: dict[str, Any] = handler(self)
        if not self.walls:
            table.pop("wall", None)
        return table

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.periodic and self.columns < 3:
            raise reject(
                f"{self.columns} columns", "at least 3 columns in a periodic strip", key="cell_width"
            )
        if self.cells > MOST_CELLS:
            raise reject(
                f"{self.cells:.2g} cells", f"a mesh of at most {MOST_CELLS:.0e} cells", key="cell_width"
            )
        check_sizes(self.layers, length=self.length, dx=self.dx)
        _check_names("layer", self.layers)
        _check_names("port", self.ports)
        _check_names("zone", self.zones)
        _check_reserved(self.layers, self.ports)
        check_moving(self.layers)
        for port in self.ports:
            check_inside(port.key, port.x0, port.x1, length=self.length)
        for side in ("bottom", "top"):
            check_side([port for port in self.ports if port.side == side], length=self.length, dx=self.dx)
        flow = sum(inlet.velocity for inlet in self.inlets)
        if flow > 0.0 and not self.outlets:
            raise reject("inlets but no outlet", "at least one outlet", key="outlet")
        if not self.zones:
            self._fill(zones=default_zones(self.inlets, self.length))
        for wall in self.walls:
            wall.complete(length=self.length, height=self.height)
        _check_names("wall", self.walls)
        check_walls(self.walls, self.ports, length=self.length, height=self.height, periodic=self.periodic)
        check_zones(self.zones, self.inlets, length=self.length, dx=self.dx)
        return self


def _check_reserved(layers: Sequence[Layer], ports: Sequence[Port]) -> None:
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
                key=f"{port.key}.name",
            )


def _check_names(kind: str, entries: Iterable[Layer | Port | Zone | Wall]) -> None:
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
