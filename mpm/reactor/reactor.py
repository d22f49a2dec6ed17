"""The reactor: a case on some ranks, its state, and the history of its run.

result = Reactor(load_case("single_zone")).run("results/zone")
result.summary["titration"]["tma"]["exit_mean"]
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from mpm.arrays import Floats
from mpm.errors import InputError
from mpm.mesh.grid import Grid
from mpm.output.history import Row, columns_of
from mpm.reactor import records
from mpm.reactor.checkpoint import identity
from mpm.reactor.course import Course
from mpm.reactor.flow import Flow
from mpm.reactor.result import Result as Result
from mpm.reactor.run import Run
from mpm.reactor.system import System
from mpm.reactor.writer import Writer
from mpm.report.records import State, Totals

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

if TYPE_CHECKING:
    from mpm.case.case import Case


class Reactor:
    """One case on the ranks of `comm`; with `flow`, that of another reactor whose case differs in species and doses only.

    `system` holds the parts, `course` the history of the run. `field`, `fields`, `coverage`, `totals` and `state` are collective: every
    rank calls them and gets the whole (`fields`: rank 0 alone).
    """

    def __init__(self, case: Case, comm: MPI.Comm = MPI.COMM_WORLD, flow: Flow | None = None):
        self.case, self.comm = case, comm
        self._identity = identity(case)  # now: the profile's file may change while the run goes on
        self.system = System(case, comm)
        if flow is not None:
            self.system.find_flow(known=flow)
        self.course = Course(self.system)

    def run(
        self,
        output: str | Path | None = None,
        callback: Callable[[Reactor], None] | None = None,
        resume: bool = False,
        overwrite: bool = False,
        progress: bool | None = None,
    ) -> Result:
        """March to the end of the case, calling `callback(reactor)` at every output time.

        `progress`: show how it gets on; by default where somebody watches, on a terminal or in a notebook.

        With `output`, everything the run writes goes there; `resume` continues from its restart state. Raises InputError (directory,
        changed case, a reactor that has run), ConvergenceError, StorageError (full disk) and Interrupted; after the last three the
        directory is usable and can be resumed.
        """
        course = self.course
        if course.rows:  # balances, rows and what passed since the last one count from the beginning of a run
            raise InputError(
                f"run: found a reactor that has run to t = {self.time:.6g} s; accepted: a new one, which may take its flow over"
            )
        course.clock.begin()
        writer = Writer(course, output, self._identity)
        call_back = None if callback is None else lambda: callback(self)
        summary = Run(course, writer, call_back, progress).execute(resume, overwrite)
        return Result(course, summary, writer.path)

    def stop(self) -> None:
        """Let the run end after the step that is under way, as a signal does; it can be resumed."""
        self.course.stop()

    # --- looking ---

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.course.clock.time

    @property
    def steps(self) -> int:
        """Time steps done; iterations of a steady state."""
        return self.course.clock.steps

    @property
    def grid(self) -> Grid:
        """Columns, rows, layers and zones of the strip."""
        return self.system.grid

    @property
    def flow(self) -> Flow:
        """The flow of the gas, found when it is first asked for: `Reactor(other_case, flow=reactor.flow)` need not find it again."""
        return self.system.flow

    @property
    def numbers(self) -> Row:
        """The latest row of the history."""
        return self.course.numbers

    def history(self) -> dict[str, Floats]:
        """Columns of the history; NaN where a row lacks one."""
        return columns_of(self.course.rows)

    def totals(self) -> Totals:
        """What has passed so far, summed over all ranks; collective."""
        return records.totals(self.system)

    def state(self) -> State:
        """Coverage, dosed species and gas reaction rates now; collective."""
        return records.state(self.system)

    def fields(self) -> dict[str, Floats]:
        """All cell fields for the files, in the grid's order, on rank 0 (empty elsewhere); collective."""
        return records.fields(self.system)

    def field(self, name: str) -> Floats:
        """One cell field as (rows, columns) on every rank, or (rows, columns, 2) for `velocity`; collective.

        Names are those of the files: C_TMA, x_CH4, theta_OH, cvd_rate, velocity, pressure. Raises InputError for another.
        """
        return records.field(self.system, name)

    def coverage(self, layer: str, site: str) -> Floats:
        """Coverage of `site` in `layer` as (rows, columns), bottom row first; collective. Raises InputError for unknown names."""
        return records.coverage(self.system, layer, site)
