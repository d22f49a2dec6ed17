"""The gas in the cells of a strip that is not everywhere equally hot: its density and viscosity.

    rho = p0 M / (R T),    p0 the ambient pressure

(incompressible ideal gas: pressure differences of the flow are small beside p0). Where the temperature is that of `[gas]` everywhere,
nobody needs a state: density and viscosity are those of the case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpm.arrays import Floats
from mpm.mesh.strip import Strip
from mpm.parallel import total

if TYPE_CHECKING:
    from mpm.case.case import Case


@dataclass(frozen=True, eq=False)
class GasState:
    """Temperature [K], density over that of the case's `[gas]`, and viscosity [Pa s] in every local cell.

    `reference` [kg/m3] is the density of the case, `pressure` p0 over that of the case: 1 but in a closed strip, where heating raises it.
    """

    temperature: Floats
    relative: Floats
    viscosity: Floats
    reference: float
    pressure: float = 1.0

    @property
    def buoyant(self) -> Floats:
        """Density less that of the case [kg/m3], whose weight the pressure balances everywhere."""
        return self.reference * (self.relative - 1.0)

    @classmethod
    def of(cls, case: Case, strip: Strip, temperature: Floats, amount: float | None = None) -> GasState:
        """The state at the `temperature` of own cells [K]; collective.

        Without outlets p0 is what keeps the `amount` of gas, the volume integral of the relative density [m2].
        """
        everywhere = strip.scatter.to_all(temperature)[strip.cell]
        relative, pressure = case.gas.temperature / everywhere, 1.0
        if amount is not None and not case.geometry.outlets:
            pressure = amount / gas_amount(strip, relative)
        return cls(
            everywhere, relative * pressure, case.gas.viscosity_at(everywhere), case.gas.density, pressure
        )


def gas_amount(strip: Strip, relative: Floats) -> float:
    """Volume integral of a relative density (local cells,) over the gas [m2, m3 per metre of depth]; collective."""
    own = slice(0, strip.owned)
    return float(total(strip.comm, [relative[own] @ strip.gas_volume[own]])[0])
