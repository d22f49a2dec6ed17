"""The steady state with heat: flow and temperature that belong together, then species and coverage, and the heat of their reactions.

Temperature in a given flow is one linear system; the flow follows from the density that it makes, until neither changes. Reactions warm the
bed by so little that species are seldom found twice.
"""

from __future__ import annotations

from mpm.errors import ConvergenceError
from mpm.reactor.steady.solver import SteadyProblem, Watch, species_problem
from mpm.reactor.system import System
from mpm.reactor.thermal import Thermal

SETTLED = 0.01  # K: a change of temperature that species need not follow
MIXED = 1e-4  # relative change of the density of a mixture that the flow need not follow
ROUNDS = 10


class ThermalSteady:
    """Finds the state of a `system` whose flow and temperature are there, but for the heat of reaction."""

    def __init__(self, system: System, thermal: Thermal, watch: Watch):
        self.system, self.thermal, self.watch = system, thermal, watch
        self._inner = species_problem(system, watch)
        self._handed_over = False
        self.iterations = 0

    def solve(self) -> None:
        """Species and temperatures until the latter no longer change. Raises ConvergenceError."""
        system, empty = self.system, self.system.transport.ledger.memento()
        for _ in range(ROUNDS):
            self._inner.solve()
            self.iterations += self._inner.iterations
            self._inner.hand_over()
            self._handed_over = True
            if self.thermal.settle() < SETTLED and self.thermal.unmixed() < MIXED:
                return
            system.transport.ledger.recall(empty)
            system.find_flow()
            self._handed_over = False
            self._inner = species_problem(system, self.watch)
        raise ConvergenceError(
            f"steady state: temperatures still change by more than {SETTLED:g} K after {ROUNDS} rounds of species and heat; "
            "try fidelity averaged"
        )

    def hand_over(self) -> None:
        """Give the state to the system, and book one second of species and heat."""
        if not self._handed_over:
            self._inner.hand_over()
        self.thermal.book_second()


def steady_problem(system: System, watch: Watch) -> SteadyProblem:
    """The problem of a system in its steady flow, with heat or without."""
    if system.thermal is None:
        return species_problem(system, watch)
    return ThermalSteady(system, system.thermal, watch)
