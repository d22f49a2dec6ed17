"""Carrier gases: molar mass, viscosity, conductivity and heat capacity of temperature, ideal-gas density.

Sutherland's formula mu = mu0 (T/T0)^(3/2) (T0 + S)/(T + S). Constants: N2 and Ar from F. M. White, Viscous Fluid
Flow, 3rd ed. (2006), table 1-2 (within 2-3 % for 100-1500 K and 120-1500 K); He from Crane Technical Paper 410
(T0 = 273 K, S = 79.4 K). Molar masses: IUPAC standard atomic weights.

Conductivity: N2 by the same formula with constants of its own (White, table 1-3); of the noble gases, whose molecules carry
nothing but their motion, k = (15/4) (R/M) mu (Chapman and Enskog; Bird, Stewart and Lightfoot, Transport Phenomena, 2nd ed.,
9.3-14). Heat capacity: 5/2 R of the noble gases; of N2 Shomate's equation with the constants of the NIST Chemistry WebBook
(Chase 1998, 100-500 K and 500-2000 K). From 273 to 600 K all are within 2.2 % of the reference equations of state and transport that
CoolProp 8 evaluates (Lemmon and Jacobsen 2004, and others); `tests/test_thermal_laws.py` has the numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpm.constants import GAS_CONSTANT

if TYPE_CHECKING:
    from mpm.arrays import Floats

GASES_VARY = 0.75
"""Exponent n of mu ~ k ~ T^n in a gas of which nothing is known: that of hard spheres is 0.5, of Maxwell's molecules 1; measured
near 273 K are 0.66 (He), 0.74 (N2), 0.81 (Ar) (Bird, Molecular Gas Dynamics, 1994, table A1)."""
SHOMATE_FROM = 100.0
"""[K], where the constants of c_p begin to hold."""
Shomate = tuple[float, float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class CarrierGas:
    """Properties of a carrier gas: molar mass [kg/mol] and the constants of its formulas.

    k0, Sk: Sutherland's constants of the conductivity at the same T0, None for a noble gas; shomate: (up to a temperature [K], constants)
    of c_p, none for a noble gas.
    """

    molar_mass: float
    mu0: float
    T0: float
    S: float
    k0: float | None = None
    Sk: float = 0.0
    shomate: tuple[tuple[float, Shomate], ...] = ()

    def viscosity[Value: (float, Floats)](self, temperature: Value) -> Value:
        """Dynamic viscosity [Pa s] at `temperature` [K] by Sutherland's formula."""
        ratio = temperature / self.T0
        value: Value = self.mu0 * ratio**1.5 * (self.T0 + self.S) / (temperature + self.S)
        return value

    def conductivity[Value: (float, Floats)](self, temperature: Value) -> Value:
        """Thermal conductivity [W/m/K] at `temperature` [K]."""
        if self.k0 is None:
            return self.viscosity(temperature) * (3.75 * GAS_CONSTANT / self.molar_mass)
        ratio = temperature / self.T0
        value: Value = self.k0 * ratio**1.5 * (self.T0 + self.Sk) / (temperature + self.Sk)
        return value

    def heat_capacity(self, temperature: float) -> float:
        """c_p [J/kg/K] of the ideal gas at `temperature` [K]: 5/2 R, or A + B t + C t^2 + D t^3 + E/t^2 with t in 1000 K (Shomate; beyond
        its range the value at its end)."""
        if not self.shomate:
            return 2.5 * GAS_CONSTANT / self.molar_mass
        t = min(max(temperature, SHOMATE_FROM), self.shomate[-1][0]) / 1000.0
        a, b, c, d, e = next(
            (k for highest, k in self.shomate if temperature <= highest), self.shomate[-1][1]
        )
        return (a + b * t + c * t**2 + d * t**3 + e / t**2) / self.molar_mass


_NITROGEN: tuple[tuple[float, Shomate], ...] = (
    (500.0, (28.98641, 1.853978, -9.647459, 16.63537, 0.000117)),
    (2000.0, (19.50583, 19.88705, -8.598535, 1.369784, 0.527601)),
)
CARRIERS = {
    "N2": CarrierGas(
        molar_mass=28.01e-3, mu0=1.663e-5, T0=273.0, S=107.0, k0=0.0242, Sk=150.0, shomate=_NITROGEN
    ),
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
