"""Solids that move through cells in the steady state: what enters each, and the coverages that follow from given concentrations.

    n_s v_s dtheta/dx = n_s Q(C) theta     from fresh or periodic solids; v_s < 0: from the right end on

The coverage is integrated exactly along the bed: solids that cross a cell of width h at its concentration leave with
theta_out = theta_in exp(-nu_s k C h/(|v_s| n_s)) (one reaction; `SurfaceKinetics.conveyed` for more).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.parallel import largest, total
from mpm.physics.kinetics import SurfaceKinetics

if TYPE_CHECKING:
    from mpm.physics.rate_solvers import Surface
    from mpm.reactor.system import System
    from mpm.transport.coverage import Coverage

TURNS, MET = 8, 1e-10  # Newton steps on the coverages of the whole bed, and a change of them that is none


class Conveyor:
    """The moving ones among the reactive cells of `coverage`, and the way of the solids through them.

    `moving` and `resting` index the reactive cells, `is_moving` (reactive,) tells them apart; `place` gives a moving cell's index in
    `moving`. `row` and `column` (moving,) are its place in the whole bed, `inside` where its solids come from another cell. Solids stay for
    `residence` [s] in a cell and move in `direction` (1, -1) along x. `runs` tells on every rank whether any solids move.
    """

    def __init__(self, system: System):
        coverage, strip = system.coverage, system.strip
        self.coverage: Coverage = coverage
        self.comm = system.comm
        speed, self.direction = abs(system.bed_motion.mean), system.case.direction
        self.runs = speed > 0.0 and len(coverage.moving_rows) > 0
        moving_rows = coverage.moving_rows if self.runs else coverage.moving_rows[:0]
        self.is_moving = np.isin(coverage.place, moving_rows)
        self.moving, self.resting = np.flatnonzero(self.is_moving), np.flatnonzero(~self.is_moving)
        self.place = np.cumsum(self.is_moving) - 1
        self.residence = strip.grid.dx / speed if speed > 0.0 else np.inf
        self.row, self.column = coverage.place[self.moving], strip.column[coverage.cells[self.moving]]
        self.before = (self.column - self.direction) % coverage.columns  # column where its solids come from
        self._first, self._last = (
            (0, coverage.columns - 1) if self.direction > 0 else (coverage.columns - 1, 0)
        )
        self.inside = (self.column != self._first) | coverage.periodic

    def whole(self, local: Floats) -> Floats:
        """Values (n, reactive cells) of every rank as (n, reactive rows, columns); collective."""
        coverage = self.coverage
        return coverage.scatter.to_all(local).reshape(len(local), len(coverage.rows), coverage.columns)

    def incoming(self, theta: Floats) -> Floats:
        """Coverage of the solids entering every moving cell (sites, moving), from those that leave all cells; collective."""
        entering = self.whole(theta)[:, self.row, self.before]
        return np.where(self.inside, entering, self.coverage.fresh[:, self.row])

    def span(self, step: float) -> float:
        """Time [s] that solids spend in a moving cell over a pseudo-time step [s].

        BDF1 storage as inflow: the storage of a step is one more stream of sites, of age `step`.
        """
        return 1.0 / (1.0 / step + 1.0 / self.residence)

    def entering(self, step: float, theta: Floats, old: Floats) -> Floats:
        """Coverage with which solids come in, that stream included, (sites, moving); collective."""
        span = self.span(step)
        return span / self.residence * self.incoming(theta) + span / step * old[:, self.moving]

    def passed(self, theta: Floats) -> Floats:
        """Sites that leave the strip less those that enter it, per second and kind [mol/m/s]; collective."""
        coverage = self.coverage
        if not self.runs or coverage.periodic:
            return np.zeros(len(theta))
        carried = coverage.capacity[self.moving] / self.residence
        last, first = self.column == self._last, self.column == self._first
        gone = theta[:, self.moving][:, last] @ carried[last]
        return total(self.comm, gone - self.incoming(theta)[:, first] @ carried[first])

    def carry(
        self, surface: Surface, concentration: Floats, theta: Floats, old: Floats, step: float
    ) -> Floats:
        """Coverages (sites, reactive cells) with those of moving cells at these concentrations (coupled, reactive cells): theta_out of
        every cell from the one before it; collective.

        In every cell theta_out = M theta_in + m. Where reactions are of first order, M is stochastic whatever comes in and m is nothing, so
        the coverage stays within [0, 1]. Other rate laws have the tangents at what comes in, until that no longer changes. Periodic solids
        come in as they left: the fixed point of all cells one after the other.
        """
        if not self.runs:
            return theta
        part, c = surface.part(self.moving), concentration[:, self.moving]
        if isinstance(part, SurfaceKinetics):
            span = self.span(step)
            responses = [
                part.conveyed(c, np.repeat(e[:, None], len(self.moving), axis=1), span).out
                for e in np.eye(len(theta))
            ]
            return self._along_bed(
                part.sums, np.stack(responses, axis=1), np.zeros_like(theta), theta, old, step
            )
        return self._follow_tangents(part, c, theta, old, step)

    def _follow_tangents(
        self, part: Surface, concentration: Floats, theta: Floats, old: Floats, step: float
    ) -> Floats:
        """`carry` by Newton's method on the coverages of the whole bed; what it has after TURNS is a guess."""
        entering = self.entering(step, theta, old)
        for _ in range(TURNS):
            passed = part.conveyed(concentration, entering, self.span(step))
            rest = np.zeros_like(theta)
            rest[:, self.moving] = passed.out - np.einsum("oin,in->on", passed.out_theta, entering)
            theta = self._along_bed(part.sums, passed.out_theta, rest, theta, old, step)
            before, entering = entering, self.entering(step, theta, old)
            if largest(self.comm, [np.abs(entering - before).max(initial=0.0)])[0] < MET:
                break
        return theta

    def _along_bed(
        self, sums: Floats, maps: Floats, rest: Floats, theta: Floats, old: Floats, step: float
    ) -> Floats:
        """`theta` with the coverages of moving cells that follow from `maps` M (out, in, moving) and `rest` m (sites, reactive)."""
        coverage, kinds, moving = self.coverage, len(theta), self.moving
        share = self.span(step) / self.residence
        local = np.zeros((kinds * kinds + 2 * kinds, len(coverage.cells)))
        local[: kinds * kinds, moving] = np.swapaxes(maps, 0, 1).reshape(
            kinds * kinds, -1
        )  # column by column of M
        local[kinds * kinds : kinds * kinds + kinds, moving] = old[:, moving]
        local[kinds * kinds + kinds :] = rest
        whole = self.whole(local)[:, coverage.moving_rows]
        columns = whole[: kinds * kinds].reshape(kinds, kinds, *whole.shape[1:]).T  # (columns, rows, out, in)
        aged = (1.0 - share) * whole[kinds * kinds : kinds * kinds + kinds].T  # (columns, rows, sites)
        more = whole[kinds * kinds + kinds :].T
        way = self.direction  # columns in the order in which solids meet them
        left = np.empty_like(aged)
        bed = Bed(columns[::way], aged[::way], more[::way], share, sums)
        left[::way] = bed.along(coverage.fresh[:, coverage.moving_rows].T, coverage.periodic)
        result = np.zeros((kinds, len(coverage.rows), coverage.columns))
        result[:, coverage.moving_rows] = left.T
        new = theta.copy()
        new[:, moving] = coverage.scatter.to_local(result.reshape(kinds, -1))[:, moving]
        return new


@dataclass(frozen=True, eq=False)
class Bed:
    """Cells of a bed in the order in which solids meet them: theta_out = M (share theta_before + aged) + rest.

    `maps` M (columns, rows, out, in), `aged` and `rest` (columns, rows, sites). `sums` (sums, sites): what stays along the way.
    """

    maps: Floats
    aged: Floats
    rest: Floats
    share: float
    sums: Floats

    def along(self, fresh: Floats, periodic: bool) -> Floats:
        """Coverages (columns, rows, sites) that leave column after column, from `fresh` ones (rows, sites)."""
        incoming = self._fixed_point(fresh) if periodic else fresh
        left = np.empty_like(self.aged)
        for column, (m, more, rest) in enumerate(zip(self.maps, self.aged, self.rest, strict=True)):
            incoming = np.einsum("roi,ri->ro", m, self.share * incoming + more) + rest
            incoming = np.maximum(incoming, 0.0)
            # rounding would add up along the bed
            incoming = left[column] = incoming / incoming.sum(axis=1, keepdims=True)
        return left

    def _fixed_point(self, start: Floats) -> Floats:
        """Coverage (rows, sites) that the solids bring back after one turn: theta = A theta + c of all columns together."""
        kinds = self.maps.shape[-1]
        product = np.broadcast_to(np.eye(kinds), self.maps.shape[1:]).copy()
        constant = np.zeros(self.maps.shape[1:3])
        for m, more, rest in zip(self.maps, self.aged, self.rest, strict=True):
            product = self.share * m @ product
            constant = np.einsum("roi,ri->ro", m, self.share * constant + more) + rest
        theta = start.copy()
        for row in range(len(product)):
            gap = np.eye(kinds) - product[row]
            kept = self.sums @ start[row]
            theta[row] = np.linalg.lstsq(np.vstack([gap, self.sums]), np.append(constant[row], kept))[0]
        return theta
