"""summary.json and the rows of history.csv of a reactor: its records, handed to the table of reported numbers (`mpm.report.contents`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpm.flow.numbers import flow_numbers
from mpm.mesh.grid import Grid
from mpm.numerics.versions import versions
from mpm.parallel import on_root
from mpm.report.contents import row_of, summary_of
from mpm.report.records import Records, State, Totals
from mpm.revision import revision

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.reactor.reactor import Reactor


def summarise(reactor: Reactor, status: str, wall: float) -> dict[str, Any]:
    """The whole of summary.json on every rank; collective."""
    flow = {} if reactor.flows is None else flow_numbers(reactor.case, reactor.strip, reactor.flows.mean())
    return summary_of(
        Records(
            case=reactor.case,
            grid=reactor.grid,
            time=reactor.time,
            totals=reactor.totals(),
            state=reactor.state(),
            status=status,
            ranks=reactor.comm.size,
            steps=reactor.steps,
            wall=wall,
            program=on_root(reactor.comm, revision),
            versions=versions(),
            flow=flow,
            latest=reactor.numbers,
        )
    )


def history_row(
    case: Case, grid: Grid, time: float, totals: Totals, state: State, before: Totals | None
) -> dict[str, float]:
    """One row of history.csv, flat dotted names; outlets and film tell what has passed since the row before."""
    return row_of(Records(case, grid, time, totals, state, before))
