"""Newton's system of flow and temperature in the steady state: its slopes are those of the fluxes themselves."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mpm.arrays import Floats
from mpm.case.conventions import CLOSED_CODE
from mpm.flow.cycle import mean_motion
from mpm.flow.heated import HeatedCycle
from mpm.reactor.reactor import Reactor
from mpm.reactor.steady.overturning import Overturning
from mpm.transport.cell_matrix import CellMatrix

from .cases import HEATED, MPI, zone
from .test_convention_runs import KINDS, MICRO, draws_in

CASES: dict[str, dict[str, Any]] = {
    "heated": HEATED,
    "an outlet that draws back": dict(KINDS["heated, an outlet that draws back"]),
}


def settled(changes: dict[str, Any]) -> tuple[Reactor, HeatedCycle, Callable[[], Floats]]:
    """A heated strip in its steady state, its flow, and what heat flows out of each cell in the flow that it has then, less what comes in
    [K m2/s]."""
    reactor = Reactor(zone({"fidelity": "steady", **changes}, MICRO), MPI.COMM_SELF)
    reactor.run(progress=False)
    thermal, strip = reactor.system.thermal, reactor.system.strip
    assert thermal is not None and isinstance(thermal.flow, HeatedCycle)
    heat, cells = thermal.heat, CellMatrix(strip, 1)

    def lost() -> Floats:
        operator = thermal._steady_operator()
        cells.assemble(cells.set_fluxes([operator.fluxes])[0])
        x, y = cells.matrix.createVecs()
        x.array[:] = heat.excess
        cells.matrix.mult(x, y)
        drawn = heat.fluxes.outlet_means(operator, heat.excess)
        bed = thermal.case.conveying_velocity
        return np.asarray(y.array - heat.fluxes.steady_supply(operator, bed, thermal._steady_heat, drawn))

    return reactor, thermal.flow, lost


@pytest.mark.parametrize("kind", CASES)
@pytest.mark.parametrize("scheme", ["fitted", "upwind", "central"])
def test_slope_of_the_heat_that_a_flow_carries(kind: str, scheme: str) -> None:
    """d(div u h)/du against difference quotients in three directions, by scheme. Fails when it is the slope
    of another scheme, or one of a facet at an outlet is missing: Newton's method would still find the state, in
    many more steps or not at all."""
    switches = {**CLOSED_CODE, "transport.scheme": scheme, "transport.backflow_rows": 1}
    reactor, flow, lost = settled({**CASES[kind], **switches})
    thermal = reactor.system.thermal
    assert thermal is not None
    assert draws_in(reactor) == ("draws" in kind)
    strip, problem, motion = reactor.system.strip, flow.problem, mean_motion(thermal.motion)
    slope = Overturning(thermal.heat, strip)._carried(problem, thermal._steady_operator())
    psi, out = slope.createVecs()
    rng = np.random.default_rng(17)
    speed = problem.field().velocities
    for _ in range(3):
        direction = rng.normal(size=len(psi.array))
        psi.array[:] = direction
        slope.mult(psi, out)
        step = 1e-6 * np.abs(speed).max() * strip.grid.dx
        found = []
        for way in (1.0, -2.0):
            problem.change(way * step * direction)
            flow.adopt(problem.field(), motion)
            found.append(lost())
        problem.change(step * direction)
        flow.adopt(problem.field(), motion)
        quotient = (found[0] - found[1]) / (2.0 * step)
        np.testing.assert_allclose(out.array, quotient, rtol=0.0, atol=1e-6 * np.abs(quotient).max())
