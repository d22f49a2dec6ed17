"""One run of a reactor from its start, or from a restart state, to its end: steps, output times, restart states, interruptions."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mpm.advice.checks import check_case
from mpm.errors import ConvergenceError, Interrupted, StorageError, printable, storage_error
from mpm.output.directory import FAILED
from mpm.parallel import is_root, largest, on_root
from mpm.reactor.progress import FLOW, Progress, log_file
from mpm.reactor.records import totals
from mpm.reactor.steady.thermal import steady_problem
from mpm.reactor.summary import summarise
from mpm.report.balances import LIMIT, require_balance, worst_balance
from mpm.signals import stop_signals

if TYPE_CHECKING:
    from mpm.reactor.course import Course
    from mpm.reactor.writer import Writer

log = logging.getLogger("mpm")


class Run:
    """Follows `course` to the end of its case, or finds its steady state; `callback` is called at every output time."""

    def __init__(
        self,
        course: Course,
        writer: Writer,
        callback: Callable[[], None] | None,
        progress: bool | None,
    ):
        self.course, self.system, self.clock = course, course.system, course.clock
        self.case, self.comm = course.case, course.comm
        self.writer, self.callback = writer, callback
        self.progress = Progress(self.clock, self.comm, progress)

    def execute(self, resume: bool, overwrite: bool) -> dict[str, Any]:
        """Do it all and return the summary.

        Raises InputError (directory, changed case), ConvergenceError, StorageError (full disk) and Interrupted; after the last three the
        directory is usable and can be resumed.
        """
        try:
            self.writer.open(resume, overwrite)
            with (
                log_file(log, self.writer.log),
                self.progress,
                stop_signals(self.course.stop),
            ):
                self._tell_what()
                return self._steady() if self.case.fidelity == "steady" else self._transient()
        except OSError as error:
            raise self._explained(error) from error
        finally:
            self.writer.close()

    def _explained(self, error: OSError) -> Exception:
        """What a full or closed disk means for the run; the error itself when it is about something else."""
        said, kept = storage_error(error), self.writer.kept
        if isinstance(said, StorageError) and kept is not None:
            said = StorageError(
                f"{said}; the restart state at t = {kept:.6g} s is whole: make room and go on with --resume"
            )
        return said or error

    def _tell_what(self) -> None:
        case = self.case
        log.info(
            "%s: %s, %d cells, %d ranks",
            printable(case.title),
            case.fidelity,
            self.system.grid.cells,
            self.comm.size,
        )
        for warning in on_root(self.comm, lambda: check_case(case)["warnings"]):
            self._warn(warning)

    def _warn(self, text: str) -> None:
        log.warning("warning: %s", text)
        self.progress.warn(text)

    # --- the transient ---

    def _transient(self) -> dict[str, Any]:
        try:
            if self.writer.kept is not None:
                log.info("resumed at t = %g s, after step %d", self.clock.time, self.clock.steps)
                self._tell_lost_phases()
            else:
                self._find_flow()
                log.info("flow found after %.1f s", self.clock.wall)
                self._record()
                self._keep()  # the flow may have taken minutes
            self._march()
            require_balance(self.case, totals(self.system))
        except (ConvergenceError, Interrupted) as error:
            self._give_up(error)
            raise
        return self._sum_up("done")

    def _tell_lost_phases(self) -> None:
        lost = self.writer.phases_lost
        if lost > 0:
            self._warn(
                f"output.phases: {lost} of the {self.case.output.phases} phases of the last cycle lie before "
                f"t = {self.clock.time:g} s, where this run goes on, and were not written"
            )

    def _find_flow(self) -> None:
        """Find the flow of a fresh run, unless it was handed over."""

        def watch(cycle: int, change: float) -> None:
            self.progress.say(f"{FLOW}: cycle {cycle + 1}, relative change {change:.0e}")
            self._check_stop()

        if not self.system.has_flow:
            self.progress.say(FLOW)
            self.system.find_flow(watch)

    def _march(self) -> None:
        """All steps to the end of the case.

        What happens only because the run ends here, a cut step and a row between two output times, comes after the last restart state: a
        run resumed with a later end is the run of that length.
        """
        schedule, clock, output = self.system.schedule, self.clock, self.case.output
        last_kept = time.monotonic()
        step = schedule.step(max(schedule.steps - 1, 0))
        for step in schedule.from_step(clock.steps):
            if step.cut:
                self._keep()
            self.course.advance(step)
            self.progress.advance()
            if schedule.is_output(step, output.every):
                self._record()
                log.info("%s", self.progress.line())
            self.writer.phase(step)
            if clock.steps == schedule.steps:
                break
            due = time.monotonic() - last_kept > output.checkpoint
            stop, due = largest(self.comm, [self.course.stopping, due and is_root(self.comm)]) > 0.0
            if due:
                self._keep()
                last_kept = time.monotonic()
            if stop:
                raise Interrupted(f"interrupted at t = {clock.time:.6g} s, after step {clock.steps}")
        if not step.cut:
            self._keep()
        if self.course.rows[-1]["time"] != clock.time:
            self._record()

    def _check_stop(self) -> None:
        if largest(self.comm, [self.course.stopping])[0] > 0.0:
            raise Interrupted(
                "interrupted while the flow was being found; nothing but the case has been written"
            )

    # --- the steady state ---

    def _steady(self) -> dict[str, Any]:
        """Find the quasi-steady state; the last iterate is written when that fails or is out of balance."""

        def watch(iteration: int, residual: float) -> None:
            self.progress.say(f"steady state, Newton step {iteration}, residual {residual:.0e} of the feed")
            self._check_stop()

        error: ConvergenceError | Interrupted | None = None
        try:
            self._find_flow()
        except (ConvergenceError, Interrupted) as stopped:
            _log_end(stopped)
            raise
        problem = steady_problem(self.system, watch)
        try:
            problem.solve()
        except (ConvergenceError, Interrupted) as stopped:
            error = stopped
        try:
            problem.hand_over()
            self.clock.steps = problem.iterations
            self.system.count_from_here()
            require_balance(self.case, totals(self.system))
        except ConvergenceError as unbalanced:
            error = error or unbalanced
        if error is not None:
            _log_end(error)
        self._record(error is None)
        summary = self._sum_up("done" if error is None else _status(error))
        if error is not None:
            raise error
        return summary

    # --- writing ---

    def _record(self, call_back: bool = True) -> None:
        """Record an output time: a row of the history, the fields, the callback."""
        self.course.record()
        self.writer.output()
        if self.callback is not None and call_back:
            self.callback()

    def _keep(self) -> None:
        """Write the restart state. Raises BalanceError when it is out of balance: then the last good one stays."""
        if self.writer.directory is not None:
            require_balance(self.case, totals(self.system))
            self.writer.keep()

    def _give_up(self, error: ConvergenceError | Interrupted) -> None:
        """Keep the last good state and say in summary.json how the run ended."""
        _log_end(error)
        if self.writer.directory is None or not self.system.has_flow:
            return
        if worst_balance(self.case, totals(self.system))[1] <= LIMIT:
            self.writer.keep()
        self._sum_up(_status(error))

    def _sum_up(self, status: str) -> dict[str, Any]:
        summary = summarise(self.course, status)
        self.writer.numbers(summary)
        return summary


def _status(error: ConvergenceError | Interrupted) -> str:
    return "interrupted" if isinstance(error, Interrupted) else "failed"


def _log_end(error: Exception) -> None:
    """The last line of the log of a run that ends early: all that is left of one that has failed before its first step."""
    log.error("%s%s", "" if isinstance(error, Interrupted) else FAILED, error)
