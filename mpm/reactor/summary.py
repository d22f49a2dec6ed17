"""summary.json of a run: its records and circumstances, handed to the table of reported numbers (`mpm.report.contents`)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mpm.flow.numbers import flow_numbers
from mpm.numerics.versions import versions
from mpm.parallel import on_root
from mpm.report.contents import summary_of
from mpm.revision import revision

if TYPE_CHECKING:
    from mpm.reactor.course import Course


def summarise(course: Course, status: str) -> dict[str, Any]:
    """The whole of summary.json on every rank; collective."""
    system = course.system
    mean = system.flow.sequence.mean() if system.has_flow else None
    records = replace(
        course.records(),
        before=None,
        status=status,
        ranks=course.comm.size,
        steps=course.clock.steps,
        wall=course.clock.wall,
        program=on_root(course.comm, revision),
        versions=versions(),
        flow={} if mean is None else flow_numbers(course.case, system.strip, mean, system.gas),
        latest=course.numbers,
    )
    return summary_of(records)
