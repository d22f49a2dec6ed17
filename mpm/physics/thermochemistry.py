"""Enthalpy and entropy of a substance at any temperature, from what is known of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mpm.arrays import Floats
from mpm.constants import GAS_CONSTANT

STANDARD_TEMPERATURE = 298.15
"""[K], of enthalpies of formation and of entropies."""


@dataclass(frozen=True)
class Nasa:
    """The polynomial of seven coefficients per range of temperature (Gordon and McBride, NASA SP-273, 1971).

    h/(R T) = a1 + a2 T/2 + a3 T^2/3 + a4 T^3/4 + a5 T^4/5 + a6/T,    s/R = a1 ln T + a2 T + a3 T^2/2 + a4 T^3/3 + a5 T^4/4 + a7

    `low` holds up to `middle` [K], `high` from there on; beyond the range in which they were fitted they are continued.
    """

    middle: float
    low: tuple[float, ...]
    high: tuple[float, ...]

    def enthalpy(self, temperature: ArrayLike) -> Floats:
        """h [J/mol], of the shape of `temperature` [K]."""
        T = np.asarray(temperature, dtype=float)
        a = self._coefficients(T)
        over = a[0] + T * (a[1] / 2 + T * (a[2] / 3 + T * (a[3] / 4 + T * a[4] / 5))) + a[5] / T
        return np.asarray(GAS_CONSTANT * T * over)

    def entropy(self, temperature: ArrayLike) -> Floats:
        """s [J/mol/K] at the reference pressure, of the shape of `temperature` [K]."""
        T = np.asarray(temperature, dtype=float)
        a = self._coefficients(T)
        over = a[0] * np.log(T) + T * (a[1] + T * (a[2] / 2 + T * (a[3] / 3 + T * a[4] / 4))) + a[6]
        return np.asarray(GAS_CONSTANT * over)

    def _coefficients(self, T: Floats) -> list[Floats]:
        return [
            np.where(self.middle >= T, one, other) for one, other in zip(self.low, self.high, strict=True)
        ]


@dataclass(frozen=True)
class Thermochemistry:
    """What is known of a substance: `nasa`, or enthalpy of formation [J/mol] and entropy [J/mol/K] at 298.15 K and a heat capacity
    [J/mol/K]."""

    enthalpy: float | None = None
    entropy: float | None = None
    heat_capacity: float | None = None
    nasa: Nasa | None = None

    @property
    def knows_enthalpy(self) -> bool:
        return self.nasa is not None or self.enthalpy is not None

    @property
    def knows_entropy(self) -> bool:
        return self.nasa is not None or self.entropy is not None

    @property
    def standard_enthalpy(self) -> float:
        """h at 298.15 K [J/mol]; it must be known."""
        if self.nasa is not None:
            return float(self.nasa.enthalpy(STANDARD_TEMPERATURE))
        if self.enthalpy is None:
            raise ValueError("no enthalpy")
        return self.enthalpy

    def gibbs(self, temperature: ArrayLike) -> Floats:
        """h - T s [J/mol] at the reference pressure; both must be known."""
        T = np.asarray(temperature, dtype=float)
        if self.nasa is not None:
            return np.asarray(self.nasa.enthalpy(T) - T * self.nasa.entropy(T))
        if self.enthalpy is None or self.entropy is None:
            raise ValueError("no enthalpy or no entropy")
        warmer = 0.0 if self.heat_capacity is None else self.heat_capacity
        enthalpy = self.enthalpy + warmer * (T - STANDARD_TEMPERATURE)
        return np.asarray(enthalpy - T * (self.entropy + warmer * np.log(T / STANDARD_TEMPERATURE)))
