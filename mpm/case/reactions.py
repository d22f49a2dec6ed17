"""A mechanism of the tables of `[chemistry]`: equations read, elements and sites balanced, rates checked."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic_core import PydanticCustomError

from mpm.case.chemistry import Chemistry, ReactionTable
from mpm.case.laws import Sides, backward_law, forward_law
from mpm.case.substances import read_substances
from mpm.physics.equation import is_reversible, parse_equation, write_equation
from mpm.physics.mechanism import Mechanism
from mpm.physics.reaction import GasReaction, Reaction, SurfaceReaction
from mpm.physics.substances import Site, Species
from mpm.units import LARGEST, reject


def build_mechanism(chemistry: Chemistry) -> Mechanism:
    """Assemble and check the mechanism of a complete `[chemistry]` table.

    Raises validator errors (see `units.reject`) for unknown names, unbalanced elements or sites, and rate laws that
    do not fit the kind of reaction.
    """
    species, sites, films = read_substances(chemistry)
    surface: list[SurfaceReaction] = []
    gas: list[GasReaction] = []
    for key, table in chemistry.reaction.items():
        try:
            reaction = _reaction(key, table, species, sites, films)
        except PydanticCustomError as error:
            context = dict(error.context or {})
            raise reject(
                **{**context, "key": f"chemistry.reaction.{key}.{context.get('key', 'equation')}"}
            ) from None
        if isinstance(reaction, SurfaceReaction):
            surface.append(reaction)
        else:
            gas.append(reaction)
    mechanism = Mechanism(
        name=chemistry.name or chemistry.mechanism,
        species=tuple(species.values()),
        sites=tuple(sites.values()),
        films=tuple(films.values()),
        surface_reactions=tuple(surface),
        gas_reactions=tuple(gas),
        reference_pressure=chemistry.reference_pressure,
    )
    _check_equilibria(mechanism)
    return mechanism


def check_rates(mechanism: Mechanism, temperature: float) -> None:
    """Refuse a sticking coefficient above 1 and a rate constant beyond floats at `temperature` [K], on the way there and back."""
    for reaction in mechanism.reactions:
        key = f"chemistry.reaction.{reaction.key}"
        if isinstance(reaction, SurfaceReaction):
            share = reaction.sticking_coefficient(temperature)
            if share is not None and not float(share) <= 1.0:
                raise reject(
                    f"sticking, b and Ea that make a sticking coefficient of {float(share):.3g} at {temperature:g} K",
                    "one of at most 1: of the collisions no more than all can react",
                    key=f"{key}.sticking",
                )
        there, back = (float(value) for value in mechanism.rate_constants(reaction, temperature))
        if not there <= LARGEST:
            raise reject(
                f"A, b and Ea that make a rate constant of {there:.3g} at {temperature:g} K",
                f"one of at most {LARGEST:g}",
                key=f"{key}.A",
            )
        if not back <= LARGEST:
            raise reject(
                f"{_source_of_return(reaction)} a rate constant of {back:.3g} for the way back at {temperature:g} K",
                f"one of at most {LARGEST:g}",
                key=f"{key}.{_key_of_return(reaction)}",
            )


def _key_of_return(reaction: Reaction) -> str:
    if reaction.equilibrium is not None:
        return "equilibrium_constant"
    return "equation" if reaction.backward is None or reaction.backward.constant is None else "reverse.A"


def _source_of_return(reaction: Reaction) -> str:
    sources = {
        "equilibrium_constant": "A, b and Ea of an equilibrium that makes",
        "reverse.A": "A, b and Ea that make",
    }
    return sources.get(_key_of_return(reaction), "enthalpies and entropies that make")


def _check_equilibria(mechanism: Mechanism) -> None:
    """A reaction that goes both ways and says no constant of the way back needs enthalpy and entropy of all that it changes."""
    for reaction in mechanism.reactions:
        if reaction.backward is None or reaction.backward.constant or reaction.equilibrium:
            continue
        if missing := mechanism.without_gibbs(reaction):
            lacks = []
            for name in missing:
                known = mechanism.thermochemistry(name)
                keys = [
                    key
                    for key, has in (("enthalpy", known.knows_enthalpy), ("entropy", known.knows_entropy))
                    if not has
                ]
                lacks.append(f"{' and '.join(keys)} of {name}")
            raise reject(
                f"{reaction.equation!r}, and no {', '.join(lacks)}, whence the way back would follow",
                f"these (or nasa), or chemistry.reaction.{reaction.key}.reverse or .equilibrium_constant, or -> as the arrow",
                key=f"chemistry.reaction.{reaction.key}.equation",
            )


def _reaction(
    key: str,
    table: ReactionTable,
    species: Mapping[str, Species],
    sites: Mapping[str, Site],
    films: Mapping[str, Site],
) -> SurfaceReaction | GasReaction:
    """One reaction, checked; errors name its keys."""
    known: dict[str, Species | Site] = {**species, **sites, **films}
    left, right = parse_equation(table.equation, known)
    sides = Sides(
        left=left,
        right=right,
        reversible=is_reversible(table.equation),
        molar_mass={name: one.molar_mass for name, one in species.items()},
        sites=tuple(sites),
        films=tuple(films),
    )
    _check_balance(table.equation, sides, known, sites)
    equation = write_equation(left, right, sides.reversible)
    if not sides.on_surface and any(name in films for name in (*left, *right)):
        raise reject(
            repr(table.equation),
            "a reaction on the surface, with the same site on both sides where the film grows without end, "
            "or one in the gas of gases only",
        )
    if not sides.net:
        raise reject(repr(table.equation), "an equation of a reaction that changes something")
    forward = forward_law(table, sides)
    backward, equilibrium = backward_law(table, sides, forward)
    net = sides.net
    if not sides.on_surface:
        return GasReaction(
            key=key,
            equation=equation,
            forward=forward,
            backward=backward,
            equilibrium=equilibrium,
            nu_gas=net,
            given_heat=table.heat_of_reaction,
        )
    return SurfaceReaction(
        key=key,
        equation=equation,
        forward=forward,
        backward=backward,
        equilibrium=equilibrium,
        nu_gas=sides.of(net, species),
        nu_site=sides.of(net, sites),
        film=sides.of(net, films),
        given_heat=table.heat_of_reaction,
    )


def _check_balance(
    equation: str, sides: Sides, known: Mapping[str, Species | Site], sites: Mapping[str, Site]
) -> None:
    """Every element, and the number of places on the surface, must be the same on both sides."""
    change: dict[str, float] = {}
    for name, nu in sides.net.items():
        for element, atoms in known[name].elements.items():
            change[element] = change.get(element, 0.0) + nu * atoms
    wrong = {element: value for element, value in change.items() if abs(value) > 1e-9}
    if wrong:
        text = ", ".join(f"{value:+g} {element}" for element, value in wrong.items())
        raise reject(f"{equation!r}, which is off by {text}", "an equation that balances every element")
    gained = sum(nu * sites[name].places for name, nu in sides.of(sides.net, sites).items())
    if abs(gained) > 1e-9:
        several = [name for name in sides.of(sides.net, sites) if sites[name].places != 1.0]
        counted = "".join(f", {name} counted as {sites[name].places:g}" for name in several)
        raise reject(
            f"{equation!r}, which {'gains' if gained > 0 else 'loses'} {abs(gained):g} site{'' if abs(gained) == 1.0 else 's'}{counted}",
            "an equation that keeps the number of sites",
        )
