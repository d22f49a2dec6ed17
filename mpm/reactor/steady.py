"""Quasi-steady state of gas and coverage in one nonlinear solve (fidelity = "steady").

Newton's method with a sparse LU factor on the system of `mpm.reactor.steady_system`. Each of its steps ends with a balance of every
cell by itself (`mpm.reactor.cellbalance`), without which a front thinner than a cell hardly moves. Large meshes start from the steady state
of a coarser one (`mpm.reactor.coarsening`), others from the gas and the solids of the case. Where Newton's method does not find the state
from there, pseudo-time of growing steps does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.errors import ConvergenceError
from mpm.numerics.linear import DirectSolver
from mpm.parallel import any_rank, largest, total
from mpm.reactor.cellbalance import balance_cells
from mpm.reactor.coarsening import coarser, prolong
from mpm.reactor.conveying import carry
from mpm.reactor.sequence import Replay
from mpm.reactor.steady_system import SteadySystem, doses
from mpm.transport.tracers import steady_fields

if TYPE_CHECKING:
    from mpm.reactor.reactor import Reactor
    from mpm.transport.fluxes import FluxOperator
    from mpm.transport.species import Transport

Floats = NDArray[np.float64]
CONVERGED = 1e-11  # sum of |residual| over the largest feed
ROUNDING = 1e-10  # accepted when nothing improves any more
TRIES = 50  # Newton steps from the first guess
STEP_TRIES = 15  # and per step of pseudo-time
LIMIT = 400  # Newton steps on one mesh
DAMPED = 0.5  # share of a Newton step that is taken when the one before made things worse: two iterates may follow each other for ever
SETTLED = 0.01  # residual at which pseudo-time goes on
FIRST_STEP, SHORTEST_STEP = 1.0, 1e-6  # s, pseudo-time
FAR = 1e4  # s, pseudo-time from which the steps grow by as much


class SteadyProblem(SteadySystem):
    """The steady system of a reactor on its flow field `number`, and how it is solved.

    `watch(iteration, residual)` is called after every Newton step; `iterations` counts those on this mesh.
    """

    def __init__(
        self,
        reactor: Reactor,
        number: int,
        watch: Callable[[int, float], None] = lambda iteration, residual: None,
    ):
        super().__init__(reactor, number)
        self.reactor, self.watch = reactor, watch
        self.iterations = 0
        self._solver: DirectSolver | None = None
        self._trouble: ConvergenceError | None = None  # of the last linear system

    def solve(self) -> None:
        """Find the quasi-steady state. Raises ConvergenceError; the last iterate is kept."""
        self._start_from_coarser()
        start = self.concentration, self.theta
        try:
            if not self._relax(self.last_step, TRIES):
                self.concentration, self.theta = start
                self._pseudo_time()
        finally:
            self._release()

    def newton(self, step: float, share: float = 1.0) -> float:
        """One Newton step, or a `share` of it, at pseudo-time step `step` [s]; returns the residual after it, relative to the feed.

        The linear system gives the inflow of every cell and the coverage with which solids enter it. Concentrations follow from the
        balance of each cell with these, coverages from the concentrations by `carry`; both stay physical, however long the step.
        """
        gas, coverage, parts = self.residual(step)
        matrix = self.jacobian(step, parts)
        if self._solver is None:
            self._solver = DirectSolver(matrix, "steady state")
            self._x, self._y = matrix.createVecs()
        self._y.array[:] = np.concatenate([gas.T.ravel(), coverage.T.ravel(), np.zeros(self.held)])
        self._solver.solve(self._y, self._x)
        if any_rank(self.strip.comm, not np.isfinite(self._x.array).all()):
            raise ConvergenceError("steady state: the solution of the linear system is not finite")
        gas_step, coverage_step = np.split(self._x.array[: self.local - self.held], [self.b * self.own])
        predicted = self.concentration - share * gas_step.reshape(self.own, self.b).T
        leaving = self.theta[: self.free, self.moving] - share * coverage_step.reshape(-1, self.free).T
        leaving = np.clip(leaving, 0.0, 1.0)
        leaving = np.vstack([leaving, np.maximum(1.0 - leaving.sum(axis=0), 0.0)])
        self.theta = self.theta.copy()
        self.theta[:, self.moving] = leaving / leaving.sum(axis=0)
        balance_cells(self, predicted, step)
        carry(self, step)
        self.iterations += 1
        return self.size(*self.residual(step)[:2])

    def _relax(self, step: float, tries: int, target: float = CONVERGED) -> bool:
        """Newton steps until the residual is below `target`; False when `tries` are not enough."""
        worst, share = np.inf, 1.0
        start = self.concentration, self.theta
        for _ in range(tries):
            last = worst
            try:
                worst = self.newton(step, share)
            except ConvergenceError as error:
                self._trouble = error
                return False
            if not np.isfinite(worst):
                self.concentration, self.theta = start
                return False
            self.watch(self.iterations, worst)
            if worst < target or (worst < ROUNDING and worst > 0.5 * last):
                return True
            share = 1.0 if worst < last else DAMPED
        return False

    def _pseudo_time(self) -> None:
        """March from the present state to rest with steps that grow as long as each converges. Raises ConvergenceError.

        Solids that come back approach their steady coverage over many turns, when two equal doses work against each other; that is slow
        in time and far for Newton's method, but easy for long implicit steps.
        """
        step = FIRST_STEP
        self.old = self.concentration, self.theta
        while True:
            last = step >= self.last_step
            if self._relax(step, STEP_TRIES, CONVERGED if last else SETTLED):
                if last:
                    return
                self.old = self.concentration, self.theta
                step = min((10.0 if step < FAR else FAR) * step, self.last_step)
            else:
                step /= 20.0
                if step < SHORTEST_STEP or self.iterations > LIMIT:
                    raise self._failure(step) from self._trouble
                self.concentration, self.theta = self.old

    def _start_from_coarser(self) -> None:
        """Take over the steady state of a coarser mesh where that saves work; without one, the present state stays the first guess."""
        case = coarser(self.transport.case)
        if case is None:
            return
        reactor = type(self.reactor)(case, self.strip.comm)
        reactor.flows = Replay.solve(case, reactor.strip, reactor.motion, reactor.schedule, None)
        reactor.flows.register(reactor.transport)
        problem = SteadyProblem(reactor, 0, self.watch)
        try:
            problem.solve()
            prolong(problem, self)
            self.old = self.concentration, self.theta
            carry(self, self.last_step)
        except ConvergenceError:
            pass  # a first guess is not worth an error

    def _release(self) -> None:
        """Free the matrix and its factor; collective."""
        if self._solver is not None:
            self._solver.destroy()
            self._solver = self._matrix = None

    def _failure(self, step: float) -> ConvergenceError:
        """Says which cell is worst."""
        gas, coverage, _ = self.residual(step)
        share = np.abs(gas).sum(axis=0)
        worst = largest(self.strip.comm, [share.max(initial=0.0)])[0]
        cell = int(np.argmax(share)) if len(share) and share.max() == worst else -1
        here = int(largest(self.strip.comm, [float(self.strip.cell[cell]) if cell >= 0 else -1.0])[0])
        grid = self.strip.grid
        row, column = divmod(here, grid.columns)
        x, y = 0.5 * (grid.x[column] + grid.x[column + 1]), 0.5 * (grid.y[row] + grid.y[row + 1])
        return ConvergenceError(
            f"steady state: Newton stopped after {self.iterations} iterations, at a pseudo-time step of {step:.2g} s, at a residual of "
            f"{self.size(gas, coverage):.3g} of the feed, worst at x = {1e3 * x:.2f} mm, y = {1e3 * y:.2f} mm; "
            f"the last iterate is kept; try fidelity averaged"
        )

    def settle_accounts(self) -> None:
        """Hand the state to the reactor's transport and bed, and book one second of it."""
        transport, bed = self.transport, self.bed
        _, _, parts = self.residual(self.last_step)
        transport.concentration[: self.b] = self.concentration
        _settle(
            transport,
            self.operators,
            self.shares,
            parts["rates"] * transport.active_area,
            parts["gas_rates"] * transport.gas_volume,
        )
        bed.theta = self.theta.copy()
        resting = transport.surface.part(self.resting)
        at_rest = self.concentration[:, bed.cells[self.resting]]
        bed.theta[:, self.resting] = resting.coverage(at_rest, self.old[1][:, self.resting], self.last_step)
        if self.conveys and not self.periodic:
            entering = self.incoming()
            last, first = self.column == self.last, self.column == self.first
            carried = bed.capacity[self.moving] / self.residence
            gone = self.theta[:, self.moving][:, last] @ carried[last] - entering[:, first] @ carried[first]
            bed.passed = total(self.strip.comm, gone)


class TracerProblem:
    """The steady state where nothing is fed that reacts: linear, and solved with the accounts. Solids stay as they come in."""

    iterations = 0

    def __init__(self, reactor: Reactor, number: int):
        self.transport, self.operators = reactor.transport, reactor.transport.operators(number)

    def solve(self) -> None:
        """Nothing to iterate on."""

    def settle_accounts(self) -> None:
        """Find the concentrations and book one second of them."""
        transport = self.transport
        none = np.zeros_like(transport.ledger.surface_events), np.zeros_like(transport.ledger.gas_events)
        _settle(transport, self.operators, doses(transport), *none)


def steady_problem(
    reactor: Reactor, number: int, watch: Callable[[int, float], None]
) -> SteadyProblem | TracerProblem:
    """The problem of a reactor on its flow field `number`: nonlinear where gas that reacts comes in."""
    transport = reactor.transport
    coupled = len(transport.roles.coupled)
    supply = transport.supply(transport.operators(number), doses(transport), {})[:coupled]
    if any_rank(reactor.comm, bool(supply.any())):
        return SteadyProblem(reactor, number, watch)
    return TracerProblem(reactor, number)


def _settle(
    transport: Transport, operators: list[FluxOperator], shares: Floats, events: Floats, gas_events: Floats
) -> None:
    """Solve the species that do not react under `events` per second [mol/m/s] of surface and gas reactions; book one second."""
    coupled = len(transport.roles.coupled)
    supply = transport.supply(operators, shares, {})
    supply[:, transport.bed.cells] += transport.nu_surface.T @ events
    supply += transport.nu_gas.T @ gas_events
    transport.concentration[coupled:] = steady_fields(transport, operators[coupled:], supply[coupled:])
    drawn = transport.outlet_means(operators, transport.concentration)
    transport.book(operators, 1.0, shares, drawn, events, gas_events)
