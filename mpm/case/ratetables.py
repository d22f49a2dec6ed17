"""Tables that say how fast a reaction is: rate constants with the units of their orders, equilibria, dependence on coverage."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    SerializerFunctionWrapHandler,
    WithJsonSchema,
    model_serializer,
)
from pydantic_core import CoreSchema

from mpm.case.model import Frozen, nothing_required
from mpm.units import (
    Dimension,
    MolarEnergy,
    Number,
    Order,
    Temperature,
    describe,
    in_base_units,
    is_counted,
    reject,
)

SURFACE_RATE = Dimension("m/s", "a surface rate constant", "0.9 m/s", at_least=0.0)
GAS_RATE = Dimension("m^3/mol/s", "a second-order rate constant", "1.0 m^3/kmol/s", at_least=0.0)
ANY_RATE = (
    'a rate constant from 0 in the unit of its orders, e.g. "0.9 m/s" for one gas on sites, or "1.0 m^3/kmol/s" for two in the gas, '
    'or "1e13 1/s" for a site alone'
)
ANY_EQUILIBRIUM = 'a constant of concentrations and coverages, e.g. "0.5 m^3/mol", or a number where as many gases come as go'
_SIZE = 1e100
"""Rate and equilibrium constants are of a size from its inverse to this: units of higher orders, and what activation makes of them."""


def unit_text(powers: Mapping[str, float]) -> str:
    """A unit as a file writes it, such as `m^2.5/mol^0.5/s`, from the powers of mol, m and s; "" where all are 0."""
    rounded = {name: round(powers.get(name, 0.0), 9) for name in ("mol", "m", "s")}
    above = [_power(name, power) for name, power in rounded.items() if power > 0.0]
    below = [_power(name, -rounded[name]) for name in ("m", "mol", "s") if rounded[name] < 0.0]
    return "/".join(["*".join(above) or "1", *below]) if above or below else ""


def _power(name: str, power: float) -> str:
    return name if power == 1.0 else f"{name}^{power:.9g}"


def powers_of(text: str) -> tuple[float, dict[str, float]]:
    """A normalised constant as a float in SI units, and the powers of mol, m and s in its unit."""
    value, powers = in_base_units(text)
    return value, {name: powers.get(name, 0.0) for name in ("mol", "m", "s")}


def _in_si(value: Any, accepted: str, time: float) -> str:
    """A constant in SI units as text; seconds must have the power `time`, and nothing beside length and amount may be in it."""
    try:
        if not isinstance(value, str):
            raise ValueError("a number without a unit")
        number, powers = in_base_units(value)
    except ValueError:
        raise reject(repr(value), accepted) from None
    if powers.get("s", 0.0) != time or not set(powers) <= {"mol", "m", "s"}:
        raise reject(repr(value), accepted)
    if not (math.isfinite(number) and number >= 0.0 and (number == 0.0 or 1.0 / _SIZE <= number <= _SIZE)):
        raise reject(
            repr(value), f"{accepted}, not below 0 and of a size from {1 / _SIZE:g} to {_SIZE:g} in SI units"
        )
    return f"{number!r} {unit_text(powers)}"


def _rate_constant(value: Any) -> str:
    """Normalise a rate constant to SI but keep its unit: which is right depends on the reaction."""
    for dimension in (SURFACE_RATE, GAS_RATE):
        if isinstance(value, str) and is_counted(value, dimension.unit):
            return str(dimension.write(dimension.read(value)))
    return _in_si(value, ANY_RATE, -1.0)


def _equilibrium_constant(value: Any) -> str | float:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if not 1.0 / _SIZE <= value <= _SIZE:
            raise reject(repr(value), f"{ANY_EQUILIBRIUM}, of a size from {1 / _SIZE:g} to {_SIZE:g}")
        return float(value)
    text = _in_si(value, ANY_EQUILIBRIUM, 0.0)
    if powers_of(text)[0] == 0.0:
        raise reject(
            repr(value), f"{ANY_EQUILIBRIUM}, above 0; a reaction that does not go back has -> as its arrow"
        )
    return text


RateConstant = Annotated[
    str,
    BeforeValidator(_rate_constant),
    WithJsonSchema(
        {"type": "string", "accepted": ANY_RATE, "examples": [SURFACE_RATE.example, GAS_RATE.example]}
    ),
]
_CONSTANT = {"type": ["string", "number"], "accepted": ANY_EQUILIBRIUM, "examples": ["0.5 m^3/mol"]}
EquilibriumConstant = Annotated[
    str | float, BeforeValidator(_equilibrium_constant), WithJsonSchema(_CONSTANT)
]


class MechanismTable(Frozen):
    """A table of a mechanism: it may lie over another, and writes those of its `quiet` keys only that are not at their defaults."""

    model_config = ConfigDict(json_schema_extra=nothing_required)

    @model_serializer(mode="wrap")
    def _write(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        written: dict[str, Any] = handler(self)
        for key in QUIET:
            field = type(self).model_fields.get(key)
            if field is not None and getattr(self, key) == field.default:
                written.pop(key, None)
        return written


QUIET = ("sites", "motz_wise", "reference_pressure", "phase", "gas_reactions")
"""Keys that a resolved case leaves out at their defaults, which is what they were before there were these keys."""


def a_table(example: str) -> BeforeValidator:
    """Refuses what is no table with an example of one."""

    def check(value: Any) -> Any:
        if not isinstance(value, (Mapping, Frozen)):
            raise reject(describe(value), f"a table, e.g. {example}")
        return value

    return BeforeValidator(check)


class CoverageTable(MechanismTable):
    """`[reaction.KEY.coverage.SITE]`: what the coverage theta of a site does to the rate constant."""

    a: Number = 0.0
    """exponent of ten per coverage: 10^(a theta)"""
    m: Number = 0.0
    """power of the coverage in the rate constant: theta^m"""
    E: MolarEnergy = 0.0
    """activation energy per coverage: exp(-E theta / R T)"""


Coverages = dict[str, Annotated[CoverageTable, a_table('{ E = "5 kJ/mol" }')]]


class ReverseTable(MechanismTable):
    """`[reaction.KEY.reverse]`: the rate of the way back by a constant of its own."""

    A: RateConstant | None = None
    """rate constant of the way back before (T / reference_temperature)^b exp(-Ea / R T), in the units of its orders"""
    b: Number = 0.0
    """exponent of the temperature in the rate constant of the way back"""
    Ea: MolarEnergy = 0.0
    """activation energy of the way back"""
    reference_temperature: Temperature = 1.0
    """temperature at which the factor of b is 1 in the rate constant of the way back"""
    orders: dict[str, Order] | None = Field(None, examples=[{"CH4": 1}])
    """orders of the way back, by gas and site; left out: the coefficients of what it consumes"""
    coverage: Coverages | None = None
    """how the rate constant of the way back depends on coverages, by site"""


Reverse = Annotated[ReverseTable, a_table('{ A = "1e13 1/s", Ea = "80 kJ/mol" }')]


class EquilibriumTable(MechanismTable):
    """`[reaction.KEY.equilibrium_constant]`: K of a reaction that goes both ways, whence its rate back."""

    A: EquilibriumConstant | None = None
    """equilibrium constant before (T / reference_temperature)^b exp(-Ea / R T): concentrations in mol/m^3, coverages as shares"""
    b: Number = 0.0
    """exponent of the temperature in the equilibrium constant"""
    Ea: MolarEnergy = 0.0
    """energy in the equilibrium constant: the heat of the reaction, below 0 where it sets heat free"""
    reference_temperature: Temperature = 1.0
    """temperature at which the factor of b is 1 in the equilibrium constant"""


def as_equilibrium_table(value: Any) -> Any:
    """A constant alone as the table that holds it."""
    return {"A": value} if isinstance(value, (str, int, float)) and not isinstance(value, bool) else value


class _ConstantOrTable:
    """Reads `equilibrium_constant`, one constant or a table, and says so in the schema."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"anyOf": [_CONSTANT, handler(schema)]}


Equilibrium = Annotated[EquilibriumTable, BeforeValidator(as_equilibrium_table), _ConstantOrTable()]
