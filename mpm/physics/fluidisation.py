"""Gas through packed and fluidised beds of particles, and forces on one particle.

SI throughout. "Seed" is the thesis whose chapters 2-5 the model follows; equation numbers are its own.
"""

import math
from typing import Literal

import numpy as np

from mpm.constants import GAS_CONSTANT, GRAVITY


def kozeny_carman_permeability(porosity: float, surface_to_volume: float, constant: float = 5.0) -> float:
    """Permeability [m2], k = eps^3/(c0 S^2) with S the surface per *total* volume [1/m] (5-1)."""
    return porosity**3 / (constant * surface_to_volume**2)


def kozeny_carman_constant(porosity: float, surface_to_volume: float, permeability: float) -> float:
    """The constant c0 = eps^3/(S^2 k) that a measured permeability [m2] stands for (5-1, table 5.4)."""
    return porosity**3 / (surface_to_volume**2 * permeability)


def gidaspow_beta(
    porosity: np.ndarray,
    slip: np.ndarray,
    diameter: float,
    sphericity: float,
    viscosity: float,
    density: float,
    viscous: float = 150.0,
    inertial: float = 1.75,
) -> np.ndarray:
    """Gas-solids interaction coefficient [kg/m3/s] of Gidaspow with sphericity (3-4, 3-5), any array shape.

    Below a voidage of 0.8 it is Ergun's with the factors `viscous` (A) and `inertial` (B); above, Wen and
    Yu's. `slip` is the interstitial velocity difference [m/s]. The seed's text leaves the exponent of (1-eps)
    implicit: A (1-eps) eps_s mu/(eps (phi d)^2), eps_s = 1 - eps.
    """
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
    diameter: float,
    sphericity: float,
    density_solid: float,
    porosity: float,
    viscosity: float,
    density_gas: float,
    viscous: float = 150.0,
    inertial: float = 1.75,
    law: Literal["ergun", "gidaspow"] = "ergun",
) -> float:
    """Superficial velocity [m/s] at which the drag carries the bed.

    Ergun: A mu (1-eps)/(eps^3 (phi d)^2) U + B rho/(eps^3 phi d) U^2 = (rho_s - rho) g.
    Gidaspow: beta(eps, U/eps) U/eps^2 = (1-eps)(rho_s - rho) g with `gidaspow_beta`; the same below eps = 0.8.
    """
    weight = (density_solid - density_gas) * GRAVITY
    if law == "ergun":
        a = inertial * density_gas / (porosity**3 * sphericity * diameter)
        b = viscous * viscosity * (1.0 - porosity) / (porosity**3 * (sphericity * diameter) ** 2)
        # 2c/(b + sqrt) instead of (sqrt - b)/2a: no cancellation when the viscous term rules.
        return 2.0 * weight / (b + math.sqrt(b * b + 4.0 * a * weight))

    def excess(velocity: float) -> float:
        beta = gidaspow_beta(
            np.asarray(porosity), np.asarray(velocity / porosity), diameter, sphericity,
            viscosity, density_gas, viscous, inertial,
        )  # fmt: skip
        return float(beta) * velocity / porosity**2 - (1.0 - porosity) * weight

    from scipy.optimize import brentq  # most of a second to load, which the closed form does not need

    return float(brentq(excess, 1e-9, 10.0))


def wen_yu_minimum_fluidisation(
    diameter: float, density_solid: float, viscosity: float, density_gas: float
) -> float:
    """Wen and Yu's correlation, Re_mf = sqrt(33.7^2 + 0.0408 Ar) - 33.7 [m/s]; needs neither voidage nor shape."""
    archimedes = density_gas * (density_solid - density_gas) * GRAVITY * diameter**3 / viscosity**2
    reynolds = math.sqrt(33.7**2 + 0.0408 * archimedes) - 33.7
    return reynolds * viscosity / (density_gas * diameter)


def granular_bond_number(cohesion: float, diameter: float, density: float) -> float:
    """Largest cohesive force of one bond [N] over the weight of a sphere (table 2.1, section 3.4.4)."""
    return cohesion / (density * math.pi / 6.0 * diameter**3 * GRAVITY)


def mean_free_path(viscosity: float, pressure: float, temperature: float, molar_mass: float) -> float:
    """Kinetic theory, l = mu/p sqrt(pi R T/(2 M)) [m]; the seed gives about 25 um for N2 at 2 Torr."""
    return viscosity / pressure * math.sqrt(math.pi * GAS_CONSTANT * temperature / (2.0 * molar_mass))


def drag_force(coefficient: float, density_gas: float, slip: float, diameter: float) -> float:
    """F = 1/2 rho u^2 C_D pi/4 d^2 [N] (2.a.1)."""
    return 0.5 * density_gas * slip**2 * coefficient * math.pi / 4.0 * diameter**2


def stokes_drag_coefficient(reynolds: float) -> float:
    """C_D = 24/Re."""
    return 24.0 / reynolds


def ergun_drag_coefficient(
    reynolds: float, porosity: float = 0.5, viscous: float = 180.0, inertial: float = 1.8
) -> float:
    """C_D = a/Re (1-eps)/eps^2 + b/eps^2 with the seed's a = 180, b = 1.8, eps = 0.50 (2.a.2)."""
    return viscous / reynolds * (1.0 - porosity) / porosity**2 + inertial / porosity**2


def knudsen_drag_coefficient(reynolds: float, knudsen: float) -> float:
    """Loth's C_D = 24/Re (1 + 0.15 Re^0.687)/(1 + (2.514 + 0.8 exp(-0.55/Kn)) Kn) (2.a.3).

    The seed prints the exponent 0.637; Schiller and Naumann's is 0.687 (as its own 3-5 has it). At the
    Reynolds numbers here (< 0.1) the difference is below 0.5 %. `knudsen` = mean free path / diameter.
    """
    slip = 1.0 + (2.514 + 0.8 * math.exp(-0.55 / knudsen)) * knudsen
    return 24.0 / reynolds * (1.0 + 0.15 * reynolds**0.687) / slip
