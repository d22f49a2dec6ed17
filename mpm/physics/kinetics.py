"""Rates of surface and gas reactions of the simplest kind in many cells at once, implicit in the coverage.

Any other rate law: `mpm.physics.general_kinetics`. Surface reaction r consumes gas g(r) on sites s(r):  rate r_r = k_r(T) C_g theta_s
[mol/m2/s]. Over a step dt the coverages of a cell follow its new concentrations,

    theta' = theta + (dt/n_s) sum_r nu_r r_r(C', theta'),   that is   (I - dt Q(C')) theta' = theta,

with Q a matrix whose off-diagonal entries are >= 0 and whose columns sum to zero, because every reaction conserves sites. Hence
theta' >= 0 and sum theta' = sum theta for any C' >= 0 and any step: coverage stays within [0, 1] by construction. A negative
concentration (a Newton iterate) leaves Q as it is at zero and enters all r_r linearly, which keeps the uptake monotone and concave.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm.arrays import Floats
from mpm.physics.exponentials import dphi1, dphi2, phi1, phi2
from mpm.physics.small_systems import invariants

if TYPE_CHECKING:
    from mpm.physics.mechanism import Mechanism

BENT = 1e-4  # of all sites of a cell


@dataclass(frozen=True, eq=False)
class Exposure:
    """Solids conveyed through cells: mean `rates` (reactions, n) [mol/m2/s] with derivatives by concentration `rates_c`
    (reactions, coupled, n) and by incoming coverage `rates_theta` (reactions, sites, n); outgoing coverage `out` (sites, n), likewise
    `out_c` (sites, coupled, n) and `out_theta` (sites, sites, n)."""

    rates: Floats
    rates_c: Floats
    rates_theta: Floats
    out: Floats
    out_c: Floats
    out_theta: Floats


class SurfaceKinetics:
    """Surface reactions in cells with `sites` n_s (n,) [mol/m2], among the `coupled` gases; temperature [K] scalar or per cell."""

    def __init__(
        self,
        mechanism: Mechanism,
        coupled: tuple[str, ...],
        sites: Floats,
        temperature: ArrayLike,
    ):
        self.sites = sites
        names = mechanism.site_names
        self.reactions = mechanism.running_surface(coupled)
        self.gas = [coupled.index(r.gas) for r in self.reactions]
        self.site = [names.index(r.site) for r in self.reactions]
        self.heat_to(temperature)
        self.nu_places = np.array([[r.nu_site.get(k, 0.0) for k in names] for r in self.reactions]).reshape(
            len(self.reactions), len(names)
        )

    @property
    def sums(self) -> Floats:
        """Sums (sums, sites) of coverages that stay whatever reacts: of all sites, and of each kind that never turns into another."""
        return invariants(self.nu_places)[0]

    def heat_to(self, temperature: ArrayLike) -> None:
        """Take the rate constants at another temperature [K], scalar or per cell."""
        t = np.broadcast_to(np.asarray(temperature, dtype=float), self.sites.shape)
        self.constant = [r.rate_constant(t) * np.ones_like(t) for r in self.reactions]

    def part(self, chosen: NDArray[np.integer]) -> SurfaceKinetics:
        """The same reactions in some of the cells."""
        other = copy.copy(self)
        other.sites = self.sites[chosen]
        other.constant = [constant[chosen] for constant in self.constant]
        return other

    def bends(self, concentration: Floats, theta: Floats, dt: float) -> NDArray[np.bool_]:
        """Where a share BENT of all sites reacts in a step of `dt` [s] at these concentrations (coupled, n), as if none ran out."""
        turnover = dt * self._site_rates(concentration) * theta[self.site]
        return np.asarray((turnover > BENT).any(axis=0))

    def coverage(self, concentration: Floats, theta: Floats, dt: float) -> Floats:
        """theta' (sites, n) after `dt` [s] at the new concentrations (coupled, n) [mol/m3]."""
        rates = self._site_rates(concentration)
        if len(theta) == 2:
            return self._after(self._gains(rates, theta, dt)[0], theta)[0]
        return np.minimum(self._solve_sites(rates, dt, theta[:, None, :])[:, 0], 1.0)

    def rates(self, concentration: Floats, theta: Floats, dt: float) -> tuple[Floats, Floats]:
        """Rates r_r (reactions, n) [mol/m2/s] at the end of the step and their derivatives (reactions, coupled, n) [m/s]."""
        site_rates = self._site_rates(concentration)
        k = len(theta)
        if k == 2:
            new, response = self._two_sites(site_rates, theta, dt)
        else:
            identity = np.broadcast_to(np.eye(k)[:, :, None], (k, *theta.shape))
            inverse = self._solve_sites(site_rates, dt, identity)
            new = np.einsum("ksn,sn->kn", inverse, theta)
            # d theta'/d q_r = (I - dt Q)^-1 dt nu_r theta'_s(r)
            response = dt * np.einsum("ksn,rs,rn->rkn", inverse, self.nu_places, new[self.site])
        values = np.empty((len(self.reactions), concentration.shape[1]))
        slopes = np.zeros((len(self.reactions), *concentration.shape))
        for r, (g, s) in enumerate(zip(self.gas, self.site, strict=True)):
            values[r] = self.constant[r] * concentration[g] * new[s]
            slopes[r, g] += self.constant[r] * new[s]
            for other, j in enumerate(self.gas):
                factor = self.constant[r] * self.constant[other] / self.sites * response[other, s]
                _respond(values[r], slopes[r], concentration, g, j, factor)
        return values, slopes

    def conveyed(self, concentration: Floats, theta: Floats, time: Floats | float) -> Exposure:
        """Solids that pass a cell in `time` [s, scalar or (n,)] at constant concentrations, coming in with `theta` (sites, n).

        Two kinds of sites: exact, d theta_0/dt = c (1 - theta_0) - a theta_0, so theta_out = theta_in exp(-a - c) + c phi_1(a + c)
        with a and c the turnovers over `time`; with one reaction that is theta_out = theta_in exp(-nu k C time/n_s). More kinds: implicit
        in the outgoing coverage. Mean rates and outgoing coverage balance exactly in both.
        """
        rates = self._site_rates(concentration)
        k, count = len(theta), len(self.reactions)
        unit = np.eye(k)
        if k == 2:
            gain, share = self._gains(rates, theta, time)
            turnover = gain[0] + gain[1]
            decay, one, two = np.exp(-turnover), phi1(turnover), phi2(turnover)
            out, mean = theta * decay + gain * one, theta * one + gain * two
            slope_one = dphi1(turnover)
            slope_two = dphi2(turnover)
            out_q, mean_q = np.empty((count, *theta.shape)), np.empty((count, *theta.shape))
            for r, s in enumerate(self.site):
                through = share[r]  # d turnover / d q_r
                out_q[r] = through * (-theta * decay + gain * slope_one)
                mean_q[r] = through * (theta * slope_one + gain * slope_two)
                out_q[r, 1 - s] += through * one
                mean_q[r, 1 - s] += through * two
            out_theta = unit[:, :, None] * decay
            mean_theta = unit[:, :, None] * one
        else:
            span = np.broadcast_to(np.asarray(time, dtype=float), theta.shape[1:])
            inverse = self._solve_sites(rates, span, np.broadcast_to(unit[:, :, None], (k, *theta.shape)))
            out = mean = np.einsum("ksn,sn->kn", inverse, theta)
            out_q = mean_q = span * np.einsum("ksn,rs,rn->rkn", inverse, self.nu_places, out[self.site])
            out_theta = mean_theta = inverse
        values = np.empty((count, concentration.shape[1]))
        for r, (g, s) in enumerate(self._pairs()):
            values[r] = self.constant[r] * concentration[g] * mean[s]
        slopes = np.zeros((count, *concentration.shape))
        out_c = np.zeros((k, *concentration.shape))
        values_theta = np.zeros((count, *theta.shape))
        for r, (g, s) in enumerate(self._pairs()):
            slopes[r, g] += self.constant[r] * mean[s]
            values_theta[r] = self.constant[r] * concentration[g] * mean_theta[s]
            for other, j in enumerate(self.gas):
                factor = self.constant[r] * self.constant[other] / self.sites * mean_q[other, s]
                _respond(values[r], slopes[r], concentration, g, j, factor)
        for other, j in enumerate(self.gas):
            out_c[:, j] += out_q[other] * (self.constant[other] / self.sites * (concentration[j] > 0.0))
        return Exposure(values, slopes, values_theta, out, out_c, out_theta)

    def _pairs(self) -> list[tuple[int, int]]:
        return list(zip(self.gas, self.site, strict=True))

    def _gains(self, rates: Floats, theta: Floats, time: Floats | float) -> tuple[Floats, list[Any]]:
        """For two kinds: turnover into each kind over `time` (2, n), and its derivative by each q_r, that into the kind which r makes."""
        gain = np.zeros_like(theta)
        share = [time * self.nu_places[r, 1 - s] for r, s in enumerate(self.site)]
        for r, s in enumerate(self.site):
            gain[1 - s] += share[r] * rates[r]
        return gain, share

    def _site_rates(self, concentration: Floats) -> Floats:
        """q_r = k_r C_g / n_s [1/s], never negative."""
        rates = np.empty((len(self.reactions), concentration.shape[1]))
        for r, g in enumerate(self.gas):
            rates[r] = self.constant[r] * np.maximum(concentration[g], 0.0) / self.sites
        return rates

    def _solve_sites(self, rates: Floats, dt: Floats | float, rhs: Floats) -> Floats:
        """Solve (I - dt Q) x = rhs for any number of sites; dt scalar or (n,), rhs and x (sites, m, n), rhs >= 0.

        Elimination without subtraction (Grassmann, Taksar and Heyman 1985): only the turnovers from site to site and the column sums
        enter, all positive, so sites are conserved to rounding however much faster than the step the reactions are.
        """
        k = len(rhs)
        turnover = dt * np.einsum("rk,rn,rs->ksn", self.nu_places, rates, np.eye(k)[self.site].reshape(-1, k))
        column_sum = np.ones((k, rates.shape[1]))
        pivot = np.empty_like(column_sum)
        x = rhs.copy()
        for i in range(k):
            later = slice(i + 1, None)
            pivot[i] = column_sum[i] + turnover[later, i].sum(axis=0)
            share = turnover[later, i] / pivot[i]
            column_sum[later] += turnover[i, later] * column_sum[i] / pivot[i]
            x[later] += share[:, None] * x[i]
            turnover[later, later] += share[:, None] * turnover[i, None, later]
        for i in reversed(range(k)):
            x[i] = (x[i] + np.einsum("sn,smn->mn", turnover[i, i + 1 :], x[i + 1 :])) / pivot[i]
        return x

    def _two_sites(self, rates: Floats, theta: Floats, dt: float) -> tuple[Floats, Floats]:
        """Closed form for two kinds of sites: theta' (2, n) and d theta'/d q_r (reactions, 2, n).

        theta_0' = (theta_0 + c) / (1 + a + c) and its complement, with a and c the turnover of either kind.
        """
        gain, share = self._gains(rates, theta, dt)
        new, whole = self._after(gain, theta)
        response = np.empty((len(self.reactions), *theta.shape))
        for r, s in enumerate(self.site):
            change = np.multiply(share[r], new[s], out=response[r, 1 - s])
            change /= whole
            np.negative(change, out=response[r, s])
        return new, response

    @staticmethod
    def _after(gain: Floats, theta: Floats) -> tuple[Floats, Floats]:
        """theta' (2, n), which as written stays in [0, 1] in floating point too, because rounding is monotone; and 1 + a + c (n,)."""
        whole = 1.0 + gain[1]
        whole += gain[0]
        new = theta + gain
        new /= whole
        return new, whole


class GasKinetics:
    """Second-order gas reactions among the coupled species: rate k(T) C_1 C_2 [mol per m3 of gas per s].

    Per total volume that is eps k C_1 C_2; the thesis (5-12) prints the source in its porous zones without eps.
    """

    def __init__(self, mechanism: Mechanism, coupled: tuple[str, ...], temperature: ArrayLike):
        self.reactions = mechanism.running_gas(coupled)
        self.heat_to(temperature)
        self.pairs = [(coupled.index(a), coupled.index(b)) for a, b in (r.reactants for r in self.reactions)]

    def heat_to(self, temperature: ArrayLike) -> None:
        """Take the rate constants at another temperature [K], scalar or per cell."""
        self.constant = [r.rate_constant(np.asarray(temperature, dtype=float)) for r in self.reactions]

    def part(self, chosen: NDArray[np.integer]) -> GasKinetics:
        """The same reactions in some of the cells."""
        other = copy.copy(self)
        other.constant = [k[chosen] if k.ndim else k for k in self.constant]
        return other

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


def _respond(rate: Floats, slopes: Floats, concentration: Floats, g: int, j: int, factor: Floats) -> None:
    """Add to a rate of gas `g` (n,) and its `slopes` (coupled, n) what the coverage's response to C_j brings, factor C_g per unit C_j.

    Continued along the tangent: where C_j < 0 the rate follows its slope at zero. Solids at rest that see both precursors turn over at a
    harmonic mean of the two supplies, which is concave; its tangents keep it so beyond zero, where a rate that ignored C_j would have a
    kink that stalls Newton.
    """
    own = concentration[g]
    if j == g:
        slopes[j] += factor * own * (own > 0.0)
    else:
        slope = factor * np.maximum(own, 0.0)
        slopes[j] += slope
        rate += slope * np.minimum(concentration[j], 0.0)
