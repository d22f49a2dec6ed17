"""Powders: size, shape and contact properties of the particles, with the seed's five as built-ins."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GRAVITY
from mpm.physics.fluidisation import ERGUN

SMALLEST = 0.2  # of the mean diameter: the smallest class; its collisions set the time step


@dataclass(frozen=True, kw_only=True)
class Powder:
    """Particles and what they do on contact with each other and with the base (SI).

    diameter, deviation: mean and standard deviation of a normal distribution by number [m];
    friction, restitution: particle-particle, and `wall_*` particle-base;
    hamaker [J], asperity [m]: of the Rumpf force (2-6), zero Hamaker constant = no cohesion;
    stiffness [N/m]: linearised stiffness of the real material, the k_m of the cohesion scaling;
    ergun: factors A and B of the drag law; measured_umf: the seed's fluidisation test [m/s], None when untested.
    """

    name: str
    diameter: float
    deviation: float
    density: float
    sphericity: float
    friction: float = 0.273
    wall_friction: float = 0.4
    restitution: float = 0.97
    wall_restitution: float = 0.83
    hamaker: float = 3.1e-20
    wall_hamaker: float = 6.2e-20
    asperity: float = 1e-9
    stiffness: float = 2500.0
    ergun: tuple[float, float] = ERGUN
    measured_umf: float | None = None
    source: str = ""

    @property
    def mass(self) -> float:
        """Mass of a sphere of the mean diameter [kg]."""
        return self.density * math.pi / 6.0 * self.diameter**3

    @property
    def weight(self) -> float:
        """Weight of a sphere of the mean diameter [N]."""
        return self.mass * GRAVITY

    def size_classes(self, count: int) -> Floats:
        """Diameters [m] of `count` equally frequent classes of the normal size distribution, shape (count,).

        Each is the mean of its quantile interval, stretched so that the standard deviation of the classes is
        the powder's (few classes would otherwise lose the tails). One class: the mean diameter. Positive up to
        `largest_deviation`.
        """
        if count == 1 or self.deviation == 0.0:
            return np.array([self.diameter])
        return self.diameter + self.deviation * class_scores(count)

    def largest_deviation(self, count: int) -> float:
        """Standard deviation [m] up to which `count` classes keep mean and spread: the smallest is `SMALLEST` of the mean."""
        return (1.0 - SMALLEST) * self.diameter / float(class_scores(count).max()) if count > 1 else math.inf


def class_scores(count: int) -> Floats:
    """Sizes of `count` > 1 equally frequent classes of a standard normal distribution: mean 0, standard deviation 1."""
    normal = NormalDist()
    # Mean of a standard normal between two quantiles: count * (pdf(lower) - pdf(upper)).
    edges = [0.0, *(normal.pdf(normal.inv_cdf(i / count)) for i in range(1, count)), 0.0]
    score: Floats = count * (np.array(edges[:-1]) - np.array(edges[1:]))
    return score / float(score.std())


_GLASS = (
    "friction, restitution, Hamaker constants, asperity: table 2.1; stiffness: supplement B; "
    "sizes and sphericity: table 3.2; u_mf: section 3.4.2"
)
_COARSE = "no cohesion and a base friction of 0.42: section 3.3.4 and table 4.1; else as the fine glass"

POWDERS: dict[str, Powder] = {
    powder.name: powder
    for powder in (
        Powder(
            name="GL50", diameter=50e-6, deviation=0.0, density=2500.0, sphericity=0.79,
            source="table 2.1 (sieve cut 45-63 um, simulated as one size); sphericity assumed that of GL56",
        ),
        Powder(name="GL29", diameter=29e-6, deviation=8.1e-6, density=2500.0, sphericity=0.78, measured_umf=0.175e-2, source=_GLASS),
        Powder(name="GL56", diameter=56e-6, deviation=13.9e-6, density=2500.0, sphericity=0.79, measured_umf=0.35e-2, source=_GLASS),
        Powder(
            name="GL223", diameter=223e-6, deviation=53.5e-6, density=2500.0, sphericity=0.80,
            wall_friction=0.42, hamaker=0.0, wall_hamaker=0.0, measured_umf=5e-2, source=_COARSE,
        ),
        Powder(
            name="SS231", diameter=231e-6, deviation=64.2e-6, density=7500.0, sphericity=0.81,
            wall_friction=0.42, hamaker=0.0, wall_hamaker=0.0, ergun=(248.0, 1.75), measured_umf=10e-2,
            source="sizes: table 3.2; Ergun's A: section 3.4.2; contact values assumed those of glass",
        ),
    )
}  # fmt: skip
