"""A porous medium: its surface and permeability, and what it makes of diffusion. Equation numbers are those of the thesis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from mpm.constants import GAS_CONSTANT

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


DiffusionLaw = Literal["effective", "free", "printed"]


def effective_diffusivity[Value: (float, NDArray[np.float64])](
    diffusivity: float | Value, porosity: Value, tortuosity_factor: Value, law: DiffusionLaw = "effective"
) -> Value:
    """What pores leave of a diffusivity D of free gas, D_eff [m2/s], by one of three laws; tau^2 is the tortuosity factor (TauFactor's).

    effective: eps D/tau^2. printed: eps D/tau, as the thesis writes it (5-6), with tau a ratio of lengths and tau^2 in its table 5.4.
    free: D, the unreduced flux of its porous zones (5-12, 5-13). All are D in free gas, where eps and tau^2 are 1. Numbers, or arrays with
    one for each row or cell.
    """
    if law == "free":
        return diffusivity + 0.0 * porosity
    if law == "printed":
        root: Value = tortuosity_factor**0.5
        return porosity * diffusivity / root
    return porosity * diffusivity / tortuosity_factor


def particle_surface(porosity: float, diameter: float, sphericity: float) -> float:
    """Surface per total volume [1/m] of a bed of particles, S = 6 (1 - eps)/(phi d), d [m] that of a sphere of equal volume (5-3)."""
    return (1.0 - porosity) * 6.0 / (sphericity * diameter)


def kozeny_carman(*, porosity: float, surface_to_volume: float, constant: float) -> float:
    """Permeability [m2], k = eps^3/(c0 S^2) with S [1/m] the surface per *total* volume (5-1, 5-2).

    c0 = 5 for packed spheres (Carman 1937), 4.2 fitted for the glass beads of the thesis (table 5.4).
    """
    return porosity**3 / (constant * surface_to_volume**2)


def slip_factor(free_path: float, pore_diameter: float) -> float:
    """1 + b/p = 1 + 8 Kn, by which slip at the walls raises the permeability of pores of `pore_diameter` [m].

    Klinkenberg 1941: b/p = 4 c l/r with c close to 1, Maxwell's slip in a capillary of radius r; `free_path` l is
    `mpm.physics.fluidisation.mean_free_path`. 1 in a dense gas.
    """
    return 1.0 + 8.0 * free_path / pore_diameter


def knudsen_diffusivity[Value: (float, NDArray[np.float64])](
    pore_diameter: Value, molar_mass: float, temperature: Value
) -> Value:
    """D_K = (d/3) sqrt(8 R T/(pi M)) [m2/s] of free molecules in a pore of diameter d [m]: Knudsen 1909."""
    speed: Value = (8.0 * GAS_CONSTANT * temperature / (math.pi * molar_mass)) ** 0.5
    return pore_diameter / 3.0 * speed


def bosanquet[Value: (float, NDArray[np.float64])](diffusivity: Value, knudsen: Value) -> Value:
    """1/D = 1/D_m + 1/D_K [m2/s]: collisions with molecules and with walls (Bosanquet; Pollard and Present 1948)."""
    return diffusivity * knudsen / (diffusivity + knudsen)
