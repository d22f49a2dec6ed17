"""Units are converted here, once, when a case is read; everything behind this door is an SI float.

`Dimension` is the type annotation of a quantity in a case file. It reads `"3.5 cm/s"`, checks dimension and
range, hands on 0.035, and writes `"0.035 m/s"` when the case is dumped. Conversion runs in decimal arithmetic,
so that "139.7 mm" becomes the float 0.1397 and not its neighbour.
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from typing import Annotated, Any

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from mpm.conversion import in_base_units as in_base_units  # offered here too
from mpm.conversion import is_counted as is_counted
from mpm.conversion import parse as parse

SMALLEST, LARGEST = 1e-30, 1e30
"""Magnitudes of quantities in SI units. What lies outside is a slip, and would overflow or vanish in the products of the model."""


def reject(found: str, accepted: str, **context: Any) -> PydanticCustomError:
    """Build the error that a validator raises: what was found, what is accepted, and optional context.

    `key` extends the address of the offending entry; `given` and `known` (a list) let the message suggest the
    nearest name. The case reader turns it into an InputError.
    """
    return PydanticCustomError(
        "mpm", "found {found}; accepted: {accepted}", {"found": found, "accepted": accepted, **context}
    )


@dataclass(frozen=True)
class Dimension:
    """Annotation of one kind of quantity: `Annotated[float, Dimension("m/s", "a velocity", "3.5 cm/s")]`.

    unit: what the float counts ("" for a pure number, which is then written without a unit);
    above, at_least, at_most, below: range, in `unit`; infinite: whether "inf s" is legal.
    """

    unit: str
    what: str
    example: str
    _: KW_ONLY
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    below: float | None = None
    infinite: bool = False

    def read(self, value: Any) -> float:
        """Return the SI float for what stands in the case file, or raise `reject(...)`."""
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise reject(describe(value), self.accepted)
        if self.unit:
            if not isinstance(value, str):
                raise reject(f"{value!r} without a unit", self.accepted)
            try:
                number = parse(value, self.unit)
            except ValueError as error:
                raise reject(f"{value!r} ({error})", self.accepted) from None
        else:
            if isinstance(value, str):
                raise reject(f"{value!r}", self.accepted)
            try:
                number = float(value)
            except OverflowError:  # an integer of hundreds of digits
                number = math.inf
        if math.isfinite(number) and number and not SMALLEST <= abs(number) <= LARGEST:
            limits = f"of a size from {SMALLEST:g} to {LARGEST:g} {self.unit}".strip()
            raise reject(describe(value), f"{self.accepted}, {limits}")
        finite = math.isfinite(number) or (self.infinite and number == math.inf)
        inside = (
            (self.above is None or number > self.above)
            and (self.at_least is None or number >= self.at_least)
            and (self.at_most is None or number <= self.at_most)
            and (self.below is None or number < self.below)
        )
        if not (finite and inside):
            raise reject(describe(value), self.accepted)
        return number

    def write(self, number: float) -> float | str:
        """Return what a case file holds for this float; reading it gives the same float again."""
        return f"{number!r} {self.unit}" if self.unit else number

    @property
    def accepted(self) -> str:
        """What may stand there, in words, with an example."""
        bounds = [
            f"{word} {limit:g} {self.unit}".strip()
            for word, limit in (
                ("above", self.above),
                ("from", self.at_least),
                ("up to", self.at_most),
                ("below", self.below),
            )
            if limit is not None
        ]
        kind = " ".join([self.what, " and ".join(bounds)]).strip()
        return f'{kind} with its unit, e.g. "{self.example}"' if self.unit else f"{kind}, e.g. {self.example}"

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read,
            serialization=core_schema.plain_serializer_function_ser_schema(self.write, when_used="json"),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        if self.unit:
            return {
                "type": "string",
                **self.about,
                "pattern": r"^\s*[+-]?([0-9]|\.[0-9]|inf).*[^0-9.\s]\S*\s*$",
            }
        bounds = {
            "exclusiveMinimum": self.above,
            "minimum": self.at_least,
            "maximum": self.at_most,
            "exclusiveMaximum": self.below,
        }
        return {"type": "number", **self.about, **{k: v for k, v in bounds.items() if v is not None}}

    @property
    def about(self) -> dict[str, Any]:
        """What a JSON Schema says of such a quantity; `accepted` becomes the end of its description (`finished`)."""
        if self.unit:
            return {"accepted": self.accepted, "examples": [self.example], "unit": self.unit}
        return {"accepted": self.accepted, "examples": [float(self.example)]}


def in_range(key: str, number: float, unit: str) -> float:
    """`number`, worked out for `key` from other keys, when it has the size of a quantity; else the validator error."""
    if not SMALLEST <= number <= LARGEST:
        raise reject(f"keys that make it {number:.3g} {unit}", f"{SMALLEST:g} to {LARGEST:g} {unit}", key=key)
    return number


def worked_out(source: str, placeholder: Any = 0.0, *, alias: str | None = None, example: Any = None) -> Any:
    """Default of a field that its model works out when it is left out; the schema says from what instead of a default."""

    def extra(schema: dict[str, Any]) -> None:
        schema.pop("default", None)
        schema["worked_out"] = source

    return Field(
        placeholder, alias=alias, json_schema_extra=extra, examples=None if example is None else [example]
    )


def describe(value: Any) -> str:
    """Return what was found as short text for an error message."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


Length = Annotated[float, Dimension("m", "a length", "3 mm", above=0.0)]
StripLength = Annotated[float, Dimension("m", "a length", "139.7 mm", above=0.0)]
ColumnWidth = Annotated[float, Dimension("m", "a length", "0.34 mm", above=0.0)]
PortWidth = Annotated[float, Dimension("m", "a length", "4 mm", above=0.0)]
Diameter = Annotated[float, Dimension("m", "a diameter", "56 um", above=0.0)]
Position = Annotated[float, Dimension("m", "a position", "104.8 mm", at_least=0.0)]
Area = Annotated[float, Dimension("m^2", "a permeability", "4.25 um^2", above=0.0)]
PerLength = Annotated[float, Dimension("1/m", "a surface per volume", "58000 1/m", at_least=0.0)]
Speed = Annotated[float, Dimension("m/s", "a speed", "3.5 cm/s", at_least=0.0)]
BedSpeed = Annotated[float, Dimension("m/s", "a speed", "1.3 cm/s", at_least=0.0)]
Velocity = Annotated[float, Dimension("m/s", "a velocity", "-0.40 cm/s")]
Duration = Annotated[float, Dimension("s", "a time", "10 ms", above=0.0)]
RunTime = Annotated[float, Dimension("s", "a time", "20 s", above=0.0)]
WallTime = Annotated[float, Dimension("s", "a time", "60 s", above=0.0)]
Interval = Annotated[float, Dimension("s", "a time", "0.25 s", above=0.0)]
Instant = Annotated[float, Dimension("s", "a time", "50 ms", at_least=0.0)]
Deadline = Annotated[float, Dimension("s", "a time", "5 s", above=0.0, infinite=True)]
Frequency = Annotated[float, Dimension("Hz", "a frequency", "16 Hz", above=0.0)]
Angle = Annotated[float, Dimension("rad", "an angle", "60 deg")]
Temperature = Annotated[float, Dimension("K", "a temperature", "473 K", above=0.0)]
Pressure = Annotated[float, Dimension("Pa", "a pressure", "101325 Pa", above=0.0)]
Adhesion = Annotated[float, Dimension("Pa", "a stress", "10 Pa", at_least=0.0)]
Density = Annotated[float, Dimension("kg/m^3", "a density", "2500 kg/m^3", above=0.0)]
GasDensity = Annotated[float, Dimension("kg/m^3", "a density", "0.72 kg/m^3", above=0.0)]
Viscosity = Annotated[float, Dimension("Pa*s", "a viscosity", "1.72e-5 Pa s", above=0.0)]
DIFFUSIVITY = Dimension("m^2/s", "a diffusivity", "2.88e-5 m^2/s", at_least=0.0)
Diffusivity = Annotated[float, DIFFUSIVITY]
MolarMass = Annotated[float, Dimension("kg/mol", "a molar mass", "28.01 g/mol", above=0.0)]
MolarEnergy = Annotated[float, Dimension("J/mol", "an activation energy", "20 kJ/mol")]
MolarEnthalpy = Annotated[float, Dimension("J/mol", "an enthalpy", "-86.5 kJ/mol")]
MolarHeatCapacity = Annotated[float, Dimension("J/mol/K", "a molar heat capacity", "35.7 J/mol/K", above=0.0)]
MolarEntropy = Annotated[float, Dimension("J/mol/K", "a molar entropy", "188.8 J/mol/K")]
HeatFlux = Annotated[float, Dimension("W/m^2", "a heat flux", "1 kW/m^2")]
HeatTransfer = Annotated[float, Dimension("W/m^2/K", "a heat transfer coefficient", "10 W/m^2/K", above=0.0)]
Heating = Annotated[float, Dimension("W/m^3", "a heating by volume", "1e5 W/m^3")]
FlowUpdate = Annotated[float, Dimension("", "a relative change", "0.01", above=0.0, below=1.0)]
HeatCapacity = Annotated[float, Dimension("J/kg/K", "a heat capacity", "871 J/kg/K", above=0.0)]
Conductivity = Annotated[float, Dimension("W/m/K", "a thermal conductivity", "1.3 W/m/K", above=0.0)]
Number = Annotated[float, Dimension("", "a number", "0.5")]
Sphericity = Annotated[float, Dimension("", "a sphericity", "0.79", above=0.0)]
Kozeny = Annotated[float, Dimension("", "a number", "4.2", above=0.0)]
Positive = Annotated[float, Dimension("", "a number", "1.5", above=0.0)]
NonNegative = Annotated[float, Dimension("", "a number", "0.30", at_least=0.0)]
Order = Annotated[float, Dimension("", "an order", "0.5", at_least=0.0, at_most=4.0)]
Places = Annotated[float, Dimension("", "a number of places", "2", above=0.0)]
Atoms = Annotated[float, Dimension("", "a number of atoms", "3", at_least=0.0)]
Fraction = Annotated[float, Dimension("", "a fraction", "2e-4", at_least=0.0, at_most=1.0)]
Coverage = Annotated[float, Dimension("", "a fraction", "1", at_least=0.0, at_most=1.0)]
Sticking = Annotated[float, Dimension("", "a fraction", "0.01", at_least=0.0, at_most=1.0)]
Porosity = Annotated[float, Dimension("", "a fraction", "0.46", above=0.0, below=1.0)]
