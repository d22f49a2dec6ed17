"""Surface reactions of any rate law in many cells at once, implicit in the coverage.

    n_s (theta_k' - theta_k)/dt = sum_r nu_kr r_r(C', theta')        nu: places that an event makes of kind k

Newton's method in every cell by itself on the coverages, its equations combined so that slow reactions do not drown in fast ones
(`mpm.physics.slow_and_fast`). Where it does not arrive, pseudo-time does. A rate falls to zero with what it uses up, so that the solution
lies within [0, 1]; iterates are kept there.

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
from mpm.physics.slow_and_fast import Combined, combined
from mpm.physics.small_systems import invariants, solve_cells

if TYPE_CHECKING:
    from mpm.physics.mechanism import Mechanism

TRIES = 30  # Newton iterations of a step
SETTLED = 1e-8  # of a coverage: a change whose square is rounding
RESTS = 20  # of them, after which rounding may be what keeps a change alive
STALLED = 1e-6  # of a coverage: the change that then counts as none
LEAST = 1e-22  # of all places: so few are none
ROUNDING = 1e-17  # of all places: what differences between nearly all of them are known to
SHRINK = 0.01  # factor on a coverage that an iteration would make negative
FIRST, LONGER, SHORTER = 1e-6, 4.0, 0.1  # steps of pseudo-time, in units of the step
LONG, LONGEST, SHORTEST, RELAXATIONS = 1e3, 1e12, 1e-30, 300
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
    """Surface reactions in cells with `sites` n_s (n,) [mol/m2], among the `coupled` gases; temperature [K] scalar or per cell.

    `sums` (sums, sites) of coverages stay whatever reacts: of all places, and of each kind of site that never turns into another.
    """

    def __init__(self, mechanism: Mechanism, coupled: Sequence[str], sites: Floats, temperature: ArrayLike):
        self.sites = sites
        self.reactions = mechanism.running_surface(coupled)
        names = mechanism.site_names
        nu = [[r.nu_site.get(k, 0.0) for k in names] for r in self.reactions]
        self.nu_places = np.array(nu).reshape(len(self.reactions), len(names)) * mechanism.places
        self.sums = invariants(self.nu_places)[0]
        self._table = RateTable(mechanism, self.reactions, coupled, sites)
        # coverages before the last step, its length, and those after it
        self._last: tuple[Floats, float, Floats] | None = None
        self.heat_to(temperature)

    def heat_to(self, temperature: ArrayLike) -> None:
        """Take the rate constants at another temperature [K], scalar or per cell."""
        self._table.heat_to(temperature)

    def part(self, chosen: NDArray[np.integer]) -> GeneralKinetics:
        """The same reactions in some of the cells."""
        other = object.__new__(GeneralKinetics)
        other.__dict__.update(self.__dict__)
        other.sites, other._table, other._last = self.sites[chosen], self._table.part(chosen), None
        return other

    def bends(self, concentration: Floats, theta: Floats, dt: float) -> NDArray[np.bool_]:
        """Where rates may not be linear in the concentrations (coupled, n) over a step: nothing is known of any law."""
        return np.ones(concentration.shape[1], dtype=bool)

    def coverage(self, concentration: Floats, theta: Floats, dt: float) -> Floats:
        """theta' (sites, n) after `dt` [s] at the new concentrations (coupled, n) [mol/m3]; not numbers where none are found."""
        gas = self._table.gas_part(np.maximum(concentration, 0.0))
        return self._solve(gas, theta, np.broadcast_to(dt, self.sites.shape), self._guess(theta, dt))

    def rates(self, concentration: Floats, theta: Floats, dt: float) -> tuple[Floats, Floats]:
        """Rates r_r (reactions, n) [mol/m2/s] at the end of the step and their derivatives (reactions, coupled, n) [m/s].

        Continued along the tangents at zero where a concentration is negative, as Newton iterates are.
        """
        guess, before = self._guess(theta, dt), self._none(concentration, 0)
        step = self._step(concentration, theta, np.broadcast_to(dt, self.sites.shape), before, guess)
        self._last = theta, dt, step.theta
        return step.rates + _beyond(step.rates_c, concentration), step.rates_c

    def _guess(self, theta: Floats, dt: float) -> Floats:
        """Where Newton's method starts: from what it last found for this very step, at other concentrations, else from its beginning."""
        if self._last is not None and self._last[0] is theta and self._last[1] == dt:
            return np.where(np.isfinite(self._last[2]), self._last[2], theta)
        return theta

    def conveyed(self, concentration: Floats, theta: Floats, time: Floats | float) -> Exposure:
        """Solids that pass a cell in `time` [s, scalar or (n,)] at constant concentrations, coming in with `theta` (sites, n).

        SUBSTEPS implicit steps one after the other, which tend to the exact exposure as cells become small.
        """
        dt = np.broadcast_to(np.asarray(time, dtype=float) / SUBSTEPS, self.sites.shape)
        k = len(theta)
        before = self._none(concentration, k)
        steps = []
        for _ in range(SUBSTEPS):
            steps.append(self._step(concentration, theta, dt, before, theta))
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
        return Step(
            np.zeros((k, n)), np.zeros((len(self.reactions), n)), none, no_rates[:, :c], unit, no_rates[:, c:]
        )

    # --- one step ---

    def _step(self, concentration: Floats, theta: Floats, dt: Floats, before: Step, guess: Floats) -> Step:
        """From `theta` (sites, n), which depends on concentrations and on the coverage at the start as `before` says, by `dt` (n,) [s]."""
        gas = self._table.gas_part(np.maximum(concentration, 0.0))
        new = self._solve(gas, theta, dt, guess)
        at = self._table.rates(gas, new)
        c = len(concentration)
        equations = combined(self.nu_places, at.gross)
        start = np.concatenate([theta[:, None], before.theta_c, before.theta_theta], axis=1)
        # solids act through theta alone
        nothing = np.zeros((len(at.net), before.theta_theta.shape[1], theta.shape[1]))
        slopes = np.concatenate([at.by_gas, nothing], axis=1)
        rhs = equations.sum_sites(start[:, 1:]) + dt / self.sites * equations.sum_reactions(slopes)
        response = solve_cells(self._matrix(equations, at, dt), rhs)
        slopes += np.einsum("rkn,kjn->rjn", at.by_site, response)
        change = np.concatenate([new[:, None], response], axis=1) - start
        values = np.concatenate([at.net[:, None], slopes], axis=1)
        values = equations.corrected(values, self.sites / dt * equations.sum_sites(change))
        return Step(
            new, values[:, 0], response[:, :c], values[:, 1 : c + 1], response[:, c:], values[:, c + 1 :]
        )

    def _matrix(self, equations: Combined, at: Rates, dt: Floats, held: Floats | float = 0.0) -> Floats:
        """T (1 + held) - dt T nu^T dr/dtheta / n_s, (equations, sites, n)."""
        return np.asarray(
            (1.0 + held) * equations.of_sites - dt / self.sites * equations.sum_reactions(at.by_site)
        )

    # --- Newton's method ---

    def _solve(self, gas: GasPart, theta: Floats, dt: Floats, guess: Floats) -> Floats:
        """Coverages at the end of a step of `dt` (n,) [s] from `theta`; not numbers where none are found."""
        new, lost = self._newton(gas, theta, dt, guess)
        if len(lost):
            new[:, lost] = self.part(lost)._relax(gas.part(lost), theta[:, lost], dt[lost])
        return np.clip(new, 0.0, 1.0)

    def _newton(self, gas: GasPart, theta: Floats, dt: Floats, guess: Floats) -> tuple[Floats, Ints]:
        """Newton's method in all cells from `guess`; coverages (sites, n) and the cells in which it did not arrive."""
        new, active, part = guess.copy(), np.arange(theta.shape[1]), self
        for tries in range(TRIES):
            now = new.take(active, axis=1)
            change = part._change(gas, theta.take(active, axis=1), now, dt[active], 0.0)
            new[:, active] = after = np.where(change < now, np.minimum(now - change, 1.0), SHRINK * now)
            done = _arrived(change, now, after, tries >= RESTS)
            if done.any():
                active = active[~done]
                if not len(active):
                    break
                part, gas = part.part(np.flatnonzero(~done)), gas.part(np.flatnonzero(~done))
        return new, active

    def _relax(self, gas: GasPart, theta: Floats, dt: Floats) -> Floats:
        """The same from where Newton's method gets lost, as with reactions that their own products drive: pseudo-time.

        d theta/ds = theta_before - theta + dt/n_s nu^T r rests at the end of the step. Linearly implicit steps in s of each cell's own
        length: shorter after one in which a coverage would fall to less than SHRINK of what it is, or that is too long for something that
        grows by itself (a linearly implicit step goes the wrong way then), longer after others.
        """
        new, n = theta.copy(), theta.shape[1]
        left, part = np.arange(n), self
        length = np.full(n, FIRST)
        found = np.zeros(n, dtype=bool)
        for _ in range(RELAXATIONS):
            now = new[:, left]
            change, onward = part._pseudo_step(gas, theta[:, left], now, dt[left], 1.0 / length[left])
            after = now - change
            good = onward & ((after >= SHRINK * now) | (np.abs(after) <= LEAST)).all(axis=0)
            new[:, left[good]] = np.clip(after, 0.0, 1.0)[:, good]
            done = good & _arrived(change, now, after, length[left] >= LONGEST) & (length[left] > LONG)
            found[left[done]] = True
            length[left] *= np.where(good, LONGER, SHORTER)
            stay = ~done & (length[left] > SHORTEST) & np.isfinite(change).all(axis=0)
            length = np.minimum(length, LONGEST)
            if not stay.all():
                left = left[stay]
                if not len(left):
                    break
                part, gas = part.part(np.flatnonzero(stay)), gas.part(np.flatnonzero(stay))
        new[:, ~found] = np.nan
        return new

    def _change(self, gas: GasPart, before: Floats, now: Floats, dt: Floats, held: Floats | float) -> Floats:
        """Newton's change (sites, n), to be taken off `now`, with a storage `held` in pseudo-time [1]."""
        matrix, residual, _ = self._newton_system(gas, before, now, dt, held)
        return solve_cells(matrix, residual)[:, 0]

    def _pseudo_step(
        self, gas: GasPart, before: Floats, now: Floats, dt: Floats, held: Floats
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """The same, and whether every cell's step is short beside what grows by itself: a matrix that is singular on the way from no step
        to this one has changed the sign of its determinant."""
        matrix, residual, equations = self._newton_system(gas, before, now, dt, held)
        signs = [np.linalg.slogdet(np.moveaxis(m, 2, 0))[0] for m in (matrix, equations.of_sites)]
        return solve_cells(matrix, residual)[:, 0], signs[0] * signs[1] > 0.0

    def _newton_system(
        self, gas: GasPart, before: Floats, now: Floats, dt: Floats, held: Floats | float
    ) -> tuple[Floats, Floats, Combined]:
        """Matrix (equations, sites, n) and residual (equations, 1, n) of a step, and how its equations are combined."""
        at = self._table.rates(gas, now)
        equations = combined(self.nu_places, at.gross)
        residual = equations.sum_sites((now - before)[:, None])
        residual -= dt / self.sites * equations.sum_reactions(at.net[:, None])
        return self._matrix(equations, at, dt, held), residual, equations


def _arrived(change: Floats, now: Floats, after: Floats, late: ArrayLike) -> NDArray[np.bool_]:
    """Whether a `change` from `now` to `after` (sites, n) was the last of its cell, as it seems or, when it is `late`, as far as rounding
    lets one see; and nothing held it back."""
    close, least = np.where(late, STALLED, SETTLED), np.where(late, ROUNDING, LEAST)
    return np.asarray(((change <= now + least) & (np.abs(after - now) <= close * after + least)).all(axis=0))


def _beyond(slopes: Floats, concentration: Floats) -> Floats:
    """What negative concentrations (gases, n) add to rates along the tangents `slopes` (reactions, gases, n)."""
    return np.asarray(np.einsum("rjn,jn->rn", slopes, np.minimum(concentration, 0.0)))
