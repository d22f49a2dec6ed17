"""Reaction mechanisms are data: read from a file or a case, checked, and turned into `mpm.physics.mechanism` values.

A mechanism file (TOML; `mechanisms/alumina.toml` is the built-in one) lists species and sites with their molar mass,
and reactions as equations `A + 2 B -> C`. Any table of it can be overridden by key in `[chemistry]` of a case,
for instance `chemistry.reaction.tma.sticking = 0.1`; `mechanism = "inline"` starts from nothing.

Every reaction is checked for the balance of its elements and of its sites when it is read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from mpm.case.model import Frozen, nothing_required
from mpm.case.schema import DRAFT, finished
from mpm.physics.elements import parse_formula
from mpm.physics.equation import ARROW, parse_equation, write_equation
from mpm.physics.mechanism import GasReaction, Mechanism, Site, Species, SurfaceReaction
from mpm.units import (
    LARGEST,
    Atoms,
    Density,
    Dimension,
    MolarEnergy,
    MolarMass,
    Number,
    Sticking,
    Temperature,
    parse,
    reject,
    worked_out,
)

_SURFACE_RATE = Dimension("m/s", "a surface rate constant", "0.9 m/s", at_least=0.0)
_GAS_RATE = Dimension("m^3/mol/s", "a second-order rate constant", "1.0 m^3/kmol/s", at_least=0.0)


def _rate_constant(value: Any) -> str:
    """Normalise a rate constant to SI but keep its unit: which of the two is right depends on the reaction."""
    for dimension in (_SURFACE_RATE, _GAS_RATE):
        if isinstance(value, str):
            try:
                parse(value, dimension.unit)
            except ValueError:
                continue
            return str(dimension.write(dimension.read(value)))
    raise reject(repr(value), f"{_SURFACE_RATE.accepted}, or {_GAS_RATE.accepted}")


_RateConstant = Annotated[
    str,
    BeforeValidator(_rate_constant),
    WithJsonSchema(
        {
            "type": "string",
            "accepted": f"{_SURFACE_RATE.accepted}, or {_GAS_RATE.accepted}",
            "examples": [_SURFACE_RATE.example, _GAS_RATE.example],
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


def mechanism_schema() -> dict[str, Any]:
    """JSON Schema of a mechanism file, for editors: the tables of `[chemistry]`, each entry complete."""
    schema = finished(Chemistry.model_json_schema())
    del schema["properties"]["mechanism"]
    for table, keys in (("SpeciesTable", ["molar_mass"]), ("ReactionTable", ["equation"])):
        schema["$defs"][table]["required"] = keys
    return {"$schema": DRAFT, **schema, "title": "Mechanism", "description": "A mechanism file of mpm."}


_NAME = re.compile(r"[^\s.]+")


RESERVED_SPECIES = {
    "default": "gas.diffusivity",
    "sites": "balance.sites of history.csv",
    "cvd": "map_cvd.png",
}
"""Names that a species would share with another entry of the case or the results, and where."""


def build_mechanism(chemistry: Chemistry) -> Mechanism:
    """Assemble and check the mechanism of a complete `[chemistry]` table.

    Raises validator errors (see `units.reject`) for unknown names, unbalanced elements or sites, and rate laws that
    do not fit the kind of reaction.
    """
    species = {
        name: Species(name, table.molar_mass, _elements("species", name, table))
        for name, table in chemistry.species.items()
    }
    sites = {
        name: Site(name, _elements("site", name, table), table.molar_mass)
        for name, table in chemistry.site.items()
    }
    films = {
        name: Site(name, _elements("film", name, table), table.molar_mass, table.density)
        for name, table in chemistry.film.items()
    }
    seen: set[str] = set()
    for kind, names in (("species", species), ("site", sites), ("film", films)):
        for name in names:
            if kind == "species" and name in RESERVED_SPECIES:
                raise reject(
                    f"{name!r}, which means something else in {RESERVED_SPECIES[name]}",
                    "another name; formula = ... says what it is made of",
                    key=f"chemistry.species.{name}",
                )
            if name in seen or not _NAME.fullmatch(name) or not name.isprintable() or ARROW.search(name):
                raise reject(
                    f"{name!r}",
                    "a name without blanks, dots and arrows that no other species, site or film has",
                    key=f"chemistry.{kind}.{name}",
                )
            seen.add(name)
    known: dict[str, Species | Site] = {**species, **sites, **films}
    surface, gas = [], []
    for key, table in chemistry.reaction.items():
        try:
            left, right = parse_equation(table.equation, known)
            _check_balance(table.equation, left, right, known, sites)
            if any(name in sites for name in left):
                surface.append(_surface_reaction(key, table, left, right, species, sites, films))
            else:
                gas.append(_gas_reaction(key, table, left, right, species))
        except PydanticCustomError as error:
            context = dict(error.context or {})
            raise reject(
                **{**context, "key": f"chemistry.reaction.{key}.{context.get('key', 'equation')}"}
            ) from None
    return Mechanism(
        name=chemistry.name or chemistry.mechanism,
        species=tuple(species.values()),
        sites=tuple(sites.values()),
        films=tuple(films.values()),
        surface_reactions=tuple(surface),
        gas_reactions=tuple(gas),
    )


def check_rates(mechanism: Mechanism, temperature: float) -> None:
    """Refuse a sticking coefficient above 1 and a rate constant beyond floats at `temperature` [K]."""
    reactions: list[SurfaceReaction | GasReaction] = [*mechanism.surface_reactions, *mechanism.gas_reactions]
    for reaction in reactions:
        key = f"chemistry.reaction.{reaction.key}"
        if isinstance(reaction, SurfaceReaction):
            constant = reaction.rate_constant(temperature, mechanism.get(reaction.gas).molar_mass)
            share = reaction.sticking_coefficient(temperature)
            if share is not None and not float(share) <= 1.0:
                raise reject(
                    f"sticking, b and Ea that make a sticking coefficient of {float(share):.3g} at {temperature:g} K",
                    "one of at most 1: of the collisions no more than all can react",
                    key=f"{key}.sticking",
                )
        else:
            constant = reaction.rate_constant(temperature)
        if not float(constant) <= LARGEST:
            raise reject(
                f"A, b and Ea that make a rate constant of {float(constant):.3g} at {temperature:g} K",
                f"one of at most {LARGEST:g}",
                key=f"{key}.A",
            )


def _elements(kind: str, name: str, table: SpeciesTable | SiteTable) -> dict[str, float]:
    if table.elements is not None:
        for element in table.elements:
            if not element.isalnum():
                raise reject(
                    repr(element),
                    "symbols of elements, e.g. elements = { Al = 1, C = 3, H = 9 }",
                    key=f"chemistry.{kind}.{name}.elements",
                )
        return dict(table.elements)
    try:
        return parse_formula(table.formula or name)
    except ValueError as error:
        raise reject(
            str(error),
            'a formula, e.g. "Al(CH3)3", or elements = { Al = 1, C = 3, H = 9 }',
            key=f"chemistry.{kind}.{name}.formula",
        ) from None


def _check_balance(
    equation: str,
    left: Mapping[str, float],
    right: Mapping[str, float],
    known: Mapping[str, Species | Site],
    sites: Mapping[str, Site],
) -> None:
    """Every element, and the number of sites, must be the same on both sides."""
    change: dict[str, float] = {}
    for sign, side in ((-1.0, left), (1.0, right)):
        for name, count in side.items():
            for element, atoms in known[name].elements.items():
                change[element] = change.get(element, 0.0) + sign * count * atoms
    wrong = {element: value for element, value in change.items() if abs(value) > 1e-9}
    if wrong:
        text = ", ".join(f"{value:+g} {element}" for element, value in wrong.items())
        raise reject(f"{equation!r}, which is off by {text}", "an equation that balances every element")
    lost = sum(left.get(name, 0.0) - right.get(name, 0.0) for name in sites)
    if abs(lost) > 1e-9:
        raise reject(
            f"{equation!r}, which loses {lost:g} sites", "an equation that keeps the number of sites"
        )


def _surface_reaction(
    key: str,
    table: ReactionTable,
    left: Mapping[str, float],
    right: Mapping[str, float],
    species: Mapping[str, Species],
    sites: Mapping[str, Site],
    films: Mapping[str, Site],
) -> SurfaceReaction:
    gases = [name for name in left if name in species]
    states = [name for name in left if name in sites]
    if len(gases) != 1 or len(states) != 1 or len(left) != 2:
        raise reject(repr(table.equation), "a surface reaction that consumes one gas species and one site")
    net = {name: right.get(name, 0.0) - left.get(name, 0.0) for name in dict.fromkeys((*left, *right))}
    if not net[states[0]]:
        raise reject(repr(table.equation), "a surface reaction that changes the state of its site")
    if (table.sticking is None) == (table.A is None):
        raise reject(
            "both sticking and A" if table.A else "neither sticking nor A",
            "one of sticking and A",
            key="sticking",
        )
    A = 0.0
    if table.A is not None:
        try:
            A = parse(table.A, "m/s")
        except ValueError:
            raise reject(repr(table.A), _SURFACE_RATE.accepted, key="A") from None
    elif table.b and "reference_temperature" not in table.model_fields_set:
        raise reject(
            f"b = {table.b:g} beside sticking, and no reference_temperature",
            'reference_temperature, at which sticking holds, e.g. "473 K"; "1 K" for a T^b as in Chemkin and Cantera',
            key="b",
        )
    return SurfaceReaction(
        key=key,
        equation=write_equation(left, right),
        A=A,
        b=table.b,
        Ea=table.Ea,
        reference_temperature=table.reference_temperature,
        gas=gases[0],
        site=states[0],
        nu_gas={name: value for name, value in net.items() if name in species and value},
        nu_site={name: value for name, value in net.items() if name in sites and value},
        film={name: value for name, value in net.items() if name in films and value},
        sticking=table.sticking,
    )


def _gas_reaction(
    key: str,
    table: ReactionTable,
    left: Mapping[str, float],
    right: Mapping[str, float],
    species: Mapping[str, Species],
) -> GasReaction:
    if len(left) != 2 or any(name not in species for name in (*left, *right)):
        raise reject(repr(table.equation), "a gas reaction of two different species into gas species")
    if table.sticking is not None or table.A is None:
        raise reject("sticking" if table.sticking is not None else "no A", _GAS_RATE.accepted, key="A")
    try:
        A = parse(table.A, "m^3/mol/s")
    except ValueError:
        raise reject(repr(table.A), _GAS_RATE.accepted, key="A") from None
    net = {name: right.get(name, 0.0) - left.get(name, 0.0) for name in dict.fromkeys((*left, *right))}
    return GasReaction(
        key=key,
        equation=write_equation(left, right),
        A=A,
        b=table.b,
        Ea=table.Ea,
        reference_temperature=table.reference_temperature,
        reactants=dict.fromkeys(left, 1),
        nu={name: value for name, value in net.items() if value},
    )
