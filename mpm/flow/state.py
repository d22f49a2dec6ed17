"""The gas in the cells of a strip that is not everywhere equally hot: its density and viscosity.

    rho = p0 M / (R T),    p0 the ambient pressure

(incompressible ideal gas: pressure differences of the flow are small beside p0). M is that of the carrier, or of the mixture. Where the
temperature is that of `[gas]` everywhere, nobody needs a state: density and viscosity are those of the case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.mesh.strip import Strip
from mpm.parallel import total
from mpm.physics.mixture import Fractions, mass_ratio, viscosity_ratio

if TYPE_CHECKING:
    from mpm.case.case import Case


@dataclass(frozen=True, eq=False)
class GasState:
    """Temperature [K], amount of gas per volume over that of the case's `[gas]` and viscosity [Pa s] in every local cell.

    `reference` [kg/m3] is the density of the case, `pressure` p0 over that of the case: 1 but in a closed strip, where heating raises it.
    `fractions` are the mole fractions of a mixture by species (local cells,), `mass` its molar mass over that of the carrier: else none and
    1.
    """

    temperature: Floats
    relative: Floats
    viscosity: Floats
    reference: float
    pressure: float
    fractions: Fractions
    mass: Floats

    @property
    def density(self) -> Floats:
        """[kg/m3]."""
        return self.reference * self.relative * self.mass

    @property
    def buoyant(self) -> Floats:
        """Density less that of the case [kg/m3], whose weight the pressure balances everywhere."""
        return self.density - self.reference

    @classmethod
    def of(
        cls,
        case: Case,
        strip: Strip,
        temperature: Floats,
        fractions: Fractions | None = None,
        amount: float | None = None,
    ) -> GasState:
        """The state at the `temperature` of own cells [K], with the mole `fractions` of a mixture there; collective.

        Without outlets p0 is what keeps the `amount` of gas, the volume integral of the relative density [m2].
        """
        names = list(fractions or {})
        own = np.stack([temperature, *((fractions or {})[name] for name in names)])
        hot, *shares = strip.scatter.to_all(own)[:, strip.cell]
        pressure = 1.0
        if amount is not None and not case.geometry.outlets:
            pressure = amount / gas_amount(strip, case.gas.temperature / hot)
        return cls.local(case, hot, dict(zip(names, shares, strict=True)), pressure)

    @classmethod
    def local(cls, case: Case, temperature: Floats, fractions: Fractions, pressure: float) -> GasState:
        """The state of local cells that have these."""
        gas, species = case.gas, case.mechanism.species
        mass = mass_ratio(species, gas.molar_mass, fractions) + 0.0 * temperature
        thicker = viscosity_ratio(species, gas.molar_mass, gas.viscosity, fractions)
        relative = gas.temperature / temperature * pressure
        viscosity = gas.viscosity_at(temperature) * thicker
        return cls(temperature, relative, viscosity, gas.density, pressure, fractions, mass)

    def stored(self, own: int) -> Floats:
        """What `restored` needs of own cells: temperature, then pressure, then mole fractions in the order of their names."""
        pressure = np.full(own, self.pressure)
        shares = [self.fractions[name][:own] for name in sorted(self.fractions)]
        return np.stack([self.temperature[:own], pressure, *shares])

    @classmethod
    def restored(cls, case: Case, strip: Strip, stored: Floats, names: Sequence[str]) -> GasState:
        """The state of `stored` in grid order, with the mole fractions of these species."""
        hot, _, *shares = stored[:, strip.cell]
        fractions = dict(zip(sorted(names), shares, strict=True))
        return cls.local(case, hot, fractions, float(stored[1, 0]))


def gas_amount(strip: Strip, relative: Floats) -> float:
    """Volume integral of a relative density (local cells,) over the gas [m2, m3 per metre of depth]; collective."""
    own = slice(0, strip.owned)
    return float(total(strip.comm, [relative[own] @ strip.gas_volume[own]])[0])
