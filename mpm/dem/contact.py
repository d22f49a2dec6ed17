"""The linear spring-dashpot contact (2-3 ... 2-5): its scales, and how LAMMPS is told about it.

Two forms of the same law are used. `gran/hooke/history` is the faster one; its damping is a rate per effective
mass, so the restitution is right for one mass only, that is for equal particles. `granular hooke ... damping
coeff_restitution` has the restitution of every pair. For walls only the second is right: `fix wall/gran
hooke/history` of the release of July 2025 depends on the system of units.
"""

import math
from dataclasses import dataclass

TANGENTIAL_STIFFNESS = 2.0 / 7.0  # k_t/k_n
TANGENTIAL_DAMPING = 0.5  # eta_t/eta_n


@dataclass(frozen=True, kw_only=True)
class Contact:
    """One kind of contact: normal stiffness [N/m], normal restitution, sliding friction."""

    stiffness: float
    restitution: float
    friction: float

    def damping(self, mass: float) -> float:
        """Normal dashpot eta_n = 2 sqrt(k m) |ln e|/sqrt(pi^2 + ln^2 e) [kg/s], m the effective mass (2-5)."""
        log = math.log(self.restitution)
        return 2.0 * math.sqrt(self.stiffness * mass) * abs(log) / math.hypot(math.pi, log)

    def duration(self, mass: float) -> float:
        """Duration of a collision [s], pi/sqrt(k/m - (eta/2m)^2), m the effective mass."""
        rate = self.damping(mass) / (2.0 * mass)
        return math.pi / math.sqrt(self.stiffness / mass - rate**2)

    def hooke_history(self, mass: float) -> str:
        """Arguments of pair style gran/hooke/history for pairs of the effective mass `mass` [kg]."""
        gamma = self.damping(mass) / mass
        return (
            f"{self.stiffness:.16g} {TANGENTIAL_STIFFNESS * self.stiffness:.16g} "
            f"{gamma:.16g} {TANGENTIAL_DAMPING * gamma:.16g} {self.friction:.16g} 1"
        )

    def granular(self) -> str:
        """Coefficients of pair style granular and of fix wall/gran granular."""
        return (
            f"hooke {self.stiffness:.16g} {self.restitution:.16g} "
            f"tangential linear_history {TANGENTIAL_STIFFNESS * self.stiffness:.16g} "
            f"{TANGENTIAL_DAMPING:.16g} {self.friction:.16g} damping coeff_restitution"
        )
