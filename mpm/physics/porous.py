"""A porous medium: its surface and permeability, and what it makes of diffusion. Equation numbers are those of the thesis."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def effective_diffusivity[Value: (float, NDArray[np.float64])](
    diffusivity: float | Value, porosity: Value, tortuosity_factor: Value
) -> Value:
    """D_eff = porosity D / tau^2 [m2/s], with D of free gas and tau^2 the tortuosity factor (TauFactor's, table 5.4 of the thesis).

    Both are 1 in free gas. The thesis prints D eps/tau with tau a ratio of lengths (5-6) and leaves the flux in its porous zones
    unreduced (5-12, 5-13): docs/source.md says what either changes. Numbers, or arrays with one for each row or cell.
    """
    return porosity * diffusivity / tortuosity_factor


def particle_surface(porosity: float, diameter: float, sphericity: float) -> float:
    """Surface per total volume [1/m] of a bed of particles, S = 6 (1 - eps)/(phi d), d [m] that of a sphere of equal volume (5-3)."""
    return (1.0 - porosity) * 6.0 / (sphericity * diameter)


def kozeny_carman(*, porosity: float, surface_to_volume: float, constant: float) -> float:
    """Permeability [m2], k = eps^3/(c0 S^2) with S [1/m] the surface per *total* volume (5-1, 5-2).

    c0 = 5 for packed spheres (Carman 1937), 4.2 fitted for the glass beads of the thesis (table 5.4).
    """
    return porosity**3 / (constant * surface_to_volume**2)
