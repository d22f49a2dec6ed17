"""Surface reactions of any rate law in many cells at once, implicit in the coverage.

    n_s (theta_k' - theta_k)/dt = sum_r nu_kr r_r(C', theta')        nu: places that an event makes of kind k

Newton's method in every cell by itself on the coverages, with the sums that no reaction changes (all places; each kind of site that never
turns into another) in place of as many of these equations: they hold to rounding, however much faster than the step the reactions are. From
where Newton's method does not arrive, it follows the solution from short steps to the whole one. A rate falls to zero with what it uses up,
so that the solution lies within [0, 1]; iterates are kept there.

Net rates of reactions that are almost at equilibrium are small differences of large numbers. Events are therefore corrected, by as much as
these numbers are uncertain, to those that make the coverages what they are: what the gas sees and what the surface keeps agree to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm.arrays import Floats, Ints
from mpm.physics.kinetics import Exposure
from mpm.physics.rate_table import GasPart, Rates, RateTable
from mpm.physics.small_systems import invariants, solve_cells

if TYPE_CHECKING:
    from mpm.physics.mechanism import Mechanism

TRIES = 40  # Newton iterations of a step
SETTLED, LEAST = (
    1e-10,
    1e-25,
)  # of a coverage and of all places: a change after which its square is below rounding
STALLED, RESTS = 1e-7, 25  # a change that rounding alone keeps alive, after this many iterations
SHRINK = 0.1  # factor on a coverage that an iteration would make negative
LADDER = (
    8.0  # factor between the steps on the way to one that was too long, and how short the first one may be
)
SHORTEST, RUNGS = 1e-25, 200
SUBSTEPS = 4  # of solids that cross a cell


@dataclass(frozen=True, eq=False)
class Step:
    """Coverages (sites, n) after a step, rates (reactions, n) in it, and their derivatives by concentrations (..., gases, n) and by the
    coverages before (..., sites, n)."""

    theta: Floats
    rates: Floats
    theta_c: Floats
    rates_c: Floats
    theta_theta: Floats
    rates_theta: Floats


class GeneralKinetics:
    """Surface reactions in cells with `sites` n_s (n,) [mol/m2], among the `coupled` gases; temperature [K] scalar or per cell."""

    def __init__(self, mechanism: Mechanism, coupled: Sequence[str], sites: Floats, temperature: ArrayLike):
        self.sites = sites
        self.reactions = mechanism.running_surface(coupled)
        names = mechanism.site_names
        nu = [[r.nu_site.get(k, 0.0) for k in names] for r in self.reactions]
        self.nu_places = np.array(nu).reshape(len(self.reactions), len(names)) * mechanism.places
        self._sums, self._replaced = invariants(self.nu_places)
        self._table = RateTable(mechanism, self.reactions, coupled, sites)
        self.heat_to(temperature)

    def heat_to(self, temperature: ArrayLike) -> None:
        """Take the rate constants at another temperature [K], scalar or per cell."""
        self._table.heat_to(temperature)

    def part(self, chosen: NDArray[np.integer]) -> GeneralKinetics:
        """The same reactions in some of the cells."""
        other = object.__new__(GeneralKinetics)
        other.__dict__.update(self.__dict__)
        other.sites, other._table = self.sites[chosen], self._table.part(chosen)
        return other

    def coverage(self, concentration: Floats, theta: Floats, dt: float) -> Floats:
        """theta' (sites, n) after `dt` [s] at the new concentrations (coupled, n) [mol/m3]; not numbers where none are found."""
        return self._solve(self._table.gas_part(np.maximum(concentration, 0.0)), theta, dt)

    def rates(self, concentration: Floats, theta: Floats, dt: float) -> tuple[Floats, Floats]:
        """Rates r_r (reactions, n) [mol/m2/s] at the end of the step and their derivatives (reactions, coupled, n) [m/s].

        Continued along the tangents at zero where a concentration is negative, as Newton iterates are.
        """
        step = self._step(
            concentration, theta, np.broadcast_to(dt, self.sites.shape), self._none(concentration, 0)
        )
        return step.rates + _beyond(step.rates_c, concentration), step.rates_c

    def conveyed(self, concentration: Floats, theta: Floats, time: Floats | float) -> Exposure:
        """Solids that pass a cell in `time` [s, scalar or (n,)] at constant concentrations, coming in with `theta` (sites, n).

        SUBSTEPS implicit steps one after the other, which tend to the exact exposure as cells become small.
        """
        dt = np.broadcast_to(np.asarray(time, dtype=float) / SUBSTEPS, self.sites.shape)
        k = len(theta)
        before = self._none(concentration, k)
        steps = []
        for _ in range(SUBSTEPS):
            steps.append(self._step(concentration, theta, dt, before))
            theta, before = steps[-1].theta, steps[-1]
        last = steps[-1]
        rates_c = np.mean([step.rates_c for step in steps], axis=0)
        rates = np.mean([step.rates for step in steps], axis=0) + _beyond(rates_c, concentration)
        rates_theta = np.mean([step.rates_theta for step in steps], axis=0)
        return Exposure(rates, rates_c, rates_theta, last.theta, last.theta_c, last.theta_theta)

    def _none(self, concentration: Floats, solids: int) -> Step:
        """Before any step: the coverage is what it is; derivatives by it are followed for so many kinds, all or none."""
        k, n, c = self.nu_places.shape[1], concentration.shape[1], len(concentration)
        unit = np.broadcast_to(np.eye(k)[:, :solids, None], (k, solids, n))
        no_rates = np.zeros((len(self.reactions), c + solids, n))
        none = np.zeros((k, c, n))
        return Step(np.zeros((k, n)), no_rates[:, 0], none, no_rates[:, :c], unit, no_rates[:, c:])

    # --- one step ---

    def _step(self, concentration: Floats, theta: Floats, dt: Floats, before: Step) -> Step:
        """From `theta` (sites, n), which depends on concentrations and on the coverage at the start as `before` says, by `dt` (n,) [s]."""
        gas = self._table.gas_part(np.maximum(concentration, 0.0))
        new = self._solve(gas, theta, dt)
        at = self._table.rates(gas, new)
        c, nu = len(concentration), self.nu_places
        nothing = np.zeros(
            (len(nu), before.theta_theta.shape[1], theta.shape[1])
        )  # solids act through theta alone
        slopes = np.concatenate([at.by_gas, nothing], axis=1)
        rhs = dt / self.sites * np.einsum("rk,rjn->kjn", nu, slopes)
        rhs += np.concatenate([before.theta_c, before.theta_theta], axis=1)
        for row, total in zip(self._replaced, self._sums, strict=True):
            rhs[row, :c] = np.einsum("k,kjn->jn", total, before.theta_c)
            rhs[row, c:] = np.einsum("k,kjn->jn", total, before.theta_theta)
        response = solve_cells(self._matrix(at, dt), rhs)
        slopes += np.einsum("rkn,kjn->rjn", at.by_site, response)
        values = np.concatenate([at.net[:, None], slopes], axis=1)
        change = np.concatenate([theta[:, None], before.theta_c, before.theta_theta], axis=1)
        change = np.concatenate([new[:, None], response], axis=1) - change
        values = self._corrected(values, change, at.gross, dt)
        return Step(
            new, values[:, 0], response[:, :c], values[:, 1 : c + 1], response[:, c:], values[:, c + 1 :]
        )

    def _corrected(self, values: Floats, change: Floats, gross: Floats, dt: Floats) -> Floats:
        """Rates and their derivatives (reactions, m, n) that make the `change` of the coverages (sites, m, n) in the step `dt`.

        r + W nu (nu^T W nu + sums)^-1 (n_s change/dt - nu^T r): the least correction, of every reaction by its weight W, its `gross` rate.
        """
        nu = self.nu_places
        missing = self.sites / dt * change - np.einsum("rk,rjn->kjn", nu, values)
        largest = gross.max(axis=0, initial=0.0)
        weights = np.where(largest > 0.0, gross / np.where(largest > 0.0, largest, 1.0), 1.0) + 1e-9
        normal = np.einsum("rk,rn,rl->kln", nu, weights, nu)
        normal += np.einsum("sk,sl->kl", self._sums, self._sums)[:, :, None]
        share = solve_cells(normal, missing)
        return np.asarray(values + weights[:, None] * np.einsum("rk,kjn->rjn", nu, share))

    def _matrix(self, at: Rates, dt: Floats) -> Floats:
        """I - dt nu^T dr/dtheta / n_s, with the sums in place of as many rows, (sites, sites, n)."""
        kinds = len(self.nu_places[0])
        matrix = -dt / self.sites * np.einsum("rk,rln->kln", self.nu_places, at.by_site)
        matrix += np.eye(kinds)[:, :, None]
        for row, total in zip(self._replaced, self._sums, strict=True):
            matrix[row] = total[:, None]
        return np.asarray(matrix)

    # --- Newton's method ---

    def _solve(self, gas: GasPart, theta: Floats, dt: ArrayLike) -> Floats:
        """Coverages at the end of a step of `dt` [s], scalar or (n,), from `theta`."""
        span = np.array(np.broadcast_to(np.asarray(dt, dtype=float), self.sites.shape))
        new, found = self._newton(gas, theta, theta, span, np.arange(theta.shape[1]))
        lost = np.flatnonzero(~found)
        if len(lost):
            new[:, lost] = self._follow(gas, theta, span, lost)
        return np.clip(new, 0.0, 1.0)

    def _newton(
        self, gas: GasPart, theta: Floats, start: Floats, dt: Floats, cells: Ints
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Newton's method in `cells` from `start` (sites, cells); coverages (sites, cells) and where they were found."""
        new, found = start.copy(), np.zeros(len(cells), dtype=bool)
        active = np.arange(len(cells))
        for tries in range(TRIES):
            here, now = cells[active], new[:, active]
            table = self._table if len(here) == len(self.sites) else self._table.part(here)
            at = table.rates(gas if table is self._table else gas.part(here), now)
            part = self if table is self._table else self.part(here)
            old, span = theta[:, here], dt[here]
            residual = now - old - span / part.sites * (self.nu_places.T @ at.net)
            for row, total in zip(self._replaced, self._sums, strict=True):
                residual[row] = total @ (now - old)
            change = solve_cells(part._matrix(at, span), residual[:, None])[:, 0]
            after = np.where(change < now, np.minimum(now - change, 1.0), SHRINK * now)
            new[:, active] = after
            free = change <= now + LEAST  # nothing held it back
            limit = SETTLED * after + LEAST if tries < RESTS else STALLED
            done = (free & (np.abs(change) <= limit)).all(axis=0)
            found[active[done]] = True
            active = active[~done & np.isfinite(change).all(axis=0)]
            if not len(active):
                break
        return new, found

    def _follow(self, gas: GasPart, theta: Floats, dt: Floats, cells: Ints) -> Floats:
        """Coverages of `cells` by way of steps that grow from short ones to `dt`; not numbers where that does not lead there."""
        whole = dt[cells]
        reached = np.zeros(len(cells))  # share of the step whose end is known
        trial = np.full(len(cells), LADDER**-8)
        at, factor = theta[:, cells].copy(), np.full(len(cells), LADDER)
        span = dt.copy()
        for _ in range(RUNGS):
            left = np.flatnonzero((reached < 1.0) & (trial > SHORTEST))
            if not len(left):
                break
            here = cells[left]
            span[here] = whole[left] * trial[left]
            new, found = self._newton(gas, theta, at[:, left], span, here)
            good, bad = left[found], left[~found]
            at[:, good] = new[:, found]
            reached[good] = trial[good]
            trial[good] = np.minimum(trial[good] * factor[good], 1.0)
            factor[bad] = np.maximum(np.sqrt(factor[bad]), 1.05)
            first = bad[reached[bad] == 0.0]
            factor[first] = LADDER
            trial[bad] = np.where(reached[bad] > 0.0, reached[bad] * factor[bad], trial[bad] / LADDER**2)
        at[:, reached < 1.0] = np.nan
        return at


def _beyond(slopes: Floats, concentration: Floats) -> Floats:
    """What negative concentrations (gases, n) add to rates along the tangents `slopes` (reactions, gases, n)."""
    return np.asarray(np.einsum("rjn,jn->rn", slopes, np.minimum(concentration, 0.0)))
