"""Sums of coverages that slow reactions alone change, told apart from those that fast ones do.

    T theta' = T theta + dt/n_s (T nu^T) r

In every cell the equations of the site species are combined so that the first one holds the fastest reaction and the others do not, the
second one the fastest of those that are left, and so on: the coefficients of nu are small rational numbers and cancel exactly. Added up in
floating point, net rates that are small differences of large ones would drown whatever happens slowly beside them: with sites that live
for microseconds and steps of years, which is a steady state, all of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mpm.arrays import Floats, Ints

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
            some = self.leading[i] >= 0
            if not some.any():
                continue
            there = slice(None) if some.all() else cells[some]
            leads, chosen = self.leading[i, there], cells[there]
            terms = np.einsum("rn,rmn->mn", self.of_reactions[i][:, there], result[:, :, there])
            missing = (wanted[i][:, there] - terms) / self.of_reactions[i, leads, chosen]
            result[leads, :, chosen] += missing.T
        return result


class Orders:
    """How the equations of sites with stoichiometry `nu` (reactions, sites) are combined, for every order in which reactions have led so
    far: a tree that starts with none of them, in which branches are made when they are first met.

    Of each order `of_sites` is T (equations, sites), `of_reactions` T nu^T (equations, reactions), `leading` what has led, -1 for nothing,
    `left` which reactions may lead next, and `next` (reactions + 1,) the order that comes of it, the last of nothing, -1 if not yet made.
    """

    def __init__(self, nu: Floats):
        self.of_sites: list[Floats] = []
        self.of_reactions: list[Floats] = []
        self.leading: list[tuple[int, ...]] = []
        self.left: list[Ints] = []
        self.next: list[Ints] = []
        self._add(np.eye(nu.shape[1]), nu.T.copy(), ())

    def _add(self, sites: Floats, reactions: Floats, leading: tuple[int, ...]) -> int:
        self.of_sites.append(sites)
        self.of_reactions.append(reactions)
        self.leading.append(leading)
        self.left.append(np.flatnonzero(reactions[len(leading) :].any(axis=0)))
        self.next.append(np.full(reactions.shape[1] + 1, -1))
        return len(self.leading) - 1

    def led_by(self, order: int, lead: int) -> int:
        """The order that comes of `order` where reaction `lead` is next: the first equation that is left holds it, no later one does."""
        if self.next[order][lead] >= 0:
            return int(self.next[order][lead])
        sites, reactions = self.of_sites[order].copy(), self.of_reactions[order].copy()
        i = len(self.leading[order])
        if lead >= 0:
            row = i + int(np.abs(reactions[i:, lead]).argmax())
            for rows in (sites, reactions):
                rows[[i, row]] = rows[[row, i]]
            factors = reactions[i + 1 :, lead] / reactions[i, lead]
            sites[i + 1 :] -= factors[:, None] * sites[i]
            reactions[i + 1 :] -= factors[:, None] * reactions[i]
            reactions[i + 1 :][np.abs(reactions[i + 1 :]) < NOTHING] = 0.0
        self.next[order][lead] = self._add(sites, reactions, (*self.leading[order], lead))
        return int(self.next[order][lead])

    def fastest(self, speed: Floats) -> Ints:
        """The order of each cell (n,) where the fastest of the reactions that are left leads, `speed` (reactions, n)."""
        found = np.zeros(speed.shape[1], dtype=np.intp)
        for _ in range(self.of_sites[0].shape[0] if len(speed) else 0):
            before = found.copy()
            here = np.flatnonzero(np.bincount(before))
            for order in here.tolist():
                cells = np.flatnonzero(before == order) if len(here) > 1 else slice(None)
                found[cells] = self._next(order, speed[self.left[order]][:, cells])
        return found

    def _next(self, order: int, speed: Floats) -> Ints | int:
        """What comes of one order in its cells, where the reactions that are left have this `speed` (left, n)."""
        if not len(speed):
            return self.led_by(order, -1)
        leads = self.left[order][speed.argmax(axis=0)]
        for lead in np.flatnonzero(np.bincount(leads)).tolist():
            self.led_by(order, lead)
        return self.next[order][leads]


@lru_cache(maxsize=64)
def _orders(nu: bytes, shape: tuple[int, int]) -> Orders:
    return Orders(np.frombuffer(nu).reshape(shape))


def combined(nu: Floats, speed: Floats) -> Combined:
    """The equations of sites with stoichiometry `nu` (reactions, sites), in cells where reactions have this gross `speed` (reactions,
    n)."""
    orders, kinds = _orders(np.ascontiguousarray(nu, dtype=float).tobytes(), nu.shape), nu.shape[1]
    found = orders.fastest(speed)
    used = np.flatnonzero(np.bincount(found)) if len(found) else np.zeros(1, dtype=np.intp)
    place = np.searchsorted(used, found)
    none = (-1,) * kinds
    leading = np.array([(*orders.leading[order], *none)[:kinds] for order in used], dtype=np.intp)
    sites, reactions = (
        np.take(np.stack([one[order] for order in used], axis=-1), place, axis=-1)
        for one in (orders.of_sites, orders.of_reactions)
    )
    return Combined(sites, reactions, leading.T[:, place])
