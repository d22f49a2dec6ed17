"""A mechanism of the tables of `[chemistry]`: formulas and equations read, elements and sites balanced, rates checked."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from pydantic_core import PydanticCustomError

from mpm.case.chemistry import (
    GAS_RATE,
    SURFACE_RATE,
    Chemistry,
    FilmTable,
    ReactionTable,
    SiteTable,
    SpeciesTable,
)
from mpm.physics.elements import parse_formula
from mpm.physics.equation import ARROW, parse_equation, write_equation
from mpm.physics.mechanism import Mechanism
from mpm.physics.rates import Arrhenius, Law, Sticking
from mpm.physics.reaction import GasReaction, SurfaceReaction
from mpm.physics.substances import Site, Species
from mpm.units import LARGEST, Dimension, parse, reject

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
        name: Species(
            name,
            table.molar_mass,
            _elements("species", name, table),
            table.enthalpy,
            table.heat_capacity,
            table.viscosity,
        )
        for name, table in chemistry.species.items()
    }
    sites = {
        name: _site(name, _elements("site", name, table), table) for name, table in chemistry.site.items()
    }
    films = {
        name: _site(name, _elements("film", name, table), table) for name, table in chemistry.film.items()
    }
    _check_names({"species": species, "site": sites, "film": films})
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


def _site(name: str, elements: dict[str, float], table: SiteTable) -> Site:
    """A site, or a film, which may have a density."""
    return Site(
        name,
        elements,
        table.molar_mass,
        table.density if isinstance(table, FilmTable) else None,
        table.enthalpy,
        table.heat_capacity,
    )


def _check_names(tables: Mapping[str, Iterable[str]]) -> None:
    """Names are one word, and of one thing only."""
    seen: set[str] = set()
    for kind, names in tables.items():
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


def check_rates(mechanism: Mechanism, temperature: float) -> None:
    """Refuse a sticking coefficient above 1 and a rate constant beyond floats at `temperature` [K]."""
    for reaction in mechanism.reactions:
        key = f"chemistry.reaction.{reaction.key}"
        if isinstance(reaction, SurfaceReaction):
            constant = reaction.rate_constant(temperature)
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


def _net(left: Mapping[str, float], right: Mapping[str, float]) -> dict[str, float]:
    """Signed stoichiometry of an equation's two sides, products positive, without what it gives back."""
    net = {name: right.get(name, 0.0) - left.get(name, 0.0) for name in dict.fromkeys((*left, *right))}
    return {name: nu for name, nu in net.items() if nu}


def _rate_constant(text: str, dimension: Dimension) -> float:
    """The factor A in SI units; the other kind of reaction has other ones."""
    try:
        return parse(text, dimension.unit)
    except ValueError:
        raise reject(repr(text), dimension.accepted, key="A") from None


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
    net = _net(left, right)
    if states[0] not in net:
        raise reject(repr(table.equation), "a surface reaction that changes the state of its site")
    if (table.sticking is None) == (table.A is None):
        raise reject(
            "both sticking and A" if table.A else "neither sticking nor A",
            "one of sticking and A",
            key="sticking",
        )
    if table.sticking is not None and table.b and "reference_temperature" not in table.model_fields_set:
        raise reject(
            f"b = {table.b:g} beside sticking, and no reference_temperature",
            'reference_temperature, at which sticking holds, e.g. "473 K"; "1 K" for a T^b as in Chemkin and Cantera',
            key="b",
        )
    return SurfaceReaction(
        key=key,
        equation=write_equation(left, right),
        forward=Law(
            constant=_surface_constant(table, species[gases[0]].molar_mass),
            gas_orders={gases[0]: 1.0},
            site_orders={states[0]: 1.0},
        ),
        nu_gas={name: nu for name, nu in net.items() if name in species},
        nu_site={name: nu for name, nu in net.items() if name in sites},
        film={name: nu for name, nu in net.items() if name in films},
        given_heat=table.heat_of_reaction,
    )


def _surface_constant(table: ReactionTable, molar_mass: float) -> Arrhenius | Sticking:
    """From A, or from a sticking coefficient of a gas of `molar_mass` [kg/mol]."""
    if table.sticking is not None:
        share = Arrhenius(table.sticking, table.b, table.Ea, table.reference_temperature)
        return Sticking(share=share, molar_mass=molar_mass)
    A = _rate_constant(table.A or "", SURFACE_RATE)
    return Arrhenius(A, table.b, table.Ea, table.reference_temperature)


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
        raise reject("sticking" if table.sticking is not None else "no A", GAS_RATE.accepted, key="A")
    A = _rate_constant(table.A, GAS_RATE)
    return GasReaction(
        key=key,
        equation=write_equation(left, right),
        forward=Law(
            constant=Arrhenius(A, table.b, table.Ea, table.reference_temperature),
            gas_orders=dict.fromkeys(left, 1.0),
        ),
        nu_gas=_net(left, right),
        given_heat=table.heat_of_reaction,
    )
