"""Diffusivity of a species in the carrier gas when the case does not give one: scaled from one reference state.

    D = D_ref (T/T_ref)^1.75 (p_ref/p) f,    D_ref = 2.88e-5 m2/s in N2 at 473 K and 101325 Pa

with the exponent of Fuller, Schettler and Giddings and, in another carrier, the ratio f of their correlation
D ~ T^1.75 sqrt(1/M_i + 1/M_c) / (p (v_i^(1/3) + v_c^(1/3))^2). Diffusion volumes v [cm3/mol]: Poling, Prausnitz and O'Connell, The
Properties of Gases and Liquids, 5th ed. (2001), table 11-1. D_ref, for every species, is the default of the solver with which the thesis
computed, which left mixture properties at their defaults. The correlation itself gives about 2.3e-5 m2/s for TMA.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from mpm.arrays import Floats
from mpm.physics.elements import parse_formula
from mpm.physics.gases import CARRIERS
from mpm.physics.substances import Species

REFERENCE_DIFFUSIVITY = 2.88e-5
"""[m2/s], in REFERENCE_CARRIER at REFERENCE_TEMPERATURE [K] and REFERENCE_PRESSURE [Pa]."""
REFERENCE_TEMPERATURE, REFERENCE_PRESSURE, REFERENCE_CARRIER = 473.0, 101325.0, "N2"
EXPONENT = 1.75

ATOMS = {
    "C": 15.9, "H": 2.31, "O": 6.11, "N": 4.54, "F": 14.7, "Cl": 21.0, "Br": 21.9, "I": 29.8, "S": 22.9,
    "He": 2.67, "Ne": 5.98, "Ar": 16.2, "Kr": 24.5, "Xe": 32.7,
}  # fmt: skip
"""Diffusion volumes of atoms. The table has no metals: they count as nothing, which changes the ratio of two carriers by 0.3 % (argon
over nitrogen) to 3 % (helium) for TMA."""
MOLECULES = {
    "H2": 6.12, "N2": 18.5, "O2": 16.3, "CO": 18.0, "CO2": 26.9, "N2O": 35.9, "NH3": 20.7, "H2O": 13.1,
    "SF6": 71.3, "Cl2": 38.4, "Br2": 69.0, "SO2": 41.8,
}  # fmt: skip
"""Diffusion volumes of simple molecules, which are not the sums of their atoms."""
_BY_ATOMS = {frozenset(parse_formula(name).items()): volume for name, volume in MOLECULES.items()}


def diffusion_volume(elements: Mapping[str, float]) -> float | None:
    """v [cm3/mol] of a molecule from its atoms; None where the table has none of them."""
    molecule = _BY_ATOMS.get(frozenset(elements.items()))
    if molecule is not None:
        return molecule
    return sum(count * ATOMS.get(element, 0.0) for element, count in elements.items()) or None


def carrier_volume(carrier: str) -> float | None:
    """v [cm3/mol] of a carrier whose name is its formula; None for any other."""
    try:
        return diffusion_volume(parse_formula(carrier))
    except ValueError:
        return None


def carrier_ratio(species: Species, carrier: str, molar_mass: float) -> float | None:
    """f = D in `carrier` (of `molar_mass` [kg/mol]) over D in nitrogen; None where a diffusion volume is unknown."""
    if carrier == REFERENCE_CARRIER:
        return 1.0
    own, other = diffusion_volume(species.elements), carrier_volume(carrier)
    nitrogen = carrier_volume(REFERENCE_CARRIER)
    if own is None or other is None or nitrogen is None:
        return None
    inverse = 1.0 / species.molar_mass
    masses = (inverse + 1.0 / molar_mass) / (inverse + 1.0 / CARRIERS[REFERENCE_CARRIER].molar_mass)
    return (
        math.sqrt(masses)
        * ((math.cbrt(own) + math.cbrt(nitrogen)) / (math.cbrt(own) + math.cbrt(other))) ** 2
    )


def thermal_diffusion[Value: (float, Floats)](
    molar_mass: float, carrier_molar_mass: float, temperature: Value
) -> Value:
    """S [mol/m/s] of a dilute species: its molar flux is -x_i S grad ln T (Soret), above 0 for what is heavier than the carrier.

    S = D_T,i/(M_i x_i) with D_T,i = -2.59e-7 T^0.659 [a_i X_i/sum a X - Y_i] [sum a X/sum b X] kg/m/s, a = M^0.511, b = M^0.489 with M in
    g/mol: Kuo, Principles of Combustion (1986), as the solver of the thesis has it (5-13). For X_i -> 0 the brackets become
    [(M_i/M)^0.511 - M_i/M] X_i and M^0.022.
    """
    ratio = molar_mass / carrier_molar_mass
    bracket = (math.pow(ratio, 0.511) - ratio) * math.pow(1e3 * carrier_molar_mass, 0.022)
    warmth: Value = temperature**0.659
    return -2.59e-7 * warmth * bracket / molar_mass


def scaled_diffusivity(
    species: Species, carrier: str, *, molar_mass: float, temperature: float, pressure: float
) -> float:
    """D [m2/s] of `species` in the carrier at `temperature` [K] and `pressure` [Pa]; in an unknown carrier that in nitrogen."""
    ratio = carrier_ratio(species, carrier, molar_mass)
    state = math.pow(temperature / REFERENCE_TEMPERATURE, EXPONENT) * (REFERENCE_PRESSURE / pressure)
    return REFERENCE_DIFFUSIVITY * state * (1.0 if ratio is None else ratio)
