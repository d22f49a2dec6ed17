"""Layers of the strip: what fills them and how they are cut into rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import (
    ConfigDict,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    Strict,
    model_serializer,
)

from mpm.case.materials import Material
from mpm.case.model import Flag, Frozen, Name, only_name_required
from mpm.units import Heating, Length, Positive, reject, worked_out

MOST_ROWS = 100_000
"""Rows of a layer beyond this are a slip, not a plan."""
STEEPEST = 100.0
"""Grading, or one over it, up to which gmsh places the rows of a layer where they belong (to 1e-4 of a row)."""
FINEST = 1e-7
"""Smallest side of a cell over the longer side of the strip that coordinates in double precision resolve as well."""

Count = Annotated[int, Strict(), Field(ge=1, le=MOST_ROWS)]


class Layer(Frozen):
    """A horizontal layer, filled with gas or with a porous `material`."""

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
    heating: Heating = worked_out("none", 0.0, example="1e5 W/m^3")
    """heat set free in the layer from without (a heater, microwaves), by volume; needs a table [energy]"""
    _material: Material | None = PrivateAttr()

    @model_serializer(mode="wrap")
    def _write_heating_where_there_is_some(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        table: dict[str, Any] = handler(self)
        if self.heating == 0.0:
            table.pop("heating", None)
        return table

    def complete(self, materials: Mapping[str, Material]) -> None:
        """Find the material by its name; the case does this once its materials are read."""
        self._material = None if self.material_name is None else materials[self.material_name]

    @property
    def material(self) -> Material | None:
        """What fills the layer; None: gas alone."""
        return self._material

    @property
    def solid(self) -> Material:
        """The material of a layer that has one, as the moving layer always does; ValueError for a layer of gas."""
        if self._material is None:
            raise ValueError(f"layer {self.name} is gas")
        return self._material


def check_sizes(layers: Sequence[Layer], *, length: float, dx: float) -> None:
    """Rows and columns must be such as a mesh can have."""
    longest = max(length, sum(layer.height for layer in layers))
    for layer in layers:
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
    if dx < FINEST * longest:
        raise reject(
            f"columns of {dx:.2g} m in a strip of {longest:.2g} m",
            f"columns above {FINEST * longest:.2g} m",
            key="cell_width",
        )


def check_moving(layers: Sequence[Layer]) -> None:
    """At most one layer is conveyed, and that is not gas."""
    moving = [layer for layer in layers if layer.moving]
    if len(moving) > 1:
        raise reject(
            f"moving layers {', '.join(layer.name for layer in moving)}",
            "at most one moving layer",
            key=f"layer.{moving[1].name}.moving",
        )
    for layer in moving:
        if layer.material_name is None:
            raise reject(
                "a moving layer of gas", "a material for the moving layer", key=f"layer.{layer.name}.moving"
            )
