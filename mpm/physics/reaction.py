"""A reaction: what an event changes, and how often it happens.

Rates are *rates of progress* of the reaction as written (Fluent's convention, equations 5-17 to 5-19), way there less way back:

    surface   r = k_f prod C^eta prod theta^mu - k_b prod C^eta' prod theta^mu'   [mol/m2/s]
    gas       r = k_f prod C^eta - k_b prod C^eta'                               [mol/m3 of gas/s]
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from mpm.arrays import Floats
from mpm.physics.rates import Arrhenius, Law, Sticking


@dataclass(frozen=True, kw_only=True)
class Reaction:
    """What both kinds have: the key in the file, the equation, the laws of its two ways, and what an event changes.

    nu_gas: signed molecules of each gas species per event, products positive. equilibrium: K of concentrations [mol/m3] and coverages,
    which makes k_b of k_f; with a `backward` law that has no constant and none given, K follows from thermochemistry. given_heat: J/mol of
    events, in place of enthalpies.
    """

    key: str
    equation: str
    forward: Law
    backward: Law | None = None
    equilibrium: Arrhenius | None = None
    nu_gas: Mapping[str, float]
    given_heat: float | None = None

    @property
    def changes(self) -> Mapping[str, float]:
        """Signed amounts of all that an event changes: gas, sites and films."""
        return self.nu_gas

    @property
    def laws(self) -> tuple[Law, ...]:
        """Those of its one way or its two."""
        return (self.forward,) if self.backward is None else (self.forward, self.backward)

    @property
    def ways(self) -> Iterator[tuple[float, Law]]:
        """1 and the law of the way there, -1 and that of the way back if there is one: the sign is that of all changes."""
        return zip((1.0, -1.0), self.laws, strict=False)

    @property
    def reactants(self) -> tuple[str, ...]:
        """The gas species whose concentrations set the rate of the way there."""
        return tuple(self.forward.gas_orders)

    @property
    def gases(self) -> tuple[str, ...]:
        """The gas species whose concentrations set the rate of either way."""
        return tuple(dict.fromkeys(name for law in self.laws for name in law.gas_orders))

    def runs(self, present: Collection[str]) -> bool:
        """Whether all gases of one of its ways are among the species that are present."""
        return any(set(law.gas_orders) <= set(present) for law in self.laws)

    def consumes(self, species: str) -> bool:
        """Whether one of its ways takes up this gas."""
        return any(sign * self.nu_gas.get(species, 0.0) < 0.0 for sign, _ in self.ways)

    def __str__(self) -> str:
        return self.equation


@dataclass(frozen=True, kw_only=True)
class SurfaceReaction(Reaction):
    """Sites take part, with gases or without.

    nu_site, film: signed site species and formula units of solid products per event, so (5-18) has nu_gas = {H2O: -3, CH4: 4},
    nu_site = {OAl(CH3)2: -2, OH: 2}, film = {Al2O3: 1}.
    """

    nu_site: Mapping[str, float]
    film: Mapping[str, float] = field(default_factory=dict)

    @property
    def changes(self) -> Mapping[str, float]:
        """Signed amounts of all that an event changes: gas, sites and films."""
        return {**self.nu_gas, **self.nu_site, **self.film}

    @property
    def is_first_order(self) -> bool:
        """Whether it is r = k(T) C theta of one gas that it takes up and one site that it turns over, with no way back."""
        return (
            self.backward is None
            and self.forward.is_first_order
            and self.nu_gas.get(self.gas, 0.0) < 0.0
            and self.nu_site.get(self.site, 0.0) < 0.0
            and all(nu > 0.0 for name, nu in self.nu_site.items() if name != self.site)
        )

    @property
    def gas(self) -> str:
        """The gas of a reaction that has one: the first of several."""
        return self.reactants[0]

    @property
    def site(self) -> str:
        """The site species that the way there meets: the first of several."""
        return next(iter(self.forward.site_orders))

    def rate_constant(self, temperature: ArrayLike) -> Floats:
        """k of the way there as it is given (m/s for one gas and one site), of the shape of `temperature` [K]."""
        constant = self.forward.constant
        if constant is None:  # the way there always has one
            raise ValueError(self.equation)
        return constant.at(temperature)

    def sticking_coefficient(self, temperature: ArrayLike) -> Floats | None:
        """Share of the collisions with reactive places that react at `temperature` [K]: sticking (T/T_ref)^b exp(-Ea/(R T)).

        None for a reaction whose rate constant is given by A.

        Chemkin and Cantera write the same as a T^b exp(-Ea/(R T)), that is with T_ref = 1 K (Cantera, "Sticking reactions"; Kee, Coltrin,
        Glarborg, Chemically Reacting Flow, 2003, section 11.5).
        """
        constant = self.forward.constant
        return constant.share.at(temperature) if isinstance(constant, Sticking) else None

    @property
    def product_sites(self) -> tuple[str, ...]:
        """The states that the sites change to."""
        return tuple(name for name, nu in self.nu_site.items() if nu > 0.0)

    @property
    def molecules_per_site(self) -> float:
        """Molecules of the gas that turn over one site, for a reaction of first order: 1 in (5-17), 1.5 in (5-18)."""
        return self.nu_gas.get(self.gas, 0.0) / self.nu_site[self.site]


@dataclass(frozen=True, kw_only=True)
class GasReaction(Reaction):
    """Species meet in the gas, or one of them falls apart."""

    def rate_constant(self, temperature: ArrayLike) -> Floats:
        """k of the way there, of the shape of `temperature` [K]; m3/mol/s where the orders add up to two."""
        constant = self.forward.constant
        if constant is None:
            raise ValueError(self.equation)
        return np.asarray(constant.at(temperature))

    @property
    def is_second_order(self) -> bool:
        """Whether it is r = k(T) C_1 C_2 of two species, with no way back."""
        return self.backward is None and list(self.forward.gas_orders.values()) == [1.0, 1.0]
