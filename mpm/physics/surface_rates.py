"""Rates of surface reactions by both of their ways, of one surface in one gas: what an integrator in time asks for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GAS_CONSTANT

if TYPE_CHECKING:
    from mpm.physics.mechanism import Mechanism

_LEAST = 1e-7
"""Coverage below which powers of it are bent into a line through zero: half an order has no slope there."""


class SurfaceRates:
    """Rates of the surface reactions in a gas of these concentrations [mol/m3], at `temperature` [K] with n_s [mol/m2] places.

    Each way of a reaction is k prod theta^mu exp(e . theta): `constant` (ways,) with the gas in it, `orders`, `exponents` (ways, sites),
    `taking` which coverages count; `change` (sites, ways) and `uptake` (gases of `species`, ways) per place and second.
    """

    def __init__(
        self, mechanism: Mechanism, gas: Mapping[str, float], temperature: float, site_density: float
    ) -> None:
        self.sites, self.species = mechanism.site_names, mechanism.species_names
        names = self.sites
        constant, orders, taking = [], [], []
        exponents, change, uptake = [], [], []
        for reaction in mechanism.surface_reactions:
            constants = mechanism.rate_constants(reaction, temperature, site_density)
            for k, (sign, law) in zip(constants, reaction.ways, strict=False):
                amounts = [(gas.get(name, 0.0), order) for name, order in law.gas_orders.items()]
                if any(amount <= 0.0 for amount, _ in amounts):
                    continue  # whatever its order: none of it reacts
                bends = [law.coverage.get(name) for name in names]
                constant.append(float(k) * np.prod([amount**order for amount, order in amounts]))
                powers = [b.m if b else 0.0 for b in bends]
                orders.append([law.site_orders.get(n, 0.0) + m for n, m in zip(names, powers, strict=True)])
                taking.append([n in law.site_orders or m != 0.0 for n, m in zip(names, powers, strict=True)])
                exponents.append(
                    [b.a * np.log(10.0) - b.E / (GAS_CONSTANT * temperature) if b else 0.0 for b in bends]
                )
                change.append([sign * reaction.nu_site.get(n, 0.0) for n in names])
                uptake.append([-sign * reaction.nu_gas.get(n, 0.0) for n in self.species])
        count = len(constant)
        self.constant = np.array(constant).reshape(count)
        self.orders = np.array(orders).reshape(count, len(names))
        self.taking = np.array(taking, dtype=bool).reshape(count, len(names))
        self.exponents = np.array(exponents).reshape(count, len(names))
        self.change = (np.array(change).reshape(count, len(names)) * mechanism.places).T / site_density
        self.uptake = np.array(uptake).reshape(count, len(self.species)).T / site_density

    def __call__(self, theta: Floats) -> Floats:
        """Events of every way [mol/m2/s] at coverages (sites,)."""
        return np.asarray(self.constant * np.prod(self._powers(theta), axis=1) * self._bent(theta))

    def taken(self, coverage: Mapping[str, float]) -> dict[str, float]:
        """Molecules of each gas per place and second, net, that a surface of this coverage takes up."""
        theta = np.array([coverage.get(name, 0.0) for name in self.sites])
        return dict(zip(self.species, map(float, self.uptake @ self(theta)), strict=True))

    def slopes(self, theta: Floats) -> Floats:
        """Their derivatives by the coverages, (ways, sites)."""
        powers, size = self._powers(theta), np.hypot(theta, _LEAST)
        steepness = (
            self.taking * (1.0 + (self.orders - 1.0) * (theta / size) ** 2) * size ** (self.orders - 1.0)
        )
        whole = self.constant * self._bent(theta)
        others = np.stack([np.prod(np.delete(powers, k, axis=1), axis=1) for k in range(len(theta))], axis=1)
        return np.asarray(
            whole[:, None] * (steepness * others + np.prod(powers, axis=1)[:, None] * self.exponents)
        )

    def _powers(self, theta: Floats) -> Floats:
        """theta^mu (ways, sites), smooth through zero and negative beyond it, as a solver's errors want it."""
        return np.where(self.taking, theta * np.hypot(theta, _LEAST) ** (self.orders - 1.0), 1.0)

    def _bent(self, theta: Floats) -> Floats:
        return np.asarray(np.exp(self.exponents @ theta))
