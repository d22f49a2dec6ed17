"""Rates of surface and gas reactions in many cells at once, implicit in the coverage.

Surface reaction r consumes gas g(r) on sites s(r):  rate r_r = k_r(T) C_g theta_s  [mol/m2/s].
Over a step dt the coverages of a cell follow its new concentrations,

    theta' = theta + (dt/n_s) sum_r nu_r r_r(C', theta'),   that is   (I - dt Q(C')) theta' = theta,

with Q a matrix whose off-diagonal entries are >= 0 and whose columns sum to zero, because every reaction conserves sites. Hence
theta' >= 0 and sum theta' = sum theta for any C' >= 0 and any step: coverage stays within [0, 1] by construction. A negative
concentration (a Newton iterate) leaves Q as it is at zero and enters r_r linearly, which keeps the uptake monotone and concave.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from mpm.chemistry import Mechanism

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Roles:
    """Which species a run has to follow.

    `coupled` react and are solved together; `products` are only made (or inert) and follow one by one; all others stay absent
    because nothing feeds or makes them.
    """

    coupled: tuple[str, ...]
    products: tuple[str, ...]

    @classmethod
    def of(cls, mechanism: Mechanism, fed: set[str]) -> Roles:
        """Species that can appear when `fed` enter: a reaction runs once all its gas reactants are present."""
        present = set(fed)
        while True:
            made = {
                name
                for reaction in (*mechanism.surface_reactions, *mechanism.gas_reactions)
                if reactants(reaction) <= present
                for name in stoichiometry(reaction)
            }
            if made <= present:
                break
            present |= made
        running = [r for r in (*mechanism.surface_reactions, *mechanism.gas_reactions) if reactants(r) <= present]
        reacting = {name for reaction in running for name in reactants(reaction)}
        order = [name for name in mechanism.species_names if name in present]
        return cls(tuple(n for n in order if n in reacting), tuple(n for n in order if n not in reacting))


def reactants(reaction) -> set[str]:
    """Gas species whose concentrations set the rate of a surface or gas reaction."""
    return {reaction.gas} if hasattr(reaction, "gas") else set(reaction.reactants)


def stoichiometry(reaction) -> dict[str, float]:
    """Signed gas stoichiometry of a surface or gas reaction, per event."""
    return reaction.nu_gas if hasattr(reaction, "nu_gas") else reaction.nu


class SurfaceKinetics:
    """Surface reactions in `n` cells with area `surface` S [1/m] and `sites` n_s [mol/m2], temperature [K] scalar or per cell."""

    def __init__(self, mechanism: Mechanism, coupled: tuple[str, ...], surface: Floats, sites: Floats, temperature: ArrayLike):
        self.coupled, self.surface, self.sites = coupled, surface, sites
        names = mechanism.site_names
        self.reactions = [r for r in mechanism.surface_reactions if r.gas in coupled]
        self.gas = [coupled.index(r.gas) for r in self.reactions]
        self.site = [names.index(r.site) for r in self.reactions]
        molar_mass = {s.name: s.molar_mass for s in mechanism.species}
        t = np.broadcast_to(np.asarray(temperature, dtype=float), surface.shape)
        self.constant = [np.asarray(r.rate_constant(t, molar_mass[r.gas])) * np.ones_like(t) for r in self.reactions]
        self.nu_site = np.array([[r.nu_site.get(k, 0.0) for k in names] for r in self.reactions]).reshape(-1, len(names))
        self.nu_gas = np.array([[r.nu_gas.get(k, 0.0) for k in coupled] for r in self.reactions]).reshape(-1, len(coupled))

    def coverage(self, concentration: Floats, theta: Floats, dt: float) -> Floats:
        """theta' (sites, n) after `dt` [s] at the new concentrations (coupled, n) [mol/m3]."""
        rates = self._site_rates(concentration)
        if len(theta) == 2:
            return self._two_sites(rates, theta, dt)[0]
        matrix = np.eye(len(theta)) - dt * np.einsum("rk,rn,rs->nks", self.nu_site, rates, self._consumed(len(theta)))
        return np.linalg.solve(matrix, theta.T[:, :, None])[:, :, 0].T

    def rates(self, concentration: Floats, theta: Floats, dt: float) -> tuple[Floats, Floats]:
        """Rates r_r (reactions, n) [mol/m2/s] at the end of the step and their derivatives (reactions, coupled, n) [m/s]."""
        site_rates = self._site_rates(concentration)
        k = len(theta)
        if k == 2:
            new, response = self._two_sites(site_rates, theta, dt)
        else:
            consumed = self._consumed(k)
            matrix = np.eye(k) - dt * np.einsum("rk,rn,rs->nks", self.nu_site, site_rates, consumed)
            inverse = np.linalg.inv(matrix)
            new = np.einsum("nks,sn->kn", inverse, theta)
            # d theta'/d q_r = (I - dt Q)^-1 dt nu_r theta'_s(r)
            response = dt * np.einsum("nks,rs,rn->rkn", inverse, self.nu_site, new[self.site])
        values = np.empty((len(self.reactions), concentration.shape[1]))
        slopes = np.zeros((len(self.reactions), *concentration.shape))
        for r, (g, s) in enumerate(zip(self.gas, self.site, strict=True)):
            values[r] = self.constant[r] * concentration[g] * new[s]
            slopes[r, g] += self.constant[r] * new[s]
            for other, j in enumerate(self.gas):
                positive = concentration[j] > 0.0
                slope = self.constant[other] / self.sites * response[other, s] * positive
                slopes[r, j] += self.constant[r] * concentration[g] * slope
        return values, slopes

    def _site_rates(self, concentration: Floats) -> Floats:
        """q_r = k_r C_g / n_s [1/s], never negative."""
        rates = np.empty((len(self.reactions), concentration.shape[1]))
        for r, g in enumerate(self.gas):
            rates[r] = self.constant[r] * np.maximum(concentration[g], 0.0) / self.sites
        return rates

    def _consumed(self, k: int) -> Floats:
        """(reactions, sites): 1 where the reaction's rate is first order in the site."""
        return np.eye(k)[self.site].reshape(-1, k)

    def _two_sites(self, rates: Floats, theta: Floats, dt: float) -> tuple[Floats, Floats]:
        """Closed form for two kinds of sites: theta' (2, n) and d theta'/d q_r (reactions, 2, n).

        theta_0' = (theta_0 + c) / (1 + a + c) and its complement, with a and c the turnover of either kind; as written, each stays in
        [0, 1] in floating point too, because rounding is monotone.
        """
        gain = np.zeros_like(theta)  # dt q of what turns the other kind into kind k
        share = np.zeros((len(self.reactions), 2))
        for r, s in enumerate(self.site):
            other = 1 - s
            share[r, other] = dt * self.nu_site[r, other]
            gain[other] += share[r, other] * rates[r]
        whole = np.stack([(1.0 + gain[1]) + gain[0], (1.0 + gain[0]) + gain[1]])
        new = (theta + gain) / whole
        response = np.empty((len(self.reactions), *theta.shape))
        for r, s in enumerate(self.site):
            change = share[r, 1 - s] * new[s] / whole[0]
            response[r, 1 - s], response[r, s] = change, -change
        return new, response


class GasKinetics:
    """Second-order gas reactions among the coupled species: rate k(T) C_1 C_2 [mol per m3 of gas per s]."""

    def __init__(self, mechanism: Mechanism, coupled: tuple[str, ...], temperature: ArrayLike):
        self.coupled = coupled
        self.reactions = [r for r in mechanism.gas_reactions if reactants(r) <= set(coupled)]
        self.constant = [r.rate_constant(np.asarray(temperature, dtype=float)) for r in self.reactions]
        self.pairs = []
        for r in self.reactions:
            a, b = [name for name, order in r.reactants.items() for _ in range(int(order))]
            self.pairs.append((coupled.index(a), coupled.index(b)))

    def rates(self, concentration: Floats) -> tuple[Floats, Floats]:
        """Rates (reactions, n) and derivatives (reactions, coupled, n); negative concentrations count as none."""
        positive = np.maximum(concentration, 0.0)
        values = np.empty((len(self.reactions), concentration.shape[1]))
        slopes = np.zeros((len(self.reactions), *concentration.shape))
        for r, (a, b) in enumerate(self.pairs):
            values[r] = self.constant[r] * positive[a] * positive[b]
            slopes[r, a] += self.constant[r] * positive[b] * (concentration[a] > 0.0)
            slopes[r, b] += self.constant[r] * positive[a] * (concentration[b] > 0.0)
        return values, slopes
