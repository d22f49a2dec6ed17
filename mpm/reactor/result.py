"""What a run gives to the program that started it; what draws is imported where it does, as the solver loads this before its first step."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpm.errors import InputError
from mpm.output.history import columns_of
from mpm.output.results import LastInstant, Run, load_run
from mpm.parallel import on_root
from mpm.reactor import records
from mpm.report.notebook import result_html
from mpm.report.verdict import verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mpm.reactor.course import Course


class Result:
    """What a run gives: `summary` (as summary.json), `history` (columns of history.csv), and fields of the last instant."""

    def __init__(self, course: Course, summary: dict[str, Any], directory: Path | None):
        self.summary, self.directory = summary, directory
        system = course.system
        self.case, self.time, self.grid = course.case, course.clock.time, system.grid
        self.history = columns_of(course.rows)
        self.fields = partial(records.fields, system)
        self.field = partial(records.field, system)
        self.coverage = partial(records.coverage, system)
        self._comm = course.comm

    def plot(self, name: str | None = None, **options: Any) -> Figure:
        """A picture as `mpm.load_run(directory).plot(name)` draws it; of a run without a directory the fields are those of its end.

        On one process. Raises InputError for a name that is not there, with the nearest.
        """
        from mpm.pictures.figures import figure_of

        return figure_of(self._run(), name, **options)

    def _run(self) -> Run:
        """This run as its directory holds it, or without one its last instant."""
        if self.directory is not None:
            return load_run(self.directory)
        if self._comm.size > 1:
            raise InputError(
                "plot: a run without a directory on several processes; accepted: run(output=...)"
            )
        return LastInstant.of(self.case, self.grid, self.history, self.summary, self.fields(), self.time)

    def __repr__(self) -> str:
        return f"Result: {verdict(self.case, self.summary)}"

    def _repr_html_(self) -> str:
        return result_html(self.case, self.summary, "" if self.directory is None else str(self.directory))

    def report(self, output: str | Path | None = None) -> Path:
        """Write one page with everything about this run (`mpm report`), by default `report.html` of its directory; returns its path.

        Collective; rank 0 writes. Raises InputError for a run that has not written its results (`run(output=...)`).
        """
        from mpm.page import report

        directory = self.directory
        if directory is None:
            raise InputError("report: this run has no directory; accepted: a result of run(output=...)")
        return on_root(self._comm, lambda: report(directory, output))
