"""Carrier gases: molar mass, viscosity of temperature (Sutherland), ideal-gas density.

Sutherland's formula mu = mu0 (T/T0)^(3/2) (T0 + S)/(T + S). Constants: N2 and Ar from F. M. White, Viscous Fluid
Flow, 3rd ed. (2006), table 1-2 (within 2-3 % for 100-1500 K and 120-1500 K); He from Crane Technical Paper 410
(T0 = 273 K, S = 79.4 K). Molar masses: IUPAC standard atomic weights.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mpm.constants import GAS_CONSTANT


@dataclass(frozen=True, kw_only=True)
class CarrierGas:
    """Properties of a carrier gas: molar mass [kg/mol] and the constants of Sutherland's viscosity."""

    molar_mass: float
    mu0: float
    T0: float
    S: float

    def viscosity(self, temperature: float) -> float:
        """Dynamic viscosity [Pa s] at `temperature` [K] by Sutherland's formula."""
        ratio = temperature / self.T0
        return self.mu0 * math.pow(ratio, 1.5) * (self.T0 + self.S) / (temperature + self.S)


CARRIERS = {
    "N2": CarrierGas(molar_mass=28.01e-3, mu0=1.663e-5, T0=273.0, S=107.0),
    "Ar": CarrierGas(molar_mass=39.95e-3, mu0=2.125e-5, T0=273.0, S=144.0),
    "He": CarrierGas(molar_mass=4.0026e-3, mu0=1.90e-5, T0=273.0, S=79.4),
}


_SPELT_OUT = {"nitrogen": "n2", "argon": "ar", "helium": "he"}


def symbol(name: str) -> str:
    """What a gas spelt out is called here, in lower case: a message then suggests the right spelling; else the name itself."""
    return _SPELT_OUT.get(name.lower(), name)


def molar_density(pressure: float, temperature: float) -> float:
    """Amount of an ideal gas per volume, p/(R T) [mol/m3]."""
    return pressure / (GAS_CONSTANT * temperature)


def ideal_gas_density(*, pressure: float, molar_mass: float, temperature: float) -> float:
    """Density p M/(R T) [kg/m3] of an ideal gas; pressure [Pa], molar mass [kg/mol], temperature [K]."""
    return pressure * molar_mass / (GAS_CONSTANT * temperature)
