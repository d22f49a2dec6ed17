"""Drag of the gas in the bed: uniform flux through slabs of local voidage (3-3 ... 3-9 in one dimension).

The gas is incompressible and the box is periodic sideways, so the volume flux j normal to the base is the same at
every height. In the conveyor's frame it is the aeration velocity, less the velocity of the base when the inlet
rests in the lab. With eps grad p = -beta (u_g - u_s) the
pressure and the drag term of (3-9) add up to the force on one particle

    f = V_p beta(eps)/(eps^2 (1 - eps)) (j - u_z),

which at rest is Ergun's pressure drop. Along the base the gas moves with the bed, so no force acts there.
"""

from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats
from mpm.physics.fluidisation import gidaspow_beta

from .powder import Powder

SLAB = 2.5  # height of a slab in mean diameters, the seed's grid of the gas


def slab_solids(*, height: Floats, diameter: Floats, edges: Floats) -> Floats:
    """Volume of the spheres (centres at `height`) between consecutive edges [m3], shape (len(edges) - 1,).

    The part of a sphere below a level at the fraction t of its diameter is t^2 (3 - 2 t).
    """
    t = np.clip((edges[None, :] - height[:, None]) / diameter[:, None] + 0.5, 0.0, 1.0)
    below = t * t * (3.0 - 2.0 * t) * (np.pi / 6.0 * diameter[:, None] ** 3)
    return np.diff(below.sum(axis=0))


@dataclass(frozen=True, kw_only=True)
class GasDrag:
    """Gas of `viscosity` [Pa s] and `density` [kg/m3], aerated at the superficial `velocity` [m/s].

    `rests_in_lab`: the inlet does not move with the conveyor.
    """

    powder: Powder
    viscosity: float
    density: float
    velocity: float
    rests_in_lab: bool = True

    def flux(self, base_velocity: float) -> float:
        """Volume flux normal to the base in the conveyor's frame [m/s]."""
        return self.velocity - base_velocity if self.rests_in_lab else self.velocity

    def edges(self, top: float) -> Floats:
        """Edges of the slabs from the base to at least `top` [m]."""
        count = int(top / (SLAB * self.powder.diameter)) + 2
        return np.arange(count, dtype=float) * SLAB * self.powder.diameter

    def coefficients(
        self,
        *,
        height: Floats,
        relative: Floats,
        diameter: Floats,
        edges: Floats,
        solid: Floats,
    ) -> Floats:
        """gamma of f = gamma (j - u_z) for each particle [kg/s], shape (n,).

        `solid`: solid fraction of the slabs, interpolated linearly between their centres; `relative` = j - u_z
        enters the inertial part only.
        """
        centres = 0.5 * (edges[1:] + edges[:-1])
        porosity = 1.0 - np.clip(np.interp(height, centres, solid), 0.0, 0.7)
        slip = relative / porosity
        volume = np.pi / 6.0 * diameter**3
        gamma = np.empty_like(height)
        for size in np.unique(diameter):  # the law is written for one diameter
            one = diameter == size
            solids = np.maximum(1.0 - porosity[one], 1e-3)
            beta = gidaspow_beta(
                1.0 - solids,
                slip[one],
                diameter=float(size),
                sphericity=self.powder.sphericity,
                viscosity=self.viscosity,
                density=self.density,
                ergun=self.powder.ergun,
            )
            gamma[one] = volume[one] * beta / ((1.0 - solids) ** 2 * solids)
        return gamma
