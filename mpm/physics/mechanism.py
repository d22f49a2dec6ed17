"""What a reaction mechanism is made of: gas species, surface sites, solid films, reactions and their rates.

Rates are *rates of progress* of the reaction as written (Fluent's convention, equations 5-17 to 5-19):

    surface   r = k(T) C_gas theta_site   [mol/m2/s]   first order in the one gas and the one site it consumes
    gas       r = k(T) C_1 C_2            [mol/m3/s]   second order, whatever the stoichiometry

    k(T) = A (T/T_ref)^b exp(-Ea/(R T)),    or  lambda sqrt(R T / (2 pi M))  with a sticking coefficient
    lambda(T) = sticking (T/T_ref)^b exp(-Ea/(R T)), the form a T^b exp(-Ea/(R T)) of Chemkin and Cantera with T_ref = 1 K

Heat of a reaction: from enthalpies of formation of all that it changes, or given.

Mechanisms are read from files and from the case by `mpm.case.chemistry`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mpm.arrays import Floats
from mpm.constants import GAS_CONSTANT

STANDARD_TEMPERATURE = 298.15
"""[K], of enthalpies of formation."""


@dataclass(frozen=True)
class Species:
    """A gas species: molar mass [kg/mol], atoms per molecule; if known, enthalpy of formation at 298.15 K [J/mol], heat capacity
    [J/mol/K] and viscosity at the temperature of `[gas]` [Pa s]."""

    name: str
    molar_mass: float
    elements: Mapping[str, float]
    enthalpy: float | None = None
    heat_capacity: float | None = None
    viscosity: float | None = None


@dataclass(frozen=True)
class Site:
    """A state of the surface sites, or a solid film: atoms per site (or formula unit); if known, molar mass [kg/mol], density [kg/m3],
    enthalpy of formation at 298.15 K [J/mol] and heat capacity [J/mol/K]."""

    name: str
    elements: Mapping[str, float]
    molar_mass: float | None = None
    density: float | None = None
    enthalpy: float | None = None
    heat_capacity: float | None = None


@dataclass(frozen=True, kw_only=True)
class _Reaction:
    """What both kinds have: the key in the file, the equation, and k(T) = A (T/T_ref)^b exp(-Ea/(R T)).

    nu_gas: signed molecules of each gas species per event, products positive. given_heat: J/mol of events, in place of enthalpies.
    """

    key: str
    equation: str
    A: float
    b: float
    Ea: float
    reference_temperature: float
    nu_gas: Mapping[str, float]
    given_heat: float | None = None

    @property
    def changes(self) -> Mapping[str, float]:
        """Signed amounts of all that an event changes: gas, sites and films."""
        return self.nu_gas

    def __str__(self) -> str:
        return self.equation

    def _arrhenius(self, temperature: ArrayLike) -> Floats:
        return self.A * self._activation(temperature)

    def _activation(self, temperature: ArrayLike) -> Floats:
        """(T/T_ref)^b exp(-Ea/(R T)), infinite where it is beyond floats."""
        T = np.asarray(temperature, dtype=float)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            return np.asarray(
                (T / self.reference_temperature) ** self.b * np.exp(-self.Ea / (GAS_CONSTANT * T))
            )


@dataclass(frozen=True, kw_only=True)
class SurfaceReaction(_Reaction):
    """A gas meets a site: r = k C_gas theta_site [mol of events/m2/s].

    nu_site, film: signed sites and formula units of solid products per event, so (5-18) has nu_gas = {H2O: -3, CH4: 4},
    nu_site = {OAl(CH3)2: -2, OH: 2}, film = {Al2O3: 1}.
    """

    gas: str
    site: str
    nu_site: Mapping[str, float]
    film: Mapping[str, float] = field(default_factory=dict)
    sticking: float | None = None

    def rate_constant(self, temperature: ArrayLike, molar_mass: float) -> Floats:
        """k [m/s] at `temperature` [K], in its shape; `molar_mass` [kg/mol] of the gas matters with sticking only.

        Kinetic theory: the flux onto a wall is C sqrt(R T/(2 pi M)), of which the share `sticking_coefficient` reacts.
        """
        T = np.asarray(temperature, dtype=float)
        share = self.sticking_coefficient(T)
        if share is None:
            return self._arrhenius(T)
        return np.asarray(share * np.sqrt(GAS_CONSTANT * T / (2.0 * np.pi * molar_mass)))

    def sticking_coefficient(self, temperature: ArrayLike) -> Floats | None:
        """Share of the collisions with the one site it consumes that react at `temperature` [K]: sticking (T/T_ref)^b exp(-Ea/(R T)).

        None for a reaction whose rate constant is given by A.

        Chemkin and Cantera write the same as a T^b exp(-Ea/(R T)), that is with T_ref = 1 K (Cantera, "Sticking reactions"; Kee, Coltrin,
        Glarborg, Chemically Reacting Flow, 2003, section 11.5).
        """
        return None if self.sticking is None else np.asarray(self.sticking * self._activation(temperature))

    @property
    def changes(self) -> Mapping[str, float]:
        """Signed amounts of all that an event changes: gas, sites and films."""
        return {**self.nu_gas, **self.nu_site, **self.film}

    @property
    def reactants(self) -> tuple[str]:
        """The gas species whose concentration sets the rate."""
        return (self.gas,)

    @property
    def product_sites(self) -> tuple[str, ...]:
        """The states that the sites change to."""
        return tuple(name for name, nu in self.nu_site.items() if nu > 0.0)

    @property
    def molecules_per_site(self) -> float:
        """Molecules of the gas that turn over one site: 1 in (5-17), 1.5 in (5-18)."""
        return self.nu_gas.get(self.gas, 0.0) / self.nu_site[self.site]


@dataclass(frozen=True, kw_only=True)
class GasReaction(_Reaction):
    """Two species meet in the gas: r = k C_1 C_2 [mol of events/m3 of gas/s]."""

    reactants: tuple[str, str]

    def rate_constant(self, temperature: ArrayLike) -> Floats:
        """k [m3/mol/s], of the shape of `temperature` [K]."""
        return self._arrhenius(temperature)


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """Species, sites and reactions, checked for balance. The carrier gas is not one of the species."""

    name: str
    species: tuple[Species, ...]
    sites: tuple[Site, ...]
    films: tuple[Site, ...]
    surface_reactions: tuple[SurfaceReaction, ...]
    gas_reactions: tuple[GasReaction, ...]

    @property
    def species_names(self) -> tuple[str, ...]:
        return tuple(species.name for species in self.species)

    @property
    def site_names(self) -> tuple[str, ...]:
        return tuple(site.name for site in self.sites)

    def running_surface(self, present: Collection[str]) -> list[SurfaceReaction]:
        """Surface reactions whose gas is among the species that are present."""
        return [reaction for reaction in self.surface_reactions if reaction.gas in present]

    def running_gas(self, present: Collection[str]) -> list[GasReaction]:
        """Gas reactions both of whose reactants are."""
        return [reaction for reaction in self.gas_reactions if set(reaction.reactants) <= set(present)]

    def half_reactions(self, species: str) -> tuple[SurfaceReaction, ...]:
        """The surface reactions that consume `species`: together they are what an ALD half-cycle does."""
        return tuple(reaction for reaction in self.surface_reactions if reaction.gas == species)

    def titrated_sites(self, species: str) -> tuple[str, ...]:
        """The site species that the half-reactions of `species` make and do not consume: all of its making on a saturated surface.

        Where they consume every one (OH -> X -> OH) all that they make.
        """
        reactions = self.half_reactions(species)
        made = dict.fromkeys(name for reaction in reactions for name in reaction.product_sites)
        used = {reaction.site for reaction in reactions}
        return tuple(name for name in made if name not in used) or tuple(made)

    @property
    def reactions(self) -> tuple[SurfaceReaction | GasReaction, ...]:
        """All reactions, those on the surface first."""
        return (*self.surface_reactions, *self.gas_reactions)

    def heat_of_reaction[Value: (float, Floats)](
        self, reaction: SurfaceReaction | GasReaction, temperature: Value
    ) -> Value:
        """dH [J/mol of events as written] at `temperature` [K], negative where heat is set free.

        What the reaction gives itself; else sum_i nu_i (h_i + c_i (T - 298.15 K)) over gas, sites and films (Hess, Kirchhoff). The heat
        capacities c_i count where all of them are known: some of them alone would be an error of the size of those left out. 0 where no
        enthalpy is known (`mpm check` says so); the case refuses some without the others.
        """
        constant, slope = self._heat(reaction)
        return constant + slope * (temperature - STANDARD_TEMPERATURE)

    def knows_heat(self, reaction: SurfaceReaction | GasReaction) -> bool:
        """Whether the heat of a reaction is given or follows from enthalpies."""
        return reaction.given_heat is not None or not self.without_enthalpy(reaction)

    def without_enthalpy(self, reaction: SurfaceReaction | GasReaction) -> tuple[str, ...]:
        """Names of what a reaction changes and of which no enthalpy is known."""
        return tuple(name for name in reaction.changes if self._parts[name].enthalpy is None)

    @cached_property
    def _parts(self) -> dict[str, Species | Site]:
        """Species, sites and films by name."""
        return {
            **{part.name: part for part in self.species},
            **{part.name: part for part in (*self.sites, *self.films)},
        }

    def _heat(self, reaction: SurfaceReaction | GasReaction) -> tuple[float, float]:
        """dH at 298.15 K [J/mol], and its slope [J/mol/K]."""
        if reaction.given_heat is not None:
            return reaction.given_heat, 0.0
        if not self.knows_heat(reaction):
            return 0.0, 0.0
        parts = [(nu, self._parts[name]) for name, nu in reaction.changes.items()]
        constant = sum(nu * part.enthalpy for nu, part in parts if part.enthalpy is not None)
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


def mole_fractions(
    mechanism: Mechanism, carrier_molar_mass: float, mass_fractions: Mapping[str, float]
) -> dict[str, float]:
    """Mole fractions of the named species in a mixture with the carrier, x_i = (Y_i/M_i) / sum_j (Y_j/M_j)."""
    amounts = {name: share / mechanism.get(name).molar_mass for name, share in mass_fractions.items()}
    total = sum(amounts.values()) + (1.0 - sum(mass_fractions.values())) / carrier_molar_mass
    return {name: amount / total for name, amount in amounts.items()}
