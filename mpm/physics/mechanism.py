"""What a reaction mechanism is made of: gas species, surface sites, solid films, and the reactions between them.

Rate laws: `mpm.physics.rates`; reactions: `mpm.physics.reaction`. Here is what takes all of them together: equilibria and heats from the
substances' enthalpies and entropies, and which reactions a set of species brings about.

Mechanisms are read from files and from the case by `mpm.case.chemistry`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from mpm.arrays import Floats
from mpm.constants import GAS_CONSTANT
from mpm.physics.rates import Law
from mpm.physics.reaction import GasReaction, Reaction, SurfaceReaction
from mpm.physics.substances import Site, Species
from mpm.physics.thermochemistry import STANDARD_TEMPERATURE, Thermochemistry

REFERENCE_PRESSURE = 1e5
"""[Pa], at which entropies of gases are tabulated."""


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """Species, sites and reactions, checked for balance. The carrier gas is not one of the species.

    `reference_pressure` [Pa]: that of the gases' entropies.
    """

    name: str
    species: tuple[Species, ...]
    sites: tuple[Site, ...]
    films: tuple[Site, ...]
    surface_reactions: tuple[SurfaceReaction, ...]
    gas_reactions: tuple[GasReaction, ...]
    reference_pressure: float = REFERENCE_PRESSURE

    @property
    def species_names(self) -> tuple[str, ...]:
        return tuple(species.name for species in self.species)

    @property
    def site_names(self) -> tuple[str, ...]:
        return tuple(site.name for site in self.sites)

    @property
    def places(self) -> Floats:
        """Places on the surface that one of each site species holds, (sites,)."""
        return np.array([site.places for site in self.sites])

    def running_surface(self, present: Collection[str]) -> list[SurfaceReaction]:
        """Surface reactions that run with these species: one of their ways finds all its gases."""
        return [reaction for reaction in self.surface_reactions if reaction.runs(present)]

    def running_gas(self, present: Collection[str]) -> list[GasReaction]:
        """Gas reactions that do."""
        return [reaction for reaction in self.gas_reactions if reaction.runs(present)]

    def half_reactions(self, species: str) -> tuple[SurfaceReaction, ...]:
        """The surface reactions that consume `species`: together they are what an ALD half-cycle does."""
        return tuple(reaction for reaction in self.surface_reactions if reaction.consumes(species))

    def titrated_sites(self, species: str) -> tuple[str, ...]:
        """The site species that the half-reactions of `species` make and do not consume for good: all of its making on a saturated surface.

        Where they consume every one (OH -> X -> OH) all that they make. What they make may change further without a gas, as a molecule
        that sits down first and reacts afterwards does: then those made in the end, unless that only gives back the sites that there were.
        Empty where `species` leaves the sites as they are, as in growth that does not stop.
        """
        made: dict[str, None] = {}
        there, gone = set[str](), set[str]()
        for reaction in self.half_reactions(species):
            for sign, _ in reaction.ways:
                if sign * reaction.nu_gas.get(species, 0.0) < 0.0:
                    consumed, products = _sides(reaction, sign)
                    made |= products
                    there |= consumed.keys()
                    gone |= set() if reaction.backward else consumed.keys()
        first = tuple(name for name in made if name not in gone) or tuple(made)
        while True:
            later, past = self._changed_alone(species, made, there)
            if later.keys() <= made.keys() and past <= gone:
                return tuple(name for name in made if name not in gone) or first
            made, gone = made | later, gone | past

    def _changed_alone(
        self, species: str, made: Mapping[str, None], there: Collection[str]
    ) -> tuple[dict[str, None], set[str]]:
        """What becomes without a gas of sites that `made` has, beside those that were `there`, and which are gone for good by that.

        Nothing that gives `species` back: that is its desorption.
        """
        later: dict[str, None] = {}
        gone: set[str] = set()
        for reaction in self.surface_reactions:
            for sign, law in reaction.ways:
                consumed, products = _sides(reaction, sign)
                if law.gas_orders or sign * reaction.nu_gas.get(species, 0.0) > 0.0:
                    continue
                if consumed.keys() & made.keys() and consumed.keys() <= made.keys() | there:
                    new = {name: None for name in products if name not in there}
                    later |= new
                    gone |= consumed.keys() if new and reaction.backward is None else set()
        return later, gone

    @property
    def reactions(self) -> tuple[SurfaceReaction | GasReaction, ...]:
        """All reactions, those on the surface first."""
        return (*self.surface_reactions, *self.gas_reactions)

    @property
    def parasitic_reactions(self) -> tuple[GasReaction, ...]:
        """Gas reactions that do not go back: what they make grows where nobody wants it (CVD). An equilibrium in the gas is none."""
        return tuple(reaction for reaction in self.gas_reactions if reaction.backward is None)

    @property
    def is_first_order(self) -> bool:
        """Whether every surface reaction is one gas that meets one site, first order in both, with no way back."""
        return all(reaction.is_first_order for reaction in self.surface_reactions) and bool(
            (self.places == 1.0).all()
        )

    # --- rate constants ---

    def rate_constants(
        self, reaction: Reaction, temperature: ArrayLike, site_density: ArrayLike = 1.0
    ) -> tuple[Floats, Floats]:
        """k_f n_s^p and k_b n_s^p of a reaction at `temperature` [K] on surfaces with `site_density` n_s [mol/m2], before coverages have
        their say; k_b is 0 without a way back.

        In mol of events/m2/s (surface) or mol/m3/s (gas) where all concentrations are 1 mol/m3 and all coverages 1.
        """
        T = np.asarray(temperature, dtype=float)
        there = self._constant(reaction.forward, T, site_density)
        if reaction.backward is None:
            return there, np.zeros_like(there)
        if reaction.backward.constant is not None:
            return there, self._constant(reaction.backward, T, site_density)
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            return there, np.asarray(there / self.equilibrium_constant(reaction, T))

    def _constant(self, law: Law, temperature: Floats, site_density: ArrayLike) -> Floats:
        if law.constant is None:
            raise ValueError("a rate law without a constant")
        value = law.constant.at(temperature)
        if law.per_site:
            places = {site.name: site.places for site in self.sites}
            held = np.prod([places[name] ** -order for name, order in law.site_orders.items()])
            value = value * held * np.asarray(site_density, dtype=float) ** law.per_site
        return np.asarray(value)

    def equilibrium_constant(self, reaction: Reaction, temperature: ArrayLike) -> Floats:
        """K of concentrations [mol/m3] and coverages: prod C^nu prod theta^nu where a reversible reaction rests.

        As given, or exp(-dG/(R T)) (p0/(R T))^(sum of nu of gases): gases are ideal, site species and films ideal at the activity of their
        coverage and 1 (Cantera, "Ideal surface").
        """
        T = np.asarray(temperature, dtype=float)
        if reaction.equilibrium is not None:
            return reaction.equilibrium.at(T)
        change = sum(nu * self._parts[name].thermochemistry.gibbs(T) for name, nu in reaction.changes.items())
        gases = sum(reaction.nu_gas.values())
        with np.errstate(over="ignore", under="ignore"):
            return np.asarray(
                np.exp(-change / (GAS_CONSTANT * T)) * (self.reference_pressure / (GAS_CONSTANT * T)) ** gases
            )

    def thermochemistry(self, name: str) -> Thermochemistry:
        """What is known of the enthalpy and entropy of a species, site or film."""
        return self._parts[name].thermochemistry

    @property
    def equilibrated(self) -> frozenset[str]:
        """Names of all whose enthalpy and entropy set the rate of some way back."""
        return frozenset(
            name
            for reaction in self.reactions
            if reaction.backward is not None
            and reaction.backward.constant is None
            and reaction.equilibrium is None
            for name in reaction.changes
        )

    def without_gibbs(self, reaction: Reaction) -> tuple[str, ...]:
        """Names of what a reaction changes and of which enthalpy or entropy is not known."""
        parts = {name: self._parts[name].thermochemistry for name in reaction.changes}
        return tuple(name for name, t in parts.items() if not (t.knows_enthalpy and t.knows_entropy))

    # --- heat ---

    def heat_of_reaction[Value: (float, Floats)](self, reaction: Reaction, temperature: Value) -> Value:
        """dH [J/mol of events as written] at `temperature` [K], negative where heat is set free.

        What the reaction gives itself; else sum_i nu_i (h_i + c_i (T - 298.15 K)) over gas, sites and films (Hess, Kirchhoff), or
        sum_i nu_i h_i(T) where all have polynomials. The heat capacities c_i count where all of them are known: some of them alone would be
        an error of the size of those left out. 0 where no enthalpy is known (`mpm check` says so); the case refuses some without the
        others.
        """
        polynomials = [(nu, self._parts[name].nasa) for name, nu in reaction.changes.items()]
        if reaction.given_heat is None and all(one is not None for _, one in polynomials):
            heat = sum(nu * one.enthalpy(temperature) for nu, one in polynomials if one is not None)
            return cast("Value", heat)
        constant, slope = self._heat(reaction)
        return constant + slope * (temperature - STANDARD_TEMPERATURE)

    def knows_heat(self, reaction: Reaction) -> bool:
        """Whether the heat of a reaction is given or follows from enthalpies."""
        return reaction.given_heat is not None or not self.without_enthalpy(reaction)

    def without_enthalpy(self, reaction: Reaction) -> tuple[str, ...]:
        """Names of what a reaction changes and of which no enthalpy is known."""
        return tuple(
            name for name in reaction.changes if not self._parts[name].thermochemistry.knows_enthalpy
        )

    @cached_property
    def _parts(self) -> dict[str, Species | Site]:
        """Species, sites and films by name."""
        return {
            **{part.name: part for part in self.species},
            **{part.name: part for part in (*self.sites, *self.films)},
        }

    def _heat(self, reaction: Reaction) -> tuple[float, float]:
        """dH at 298.15 K [J/mol], and its slope [J/mol/K]."""
        if reaction.given_heat is not None:
            return reaction.given_heat, 0.0
        if not self.knows_heat(reaction):
            return 0.0, 0.0
        parts = [(nu, self._parts[name]) for name, nu in reaction.changes.items()]
        constant = sum(nu * part.thermochemistry.standard_enthalpy for nu, part in parts)
        slopes = [nu * part.heat_capacity for nu, part in parts if part.heat_capacity is not None]
        return constant, sum(slopes) if len(slopes) == len(parts) else 0.0

    def get(self, name: str) -> Species:
        """The species called `name` (KeyError otherwise)."""
        for species in self.species:
            if species.name == name:
                return species
        raise KeyError(name)

    def __str__(self) -> str:
        return "\n".join(str(reaction) for reaction in (*self.surface_reactions, *self.gas_reactions))


def _sides(reaction: SurfaceReaction, sign: float) -> tuple[dict[str, None], dict[str, None]]:
    """The sites that one way of a reaction consumes and those that it makes; `sign` as in `Reaction.ways`."""
    changes = {name: sign * nu for name, nu in reaction.nu_site.items()}
    consumed = dict.fromkeys(name for name, nu in changes.items() if nu < 0.0)
    return consumed, dict.fromkeys(name for name, nu in changes.items() if nu > 0.0)


def mole_fractions(
    mechanism: Mechanism, carrier_molar_mass: float, mass_fractions: Mapping[str, float]
) -> dict[str, float]:
    """Mole fractions of the named species in a mixture with the carrier, x_i = (Y_i/M_i) / sum_j (Y_j/M_j)."""
    amounts = {name: share / mechanism.get(name).molar_mass for name, share in mass_fractions.items()}
    total = sum(amounts.values()) + (1.0 - sum(mass_fractions.values())) / carrier_molar_mass
    return {name: amount / total for name, amount in amounts.items()}
