"""Sums of coverages that slow reactions alone change, told apart from those that fast ones do.

    T theta' = T theta + dt/n_s (T nu^T) r

In every cell the equations of the site species are combined so that the first one holds the fastest reaction and the others do not, the
second one the fastest of those that are left, and so on: the coefficients of nu are small rational numbers and cancel exactly. Added up in
floating point, net rates that are small differences of large ones would drown whatever happens slowly beside them: with sites that live
for microseconds and steps of years, which is a steady state, all of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.physics.small_systems import swap_rows

NOTHING = 1e-12  # of a combined coefficient: what rounding leaves of one that is zero


@dataclass(frozen=True, eq=False)
class Combined:
    """T (equations, sites, n), T nu^T (equations, reactions, n), and the reaction that each equation is there for, `leading`
    (equations, n): no later equation holds it, -1 where none is left."""

    of_sites: Floats
    of_reactions: Floats
    leading: Ints

    def sum_sites(self, values: Floats) -> Floats:
        """T of values by site (sites, m, n)."""
        return np.asarray(np.einsum("ikn,kmn->imn", self.of_sites, values))

    def sum_reactions(self, values: Floats) -> Floats:
        """T nu^T of values by reaction (reactions, m, n)."""
        return np.asarray(np.einsum("irn,rmn->imn", self.of_reactions, values))

    def corrected(self, values: Floats, wanted: Floats) -> Floats:
        """Rates (reactions, m, n) whose combinations are those `wanted` (equations, m, n): from `values`, by changing the leading reaction
        of each equation, the slowest first."""
        result, cells = values.copy(), np.arange(values.shape[2])
        for i in reversed(range(len(self.leading))):
            chosen = cells[self.leading[i] >= 0]
            leads = self.leading[i, chosen]
            terms = np.einsum("rn,rmn->mn", self.of_reactions[i][:, chosen], result[:, :, chosen])
            missing = (wanted[i][:, chosen] - terms) / self.of_reactions[i, leads, chosen]
            result[leads, :, chosen] += missing.T
        return result


def combined(nu: Floats, speed: Floats) -> Combined:
    """The equations of sites with stoichiometry `nu` (reactions, sites), in cells where reactions have this gross `speed` (reactions,
    n)."""
    kinds, n = nu.shape[1], speed.shape[1]
    cells = np.arange(n)
    reactions = np.repeat(nu.T[:, :, None], n, axis=2)
    sites = np.repeat(np.eye(kinds)[:, :, None], n, axis=2)
    leading = np.full((kinds, n), -1)
    for i in range(kinds if len(nu) else 0):
        left = np.abs(reactions[i:]).max(axis=0) > 0.0
        speeds = np.where(left, speed, -1.0)
        fastest = speeds.argmax(axis=0)
        some = left[fastest, cells]
        row = i + np.abs(reactions[i:, fastest, cells]).argmax(axis=0)
        swap_rows(reactions, i, row)
        swap_rows(sites, i, row)
        leading[i] = np.where(some, fastest, -1)
        pivot = np.where(some, reactions[i, fastest, cells], 1.0)
        for j in range(i + 1, kinds):
            factor = np.where(some, reactions[j, fastest, cells], 0.0) / pivot
            reactions[j] -= factor * reactions[i]
            sites[j] -= factor * sites[i]
            reactions[j][np.abs(reactions[j]) < NOTHING] = 0.0
    return Combined(sites, reactions, leading)
