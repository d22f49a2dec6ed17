"""Flux between two points: how convection and diffusion are put together, `transport.scheme`.

Between two cell centres F = a C_behind - b C_ahead with a - b = u, the velocity through the face, and g the conductance between the centres
(1/g is the sum of the half-cell resistances h / (2 D_eff)). With Pe = u/g:

    fitted     a = g B(-Pe), b = g B(Pe), B(z) = z/(exp z - 1): exact for a constant velocity (Scharfetter and Gummel 1969)
    upwind     a = g + max(u, 0), b = g + max(-u, 0): first order, adds |u| h/2 to D_eff; what older closed codes do untold
    central    a = g + u/2, b = g - u/2 where |Pe| <= 2, else a = max(u, 0), b = max(-u, 0): the hybrid scheme (Spalding 1972)

Neither a nor b is ever negative, so that matrices are M-matrices: concentrations stay positive and within bounds in all three.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from mpm.arrays import Floats
from mpm.physics.exponentials import bernoulli, bernoulli_slope

Scheme = Literal["fitted", "upwind", "central"]

PURE_UPWIND = 1e-12  # of the velocity: a conductance below that changes the flux by less than rounding
HYBRID = 2.0  # Pe beyond which central differences would overshoot


def two_point_flux(velocity: Floats, conductance: Floats, scheme: Scheme = "fitted") -> tuple[Floats, Floats]:
    """Coefficients (a, b) [m/s] of the flux a C_behind - b C_ahead for a face velocity [m/s] and conductance g [m/s].

    g = 0 is legal and gives pure upwind; a - b = velocity always, and neither is negative, not even by rounding.
    """
    velocity, conductance = np.broadcast_arrays(np.asarray(velocity, float), np.asarray(conductance, float))
    upstream = np.maximum(-velocity, 0.0)
    if scheme == "upwind":
        b = conductance + upstream
    elif scheme == "central":
        b = np.where(np.abs(velocity) <= HYBRID * conductance, conductance - 0.5 * velocity, upstream)
    else:
        diffusing = conductance > PURE_UPWIND * np.abs(velocity)
        g = np.where(diffusing, conductance, 1.0)
        b = np.where(diffusing, g * bernoulli(velocity / g), upstream)
    b = np.maximum(b, 0.0)
    return np.maximum(b + velocity, 0.0), b


def coefficient_slope(velocity: Floats, conductance: Floats, scheme: Scheme = "fitted") -> Floats:
    """db/du of `two_point_flux`; da/du is 1 more."""
    pure = np.where(velocity < 0.0, -1.0, 0.0)
    if scheme == "upwind":
        return pure
    if scheme == "central":
        return np.where(np.abs(velocity) <= HYBRID * conductance, -0.5, pure)
    diffusing = conductance > 0.0
    g = np.where(diffusing, conductance, 1.0)
    return np.where(diffusing, bernoulli_slope(velocity / g), pure)
