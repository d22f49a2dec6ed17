"""What a run writes, where it writes at all: rank 0 opens the files, the others wait for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpm.case.keys import values
from mpm.flow.numbers import flux_profiles
from mpm.output.directory import RunDirectory
from mpm.output.history import Row
from mpm.output.phases import LastCycle, phase_fields
from mpm.parallel import is_root, on_root
from mpm.reactor import checkpoint, records

if TYPE_CHECKING:
    from pathlib import Path

    from mpm.motion.schedule import Step
    from mpm.reactor.course import Course


class Writer:
    """Writes a run, whose case is `known` by this identity, to a directory; without one it writes nothing. Every method is collective.

    `kept` is the time of the restart state on disk [s]; `phases_lost` counts the phases of the last cycle before that state that were not
    written, because it was not the last cycle then.
    """

    def __init__(self, course: Course, output: str | Path | None, known: checkpoint.Identity):
        self.course, self.comm, self.known = course, course.comm, known
        self.directory = None if output is None else RunDirectory(output)
        self.last_cycle = LastCycle.of(course.case, course.system.schedule)
        self.kept: float | None = None
        self.phases_lost = 0

    @property
    def path(self) -> Path | None:
        """Where the run is written."""
        return None if self.directory is None else self.directory.path

    @property
    def log(self) -> Path | None:
        """The log's file, on rank 0."""
        return self.directory.log if self.directory is not None and is_root(self.comm) else None

    def open(self, resume: bool, overwrite: bool) -> None:
        """Prepare the directory and read a restart state into every rank. Raises InputError (directory, changed case)."""
        directory, case = self.directory, self.course.case
        if directory is None:
            return

        def prepare() -> Any:
            directory.prepare(resume=resume, overwrite=overwrite)
            state = directory.read_checkpoint() if resume else None
            if resume:
                checkpoint.check_same_case(directory, case, state)
            directory.write_case(case.to_toml())
            if not resume:  # a resumed case is the resolved one, in which everything is typed
                directory.write_origin({value.name: value.origin for value in values(case)})
            return state

        state = on_root(self.comm, prepare)
        if state is not None:
            self._go_on(directory, *state)
        elif resume:
            on_root(self.comm, lambda: directory.cut_back(0, 0.0))

    def _go_on(self, directory: RunDirectory, arrays: checkpoint.Arrays, meta: dict[str, Any]) -> None:
        """Put the run into a restart state and drop what was written after it."""
        course = self.course
        checkpoint.restore(course, arrays, meta)
        self.kept = time = course.clock.time

        def cut_back() -> tuple[list[Row], int]:
            directory.cut_back(meta["rows"], time, cycle=self.last_cycle.since)
            return list(directory.table.rows), len(directory.phases.steps)

        rows, phases = on_root(self.comm, cut_back)
        course.go_on_from(rows)
        self.phases_lost = self.last_cycle.passed(course.system.schedule, course.clock.steps) - phases

    def output(self) -> None:
        """The latest row of the history and the fields."""
        directory, course = self.directory, self.course
        if directory is None:
            return
        fields = records.fields(course.system, directory.fields.precision)

        def write() -> None:
            directory.append_history(course.numbers)
            directory.write_fields(course.clock.time, course.system.grid, fields)

        on_root(self.comm, write)

    def phase(self, step: Step) -> None:
        """What `step` has led to, when it is one of the wanted phases of the last cycle."""
        directory, system, time = self.directory, self.course.system, self.course.clock.time
        motion = system.bed_motion
        number = self.last_cycle.number(step)
        if directory is None or number is None:
            return
        usual = records.fields(system, directory.phases.precision)

        def write() -> None:
            fields = phase_fields(usual, system.case, system.grid, motion, step)
            moved = motion.vibration.displacement(step.since + step.dt)
            directory.phases.write(time, system.grid, fields, moved, number)

        on_root(self.comm, write)

    def keep(self) -> None:
        """The restart state."""
        if self.directory is not None:
            checkpoint.write(self.course, self.known, self.directory)
            self.kept = self.course.clock.time

    def numbers(self, summary: dict[str, Any]) -> None:
        """The summary, and the flux of the mean flow along the strip."""
        directory, system = self.directory, self.course.system
        if directory is None or not system.has_flow:
            return
        profiles = flux_profiles(system.strip, system.flow.sequence.mean())

        def write() -> None:
            directory.write_flux(profiles)
            directory.write_summary(summary)

        on_root(self.comm, write)

    def close(self) -> None:
        """Give the directory free for others."""
        if self.directory is not None:
            self.directory.release()
