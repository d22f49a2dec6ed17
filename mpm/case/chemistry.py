"""Reaction mechanisms are data: read from a file or a case, checked, and turned into `mpm.physics.mechanism` values.

A mechanism file (TOML; `mechanisms/alumina.toml` is the built-in one) lists species and sites with their molar mass,
and reactions as equations `A + 2 B -> C`. Any table of it can be overridden by key in `[chemistry]` of a case,
for instance `chemistry.reaction.tma.sticking = 0.1`; `mechanism = "inline"` starts from nothing.

`mpm.case.reactions` makes a mechanism of it.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema

from mpm.case.model import Frozen, nothing_required
from mpm.case.schema import DRAFT, finished
from mpm.units import (
    Atoms,
    Density,
    Dimension,
    MolarEnergy,
    MolarEnthalpy,
    MolarHeatCapacity,
    MolarMass,
    Number,
    Sticking,
    Temperature,
    Viscosity,
    is_counted,
    reject,
    worked_out,
)

HEATS = ("enthalpy", "heat_capacity", "heat_of_reaction")
"""Keys of a mechanism that say how much heat reactions set free."""
SURFACE_RATE = Dimension("m/s", "a surface rate constant", "0.9 m/s", at_least=0.0)
GAS_RATE = Dimension("m^3/mol/s", "a second-order rate constant", "1.0 m^3/kmol/s", at_least=0.0)


def _rate_constant(value: Any) -> str:
    """Normalise a rate constant to SI but keep its unit: which of the two is right depends on the reaction."""
    for dimension in (SURFACE_RATE, GAS_RATE):
        if isinstance(value, str) and is_counted(value, dimension.unit):
            return str(dimension.write(dimension.read(value)))
    raise reject(repr(value), f"{SURFACE_RATE.accepted}, or {GAS_RATE.accepted}")


_RateConstant = Annotated[
    str,
    BeforeValidator(_rate_constant),
    WithJsonSchema(
        {
            "type": "string",
            "accepted": f"{SURFACE_RATE.accepted}, or {GAS_RATE.accepted}",
            "examples": [SURFACE_RATE.example, GAS_RATE.example],
        }
    ),
]


class _Table(Frozen):
    model_config = ConfigDict(json_schema_extra=nothing_required)


class SpeciesTable(_Table):
    """`[species.NAME]`: a gas species; elements from `formula` (default: the name) or counted by hand."""

    molar_mass: MolarMass
    """molar mass of the species"""
    formula: str | None = worked_out("the name itself", None, example="Al(CH3)3")
    """chemical formula, whose elements the reactions must balance"""
    elements: dict[str, Atoms] | None = worked_out(
        "counted in the formula", None, example={"Al": 1, "C": 3, "H": 9}
    )
    """atoms of each element, in place of a formula"""
    enthalpy: MolarEnthalpy | None = None
    """enthalpy of formation at 298.15 K, for the heat of reactions; of sites only differences count, from any zero"""
    heat_capacity: MolarHeatCapacity | None = None
    """molar heat capacity: a reaction with those of all its parts has a heat that follows temperature"""
    viscosity: Viscosity | None = None
    """viscosity of the species alone at gas.temperature, for the gas as a mixture (gas.mixture)"""


class SiteTable(_Table):
    """`[site.NAME]` (a state of the surface sites)."""

    molar_mass: MolarMass | None = None
    """molar mass of the group, for the check of the formula (site) and for the film's thickness (film)"""
    formula: str | None = worked_out("the name itself", None, example="OAl(CH3)2")
    """chemical formula, whose elements the reactions must balance"""
    elements: dict[str, Atoms] | None = worked_out(
        "counted in the formula", None, example={"Al": 1, "C": 3, "H": 9}
    )
    """atoms of each element, in place of a formula"""
    enthalpy: MolarEnthalpy | None = None
    """enthalpy of formation at 298.15 K, for the heat of reactions; of sites only differences count, from any zero"""
    heat_capacity: MolarHeatCapacity | None = None
    """molar heat capacity: a reaction with those of all its parts has a heat that follows temperature"""


class FilmTable(SiteTable):
    """`[film.NAME]` (a solid product); with `density` and `molar_mass` its thickness is reported."""

    density: Density | None = None
    """density of the film: with molar_mass, its thickness is reported"""


class ReactionTable(_Table):
    """`[reaction.KEY]`: an equation with `sticking` or `A`, either times (T/reference_temperature)^b exp(-Ea/RT)."""

    equation: Annotated[str, Field(examples=["OH + TMA -> CH4 + OAl(CH3)2"])]
    """what reacts to what; elements and sites must balance. With a site on the left it is a surface reaction, else one in the gas"""
    sticking: Sticking | None = None
    """share of the collisions with a reactive site that react (surface reactions, in place of A)"""
    A: _RateConstant | None = None
    """rate constant before (T / reference_temperature)^b exp(-Ea / R T): a speed for a surface reaction, m^3/mol/s in the gas"""
    b: Number = 0.0
    """exponent of the temperature in the rate constant"""
    Ea: MolarEnergy = 0.0
    """activation energy"""
    reference_temperature: Temperature = 1.0
    """temperature at which the factor of b is 1"""
    heat_of_reaction: MolarEnthalpy | None = None
    """heat per mol of events as the equation is written, below 0 where it is set free; in place of what enthalpies give"""


class Chemistry(_Table):
    """The `[chemistry]` table, with the mechanism's own tables merged in: complete in itself."""

    mechanism: str = "alumina"
    """the reactions: the name of a built-in mechanism, the path of a mechanism file, or inline (all of it in this table)"""
    name: str = worked_out("the mechanism's file name", "", example="alumina")
    """what the mechanism is called in results"""
    species: dict[str, SpeciesTable] = Field({})
    """gas species, by name; keys given here lie over the mechanism's"""
    site: dict[str, SiteTable] = Field({})
    """states of the surface sites, by name; the first is the fresh surface"""
    film: dict[str, FilmTable] = Field({})
    """solid products, by name"""
    reaction: dict[str, ReactionTable] = Field({})
    """reactions, by name; keys given here lie over the mechanism's, e.g. chemistry.reaction.tma.sticking = 0.1"""


def drop_heats(tables: dict[str, Any]) -> None:
    """Take enthalpies and the like out of the tables of `[chemistry]`: what a case without [energy] does not read and has not typed."""
    for kind in ("species", "site", "film", "reaction"):
        for entry in tables.get(kind, {}).values():
            for key in HEATS:
                entry.pop(key, None)


def mechanism_schema() -> dict[str, Any]:
    """JSON Schema of a mechanism file, for editors: the tables of `[chemistry]`, each entry complete."""
    schema = finished(Chemistry.model_json_schema())
    del schema["properties"]["mechanism"]
    for table, keys in (("SpeciesTable", ["molar_mass"]), ("ReactionTable", ["equation"])):
        schema["$defs"][table]["required"] = keys
    return {"$schema": DRAFT, **schema, "title": "Mechanism", "description": "A mechanism file of mpm."}
