"""Heat in gas and packed beds: effective conductivity, exchange between gas and particles, numbers of natural convection.

SI; floats, or arrays with a value for each cell. eps is the porosity, k the conductivity of the gas, k_s that of the solid.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GRAVITY

ConductivityModel = Literal["parallel", "series", "geometric", "zehner_bauer_schluender"]
MODELS: tuple[ConductivityModel, ...] = ("parallel", "series", "geometric", "zehner_bauer_schluender")

CRITICAL_RAYLEIGH = 1707.762
"""Ra at which a layer between rigid plates, heated from below, begins to turn over (Chandrasekhar, Hydrodynamic and Hydromagnetic
Stability, 1961, chapter II)."""
CRITICAL_DARCY_RAYLEIGH = 4.0 * math.pi**2
"""The same of a porous layer between impermeable plates (Horton and Rogers 1945, Lapwood 1948)."""
_NEAR = 0.05
"""|N| below which `zehner_schluender` sums its series: the closed form loses digits there."""


def effective_conductivity[Value: (float, Floats)](
    model: ConductivityModel, porosity: Value, gas: Value, solid: Value
) -> Value:
    """k_eff [W/m/K] of a porous solid full of gas that does not flow.

    parallel (upper bound; the thesis, 5-11)   eps k + (1 - eps) k_s
    series (lower bound)                       1/(eps/k + (1 - eps)/k_s)
    geometric                                  k^eps k_s^(1 - eps)
    zehner_bauer_schluender                    of packed spheres that touch in points: `zehner_schluender`

    Bounds: Wiener 1912. The four are compared with measurements in Nield and Bejan, Convection in Porous Media, section 2.2.
    """
    if model == "parallel":
        return porosity * gas + (1.0 - porosity) * solid
    if model == "series":
        return 1.0 / (porosity / gas + (1.0 - porosity) / solid)
    if model == "geometric":
        mean: Value = gas**porosity * solid ** (1.0 - porosity)
        return mean
    spheres = zehner_schluender(np.asarray(porosity), np.asarray(gas), np.asarray(solid))
    value: Value = spheres.item() if spheres.ndim == 0 else spheres  # type: ignore[assignment]
    return value


def zehner_schluender(porosity: Floats, gas: Floats, solid: Floats) -> Floats:
    """k_eff [W/m/K] of a bed of spheres by Zehner and Schluender (1970), with point contacts, without radiation.

        k_eff/k = 1 - sqrt(1 - eps) + sqrt(1 - eps) f,    B = 1.25 ((1 - eps)/eps)^(10/9),   N = 1 - B k/k_s,
        f = (2/N) [ (B/N^2) (1 - k/k_s) ln(k_s/(B k)) - (B + 1)/2 - (B - 1)/N ]

    (VDI Heat Atlas, 2nd ed. 2010, D6.3; what Bauer and Schluender 1978 add to it, radiation, flattened contacts and rarefied gas, is
    small for beads of some 10 um below 600 K and left out.) With k_s/k = B/(1 - N) and ln(k_s/(B k)) = -ln(1 - N) the bracket is
    sum_n N^(n+1) ((B - 1)/(n + 3) + 1/(n + 2)), which holds at N = 0 too.
    """
    b = 1.25 * ((1.0 - porosity) / porosity) ** (10.0 / 9.0)
    n = np.asarray(1.0 - b * gas / solid)
    near = np.abs(n) < _NEAR
    safe = np.where(near, 1.0 - 0.5, n)
    closed = ((b - 1.0 + safe) / safe**2 * -np.log1p(-safe) - 0.5 * (b + 1.0) - (b - 1.0) / safe) / safe
    series = sum(n**i * ((b - 1.0) / (i + 3) + 1.0 / (i + 2)) for i in range(13))
    root = np.sqrt(1.0 - porosity)
    return np.asarray(gas * (1.0 - root + root * 2.0 * np.where(near, series, closed)))


def volumetric_heat_capacity[Value: (float, Floats)](
    porosity: Value, *, gas: Value, density: Value, heat_capacity: Value
) -> Value:
    """C_h = eps (rho c_p) + (1 - eps) rho_s c_s [J/m3/K]; `gas` is rho c_p of the gas [J/m3/K], the others are of the solid."""
    return porosity * gas + (1.0 - porosity) * density * heat_capacity


def nusselt_of_particles(prandtl: float, reynolds: float) -> float:
    """Nu = 2 + 1.1 Pr^(1/3) Re_p^0.6 of particles in a packed bed (Wakao and Kaguei, Heat and Mass Transfer in Packed Beds, 1982).

    Re_p = rho u d/mu with the superficial velocity, 15 to 8500 in their data; still gas has 2.
    """
    return 2.0 + 1.1 * math.cbrt(prandtl) * math.pow(reynolds, 0.6)


def exchange_time(
    *,
    porosity: float,
    density: float,
    heat_capacity: float,
    transfer: float,
    surface: float,
) -> float:
    """(1 - eps) rho_s c_s/(h S) [s]: in which the solid takes the temperature of the gas that flows past it; surface S per volume [1/m]."""
    return (1.0 - porosity) * density * heat_capacity / (transfer * surface)


def rayleigh(
    *,
    difference: float,
    height: float,
    temperature: float,
    viscosity: float,
    density: float,
    diffusivity: float,
) -> float:
    """Ra = g (dT/T) h^3/(nu alpha) of a layer of ideal gas (beta = 1/T); `diffusivity` alpha is that of heat [m2/s]."""
    return GRAVITY * (difference / temperature) * height**3 / (viscosity / density * diffusivity)


def darcy_rayleigh(
    *,
    difference: float,
    height: float,
    temperature: float,
    viscosity: float,
    density: float,
    permeability: float,
    conductivity: float,
    gas_heat_capacity: float,
) -> float:
    """Ra_D = g (dT/T) K h/(nu alpha), alpha = k_eff/(rho c_p of the gas): natural convection in a porous layer (Nield and Bejan)."""
    alpha = conductivity / (density * gas_heat_capacity)
    return GRAVITY * (difference / temperature) * permeability * height / (viscosity / density * alpha)
