"""The course of a run: a system, how far it has come, and the history of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm.output.history import Row
from mpm.reactor import records
from mpm.reactor.clock import Clock
from mpm.report.contents import row_of
from mpm.report.records import Records, Totals

if TYPE_CHECKING:
    from mpm.motion.schedule import Step
    from mpm.reactor.system import System


class Course:
    """Takes the steps of `system` and keeps the `rows` of its history; `before` are the totals at the latest one.

    `stopping` is set to end the run after the step that is under way. All methods are collective.
    """

    def __init__(self, system: System):
        self.system, self.case, self.comm = system, system.case, system.comm
        self.clock = Clock(system.case.time.end, system.schedule.steps)
        self.rows: list[Row] = []
        self.before: Totals | None = None
        self.stopping = False

    def advance(self, step: Step) -> None:
        """Take one step of the schedule. Raises ConvergenceError, the state before it kept."""
        self.system.advance(step)
        self.clock.time, self.clock.steps = step.t1, step.index + 1

    def records(self) -> Records:
        """What a row of the history is made of, now."""
        system, now = self.system, self.clock.time
        return Records(
            self.case, system.grid, now, records.totals(system), records.state(system), self.before
        )

    def record(self) -> None:
        """Add a row to the history."""
        now = self.records()
        self.before = now.totals
        self.go_on_from([*self.rows, row_of(now)])

    def go_on_from(self, rows: list[Row]) -> None:
        """Make `rows` the history so far."""
        self.rows = rows
        balances = [value for name, value in self.numbers.items() if name.startswith("balance.")]
        self.clock.worst_balance = max(balances, default=0.0)

    @property
    def numbers(self) -> Row:
        """The latest row."""
        return self.rows[-1] if self.rows else {}

    def stop(self) -> None:
        """Let the run end after the step that is under way, as a signal does; it can be resumed."""
        self.stopping = True
