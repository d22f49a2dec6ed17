"""The quasi-steady system: what gas and coverage must satisfy once nothing changes any more.

    div(u C_i - D_i^eff grad C_i) = eps R_i^gas + S sum_r nu_ir r_r            cycle-mean velocity u
    n_s v_s dtheta/dx = n_s Q(C) theta     in the moving layer (`mpm.reactor.steady.conveyor`)
    0 = Q(C) theta                         in layers at rest

Unknowns are the concentrations of the reacting species, the coverage with which solids leave every moving cell (but for as many kinds of
site as there are sums that no reaction changes, such as that of all places) and, where outlets draw gas back in, what that gas holds: the
mean of the cells next to each outlet. A storage term over a pseudo-time step [s] can be added; over the longest, `last_step`, it is
negligible.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.numerics.block_matrix import BlockMatrix, Coupling, Unknowns
from mpm.parallel import is_root, total
from mpm.physics.small_systems import invariants
from mpm.reactor.steady.conveyor import Conveyor
from mpm.transport.cell_matrix import FacePattern
from mpm.transport.reactions import Events

if TYPE_CHECKING:
    from mpm.physics.kinetics import Exposure
    from mpm.reactor.system import System
    from mpm.transport.fluxes import PortFlux

LAST_STEP = 1e12  # s, shortest last pseudo-time step
NO_FEED = 1e-30  # mol/m/s, where nothing is fed and nothing moves
STORED = 1e-10  # of the largest feed: what the solids at rest may still take up over the last step


@dataclass(frozen=True, eq=False)
class Iterate:
    """Concentrations (coupled, own cells) [mol/m3] and coverages (sites, reactive cells): leaving ones where moving, own ones at rest."""

    concentration: Floats
    theta: Floats


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The system at one iterate: residuals of the gas (coupled, own) [mol/m/s] and of the coverage (free, moving), the `events` of all
    reactions, and the derivatives that its Jacobian is made of: of the rates on surfaces (reactions, coupled, reactive) and in the gas
    (reactions, coupled, own), and of solids `conveyed` through moving cells. `size` is the residual relative to the largest feed."""

    gas: Floats
    coverage: Floats
    events: Events
    surface_slopes: Floats
    gas_slopes: Floats
    conveyed: Exposure
    size: float


class SteadySystem:
    """Residual and Jacobian of a reactor's `system` in its steady flow, in which gas reacts.

    Of a moving cell's coverages those of `kinds`, `free` in number, are unknowns; a change of them is one of `all_kinds` (sites, free)
    times it. `scale` [mol/m/s]: the largest feed, or the sites that pass where those let gas go by themselves.
    """

    def __init__(self, system: System):
        self.system, self.strip = system, system.strip
        self.transport, self.coverage = system.transport, system.coverage
        self.ports, self.reactions = self.transport.ports, self.transport.reactions
        self.conveyor = Conveyor(system)
        self.coupled, self.own = self.transport.coupled, self.strip.owned
        sums, dependent = invariants(self.reactions.surface.nu_places)
        self.kinds = np.setdiff1d(np.arange(sums.shape[1]), dependent)
        self.free = len(self.kinds)
        self.all_kinds = np.zeros((sums.shape[1], self.free))
        self.all_kinds[self.kinds, np.arange(self.free)] = 1.0
        self.all_kinds[dependent] = -sums[:, self.kinds]
        self.all_operators = system.operators(system.velocity)
        self.operators = self.all_operators[: self.coupled]
        self.shares = self.ports.steady_shares
        self.storage = self.reactions.gas_volume
        self._faces = FacePattern(self.strip)
        self.outflow = np.stack([operator.outflow for operator in self.operators])
        self.start = Iterate(self.transport.concentration[: self.coupled].copy(), self.coverage.theta)
        held = total(self.strip.comm, [self.coverage.capacity[self.conveyor.resting].sum()])[0]
        self.scale = self.ports.feed_rate
        if self.reactions.start_by_themselves:
            moved = total(self.strip.comm, [self.coverage.capacity[self.conveyor.moving].sum()])[0]
            self.scale = max(self.scale, float(moved) / self.conveyor.residence, NO_FEED)
        self.last_step = max(LAST_STEP, float(held) / (STORED * self.scale))
        self._drawing: list[PortFlux] = (
            list(self.operators[0].outlets.values()) if self.operators[0].drawn_in else []
        )
        self.unknowns = Unknowns(
            self.strip.comm,
            {
                "gas": self.coupled * self.own,
                "coverage": self.free * len(self.conveyor.moving),
                "outlets": self.coupled * len(self._drawing) if is_root(self.strip.comm) else 0,
            },
        )
        self._linked = np.flatnonzero(self.conveyor.inside)  # moving cells fed with solids by another one
        self.jacobian = BlockMatrix(self.unknowns, self._couplings())

    # --- unknowns ---

    def _couplings(self) -> dict[str, Coupling]:
        """Which unknowns meet in the Jacobian; its values in `fill_jacobian` have the same names."""
        coupled, free, faces = self.coupled, self.free, self._faces
        each = np.arange(coupled)[:, None]
        gas = self._gas_numbers()
        mine = self.unknowns.first["coverage"] + free * np.arange(len(self.conveyor.moving))
        upstream = self._upstream(mine)[self._linked]
        cell = gas[self.coverage.cells[self.conveyor.moving]]
        single = (mine[:, None] + np.arange(free)).ravel()
        means = self.unknowns.firsts["outlets"][0] + coupled * np.arange(len(self._drawing))
        held = (means[:, None] + np.arange(coupled)).ravel()[: self.unknowns.sizes["outlets"]]
        couplings = {
            "neighbours": Coupling((gas[faces.cells] + each).ravel(), (gas[faces.neighbours] + each).ravel()),
            "gas": Coupling(gas[: self.own], gas[: self.own], coupled, coupled),
            "gas by coverage": Coupling(cell[self._linked], upstream, coupled, free),
            "coverage by gas": Coupling(mine, cell, free, coupled),
            "coverage by coverage": Coupling(mine[self._linked], upstream, free, free),
            "coverage": Coupling(single, single),
            "means": Coupling(held, held),
        }
        for k, (mean, port) in enumerate(zip(means, self._drawing, strict=True)):
            beside, near = (gas[port.cells] + each).ravel(), (gas[port.near] + each).ravel()
            number = mean + np.arange(coupled)
            couplings[f"gas by mean {k}"] = Coupling(beside, np.repeat(number, len(port.cells)))
            couplings[f"mean {k} by gas"] = Coupling(np.repeat(number, len(port.near)), near)
        return couplings

    def _gas_numbers(self) -> Ints:
        """Global number of the first gas unknown of every local cell; ghosts have those of their owners."""
        number = self.strip.global_cell
        starts = np.cumsum([0, *self.strip.comm.allgather(self.own)])[:-1]
        owner = np.searchsorted(starts, number, side="right") - 1
        return self.unknowns.firsts["gas"][owner] + self.coupled * (number - starts[owner])

    def _upstream(self, mine: Ints) -> Ints:
        """Global number of the first coverage of the cell before each moving cell; collective."""
        conveyor = self.conveyor
        numbers = np.full((1, len(self.coverage.cells)), -1.0)
        numbers[0, conveyor.moving] = mine
        return np.asarray(conveyor.whole(numbers)[0].astype(np.int64)[conveyor.row, conveyor.before])

    # --- residual ---

    def evaluate(self, now: Iterate, old: Iterate, step: float) -> Evaluation:
        """The residual at `now`, a pseudo-time `step` [s] after `old`; collective."""
        conveyor, reactions, cells = self.conveyor, self.reactions, self.coverage.cells
        moving, resting = conveyor.moving, conveyor.resting
        c = now.concentration
        drawn = self.ports.outlet_means(self.operators, c)
        supply = self.ports.supply(self.operators, self.shares, drawn)
        gas_rates, gas_slopes = reactions.gas.rates(c)
        at_rest = reactions.surface.part(resting).rates(c[:, cells[resting]], old.theta[:, resting], step)
        entering = conveyor.entering(step, now.theta, old.theta)
        conveyed = reactions.surface.part(moving).conveyed(c[:, cells[moving]], entering, conveyor.span(step))
        rates = np.zeros((len(reactions.surface.reactions), len(cells)))
        slopes = np.zeros((len(rates), self.coupled, len(cells)))
        rates[:, resting], slopes[:, :, resting] = at_rest
        rates[:, moving], slopes[:, :, moving] = conveyed.rates, conveyed.rates_c
        events = reactions.events(rates, gas_rates)
        gas = self.transport.flux_product(self.operators, c) - supply - reactions.made(events)[: self.coupled]
        gas += self.storage * (c - old.concentration) / step
        coverage = (now.theta[:, moving] - conveyed.out)[self.kinds]
        return Evaluation(gas, coverage, events, slopes, gas_slopes, conveyed, self._size(gas, coverage))

    def _size(self, gas: Floats, coverage: Floats) -> float:
        """Sum of |gas residual| plus that of the coverage in sites per second, over `scale`."""
        moving, residence = self.conveyor.moving, self.conveyor.residence
        sites = np.abs(coverage) @ self.coverage.capacity[moving] / residence if len(moving) else np.zeros(1)
        parts = total(self.strip.comm, [np.abs(gas).sum(), sites.sum()])
        return float(parts.sum() / self.scale)

    # --- Jacobian ---

    def fill_jacobian(self, at: Evaluation, step: float) -> None:
        """Enter the derivatives at `at` into `jacobian`; collective."""
        reactions, moving, conveyed, free = self.reactions, self.conveyor.moving, at.conveyed, self.free
        kinds = self.kinds
        whole_change = self.all_kinds * (self.conveyor.span(step) / self.conveyor.residence)
        blocks = -reactions.slopes(at.surface_slopes, at.gas_slopes)
        for i in range(self.coupled):
            blocks[:, i, i] += self.outflow[i] + self.storage / step
        # of the share of the entering solids that comes from upstream
        rates_theta = np.einsum("rkn,kf->rfn", conveyed.rates_theta, whole_change)
        out_theta = np.einsum("ikn,kf->ifn", conveyed.out_theta[kinds], whole_change)
        values = {
            "neighbours": np.concatenate([self._faces.coupling(operator) for operator in self.operators]),
            "gas": blocks,
            "gas by coverage": -reactions.slopes_by_coverage(rates_theta, moving)[self._linked],
            "coverage by gas": -np.moveaxis(conveyed.out_c[kinds], -1, 0),
            "coverage by coverage": -np.moveaxis(out_theta, -1, 0)[self._linked],
            "coverage": np.ones(free * len(moving)),
            "means": np.ones(self.unknowns.sizes["outlets"]),
        }
        whole = total(self.strip.comm, [port.sizes.sum() for port in self._drawing])
        for k, (port, area) in enumerate(zip(self._drawing, whole, strict=True)):
            values[f"gas by mean {k}"] = np.tile(-port.into, self.coupled)
            values[f"mean {k} by gas"] = np.tile(-port.weights / area, self.coupled)
        self.jacobian.fill(values)
