"""What reacts: gas species, states of the surface sites, solid films."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mpm.physics.thermochemistry import Nasa, Thermochemistry


@dataclass(frozen=True)
class Species:
    """A gas species: molar mass [kg/mol], atoms per molecule; if known, enthalpy of formation [J/mol] and entropy [J/mol/K] at 298.15 K,
    heat capacity [J/mol/K] or a polynomial of all three, and viscosity at the temperature of `[gas]` [Pa s]."""

    name: str
    molar_mass: float
    elements: Mapping[str, float]
    enthalpy: float | None = None
    heat_capacity: float | None = None
    viscosity: float | None = None
    entropy: float | None = None
    nasa: Nasa | None = None

    @property
    def thermochemistry(self) -> Thermochemistry:
        """What is known of its enthalpy and entropy."""
        return Thermochemistry(self.enthalpy, self.entropy, self.heat_capacity, self.nasa)


@dataclass(frozen=True)
class Site:
    """A state of the surface sites, or a solid film: atoms per site (or formula unit), places on the surface that one of it holds; if
    known, molar mass [kg/mol], density [kg/m3], enthalpy of formation [J/mol] and entropy [J/mol/K] at 298.15 K, heat capacity [J/mol/K]
    or a polynomial of all three."""

    name: str
    elements: Mapping[str, float]
    molar_mass: float | None = None
    density: float | None = None
    enthalpy: float | None = None
    heat_capacity: float | None = None
    entropy: float | None = None
    nasa: Nasa | None = None
    places: float = 1.0

    @property
    def thermochemistry(self) -> Thermochemistry:
        """What is known of its enthalpy and entropy."""
        return Thermochemistry(self.enthalpy, self.entropy, self.heat_capacity, self.nasa)
