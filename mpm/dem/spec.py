"""What fixes a box, and the state of the bed in it."""

import math
from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats, Ints

from . import cohesion
from .base import Base
from .contact import Contact
from .powder import Powder


@dataclass(frozen=True, kw_only=True)
class BoxSpec:
    """Everything that fixes a box, SI.

    `diameters`: the size classes (n,); `steps`: per shortest collision; `reduced`: cohesion scaled to the spring.
    """

    powder: Powder
    diameters: Floats
    length: float
    depth: float
    height: float
    base: Base
    stiffness: float
    cohesion: bool = True
    steps: float = 14.0
    reduced: bool = True

    @property
    def pair_contact(self) -> Contact:
        return Contact(
            stiffness=self.stiffness, restitution=self.powder.restitution, friction=self.powder.friction
        )

    @property
    def wall_contact(self) -> Contact:
        return Contact(
            stiffness=self.stiffness,
            restitution=self.powder.wall_restitution,
            friction=self.powder.wall_friction,
        )

    @property
    def equal_sizes(self) -> bool:
        return len(self.diameters) == 1

    @property
    def frit_type(self) -> int:
        """LAMMPS' type of the particles of the base; 1 ... n are the size classes."""
        return len(self.diameters) + 1

    def masses(self) -> Floats:
        """Mass of a particle of each class [kg], shape (n,)."""
        return self.powder.density * math.pi / 6.0 * self.diameters**3

    def largest_timestep(self) -> float:
        """The shortest collision, that of two smallest particles, over `steps` [s]."""
        return self.pair_contact.duration(float(self.masses().min()) / 2.0) / self.steps

    def hamaker(self, wall: bool) -> float:
        """Hamaker constant of the box [J], scaled to the spring stiffness if so wished; zero without cohesion."""
        if not self.cohesion:
            return 0.0
        value = self.powder.wall_hamaker if wall else self.powder.hamaker
        if not self.reduced:
            return value
        return cohesion.reduced_hamaker(
            hamaker=value, stiffness=self.stiffness, material_stiffness=self.powder.stiffness
        )


@dataclass(frozen=True, kw_only=True)
class Particles:
    """State of the bed, in the order of the particles' numbers: positions unwrapped [m], classes from 0."""

    position: Floats
    velocity: Floats
    spin: Floats
    classes: Ints

    @classmethod
    def at_rest(cls, position: Floats, classes: Ints) -> "Particles":
        still = np.zeros_like(position)
        return cls(position=position, velocity=still, spin=still.copy(), classes=classes)
