"""Properties of the gas as a mixture: molar mass, viscosity and diffusivities from its composition.

Mole fractions are given by species, arrays with a value for each cell; the carrier is what they leave. Without any, everything is that of
the carrier.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mpm.arrays import Floats
from mpm.physics.diffusion import carrier_volume, diffusion_volume
from mpm.physics.substances import Species

Fractions = Mapping[str, Floats]


def mass_ratio(species: Sequence[Species], carrier: float, fractions: Fractions) -> Floats | float:
    """Mean molar mass over that of the carrier [kg/mol], 1 + sum_i x_i (M_i/M - 1): at one pressure and temperature that of densities."""
    return 1.0 + sum(
        fractions[one.name] * (one.molar_mass / carrier - 1.0) for one in species if one.name in fractions
    )


def viscosity_ratio(
    species: Sequence[Species], carrier: float, viscosity: float, fractions: Fractions
) -> Floats | float:
    """Viscosity of the mixture over that of the carrier, by Wilke (J. Chem. Phys. 18, 517, 1950):

        mu = sum_i x_i mu_i / sum_j x_j phi_ij,
        phi_ij = [1 + (mu_i/mu_j)^(1/2) (M_j/M_i)^(1/4)]^2 / [8 (1 + M_i/M_j)]^(1/2).

    `viscosity` [Pa s] of the carrier at the temperature at which those of the species are given; a species without one counts as carrier.
    """
    known = [one for one in species if one.viscosity is not None and one.name in fractions]
    rest = 1.0 - sum(fractions[one.name] for one in known)
    parts = [(rest, viscosity, carrier)]
    parts += [(fractions[one.name], one.viscosity or 0.0, one.molar_mass) for one in known]
    return (
        sum(
            share
            * mu
            / sum(other * _phi(mu, mass, mu_other, mass_other) for other, mu_other, mass_other in parts)
            for share, mu, mass in parts
        )
        / viscosity
    )


def _phi(mu: float, mass: float, other_mu: float, other_mass: float) -> float:
    """Wilke's phi_ij of i and another j."""
    above = (1.0 + np.sqrt(mu / other_mu) * (other_mass / mass) ** 0.25) ** 2
    return float(above / np.sqrt(8.0 * (1.0 + mass / other_mass)))


def diffusivity_ratio(
    name: str, species: Sequence[Species], carrier: str, molar_mass: float, fractions: Fractions
) -> Floats | float:
    """Diffusivity of a species in the mixture over that in the carrier (of `molar_mass` [kg/mol]), by Blanc:

        1/D_i = sum_j x_j/((1 - x_i) D_ij)      over the others,

    with D_ij over D_i,carrier as Fuller's correlation has it (`mpm.physics.diffusion`); what has no diffusion volume counts as carrier.
    """
    (one,) = [s for s in species if s.name == name]
    own, held = diffusion_volume(one.elements), carrier_volume(carrier)
    if own is None or held is None:
        return 1.0
    others = [s for s in species if s.name != name and s.name in fractions and diffusion_volume(s.elements)]
    mine = fractions.get(name, 0.0)
    resistance = 1.0 - mine - sum(fractions[s.name] for s in others)
    for other in others:
        masses = (1.0 / one.molar_mass + 1.0 / molar_mass) / (1.0 / one.molar_mass + 1.0 / other.molar_mass)
        volume = diffusion_volume(other.elements) or 0.0
        sizes = (np.cbrt(own) + np.cbrt(volume)) / (np.cbrt(own) + np.cbrt(held))
        resistance = resistance + fractions[other.name] * np.sqrt(masses) * sizes**2
    return (1.0 - mine) / resistance
