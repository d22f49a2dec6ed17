"""How the quasi-steady state of gas and coverage is found (fidelity = "steady").

Newton's method with a sparse LU factor on `mpm.reactor.steady.system`. Each of its steps ends with a balance of every cell by itself
(`mpm.reactor.steady.cellwise`), without which a front thinner than a cell hardly moves. Large meshes start from the steady state of a
coarser one (`mpm.reactor.steady.coarsening`), others from the gas and the solids of the case. Where Newton's method does not find the
state from there, pseudo-time of growing steps does, or a march in time (`mpm.reactor.steady.marching`) leads near it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.numerics.linear import DirectSolver
from mpm.numerics.memory import give_back
from mpm.parallel import any_rank, largest
from mpm.reactor.steady.cellwise import balanced
from mpm.reactor.steady.coarsening import coarser, prolonged
from mpm.reactor.steady.conveyor import Conveyor
from mpm.reactor.steady.marching import guesses
from mpm.reactor.steady.system import LAST_STEP, Evaluation, Iterate, SteadySystem
from mpm.reactor.system import System
from mpm.transport.fluxes import FluxOperator
from mpm.transport.reactions import Events
from mpm.transport.species import Transport
from mpm.transport.tracers import steady_fields

Watch = Callable[[int, float], None]  # of a Newton step's number and the residual after it
CONVERGED = 1e-11  # sum of |residual| over the largest feed
ROUNDING = 1e-10  # accepted when nothing improves any more
TRIES = 50  # Newton steps from the first guess
STEP_TRIES = 15  # and per step of pseudo-time
LIMIT = 400  # Newton steps on one mesh
DAMPED = 0.5  # length of a damped Newton step, after one that made things worse: two iterates may follow each other for ever
HOPELESS = 1e9  # residual that no step has come back from
LOOSE = 0.01  # residual at which pseudo-time goes on
FIRST_STEP, SHORTEST_STEP = 1.0, 1e-6  # s, pseudo-time
GROWTH, SHRINKAGE = 10.0, 20.0  # of its steps, after one that converged and one that did not
FAR = 1e4  # s, pseudo-time from which the steps grow by as much


class SteadyProblem(Protocol):
    """A steady state to be found; `iterations` counts Newton steps."""

    iterations: int

    def solve(self) -> None:
        """Find it. Raises ConvergenceError; the last iterate is kept."""

    def hand_over(self) -> None:
        """Give the state to the system's transport and coverage, and book one second of it."""


class SteadySolver:
    """Finds the steady state of a `system` whose gas reacts; `watch(iteration, residual)` is called after every Newton step."""

    def __init__(self, system: System, watch: Watch = lambda iteration, residual: None):
        self.equations = SteadySystem(system)
        self.watch, self.iterations = watch, 0
        self.state = self.old = self.equations.start
        self._solver: DirectSolver | None = None
        self._trouble: ConvergenceError | None = None  # of the last linear system

    def solve(self) -> None:
        """Find the quasi-steady state. Raises ConvergenceError; the last iterate is kept."""
        self._start_from_coarser()
        start = self.state
        try:
            if not self._relax(self.equations.last_step, TRIES):
                self.state = start
                self._pseudo_time_or_march(start)
        finally:
            if self._solver is not None:
                self._solver.destroy()
                self._solver = None

    def _pseudo_time_or_march(self, start: Iterate) -> None:
        """Pseudo-time, and where that fails Newton's method from where marches in time lead. Raises the ConvergenceError of pseudo-time."""
        try:
            self._pseudo_time()
        except ConvergenceError:
            last, equations = (self.state, self.old), self.equations
            products = equations.transport.concentration[equations.coupled :]
            cold = np.vstack([start.concentration, products])
            for gas, theta in guesses(equations.system, equations.conveyor, cold, start.theta):
                self.state = self.old = Iterate(gas[: equations.coupled], theta)
                if self._relax(equations.last_step, STEP_TRIES):
                    return
            self.state, self.old = last
            raise

    def newton(self, at: Evaluation, step: float, length: float = 1.0) -> Evaluation:
        """One Newton step, or a damped one of this `length`, at pseudo-time step `step` [s]; returns the evaluation after it.

        The linear system gives the inflow of every cell and the coverage with which solids enter it. Concentrations follow from the
        balance of each cell with these, coverages from the concentrations by `Conveyor.carry`; both stay physical, however long the step.
        """
        equations = self.equations
        parts = self._linear(at, step)
        gas = parts["gas"].reshape(equations.own, equations.coupled).T
        moving = equations.conveyor.moving
        coverage = parts["coverage"].reshape(len(moving), equations.free).T
        change = length * equations.all_kinds @ coverage
        leaving = np.clip(self.state.theta[:, moving] - change, 0.0, 1.0)
        theta = self.state.theta.copy()
        theta[:, moving] = leaving / leaving.sum(axis=0)
        predicted = self.state.concentration - length * gas
        guess = Iterate(self.state.concentration, theta)
        self._carry(balanced(equations, predicted, guess, self.old, step), theta, step)
        self.iterations += 1
        return equations.evaluate(self.state, self.old, step)

    def _linear(self, at: Evaluation, step: float) -> dict[str, Floats]:
        """The Newton step of all unknowns."""
        equations = self.equations
        equations.fill_jacobian(at, step)
        matrix = equations.jacobian.matrix
        if self._solver is None:
            give_back(equations.strip.comm)  # before the largest of all that a run holds
            self._solver = DirectSolver(matrix, "steady state", single=True)
            self._solution, self._right = matrix.createVecs()
        parts = {"gas": at.gas.T, "coverage": at.coverage.T}
        self._right.array[:] = equations.unknowns.join(parts)
        self._solver.solve(self._right, self._solution)
        found = np.array(self._solution.array)
        if any_rank(equations.strip.comm, not np.isfinite(found).all()):
            raise ConvergenceError("steady state: the solution of the linear system is not finite")
        return equations.unknowns.split(found)

    def _carry(self, concentration: Floats, theta: Floats, step: float) -> None:
        """Take over `concentration` (coupled, own), with the coverages that follow from it."""
        equations = self.equations
        at_solids = concentration[:, equations.coverage.cells]
        surface, old = equations.reactions.surface, self.old.theta
        theta = equations.conveyor.carry(surface, at_solids, theta, old, step)
        self.state = Iterate(concentration, theta)

    def _relax(self, step: float, tries: int, target: float = CONVERGED) -> bool:
        """Newton steps until the residual is below `target`; False when `tries` are not enough."""
        start, length, worst = self.state, 1.0, np.inf
        at = self.equations.evaluate(self.state, self.old, step)
        if not np.isfinite(at.size):  # no coverage was found in some cell
            return False
        for _ in range(tries):
            last = worst
            try:
                at = self.newton(at, step, length)
            except ConvergenceError as error:
                self._trouble = error
                return False
            worst = at.size
            if not worst < HOPELESS:
                self.state = start
                return False
            self.watch(self.iterations, worst)
            if worst < target or (worst < ROUNDING and worst > 0.5 * last):
                return True
            length = 1.0 if worst < last else DAMPED
        return False

    def _pseudo_time(self) -> None:
        """March from the present state to rest with steps that grow as long as each converges. Raises ConvergenceError.

        Solids that come back approach their steady coverage over many turns, when two equal doses work against each other; that is slow
        in time and far for Newton's method, but easy for long implicit steps.
        """
        step, last_step = FIRST_STEP, self.equations.last_step
        self.old = self.state
        while True:
            last = step >= last_step
            if self._relax(step, STEP_TRIES, CONVERGED if last else LOOSE):
                if last:
                    return
                self.old = self.state
                step = min((GROWTH if step < FAR else FAR) * step, last_step)
            else:
                step /= SHRINKAGE
                if step < SHORTEST_STEP or self.iterations > LIMIT:
                    raise self._failure(step) from self._trouble
                self.state = self.old

    def _start_from_coarser(self) -> None:
        """Take over the steady state of a coarser mesh where that saves work; without one, the present state stays the first guess."""
        case = coarser(self.equations.system.case)
        if case is None:
            return
        coarse = SteadySolver(System(case, self.equations.strip.comm), self.watch)
        try:
            coarse.solve()
        except ConvergenceError:
            return  # a first guess is not worth an error
        self.state = self.old = prolonged(coarse.equations, coarse.state, self.equations)
        del coarse
        give_back(self.equations.strip.comm)
        self._carry(self.state.concentration, self.state.theta, self.equations.last_step)

    def _failure(self, step: float) -> ConvergenceError:
        """Says which cell is worst."""
        strip = self.equations.strip
        at = self.equations.evaluate(self.state, self.old, step)
        residual = np.abs(at.gas).sum(axis=0)
        worst = largest(strip.comm, [residual.max(initial=0.0)])[0]
        cell = int(np.argmax(residual)) if len(residual) and residual.max() == worst else -1
        here = int(largest(strip.comm, [float(strip.cell[cell]) if cell >= 0 else -1.0])[0])
        grid = strip.grid
        row, column = divmod(here, grid.columns)
        x, y = grid.centres[column], grid.row_centres[row]
        return ConvergenceError(
            f"steady state: Newton stopped after {self.iterations} iterations, at a pseudo-time step of {step:.2g} s, at a residual of "
            f"{at.size:.3g} of the feed, worst at x = {1e3 * x:.2f} mm, y = {1e3 * y:.2f} mm; "
            f"the last iterate is kept; try fidelity averaged"
        )

    def hand_over(self) -> None:
        """Give the state to the system's transport and coverage, and book one second of it."""
        equations, transport, coverage = self.equations, self.equations.transport, self.equations.coverage
        concentration, theta = self.state.concentration, self.state.theta.copy()
        at = equations.evaluate(self.state, self.old, equations.last_step)
        transport.concentration = np.vstack([concentration, transport.concentration[equations.coupled :]])
        _book(transport, equations.all_operators, equations.shares, at.events)
        resting = equations.conveyor.resting
        at_rest = concentration[:, coverage.cells[resting]]
        surface = equations.reactions.surface.part(resting)
        theta[:, resting] = surface.coverage(at_rest, self.old.theta[:, resting], equations.last_step)
        coverage.become(theta, equations.conveyor.passed(theta))


class TracerSolver:
    """The steady state where nothing is fed that reacts: linear, and solved with the accounts. Solids stay as they come in."""

    iterations = 0

    def __init__(self, system: System):
        self.system = system

    def solve(self) -> None:
        """Nothing to iterate on."""

    def hand_over(self) -> None:
        """Find the concentrations and book one second of them."""
        system, transport = self.system, self.system.transport
        operators = system.operators(system.velocity)
        _book(transport, operators, transport.ports.steady_shares, transport.reactions.none())


class SolidsSolver:
    """The steady state where the gas has no say in what reacts: solids change on their way, and what they let go is carried off."""

    iterations = 0

    def __init__(self, system: System):
        self.system = system
        self.conveyor = Conveyor(system)

    def solve(self) -> None:
        """Nothing to iterate on."""

    def hand_over(self) -> None:
        """Find coverages and concentrations, and book one second of them. Raises ConvergenceError."""
        system, conveyor = self.system, self.conveyor
        transport, coverage, surface = system.transport, system.coverage, system.transport.reactions.surface
        nothing, old = np.zeros((0, len(coverage.cells))), coverage.theta
        theta = conveyor.carry(surface, nothing, old, old, LAST_STEP)
        moving, resting = conveyor.moving, conveyor.resting
        rates = np.zeros((len(surface.reactions), len(coverage.cells)))
        entering = conveyor.entering(LAST_STEP, theta, old)
        passed = surface.part(moving).conveyed(nothing[:, moving], entering, conveyor.span(LAST_STEP))
        rates[:, moving], theta[:, moving] = passed.rates, passed.out
        still = surface.part(resting)
        rates[:, resting] = still.rates(nothing[:, resting], old[:, resting], LAST_STEP)[0]
        theta[:, resting] = still.coverage(nothing[:, resting], old[:, resting], LAST_STEP)
        if any_rank(system.comm, not (np.isfinite(rates).all() and np.isfinite(theta).all())):
            raise ConvergenceError("steady state: no coverage was found; try fidelity averaged")
        no_gas = np.zeros((len(transport.reactions.gas.reactions), transport.strip.owned))
        events = transport.reactions.events(rates, no_gas)
        _book(transport, system.operators(system.velocity), transport.ports.steady_shares, events)
        coverage.become(theta, conveyor.passed(theta))


def species_problem(system: System, watch: Watch) -> SteadyProblem:
    """The species and coverage of a system in its steady flow: nonlinear where gas that reacts comes in or off the solids."""
    ports, reactions, coupled = system.transport.ports, system.transport.reactions, system.transport.coupled
    supply = ports.supply(system.operators(system.velocity), ports.steady_shares, {})[:coupled]
    if coupled and (reactions.start_by_themselves or any_rank(system.comm, bool(supply.any()))):
        return SteadySolver(system, watch)
    return SolidsSolver(system) if reactions.start_by_themselves else TracerSolver(system)


def _book(transport: Transport, operators: Sequence[FluxOperator], shares: Floats, events: Events) -> None:
    """Solve the species that do not react under the `events` of the others; book one second of all."""
    coupled, ports = transport.coupled, transport.ports
    supply = ports.supply(operators, shares, {}) + transport.reactions.made(events)
    products = steady_fields(transport.strip, list(operators[coupled:]), supply[coupled:])
    transport.concentration = np.vstack([transport.concentration[:coupled], products])
    drawn = ports.outlet_means(operators, transport.concentration)
    transport.ledger.book(ports, operators, transport.concentration, 1.0, shares, drawn, events)
