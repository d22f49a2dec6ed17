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
from mpm.physics.mixture import Fractions
from mpm.physics.roles import Roles

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
        roles = Roles.of(case.mechanism, set(case.fed_species))
        self.names = sorted((*roles.coupled, *roles.products)) if case.gas.mixture else []
        nothing = dict.fromkeys(self.names, np.zeros(strip.owned))
        self.gas = GasState.of(case, strip, temperature, nothing)
        self._amount = gas_amount(strip, self.gas.relative)
        self.changed = False
        self.source = np.zeros(strip.owned)

    def follow(self, temperature: Floats, fractions: Fractions, dt: float) -> None:
        """Take over the `temperature` of own cells [K] and the mole `fractions` of a mixture for a step of `dt` [s]; collective."""
        new, old, own = self._state(temperature, fractions), self.gas, slice(0, self.strip.owned)
        most = max(
            np.abs(new.relative[own] / old.relative[own] - 1.0).max(initial=0.0),
            np.abs(new.mass[own] / old.mass[own] - 1.0).max(initial=0.0),
            np.abs(new.temperature[own] / old.temperature[own] - 1.0).max(initial=0.0),  # at constant volume
        )
        self.changed = bool(largest(self.strip.comm, [most])[0] > self._same)
        self.source = np.zeros(self.strip.owned)
        if self.changed:
            lost = old.relative[own] - new.relative[own]
            self.source = lost * self.strip.gas_volume[own] / dt
            self.gas = new

    def take(self, temperature: Floats, fractions: Fractions) -> None:
        """Be in the steady state at the `temperature` of own cells [K] and with these mole fractions of a mixture; collective."""
        self.gas = self._state(temperature, fractions)

    def _state(self, temperature: Floats, fractions: Fractions) -> GasState:
        chosen = {name: fractions[name] for name in self.names}
        return GasState.of(self.case, self.strip, temperature, chosen, self._amount)

    def stored(self) -> dict[str, Any]:
        """Arrays of a restart state, in grid order on rank 0."""
        return {"density": self.store(self.gas), "amount": self._amount, "changed": self.changed}

    def restore(self, stored: dict[str, Any]) -> None:
        """The inverse of `stored`, on every rank."""
        self.gas = self.restored(stored["density"])
        self._amount, self.changed = float(stored["amount"]), bool(stored["changed"])

    def store(self, gas: GasState) -> Floats | None:
        """A state for a restart, in grid order on rank 0 (None elsewhere); collective."""
        return self.strip.scatter.to_root(gas.stored(self.strip.owned))

    def restored(self, stored: Floats) -> GasState:
        """The inverse of `store`, on every rank."""
        return GasState.restored(self.case, self.strip, stored, self.names)


def moved(strip: Strip, now: GasState, then: GasState) -> float:
    """Largest mean over a layer of |T/T_then - 1|, and of that of the molar mass of a mixture; collective."""
    own, grid = slice(0, strip.owned), strip.grid
    layer, weights = grid.row_layer[strip.row[own]], strip.volume[own]
    count = len(grid.layer_names)
    warmer, heavier = (
        np.abs(new[own] / old[own] - 1.0)
        for new, old in ((now.temperature, then.temperature), (now.mass, then.mass))
    )
    rows = [np.bincount(layer, change * weights, count) for change in (warmer, heavier)]
    *sums, volume = total(strip.comm, [*rows, np.bincount(layer, weights, count)])
    return float(np.max(np.stack(sums) / volume))
