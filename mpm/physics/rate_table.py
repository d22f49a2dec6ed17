"""Rates of general laws in many cells at once, and their derivatives: `mpm.physics.rates` with numbers in it.

What gases contribute, k(T) n_s^p prod C^eta, stays while coverages are sought; only prod theta^mu and the dependence on coverage follow
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm.arrays import Floats
from mpm.constants import GAS_CONSTANT
from mpm.physics.powers import power
from mpm.physics.rates import Dependence, Law

if TYPE_CHECKING:
    from mpm.physics.mechanism import Mechanism
    from mpm.physics.reaction import Reaction


@dataclass(frozen=True)
class Way:
    """One way of reaction number `reaction`: orders and dependences by the numbers of gases and sites.

    It counts as `sign` events of reaction number `counted`: that reaction itself, or the first one that it undoes.
    """

    reaction: int
    back: bool
    counted: int
    sign: float
    gases: tuple[tuple[int, float], ...]
    sites: tuple[tuple[int, float], ...]
    coverage: tuple[tuple[int, Dependence], ...]


@dataclass(frozen=True, eq=False)
class GasPart:
    """Of every way, k(T) n_s^p prod C^eta (ways, n), and its derivatives by the concentrations (ways, gases, n)."""

    values: Floats
    slopes: Floats

    def part(self, chosen: NDArray[np.integer]) -> GasPart:
        """In some of the cells."""
        return GasPart(self.values.take(chosen, axis=1), self.slopes.take(chosen, axis=2))


@dataclass(frozen=True, eq=False)
class Rates:
    """Net rates of reactions (reactions, n), `gross` of both ways added, and derivatives of the net ones by concentrations (reactions,
    gases, n) and coverages (reactions, sites, n)."""

    net: Floats
    gross: Floats
    by_gas: Floats
    by_site: Floats


class RateTable:
    """The ways of `reactions` among these `gases` and the sites of a mechanism, on surfaces with `sites` n_s (n,) [mol/m2].

    Reactions that undo each other, such as an adsorption and a desorption that a file lists apart, are counted as one that goes both ways,
    the first: what is left of them is known, while the difference of two large numbers of events would not be.
    """

    def __init__(
        self, mechanism: Mechanism, reactions: Sequence[Reaction], gases: Sequence[str], sites: Floats
    ):
        self._mechanism, self._reactions, self._sites = mechanism, reactions, sites
        self._gases, self._kinds = len(gases), len(mechanism.sites)
        numbers = {name: i for i, name in enumerate(gases)}
        places = {name: k for k, name in enumerate(mechanism.site_names)}
        counted = [_counted(r, reactions) for r in range(len(reactions))]
        self.ways = [
            _way(r, sign, counted[r], reaction, law, numbers, places)
            for r, reaction in enumerate(reactions)
            for sign, law in reaction.ways
            if set(law.gas_orders) <= set(numbers)
        ]
        self._constants = np.zeros((len(self.ways), len(sites)))
        self._thermal = np.zeros_like(sites)  # R T [J/mol]

    def heat_to(self, temperature: ArrayLike) -> None:
        """Take the rate constants at another temperature [K], scalar or per cell."""
        T = np.broadcast_to(np.asarray(temperature, dtype=float), self._sites.shape)
        self._thermal = GAS_CONSTANT * T
        both = [self._mechanism.rate_constants(r, T, self._sites) for r in self._reactions]
        for w, way in enumerate(self.ways):
            self._constants[w] = both[way.reaction][int(way.back)]

    def part(self, chosen: NDArray[np.integer]) -> RateTable:
        """The same ways in some of the cells."""
        other = object.__new__(RateTable)
        other.__dict__.update(self.__dict__)
        other._sites, other._thermal = self._sites[chosen], self._thermal[chosen]
        other._constants = self._constants.take(chosen, axis=1)
        return other

    def gas_part(self, concentration: Floats) -> GasPart:
        """What the gases contribute at concentrations (gases, n) >= 0 [mol/m3]."""
        values = self._constants.copy()
        slopes = np.zeros((len(self.ways), self._gases, values.shape[1]))
        for w, way in enumerate(self.ways):
            powers = [(g, *power(concentration[g], order)) for g, order in way.gases]
            for i, (g, _, slope) in enumerate(powers):
                others = [value for j, (_, value, _) in enumerate(powers) if j != i]
                slopes[w, g] = _product(self._constants[w] * slope, others)
            values[w] = _product(values[w], [value for _, value, _ in powers])
        return GasPart(values, slopes)

    def rates(self, gas: GasPart, theta: Floats) -> Rates:
        """All rates at coverages (sites, n)."""
        count, n = len(self._reactions), theta.shape[1]
        net, gross = np.zeros((count, n)), np.zeros((count, n))
        by_gas, by_site = np.zeros((count, self._gases, n)), np.zeros((count, self._kinds, n))
        for w, way in enumerate(self.ways):
            share, slopes = self._surface_part(way, theta)
            rate = gas.values[w] * share
            net[way.counted] += way.sign * rate
            gross[way.counted] += rate
            for g, _ in way.gases:
                by_gas[way.counted, g] += way.sign * share * gas.slopes[w, g]
            for k, slope in slopes.items():
                by_site[way.counted, k] += way.sign * gas.values[w] * slope
        return Rates(net, gross, by_gas, by_site)

    def _surface_part(self, way: Way, theta: Floats) -> tuple[Floats, dict[int, Floats]]:
        """prod theta^mu times the dependence on coverage (n,), and its slopes by site."""
        factors = [(k, *power(theta[k], order)) for k, order in way.sites]
        factors += [
            (k, *factor) for k, dependence in way.coverage for factor in self._factors(dependence, theta[k])
        ]
        slopes: dict[int, Floats] = {}
        for i, (k, _, slope) in enumerate(factors):
            own = _product(slope, [value for j, (_, value, _) in enumerate(factors) if j != i])
            slopes[k] = slopes[k] + own if k in slopes else own
        return _product(np.ones(theta.shape[1]), [value for _, value, _ in factors]), slopes

    def _factors(self, on: Dependence, theta: Floats) -> list[tuple[Floats, Floats]]:
        """10^(a theta) exp(-E theta/(R T)) and theta^m, each with its slope."""
        exponent = on.a * np.log(10.0) - on.E / self._thermal
        value = np.exp(exponent * theta)
        factors = [(value, exponent * value)]
        return [*factors, power(theta, on.m)] if on.m else factors


def _counted(number: int, reactions: Sequence[Reaction]) -> tuple[int, float]:
    """The first of the `reactions` that changes as much as this one, or as much the other way, with the same heat; and 1 or -1."""
    this = reactions[number]
    for first, other in enumerate(reactions[:number]):
        for sign in (1.0, -1.0):
            alike = {name: sign * nu for name, nu in other.changes.items()} == dict(this.changes)
            heats = (other.given_heat, this.given_heat)
            if alike and (
                heats == (None, None) or (None not in heats and sign * (heats[0] or 0.0) == heats[1])
            ):
                return first, sign
    return number, 1.0


def _way(
    number: int,
    sign: float,
    counted: tuple[int, float],
    reaction: Reaction,
    law: Law,
    gases: dict[str, int],
    sites: dict[str, int],
) -> Way:
    """An order of zero counts where the way uses up what it belongs to: there the rate must end with it."""
    changes = reaction.changes

    def counts(name: str, order: float) -> bool:
        return order != 0.0 or sign * changes.get(name, 0.0) < 0.0

    return Way(
        number,
        sign < 0.0,
        counted[0],
        sign * counted[1],
        tuple((gases[name], order) for name, order in law.gas_orders.items() if counts(name, order)),
        tuple((sites[name], order) for name, order in law.site_orders.items() if counts(name, order)),
        tuple((sites[name], dependence) for name, dependence in law.coverage.items()),
    )


def _product(first: Floats, others: Sequence[Floats]) -> Floats:
    result = first
    for other in others:
        result = result * other
    return result
