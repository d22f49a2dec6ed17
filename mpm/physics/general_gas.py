"""Gas reactions of any rate law in many cells at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm.arrays import Floats
from mpm.physics.rate_table import RateTable

if TYPE_CHECKING:
    from mpm.physics.mechanism import Mechanism


class GeneralGas:
    """Gas reactions among the coupled species: net rates k_f prod C^eta - k_b prod C^eta' [mol per m3 of gas per s]."""

    def __init__(self, mechanism: Mechanism, coupled: Sequence[str], cells: int, temperature: ArrayLike):
        self.reactions = mechanism.running_gas(coupled)
        self._kinds = len(mechanism.sites)
        self._table = RateTable(mechanism, self.reactions, coupled, np.ones(cells))
        self.heat_to(temperature)

    def heat_to(self, temperature: ArrayLike) -> None:
        """Take the rate constants at another temperature [K], scalar or per cell."""
        self._table.heat_to(temperature)

    def part(self, chosen: NDArray[np.integer]) -> GeneralGas:
        """The same reactions in some of the cells."""
        other = object.__new__(GeneralGas)
        other.__dict__.update(self.__dict__)
        other._table = self._table.part(chosen)
        return other

    def rates(self, concentration: Floats) -> tuple[Floats, Floats]:
        """Rates (reactions, n) and derivatives (reactions, coupled, n), along the tangents at zero where a concentration is negative."""
        gas = self._table.gas_part(np.maximum(concentration, 0.0))
        at = self._table.rates(gas, np.zeros((self._kinds, concentration.shape[1])))
        below = np.minimum(concentration, 0.0)
        return at.net + np.einsum("rjn,jn->rn", at.by_gas, below), at.by_gas
