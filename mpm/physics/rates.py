"""Rate laws: how fast a reaction runs one way.

    r = k(T, theta) n_s^p prod_i C_i^eta_i prod_k theta_k^mu_k        [mol of events/m2/s], in the gas [mol/m3 of gas/s]
    k = A (T/T_ref)^b exp(-Ea/(R T)) prod_k 10^(a_k theta_k) theta_k^m_k exp(-E_k theta_k/(R T))

theta_k is the share of the places on a surface that species k holds. A constant per area has p = 0 (m/s for one gas); one per site, as
Chemkin and Cantera mean it, meets amounts per area: theta_k n_s/sigma_k for a species that holds sigma_k places, so p = sum mu_k. Coverage
dependence: Kee, Coltrin, Glarborg, Chemically Reacting Flow (2003), section 11.4; Cantera, "Surface Reactions".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from mpm.arrays import Floats
from mpm.constants import GAS_CONSTANT


@dataclass(frozen=True)
class Arrhenius:
    """A (T/T_ref)^b exp(-Ea/(R T)): A in SI units, Ea [J/mol], T_ref [K]."""

    A: float
    b: float = 0.0
    Ea: float = 0.0
    reference_temperature: float = 1.0

    def at(self, temperature: ArrayLike) -> Floats:
        """Its value, of the shape of `temperature` [K]; infinite where it is beyond floats."""
        T = np.asarray(temperature, dtype=float)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            activation = (T / self.reference_temperature) ** self.b * np.exp(-self.Ea / (GAS_CONSTANT * T))
            return np.asarray(self.A * activation)


@dataclass(frozen=True)
class Dependence:
    """Of a rate constant on the coverage theta of one site species: 10^(a theta) theta^m exp(-E theta/(R T)), E [J/mol]."""

    a: float = 0.0
    m: float = 0.0
    E: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Sticking:
    """A rate constant lambda sqrt(R T/(2 pi M)) [m/s], or with Motz and Wise (1960) lambda/(1 - lambda/2) times that speed.

    lambda is `share` at the temperature: of the molecules of molar mass `molar_mass` [kg/mol] that hit reactive places, those that react.
    Their flux onto a wall is C sqrt(R T/(2 pi M)); where many react, the gas at the wall is no longer at equilibrium, which the correction
    accounts for.
    """

    share: Arrhenius
    molar_mass: float
    motz_wise: bool = False

    def at(self, temperature: ArrayLike) -> Floats:
        """k [m/s], of the shape of `temperature` [K]."""
        T = np.asarray(temperature, dtype=float)
        share = self.share.at(T)
        if self.motz_wise:
            share = share / (1.0 - 0.5 * share)
        return np.asarray(share * np.sqrt(GAS_CONSTANT * T / (2.0 * np.pi * self.molar_mass)))


@dataclass(frozen=True, kw_only=True)
class Law:
    """One way of a reaction: its `constant`, the orders of gases eta and of site species mu, the power p of the site density in it, and
    its dependence on coverages. No constant: it follows from that of the other way and an equilibrium."""

    constant: Arrhenius | Sticking | None
    gas_orders: Mapping[str, float] = field(default_factory=dict)
    site_orders: Mapping[str, float] = field(default_factory=dict)
    per_site: float = 0.0
    coverage: Mapping[str, Dependence] = field(default_factory=dict)

    @property
    def is_first_order(self) -> bool:
        """Whether one gas meets one site, r = k C theta with k of temperature alone."""
        return (
            list(self.gas_orders.values()) == [1.0]
            and list(self.site_orders.values()) == [1.0]
            and not self.coverage
            and not self.per_site
        )
