"""First guesses of the steady state from a march in time, where Newton's method finds none.

Reactions that their own products drive ignite: from a cold start, long implicit steps jump to and fro across the fold where they do. Short
steps of the transport itself, which are halved where they must be, follow gas and solids through it; they end close enough.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from mpm.arrays import Floats
from mpm.errors import ConvergenceError

if TYPE_CHECKING:
    from mpm.reactor.steady.conveyor import Conveyor
    from mpm.reactor.system import System

PASSAGES = (2, 4, 8, 16)  # of the bed through the strip, one march after the other
RESTING_STEP = 0.1  # s, of a bed that does not move
SHARES = 8  # steps while solids are in a cell: ignition is quicker than their passage
LATE = 1e6  # s: when inlets that begin later blow


def guesses(
    system: System, conveyor: Conveyor, concentration: Floats, theta: Floats
) -> Iterator[tuple[Floats, Floats]]:
    """Concentrations (species, own) and coverages (sites, reactive) after more and more passages of the bed, until a march fails;
    collective."""
    for passages in PASSAGES:
        try:
            steps = passages * system.strip.grid.columns
            concentration, theta = _marched(system, conveyor, concentration, theta, steps)
        except ConvergenceError:
            return
        yield concentration, theta


def _marched(
    system: System, conveyor: Conveyor, concentration: Floats, theta: Floats, steps: int
) -> tuple[Floats, Floats]:
    """The state after the bed has moved on by so many columns; gas, solids and accounts of the `system` stay as they are."""
    transport, coverage = system.transport, system.coverage
    solids, gas = coverage.memento(), transport.memento()
    operators = system.operators(system.velocity)
    dt = (conveyor.residence if conveyor.runs else RESTING_STEP) / SHARES
    column = conveyor.direction * system.strip.grid.dx if conveyor.runs else 0.0
    try:
        transport.concentration = concentration
        coverage.become(theta)
        for number in range(SHARES * steps):
            if number % SHARES == 0:
                coverage.slide(column)
            transport.advance(operators, LATE + number * dt, dt)
        return transport.concentration, coverage.theta
    finally:
        transport.recall(gas)
        coverage.recall(solids)
