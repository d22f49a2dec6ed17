"""Species in the gas and coverage of the solids over one time step, solved together.

    eps dC_i/dt + div(u C_i - D_i^eff grad C_i) = eps R_i^gas + S sum_r nu_ir r_r

Backward Euler on the fluxes of `mpm.transport.fluxes`. The coverage is eliminated cell by cell (`mpm.physics.kinetics`), because a
site lives for microseconds and must never be split from the transport that feeds it; Newton's method then works on the concentrations of
the reacting species alone. Species that are only made follow afterwards, one linear system each.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.errors import ConvergenceError
from mpm.flow.problem import FaceFlow
from mpm.mesh.strip import Strip
from mpm.numerics.linear import KrylovSolver
from mpm.numerics.local_newton import LOWEST, balance_locally
from mpm.parallel import largest, total
from mpm.physics.kinetics import GasKinetics, Roles, SurfaceKinetics
from mpm.transport.cell_matrix import CellMatrix, StepMatrix
from mpm.transport.coverage import Bed
from mpm.transport.fluxes import FluxAssembler, FluxOperator

if TYPE_CHECKING:
    from mpm.case.case import Case, Inlet

Floats = NDArray[np.float64]
NEWTON_LIMIT = 30
# levels of fill-in of the incomplete factors, for reacting species and for products: steps of a millisecond need none, and with
# `resolved` every step has a matrix of its own
FILL = {"resolved": (0, 0), "averaged": (1, 2), "steady": (1, 2)}
REFACTORED = 2  # Newton iterations of a step with an incomplete factor of their own; afterwards the matrix hardly changes
RESIDUAL = 1e-12  # sum of |residual| over all cells, relative to the largest feed
# of the sum of what the diagonal carries: a residual below that is rounding, and accepted
ROUNDING = float(np.finfo(float).eps)
UNDERSHOOT = 1e-15  # of the largest feed concentration: a step is accepted only when nothing lies below
FORCING = 1e-2  # loosest inner tolerance of the inexact Newton iteration
LAST = 1e-2 * RESIDUAL  # what the inner tolerance aims at, and no further
HALVINGS = 6
BALANCED = 1e-4  # residual below which Newton's steps have no need of balanced cells


@dataclass
class Ledger:
    """What has passed so far, per metre of depth; this rank's part.

    Amounts [mol/m] per species of the run: `fed` (inlets, species) net of what diffuses or flows back out of the port, `out`, `back`
    (outlets, species); volumes [m2] `out_volume`, `back_volume` (outlets,); events [mol/m] of each surface reaction in each reactive cell
    and of each gas reaction in each own cell.
    """

    fed: Floats
    out: Floats
    back: Floats
    out_volume: Floats
    back_volume: Floats
    surface_events: Floats
    gas_events: Floats


class Transport:
    """Concentrations of all species that can appear, and the solvers that advance them.

    `names` are those species, `concentration` (species, own cells) [mol/m3]. Operators for the velocity fields of a run are made with
    `add_flow`; `advance` takes one step with one of them. `diffusivities` [m2/s] are those that differ.
    """

    def __init__(self, case: Case, strip: Strip, bed: Bed):
        self.case, self.strip, self.bed = case, strip, bed
        mechanism = case.mechanism
        self.feed = {
            inlet.name: case.feed_concentrations(inlet.mass_fractions) for inlet in case.geometry.inlets
        }
        fed = {name for amounts in self.feed.values() for name, c in amounts.items() if c > 0.0}
        self.roles = Roles.of(mechanism, fed)
        self.names = (*self.roles.coupled, *self.roles.products)
        temperature = case.gas.temperature
        self.surface = SurfaceKinetics(mechanism, self.roles.coupled, bed.surface, bed.sites, temperature)
        self.gas = GasKinetics(mechanism, self.roles.coupled, temperature)
        self._stoichiometry()
        own = strip.owned
        porosity = [
            m.porosity if (m := case.geometry.layers[i].material) else 1.0 for i in strip.grid.row_layer
        ]
        self.porosity = np.asarray(porosity)[strip.row[:own]]
        self.volume = strip.volume[:own]
        self.gas_volume = self.porosity * self.volume
        self.active_area = bed.surface * self.volume[bed.cells]  # reactive area per cell [m2/m]
        self.concentration = np.zeros((len(self.names), own))
        inlets, outlets = len(case.geometry.inlets), len(case.geometry.outlets)
        n = len(self.names)
        self.ledger = Ledger(
            np.zeros((inlets, n)),
            np.zeros((outlets, n)),
            np.zeros((outlets, n)),
            np.zeros(outlets),
            np.zeros(outlets),
            np.zeros((len(self.surface.reactions), len(bed.cells))),
            np.zeros((len(self.gas.reactions), own)),
        )
        self.largest_feed = max((c for f in self.feed.values() for c in f.values()), default=0.0)
        diffusivities = [case.gas.diffusivity[name] for name in self.names]
        exchange = max(diffusivities, default=0.0) / float(
            strip.grid.y[-1] - strip.grid.y[0]
        )  # of an inlet that only diffuses
        self.feed_rate = max(
            (
                (i.velocity + exchange) * i.width * max(self.feed[i.name].values(), default=0.0)
                for i in case.geometry.inlets
            ),
            default=0.0,
        )
        self.diffusivities = sorted(set(diffusivities))
        self._group = [self.diffusivities.index(d) for d in diffusivities]
        self._assemblers = [FluxAssembler(case, strip, d) for d in self.diffusivities]
        self._flows: list[list[FluxOperator]] = []
        self._linear = [
            StepMatrix(strip, self.gas_volume, f"species with D = {d:g} m2/s", FILL[case.fidelity][1])
            for d in self.diffusivities
        ]
        if self.roles.coupled:
            self._jacobian = CellMatrix(strip, len(self.roles.coupled))
            self._newton = KrylovSolver(
                self._jacobian.matrix, "reacting species", FORCING, fill=FILL[case.fidelity][0]
            )
            self._step, self._rhs = self._jacobian.matrix.createVecs()
        self._jacobian_key: int | None = None
        self.iterations = 0

    def _stoichiometry(self) -> None:
        """Signed gas stoichiometry of the running reactions, (reactions, species of the run)."""
        self.nu_surface = np.array(
            [[r.nu_gas.get(n, 0.0) for n in self.names] for r in self.surface.reactions]
        ).reshape(len(self.surface.reactions), len(self.names))
        self.nu_gas = np.array([[r.nu.get(n, 0.0) for n in self.names] for r in self.gas.reactions]).reshape(
            len(self.gas.reactions), len(self.names)
        )

    def disperse(self, dispersion: Floats) -> None:
        """Add `dispersion` (diffusivities, 2, local cells) [m2/s] along x and y in all velocity fields that are added from now on."""
        self._assemblers = [
            FluxAssembler(self.case, self.strip, d, (along_x, along_y))
            for d, (along_x, along_y) in zip(self.diffusivities, dispersion, strict=True)
        ]

    def add_flow(self, flow: FaceFlow) -> int:
        """Make the operators of a velocity field; returns its number."""
        self._flows.append([assembler.operator(flow) for assembler in self._assemblers])
        return len(self._flows) - 1

    def replace_flow(self, number: int, flow: FaceFlow) -> None:
        """Put another velocity field in the place of `number`."""
        self._flows[number] = [assembler.operator(flow) for assembler in self._assemblers]
        for linear in self._linear:
            linear.key = None
        self._jacobian_key = None

    def operators(self, number: int) -> list[FluxOperator]:
        """The operator of each species for velocity field `number`."""
        return [self._flows[number][group] for group in self._group]

    # --- without a time step ---

    def flux_product(self, operators: list[FluxOperator], concentration: Floats) -> Floats:
        """div(u C - D grad C) integrated over own cells for each species, (species, own) [mol/m/s]; nothing enters through ports."""
        result = np.empty_like(concentration)
        for i, operator in enumerate(operators):
            group = self._group[i]
            linear = self._linear[group]
            if linear.key != (id(operator), 0.0):
                linear.update(operator, np.inf)
                linear.key = (id(operator), 0.0)
            result[i] = linear.multiply(concentration[i])
        return result

    # --- one step ---

    def advance(self, number: int, t0: float, dt: float, halvings: int = 0) -> None:
        """Advance concentrations, coverage and ledger from `t0` by `dt` [s] with velocity field `number`.

        A step whose Newton iteration fails is halved, up to HALVINGS times. Raises ConvergenceError after that.
        """
        concentration, theta = self.concentration, self.bed.theta  # replaced, never changed in place
        try:
            self._advance(number, t0, dt)
        except ConvergenceError as error:
            self.concentration, self.bed.theta = concentration, theta
            if halvings == HALVINGS:
                raise ConvergenceError(f"t = {t0:.6g} s, step of {dt:.3g} s: {error}") from error
            ledger = copy.deepcopy(self.ledger)
            try:
                self.advance(number, t0, 0.5 * dt, halvings + 1)
                self.advance(number, t0 + 0.5 * dt, 0.5 * dt, halvings + 1)
            except ConvergenceError:
                self.concentration, self.bed.theta, self.ledger = concentration, theta, ledger
                raise

    def _advance(self, number: int, t0: float, dt: float) -> None:
        operators = self.operators(number)
        old, coupled = self.concentration, len(self.roles.coupled)
        drawn = self.outlet_means(operators, old)
        shares = np.array([open_share(inlet, t0, dt) for inlet in self.case.geometry.inlets])
        supply = self.supply(operators, shares, drawn)
        new = old.copy()
        theta = self.bed.theta
        if coupled:
            new[:coupled], rates, gas_rates = self._solve_coupled(
                number, dt, old[:coupled], supply[:coupled], theta
            )
            self.bed.theta = self.surface.coverage(new[:coupled][:, self.bed.cells], theta, dt)
        else:
            rates = np.zeros((len(self.surface.reactions), len(self.bed.cells)))
            gas_rates = np.zeros((len(self.gas.reactions), self.strip.owned))
        events = rates * self.active_area * dt
        gas_events = gas_rates * self.gas_volume * dt
        for i in range(coupled, len(self.names)):
            made = supply[i].copy()
            made[self.bed.cells] += self.nu_surface[:, i] @ events / dt
            made += self.nu_gas[:, i] @ gas_events / dt
            new[i] = self._solve_linear(i, number, dt, old[i], made)
        self.concentration = new
        self.book(operators, dt, shares, drawn, events, gas_events)

    def supply(self, operators: list[FluxOperator], shares: Floats, drawn: dict[str, Floats]) -> Floats:
        """What enters each cell through ports, (species, own) [mol/m/s].

        `shares` (inlets,): part of the time during which each inlet doses; `drawn`: concentrations in what outlets draw back in.
        """
        supply = np.zeros((len(operators), self.strip.owned))
        for inlet, share in zip(self.case.geometry.inlets, shares, strict=True):
            for i, operator in enumerate(operators):
                c = self.feed[inlet.name].get(self.names[i], 0.0) * share
                if c > 0.0:
                    port = operator.inlets[inlet.name]
                    supply[i, port.cells] += port.into * c
        for name, means in drawn.items():
            port = operators[0].outlets[name]
            supply[:, port.cells] += port.into * means[:, None]
        return supply

    def outlet_means(self, operators: list[FluxOperator], concentration: Floats) -> dict[str, Floats]:
        """Area mean of the cells next to each outlet, (species,) [mol/m3], where any outlet draws in (else nothing); collective.

        One row of cells; the thesis takes two.
        """
        if not operators or not operators[0].drawn_in:
            return {}
        operator = operators[0]
        sums = []
        for port in operator.outlets.values():
            sums.append([*(concentration[:, port.cells] @ port.area), port.area.sum()])
        rows = total(self.strip.comm, sums)
        return {name: row[:-1] / row[-1] for name, row in zip(operator.outlets, rows, strict=True)}

    def _matrix(self, group: int, number: int, dt: float) -> StepMatrix:
        """The linear operator gas_volume/dt + fluxes of a species group, up to date for this flow and step."""
        linear = self._linear[group]
        if linear.key != (number, dt):
            linear.update(self._flows[number][group], dt)
            linear.key = (number, dt)
        return linear

    def _solve_linear(self, i: int, number: int, dt: float, old: Floats, supply: Floats) -> Floats:
        rhs = self.gas_volume * old / dt + supply
        return self._matrix(self._group[i], number, dt).solve(rhs, old, self.feed_rate * RESIDUAL)

    def _solve_coupled(
        self, number: int, dt: float, old: Floats, supply: Floats, theta: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Inexact Newton on the reacting species; returns concentrations, surface rates, gas rates at the end of the step."""
        b, own = old.shape
        groups = self._group[:b]
        matrices = [self._matrix(group, number, dt) for group in groups]
        if self._jacobian_key != number:
            self._diagonal = self._jacobian.set_fluxes([self._flows[number][group] for group in groups])
            self._jacobian_key = number
        diagonal = self._diagonal + self.gas_volume / dt
        rhs = self.gas_volume * old / dt + supply
        new = old.copy()
        cells = self.bed.cells
        scale = max(self.feed_rate, 1e-300)
        for iteration in range(NEWTON_LIMIT):
            rates, slopes = self.surface.rates(new[:, cells], theta, dt)
            gas_rates, gas_slopes = self.gas.rates(new)
            source = (
                (self.nu_gas[:, :b].T @ gas_rates) * self.gas_volume if len(gas_rates) else np.zeros_like(new)
            )
            source[:, cells] += (self.nu_surface[:, :b].T @ rates) * self.active_area
            residual = np.stack([m.multiply(c) for m, c in zip(matrices, new, strict=True)]) - rhs - source
            size, carried = total(self.strip.comm, [np.abs(residual).sum(), np.abs(diagonal * new).sum()])
            worst = size / scale
            low = -largest(self.strip.comm, [-new.min(initial=0.0)])[0]
            if worst < max(RESIDUAL, ROUNDING * carried / scale) and low >= -UNDERSHOOT * self.largest_feed:
                return new, rates, gas_rates
            if not np.isfinite(worst):
                break
            blocks = np.zeros((b, b, own))
            if len(gas_rates):
                blocks -= np.einsum("ri,rjn->ijn", self.nu_gas[:, :b], gas_slopes) * self.gas_volume
            blocks[:, :, cells] -= np.einsum("ri,rjn->ijn", self.nu_surface[:, :b], slopes) * self.active_area
            blocks[range(b), range(b)] += diagonal
            self._jacobian.assemble(np.moveaxis(blocks, 2, 0))
            self._rhs.array[:] = residual.T.ravel()
            self.iterations += self._newton.solve(
                self._rhs, self._step, forcing(worst), refactor=iteration < REFACTORED
            )
            new = new - self._step.array.reshape(own, b).T
            if worst > BALANCED:
                new[:, cells] = self._balance(new, matrices, diagonal, rhs, theta, dt)
        raise ConvergenceError(
            f"reacting species {', '.join(self.roles.coupled)}: Newton stopped after {NEWTON_LIMIT} iterations at a residual of "
            f"{worst:.3g} of the feed, lowest concentration {low:.3g} mol/m3"
        )

    def _balance(
        self, new: Floats, matrices: list[StepMatrix], diagonal: Floats, rhs: Floats, theta: Floats, dt: float
    ) -> Floats:
        """Concentrations (coupled, reactive cells) at which those cells balance with their inflow under the iterate `new`.

        A linear step sends the front too far or not far enough, because it does not see the sites of a cell run out
        (`mpm.numerics.local_newton`); this takes a third off the Newton iterations.
        """
        cells, nu = self.bed.cells, self.nu_surface[:, : len(new)]
        product = np.stack([m.multiply(c) for m, c in zip(matrices, new, strict=True)])
        inflow = np.maximum((diagonal * new - product + rhs)[:, cells], 0.0)

        def sources(c: Floats, active: NDArray[np.intp]) -> tuple[Floats, Floats]:
            rates, slopes = self.surface.part(active).rates(c, theta[:, active], dt)
            area = self.active_area[active]
            return nu.T @ rates * area, np.einsum("ri,rjn->nij", nu, slopes) * area[:, None, None]

        idle = UNDERSHOOT * self.feed_rate
        start = np.maximum(new[:, cells], LOWEST)
        settled = balance_locally(start, diagonal[:, cells], inflow, sources, idle, tries=3)
        return np.where(inflow > 0.0, settled, 0.0)

    def book(
        self,
        operators: list[FluxOperator],
        dt: float,
        shares: Floats,
        drawn: dict[str, Floats],
        events: Floats,
        gas_events: Floats,
    ) -> None:
        """Enter `dt` [s] at the present concentrations into the ledger, with the events [mol/m] of that time."""
        ledger = self.ledger
        ledger.surface_events += events
        ledger.gas_events += gas_events
        for i in range(len(self.names)):
            c = self.concentration[i]
            for k, inlet in enumerate(self.case.geometry.inlets):
                port = operators[i].inlets[inlet.name]
                inside = self.feed[inlet.name].get(self.names[i], 0.0) * shares[k]
                ledger.fed[k, i] += dt * (port.into.sum() * inside - port.out @ c[port.cells])
            for k, (name, port) in enumerate(operators[i].outlets.items()):
                ledger.out[k, i] += dt * (port.out @ c[port.cells])
                if name in drawn:
                    ledger.back[k, i] += dt * port.into.sum() * drawn[name][i]
        if operators:
            for k, port in enumerate(operators[0].outlets.values()):
                ledger.out_volume[k] += dt * port.volume_out.sum()
                ledger.back_volume[k] += dt * port.into.sum()


def forcing(residual: float) -> float:
    """Inner tolerance that keeps Newton's quadratic convergence (Eisenstat and Walker 1996, choice 2 in spirit): the next residual is
    about the square of this one in any case, and nothing is gained below LAST."""
    return min(max(0.3 * residual, LAST / residual), FORCING)


def open_share(inlet: Inlet, t0: float, dt: float) -> float:
    """Share of the step of `dt` from `t0` [s] during which the inlet doses."""
    dosing = sum(max(min(stop, t0 + dt) - max(start, t0), 0.0) for start, stop in inlet.windows)
    return min(dosing / dt, 1.0)
