"""The last cycle of a resolved run, phase by phase: which steps are written, and what is written beside the usual fields.

Output times are hardly ever out of step with the vibration (every 0.25 s are four whole cycles of 16 Hz), so that `fields.pvd` meets one
phase again and again. `output.phases` shows the others, with the points where the reactor carries them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.motion.kinematics import BedMotion, step_motion
from mpm.motion.schedule import RESTING, Schedule, Step

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.mesh.grid import Grid


@dataclass(frozen=True, kw_only=True)
class LastCycle:
    """`count` of the steps `begin` <= index < `end`, the last cycle of whole steps, at equal distances; no steps: nothing is written.

    Phases count from the start of the vibration, so that they are those of a sine whatever the end of the run: number k of `count` is
    the end of the step at which w t = 2 pi k / count. The cycle ends with the run, not with a phase: one that is prolonged within a cycle
    goes on from a state before which this cycle's phases were the last one's, and are there.
    """

    begin: int
    end: int
    count: int
    steps_per_cycle: int
    since: float
    """Time at which the cycle begins [s]."""

    @classmethod
    def of(cls, case: Case, schedule: Schedule) -> LastCycle:
        """The last cycle of a run. A step that the end cuts short is none of the cycle's: its flow is that of the whole step."""
        count, steps = case.output.phases, schedule.phases
        end = schedule.steps - int(schedule.steps > 0 and schedule.step(schedule.steps - 1).cut)
        begin = end - steps
        if count == 0 or steps == 1 or begin < schedule.resting_steps:
            begin = end = 0
        since = schedule.step(begin).t0 if begin < end else schedule.end
        return cls(begin=begin, end=end, count=count, steps_per_cycle=steps, since=since)

    @property
    def empty(self) -> bool:
        return self.begin == self.end

    def number(self, step: Step) -> int | None:
        """Number of the phase that `step` ends at, None for steps that are not written."""
        if step.phase == RESTING or not self.begin <= step.index < self.end:
            return None
        number, between = divmod(step.phase + 1, self.steps_per_cycle // self.count)
        return number % self.count if between == 0 else None

    def passed(self, schedule: Schedule, steps: int) -> int:
        """How many of its phases lie within the first `steps` steps of a run."""
        return sum(
            self.number(schedule.step(index)) is not None for index in range(self.begin, min(steps, self.end))
        )


def phase_fields(
    fields: Mapping[str, Floats], case: Case, grid: Grid, motion: BedMotion, step: Step
) -> dict[str, Floats]:
    """The usual cell fields at the end of `step`, and beside them two velocities [m/s], (cells, 2).

    velocity_lab: volume of gas that crosses a surface at rest in the lab, per area and time. Gas in the pores moves with u / epsilon
    relative to the reactor and with u / epsilon + V in the lab, V the reactor's velocity; it takes the share epsilon of the surface:
    u + epsilon V. In a layer of gas epsilon is 1.
    bed_velocity: of the solid of the moving layer relative to the reactor, mean over the step as the flow has met it; 0 elsewhere.
    """
    porosity = np.array(
        [1.0 if m is None else m.porosity for m in (x.material for x in case.geometry.layers)]
    )
    moving = np.array([layer.moving for layer in case.geometry.layers])
    layer = np.repeat(grid.row_layer, grid.columns)
    reactor = np.array(motion.vibration.velocity(step.since + step.dt))
    solid = step_motion(motion, step.since, step.since + step.dt).bed_velocity
    return {
        **fields,
        "velocity_lab": fields["velocity"] + porosity[layer, None] * reactor,
        "bed_velocity": moving[layer, None] * np.array([solid, 0.0]),
    }
