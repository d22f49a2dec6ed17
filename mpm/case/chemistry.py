"""Reaction mechanisms are data: read from a file or a case, checked, and turned into `mpm.physics.mechanism` values.

A mechanism file (TOML; `mechanisms/alumina.toml` is the built-in one) lists species and sites with their molar mass,
and reactions as equations `A + 2 B -> C`. Any table of it can be overridden by key in `[chemistry]` of a case,
for instance `chemistry.reaction.tma.sticking = 0.1`; `mechanism = "inline"` starts from nothing.

`mpm.case.reactions` makes a mechanism of it.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from mpm.case.model import Flag
from mpm.case.ratetables import Coverages, Equilibrium, MechanismTable, RateConstant, Reverse
from mpm.case.schema import DRAFT, finished
from mpm.physics.mechanism import REFERENCE_PRESSURE
from mpm.units import (
    Atoms,
    Density,
    MolarEnergy,
    MolarEnthalpy,
    MolarEntropy,
    MolarHeatCapacity,
    MolarMass,
    Number,
    Order,
    Places,
    Positive,
    Pressure,
    Sticking,
    Temperature,
    Viscosity,
    reject,
    worked_out,
)

HEATS = ("enthalpy", "heat_capacity", "entropy", "nasa", "heat_of_reaction")
"""Keys of a mechanism that say how much heat reactions set free, and where they come to rest."""
_WATER_LOW = [
    4.19864056,
    -2.0364341e-3,
    6.52040211e-6,
    -5.48797062e-9,
    1.77197817e-12,
    -3.02937267e4,
    -0.849032208,
]
_WATER_HIGH = [
    3.03399249,
    2.17691804e-3,
    -1.64072518e-7,
    -9.7041987e-11,
    1.68200992e-14,
    -3.00042971e4,
    4.9667701,
]
"""Water in GRI-Mech 3.0."""


def _of_length(count: int, what: str) -> AfterValidator:
    def check(values: tuple[float, ...]) -> tuple[float, ...]:
        if len(values) != count:
            raise reject(f"{len(values)} numbers", what)
        return values

    return AfterValidator(check)


_SEVEN = Annotated[
    tuple[Number, ...],
    _of_length(7, "seven numbers, a1 to a7"),
    Field(json_schema_extra={"minItems": 7, "maxItems": 7}),
]
_THREE = Annotated[
    tuple[Positive, ...],
    _of_length(3, "three temperatures in K, e.g. [200, 1000, 3500]"),
    Field(json_schema_extra={"minItems": 3, "maxItems": 3}),
]


class NasaTable(MechanismTable):
    """`[species.NAME.nasa]`: enthalpy, entropy and heat capacity as polynomials of temperature, seven numbers in each of two ranges."""

    temperatures: _THREE = Field(examples=[[200.0, 1000.0, 3500.0]])
    """the lowest temperature in K, the one between the two ranges, and the highest; beyond them the polynomials are continued"""
    low: _SEVEN = Field(examples=[_WATER_LOW])
    """the seven numbers of the range below the middle temperature, as NASA, Chemkin and Cantera order them"""
    high: _SEVEN = Field(examples=[_WATER_HIGH])
    """the seven numbers of the range above the middle temperature"""


class SpeciesTable(MechanismTable):
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
    entropy: MolarEntropy | None = None
    """entropy at 298.15 K, with enthalpy for equilibria: of a gas at chemistry.reference_pressure; of sites only differences count"""
    nasa: NasaTable | None = None
    """polynomials of temperature for enthalpy, entropy and heat capacity, in place of these three"""
    viscosity: Viscosity | None = None
    """viscosity of the species alone at gas.temperature, for the gas as a mixture (gas.mixture)"""


class SolidTable(MechanismTable):
    """What sites and films have in common."""

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
    entropy: MolarEntropy | None = None
    """entropy at 298.15 K, with enthalpy for equilibria: of a gas at chemistry.reference_pressure; of sites only differences count"""
    nasa: NasaTable | None = None
    """polynomials of temperature for enthalpy, entropy and heat capacity, in place of these three"""


class SiteTable(SolidTable):
    """`[site.NAME]` (a state of the surface sites)."""

    sites: Places = 1.0
    """places on the surface that one of it holds; coverages are shares of the places"""


class FilmTable(SolidTable):
    """`[film.NAME]` (a solid product); with `density` and `molar_mass` its thickness is reported."""

    density: Density | None = None
    """density of the film: with molar_mass, its thickness is reported"""


class ReactionTable(MechanismTable):
    """`[reaction.KEY]`: an equation with `sticking` or `A`, either times (T/reference_temperature)^b exp(-Ea/RT)."""

    equation: Annotated[str, Field(examples=["OH + TMA -> CH4 + OAl(CH3)2"])]
    """what reacts to what; elements and sites must balance. With a site in it it is a surface reaction, else one in the gas; <=> goes
    both ways"""
    sticking: Sticking | None = None
    """share of the collisions with a reactive site that react (surface reactions of one gas, in place of A)"""
    motz_wise: Flag = False
    """whether a large sticking is corrected for the gas it takes away from the wall: lambda / (1 - lambda / 2) (Motz and Wise, 1960)"""
    A: RateConstant | None = None
    """rate constant before (T / reference_temperature)^b exp(-Ea / R T): in the unit of its orders; on sites of coverages as
    shares (m/s for one gas), or per site (1/s for desorption), then times the material's site density per order in sites"""
    b: Number = 0.0
    """exponent of the temperature in the rate constant"""
    Ea: MolarEnergy = 0.0
    """activation energy"""
    reference_temperature: Temperature = 1.0
    """temperature at which the factor of b is 1"""
    orders: dict[str, Order] | None = Field(None, examples=[{"H2O": 0.5}])
    """orders in gases and sites, by name; left out: 1 in each reactant, and with <=> the coefficients, as an equilibrium asks for"""
    coverage: Coverages | None = None
    """how the rate constant depends on coverages, by site; where the way back follows from an equilibrium, its constant too"""
    reverse: Reverse | None = None
    """rate of the way back of a reaction with <=>; without it and equilibrium_constant it follows from enthalpies and entropies"""
    equilibrium_constant: Equilibrium | None = None
    """K of a reaction with <=>: products over reactants, concentrations in mol/m^3, coverages as shares; or a table of A, b and Ea"""
    heat_of_reaction: MolarEnthalpy | None = None
    """heat per mol of events as the equation is written, below 0 where it is set free; in place of what enthalpies give"""


class Chemistry(MechanismTable):
    """The `[chemistry]` table, with the mechanism's own tables merged in: complete in itself."""

    mechanism: str = "alumina"
    """the reactions: the name of a built-in mechanism, the path of a mechanism file, or inline (all of it in this table); also a file of
    Cantera (NAME.yaml: a path, or one that Cantera has)"""
    phase: str = Field("", examples=["Pt_surf"])
    """which phase of a file of Cantera holds the reactions; left out, the only surface in it"""
    gas_reactions: Flag = True
    """whether reactions of the gas beside the surface in a file of Cantera are taken over too"""
    reference_pressure: Pressure = REFERENCE_PRESSURE
    """pressure at which the entropies of gases are given"""
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

    @model_validator(mode="after")
    def _of_cantera(self) -> Self:
        """What only a file of Cantera reads is gone by now where there is one."""
        for key, given in (("phase", bool(self.phase)), ("gas_reactions", not self.gas_reactions)):
            if given:
                raise reject(
                    f"{key} beside a mechanism that is no file of Cantera",
                    f'no {key}, or a mechanism = "NAME.yaml"',
                    key=key,
                )
        return self


def drop_heats(tables: dict[str, Any], kept: Collection[str] = ()) -> None:
    """Take enthalpies and the like out of the tables of `[chemistry]`: what a case without [energy] does not read and has not typed.

    Of substances that are `kept` an equilibrium reads them.
    """
    for kind in ("species", "site", "film", "reaction"):
        for name, entry in tables.get(kind, {}).items():
            for key in () if kind != "reaction" and name in kept else HEATS:
                entry.pop(key, None)


def mechanism_schema() -> dict[str, Any]:
    """JSON Schema of a mechanism file, for editors: the tables of `[chemistry]`, each entry complete."""
    schema = finished(Chemistry.model_json_schema())
    for key in ("mechanism", "phase", "gas_reactions"):  # of a case
        del schema["properties"][key]
    for table, keys in (("SpeciesTable", ["molar_mass"]), ("ReactionTable", ["equation"])):
        schema["$defs"][table]["required"] = keys
    return {"$schema": DRAFT, **schema, "title": "Mechanism", "description": "A mechanism file of mpm."}
