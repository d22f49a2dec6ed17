"""What acts on a bed on a vibrated base, per area: weight, gas, friction and adhesion (`mpm.physics.bed_balance` has the equations)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

from mpm.constants import GRAVITY
from mpm.physics.waves import Wave


class Carried(ValueError):
    """A bed that gas carries: it lifts off and does not come down."""


@dataclass(frozen=True, kw_only=True)
class BedForces:
    """What acts on the bed: `mass` m [kg/m2], `resistance` R [Pa s/m], `through_flow` U [m/s], `lag` c, `friction` mu_f, `adhesion` [Pa].

    The base moves with amplitudes `ax`, `ay` [m] at the angular frequency `omega` [1/s].
    """

    mass: float
    resistance: float = 0.0
    through_flow: float = 0.0
    lag: float = 0.0
    friction: float
    adhesion: float = 0.0
    ax: float
    ay: float
    omega: float

    @property
    def weight(self) -> float:
        """m g [Pa]."""
        return self.mass * GRAVITY

    @property
    def gas_share(self) -> float:
        """Share of the weight that the mean flow carries, R U/(m g)."""
        return self.resistance * self.through_flow / self.weight

    @cached_property
    def contact(self) -> Wave:
        """N(phase) = m (g + a_y) - R (U - c V_y) [Pa], with a_y = -A_y w^2 sin, V_y = A_y w cos."""
        peak = self.ay * self.omega
        return Wave(
            self.weight - self.resistance * self.through_flow,
            -self.mass * peak * self.omega,
            self.resistance * self.lag * peak,
        )

    @cached_property
    def held(self) -> Wave:
        """N + sigma [Pa]: negative, it lifts off."""
        return replace(self.contact, c=self.contact.c + self.adhesion)

    @cached_property
    def _grip(self) -> dict[int, Wave]:
        inertia = self.mass * self.ax * self.omega**2
        return {
            way: Wave(
                self.friction * self.held.c,
                self.friction * self.held.a - way * inertia,
                self.friction * self.held.b,
            )
            for way in (1, -1)
        }

    def grip(self, way: int) -> Wave:
        """mu_f (N + sigma) +- m a_x [Pa]: what friction has left against sliding to the right (`way` 1) or to the left (-1)."""
        return self._grip[way]

    def base_speed(self, phase: float) -> float:
        """Horizontal velocity of the base [m/s]."""
        return self.ax * self.omega * math.cos(phase)

    @property
    def is_carried(self) -> bool:
        """Whether gas carries the bed's weight and takes it away."""
        return self.contact.c <= 0.0 and self.held.dips
