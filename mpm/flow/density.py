"""Density that follows the temperature step by step, and how far temperatures have moved.

Density is that of the temperature at the beginning of a step, rho = rho(T^n), and what a cell then holds too much flows out during the
step,

    div m = -eps (rho - rho_before) / dt,

so that gas, species and heat, which are carried with m, are conserved together to rounding whatever the step. A density that would change
by less than SAME stays as it is: a strip at rest in temperature costs what one without heat does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.flow.state import GasState, gas_amount
from mpm.parallel import largest, total

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.mesh.strip import Strip

# largest relative change of the density that is not followed: 5 mK; what a base strip then gives off at once is 1 % of what flows through
# it
SAME = 1e-5


class Density:
    """The state of the gas and what it has given off in the present step.

    `changed` tells whether the density is another one than in the step before, `source` (own,) [m2/s] is what flows out of each cell then.
    """

    def __init__(self, case: Case, strip: Strip, temperature: Floats, same: float = SAME):
        self.case, self.strip, self._same = case, strip, same
        self.gas = GasState.of(case, strip, temperature)
        self._amount = gas_amount(strip, self.gas.relative)
        self.changed = False
        self.source = np.zeros(strip.owned)

    def follow(self, temperature: Floats, dt: float) -> None:
        """Take over the `temperature` of own cells [K] for a step of `dt` [s]; collective."""
        new = GasState.of(self.case, self.strip, temperature, self._amount)
        own = slice(0, self.strip.owned)
        moved = np.abs(new.relative[own] / self.gas.relative[own] - 1.0).max(initial=0.0)
        self.changed = bool(largest(self.strip.comm, [moved])[0] > self._same)
        self.source = np.zeros(self.strip.owned)
        if self.changed:
            lost = self.gas.relative[own] - new.relative[own]
            self.source = lost * self.strip.gas_volume[own] / dt
            self.gas = new

    def take(self, temperature: Floats) -> None:
        """Be in the steady state at the `temperature` of own cells [K]; collective."""
        self.gas = GasState.of(self.case, self.strip, temperature, self._amount)

    def stored(self) -> dict[str, Any]:
        """Arrays of a restart state, in grid order on rank 0."""
        own = self.strip.owned
        return {
            "density": self.strip.scatter.to_root(
                np.stack([self.gas.temperature, self.gas.relative])[:, :own]
            ),
            "amount": self._amount,
            "changed": self.changed,
        }

    def restore(self, stored: dict[str, Any]) -> None:
        """The inverse of `stored`, on every rank."""
        self.gas = restored_state(self.case, stored["density"][:, self.strip.cell])
        self._amount, self.changed = float(stored["amount"]), bool(stored["changed"])


def restored_state(case: Case, values: Floats) -> GasState:
    """The state with these temperatures and relative densities (2, local cells)."""
    temperature, relative = values
    pressure = 1.0
    if not case.geometry.outlets and len(temperature):
        pressure = float(relative[0] * temperature[0] / case.gas.temperature)
    return GasState(temperature, relative, case.gas.viscosity_at(temperature), case.gas.density, pressure)


def moved(strip: Strip, temperature: Floats, since: Floats) -> float:
    """Largest mean over a layer of |T/T_then - 1| of own cells; collective."""
    own, grid = strip.owned, strip.grid
    layer, weights = grid.row_layer[strip.row[:own]], strip.volume[:own]
    count = len(grid.layer_names)
    change = np.abs(temperature[:own] / since[:own] - 1.0)
    sums = total(
        strip.comm, [np.bincount(layer, change * weights, count), np.bincount(layer, weights, count)]
    )
    return float((sums[0] / sums[1]).max())
