"""Gas through beds of particles: its drag on them, where it carries them, and what holds them together.

SI throughout. "Seed" is the thesis whose chapters 2-5 the model follows; equation numbers are its own.
"""

from __future__ import annotations

import math

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GAS_CONSTANT, GRAVITY

ERGUN = (150.0, 1.75)
"""Ergun's factors A of the viscous and B of the inertial drag (1952)."""


def gidaspow_beta(
    porosity: Floats,
    slip: Floats,
    *,
    diameter: float,
    sphericity: float,
    viscosity: float,
    density: float,
    ergun: tuple[float, float] = ERGUN,
) -> Floats:
    """Gas-solids interaction coefficient [kg/m3/s] of Gidaspow with sphericity (3-4, 3-5), any array shape.

    Below a voidage of 0.8 it is Ergun's with the factors `ergun` (A, B); above, Wen and Yu's. `slip` is the interstitial velocity
    difference [m/s]. The seed's text leaves the exponent of (1-eps) implicit: A (1-eps) eps_s mu/(eps (phi d)^2), eps_s = 1 - eps.
    """
    viscous, inertial = ergun
    porosity = np.clip(np.asarray(porosity, dtype=float), 1e-3, 1.0)
    slip = np.abs(np.asarray(slip, dtype=float))
    solids = 1.0 - porosity
    size = sphericity * diameter
    dense = viscous * solids**2 * viscosity / (porosity * size**2) + inertial * density * solids * slip / size
    reynolds = np.maximum(density * porosity * slip * diameter / viscosity, 1e-12)
    drag = np.where(reynolds < 1000.0, 24.0 / reynolds * (1.0 + 0.15 * reynolds**0.687), 0.44)
    dilute = 0.75 * drag * density * porosity * solids * slip / size * porosity**-2.65
    # In the limit of no slip C_D Re stays finite: 24, so the dilute branch needs no slip of its own.
    still = 0.75 * 24.0 * viscosity * solids / (size * diameter) * porosity**-2.65
    dilute = np.where(slip > 0.0, dilute, still)
    return np.where(porosity < 0.8, dense, dilute)


def minimum_fluidisation_velocity(
    *,
    diameter: float,
    sphericity: float,
    density_solid: float,
    porosity: float,
    viscosity: float,
    density_gas: float,
    ergun: tuple[float, float] = ERGUN,
) -> float:
    """Superficial velocity U [m/s] at which Ergun's drag with the factors `ergun` (A, B) carries the bed.

    A mu (1-eps)/(eps^3 (phi d)^2) U + B rho/(eps^3 phi d) U^2 = (rho_s - rho) g.
    """
    viscous, inertial = ergun
    weight = (density_solid - density_gas) * GRAVITY
    a = inertial * density_gas / (porosity**3 * sphericity * diameter)
    b = viscous * viscosity * (1.0 - porosity) / (porosity**3 * (sphericity * diameter) ** 2)
    # 2c/(b + sqrt) instead of (sqrt - b)/2a: no cancellation when the viscous term rules.
    return 2.0 * weight / (b + math.sqrt(b * b + 4.0 * a * weight))


def wen_yu_minimum_fluidisation(
    *, diameter: float, density_solid: float, viscosity: float, density_gas: float
) -> float:
    """Wen and Yu's correlation, Re_mf = sqrt(33.7^2 + 0.0408 Ar) - 33.7 [m/s]; needs neither voidage nor shape."""
    archimedes = density_gas * (density_solid - density_gas) * GRAVITY * diameter**3 / viscosity**2
    reynolds = math.sqrt(33.7**2 + 0.0408 * archimedes) - 33.7
    return reynolds * viscosity / (density_gas * diameter)


def granular_bond_number(*, cohesion: float, diameter: float, density: float) -> float:
    """Largest cohesive force of one bond [N] over the weight of a sphere (table 2.1, section 3.4.4)."""
    return cohesion / (density * math.pi / 6.0 * diameter**3 * GRAVITY)


def mean_free_path(*, viscosity: float, pressure: float, temperature: float, molar_mass: float) -> float:
    """Kinetic theory, l = mu/p sqrt(pi R T/(2 M)) [m]; the seed gives about 25 um for N2 at 2 Torr."""
    return viscosity / pressure * math.sqrt(math.pi * GAS_CONSTANT * temperature / (2.0 * molar_mass))
