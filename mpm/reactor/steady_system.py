"""The quasi-steady system: what gas and coverage must satisfy once nothing changes any more.

    div(u C_i - D_i^eff grad C_i) = eps R_i^gas + S sum_r nu_ir r_r            cycle-mean velocity u
    n_s v_s dtheta/dx = n_s Q(C) theta     in the moving layer, from fresh or periodic solids; v_s < 0: from the right end on
    0 = Q(C) theta                         in layers at rest

The coverage is integrated exactly along the bed: solids that cross a cell of width h at its concentration leave with
theta_out = theta_in exp(-nu_s k C h/(|v_s| n_s)) (one reaction; `SurfaceKinetics.conveyed` for two). Unknowns are the concentrations of the
reacting species, theta_out of every moving cell and, where outlets draw gas back in, what that gas holds: the mean of the cells next to
each outlet. A storage term over a pseudo-time step [s] can be added; over the longest, `last_step`, it is negligible.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.numerics.fem import PETSc
from mpm.parallel import is_root, total
from mpm.transport.cell_matrix import CellMatrix

if TYPE_CHECKING:
    from mpm.reactor.reactor import Reactor
    from mpm.transport.fluxes import PortFlux
    from mpm.transport.species import Transport

Floats = NDArray[np.float64]
LAST_STEP = 1e12  # s, shortest last pseudo-time step
STORED = 1e-10  # of the largest feed: what the solids at rest may still take up over the last step


class SteadySystem:
    """Residual and Jacobian on the flow field `number` of the reactor's transport, and the way coverages enter them.

    `concentration` (coupled, own cells) [mol/m3]; `theta` (sites, reactive cells): leaving coverage where moving, own coverage at rest.
    At least one species that reacts is fed.
    """

    def __init__(self, reactor: Reactor, number: int):
        self.transport, self.bed, self.strip = reactor.transport, reactor.bed, reactor.strip
        transport, bed, strip = self.transport, self.bed, self.strip
        self.b, self.own = len(transport.roles.coupled), strip.owned
        self.kinds = len(bed.theta)
        self.free = self.kinds - 1  # independent coverages of a moving cell
        speed, self.direction = abs(reactor.motion.mean), reactor.case.direction
        moving_rows = set(bed.moving_rows) if speed > 0.0 else set()
        self.is_moving = np.array([place in moving_rows for place in bed.place], dtype=bool).reshape(
            len(bed.cells)
        )
        self.moving, self.resting = np.flatnonzero(self.is_moving), np.flatnonzero(~self.is_moving)
        self.place = np.full(self.own, -1)  # of own cells in `bed.cells`; -1 where nothing reacts on solids
        self.place[bed.cells] = np.arange(len(bed.cells))
        self.place_moving = np.cumsum(self.is_moving) - 1  # of moving cells of `bed.cells` in `moving`
        self.residence = strip.grid.dx / speed if speed > 0.0 else np.inf
        self.conveys = bool(moving_rows)  # on any rank
        self.periodic = bed.periodic
        self.operators = transport.operators(number)
        self.cells = CellMatrix(strip, self.b)
        self.diagonal = self.cells.set_fluxes(self.operators[: self.b])
        self._number_unknowns()
        self.theta = bed.theta.copy()  # leaving coverage where moving, own coverage where at rest
        self.concentration = transport.concentration[: self.b].copy()
        self.old = (self.concentration.copy(), self.theta.copy())
        held = float(total(strip.comm, [bed.capacity[self.resting].sum()])[0])
        self.last_step = max(LAST_STEP, held / (STORED * transport.feed_rate))
        self.shares = doses(transport)
        self._matrix: PETSc.Mat | None = None

    def _number_unknowns(self) -> None:
        """Gas unknowns cell by cell, then the coverages of moving cells; both contiguous on each rank. The means next to outlets, outlet
        by outlet, end the first rank's."""
        comm, bed, strip = self.strip.comm, self.bed, self.strip
        outlets = self.operators[0].outlets if self.operators[0].drawn_in else {}
        self.held = self.b * len(outlets) if is_root(comm) else 0
        local = self.b * self.own + self.free * len(self.moving) + self.held
        ends = local - self.held if is_root(comm) else 0
        self.mean_number = int(total(comm, [ends])[0]) + self.b * np.arange(len(outlets))
        first = int(comm.scan(local)) - local
        self.local = local
        sizes = comm.allgather((first, strip.owned))
        # global number of the first gas unknown of any cell, from its PETSc cell number
        starts = np.cumsum([0] + [owned for _, owned in sizes])[:-1]
        owner = np.searchsorted(starts, strip.global_cell, side="right") - 1
        firsts = np.array([f for f, _ in sizes])
        self.gas_number = firsts[owner] + self.b * (strip.global_cell - starts[owner])
        mine = np.full(len(bed.cells), -1.0)
        mine[self.moving] = first + self.b * self.own + self.free * np.arange(len(self.moving))
        everyone = bed.scatter.to_all(mine).reshape(len(bed.rows), bed.columns).astype(np.int64)
        self.theta_number = first + self.b * self.own + self.free * np.arange(len(self.moving))
        rows, columns = bed.place[self.moving], strip.column[bed.cells[self.moving]]
        self.before = (
            columns - self.direction
        ) % bed.columns  # where the solids of each moving cell come from
        self.first, self.last = (0, bed.columns - 1) if self.direction > 0 else (bed.columns - 1, 0)
        inside = (columns != self.first) | self.periodic
        self.upstream = np.where(inside, everyone[rows, self.before], -1)
        self.column = columns

    def incoming(self) -> Floats:
        """Coverage of the solids entering every own moving cell, (sites, moving)."""
        whole = self.bed.scatter.to_all(self.theta).reshape(self.kinds, len(self.bed.rows), self.bed.columns)
        rows = self.bed.place[self.moving]
        entering = whole[:, rows, self.before]
        fresh = self.bed.fresh[:, rows]
        return np.where(self.upstream >= 0, entering, fresh)

    def entering(self, step: float) -> tuple[float, Floats]:
        """Time [s] that solids spend in a moving cell, and their coverage as they come in, (sites, moving).

        The storage of a pseudo-time step is one more stream of sites, of age `step`.
        """
        span = 1.0 / (1.0 / step + 1.0 / self.residence)
        return span, span / self.residence * self.incoming() + span / step * self.old[1][:, self.moving]

    def residual(self, step: float) -> tuple[Floats, Floats, dict]:
        """Gas residual (b, own) [mol/m/s], coverage residual (free, moving), and what the Jacobian needs."""
        transport, bed = self.transport, self.bed
        c, cells = self.concentration, bed.cells
        old_c, old_theta = self.old
        coupled = self.operators[: self.b]
        supply = transport.supply(coupled, self.shares, transport.outlet_means(coupled, c))
        gas_rates, gas_slopes = transport.gas.rates(c)
        source = transport.nu_gas[:, : self.b].T @ gas_rates * transport.gas_volume
        span, entering = self.entering(step)
        at_rest = transport.surface.part(self.resting).rates(
            c[:, cells[self.resting]], old_theta[:, self.resting], step
        )
        conveyed = transport.surface.part(self.moving).conveyed(c[:, cells[self.moving]], entering, span)
        rates = np.zeros((len(transport.surface.reactions), len(cells)))
        rates[:, self.resting], rates[:, self.moving] = at_rest[0], conveyed.rates
        source[:, cells] += (transport.nu_surface[:, : self.b].T @ rates) * transport.active_area
        gas = transport.flux_product(coupled, c) - supply - source
        gas += transport.gas_volume * (c - old_c) / step
        coverage = (self.theta[:, self.moving] - conveyed.out)[: self.free]
        parts = {
            "rates": rates,
            "gas_rates": gas_rates,
            "gas_slopes": gas_slopes,
            "rest_slopes": at_rest[1],
            "conveyed": conveyed,
            "share": span / self.residence,
        }
        return gas, coverage, parts

    def jacobian(self, step: float, parts: dict) -> PETSc.Mat:
        """The matrix of the linear system for all unknowns."""
        transport, b, free = self.transport, self.b, self.free
        cells, area = self.bed.cells, transport.active_area
        nu = transport.nu_surface[:, :b]
        blocks = np.zeros((self.own, b, b))
        if len(transport.gas.reactions):
            blocks -= (
                np.einsum("ri,rjn->nij", transport.nu_gas[:, :b], parts["gas_slopes"])
                * transport.gas_volume[:, None, None]
            )
        slopes = np.zeros((len(transport.surface.reactions), b, len(cells)))
        slopes[:, :, self.resting], slopes[:, :, self.moving] = (
            parts["rest_slopes"],
            parts["conveyed"].rates_c,
        )
        blocks[cells] -= np.einsum("ri,rjn->nij", nu, slopes) * area[:, None, None]
        for i in range(b):
            blocks[:, i, i] += self.diagonal[i] + transport.gas_volume / step
        conveyed, share = parts["conveyed"], parts["share"]
        last = self.kinds - 1
        by_theta = (
            conveyed.rates_theta[:, :last] - conveyed.rates_theta[:, last:]
        ) * share  # (reactions, free, moving)
        gas_theta = -np.einsum("ri,rkn->nik", nu, by_theta) * area[self.moving][:, None, None]
        theta_c = -np.moveaxis(conveyed.out_c[:free], -1, 0)  # (moving, free, b)
        theta_theta = -np.moveaxis(
            (conveyed.out_theta[:free, :last] - conveyed.out_theta[:free, last:]) * share, -1, 0
        )
        linked = self.upstream >= 0
        values = [
            self.cells.values[: self.cells.count],
            blocks.ravel(),
            gas_theta[linked].ravel(),
            theta_c.ravel(),
            theta_theta[linked].ravel(),
            np.ones(free * len(self.moving)),
            *self._mean_values(),
        ]
        if self._matrix is None:
            self._matrix = PETSc.Mat().create(self.strip.comm)
            self._matrix.setSizes(((self.local, None), (self.local, None)))
            self._matrix.setType("aij")
            rows, columns = self._pattern(linked)
            self._matrix.setPreallocationCOO(rows.astype(PETSc.IntType), columns.astype(PETSc.IntType))
        self._matrix.setValuesCOO(np.concatenate(values))
        return self._matrix

    def _pattern(self, linked: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of the entries in the order of `jacobian`."""
        b, free = self.b, self.free
        faces = self.strip.faces
        ahead_of, behind_of = self.cells.from_behind, self.cells.from_ahead
        rows, columns = [], []
        for mine, other in (
            (faces.behind[ahead_of], faces.ahead[ahead_of]),
            (faces.ahead[behind_of], faces.behind[behind_of]),
        ):
            for k in range(b):
                rows.append(self.gas_number[mine] + k)
                columns.append(self.gas_number[other] + k)

        def block(row: NDArray[np.int64], n: int, column: NDArray[np.int64], m: int) -> None:
            i, j = np.divmod(np.arange(n * m), m)
            rows.append((row[:, None] + i).ravel())
            columns.append((column[:, None] + j).ravel())

        own = self.gas_number[: self.own]
        cell = self.gas_number[self.bed.cells[self.moving]]
        block(own, b, own, b)
        block(cell[linked], b, self.upstream[linked], free)
        block(self.theta_number, free, cell, b)
        block(self.theta_number[linked], free, self.upstream[linked], free)
        diagonal = (self.theta_number[:, None] + np.arange(free)).ravel()
        rows.append(diagonal)
        columns.append(diagonal)
        for number, port in zip(self.mean_number, self._drawing(), strict=True):
            near = self.gas_number[port.cells]
            for k in range(b):
                rows += [near + k, np.full(len(near), number + k)]
                columns += [np.full(len(near), number + k), near + k]
        held = self.mean_number[:, None] + np.arange(b)
        rows.append(held.ravel()[: self.held])
        columns.append(held.ravel()[: self.held])
        return np.concatenate(rows), np.concatenate(columns)

    def _drawing(self) -> list[PortFlux]:
        """The outlets whose means are unknowns: all of them when any draws gas back in."""
        return list(self.operators[0].outlets.values()) if len(self.mean_number) else []

    def _mean_values(self) -> list[Floats]:
        """Matrix entries of: supply of a cell = into c, c = mean of C next to the outlet; in the order of `_pattern`."""
        ports = self._drawing()
        whole = total(self.strip.comm, [port.area.sum() for port in ports])
        values = []
        for port, area in zip(ports, whole, strict=True):
            values += [-port.into, -port.area / area] * self.b
        return [*values, np.ones(self.held)]

    def size(self, gas: Floats, coverage: Floats) -> float:
        """Sum of |gas residual| plus that of the coverage in sites per second, over the largest feed."""
        sites = (
            np.abs(coverage) @ self.bed.capacity[self.moving] / self.residence
            if len(self.moving)
            else np.zeros(1)
        )
        parts = total(self.strip.comm, [np.abs(gas).sum(), sites.sum()])
        return float(parts.sum() / max(self.transport.feed_rate, 1e-300))


def doses(transport: Transport) -> Floats:
    """1 for every inlet that doses in the steady state, else 0, (inlets,)."""
    return np.array([float(inlet.stays_open) for inlet in transport.case.geometry.inlets])
