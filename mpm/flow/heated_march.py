"""The flow of gas that is heated, step by step from an impulsive start."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.flow.courant import check_bounded
from mpm.flow.density import Density, moved
from mpm.flow.fields import FlowField, mean_field, stored_fields
from mpm.flow.given import spreading
from mpm.flow.problem import CLOSED_PORTS, FlowProblem, PortState
from mpm.flow.state import GasState
from mpm.motion.kinematics import BedMotion, StepMotion, step_motion
from mpm.motion.schedule import Schedule, Step
from mpm.physics.mixture import Fractions

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.mesh.strip import Strip


class HeatedMarch:
    """The true transient of gas that is heated: one flow step per time step, with the weight of the gas as it is then."""

    def __init__(
        self, case: Case, strip: Strip, bed_motion: BedMotion, schedule: Schedule, temperature: Floats
    ):
        self.case, self.strip, self.bed_motion, self.schedule = case, strip, bed_motion, schedule
        self._update = 0.0 if case.energy is None else case.energy.flow_update
        # every step is solved for anyway, and what is about to turn over grows from nothing
        self.density = Density(case, strip, temperature, same=0.0)
        self.found_in = self.density.gas
        self._problems: dict[float, FlowProblem] = {}
        self.current = self._problem(schedule.step(0)).field()
        self.recent: list[FlowField] = []
        self.done = 0
        self._source = self.density.source  # of the present field

    @property
    def gas(self) -> GasState:
        return self.density.gas

    changed = True

    def _problem(self, step: Step) -> FlowProblem:
        if step.whole not in self._problems:
            self._problems[step.whole] = FlowProblem(
                self.case, self.strip, step.whole, refined=True, gas=self.found_in
            )
        return self._problems[step.whole]

    def follow(self, temperature: Floats, fractions: Fractions, step: Step) -> None:
        """Let the density follow the `temperature` of own cells [K] and the mole `fractions` of a mixture during `step`; collective."""
        self.density.follow(temperature, fractions, step.dt)
        if moved(self.strip, self.gas, self.found_in) > self._update:
            for problem in self._problems.values():
                problem.destroy()
            self.found_in, self._problems = self.gas, {}

    def at(self, step: Step) -> FlowField:
        """March to the end of `step` (once). Raises ConvergenceError, the old field kept."""
        if self.done == step.index:
            problem = self._problem(step)
            problem.weigh_as(self.gas)
            problem.start_from(self.current, self._ports(step.index), self._source)
            problem.step(self._motion(step), source=self.density.source)
            reached = problem.field()
            straight = problem.space.velocities(spreading(problem.space, self.density.source))
            driven = float(np.abs(straight).max(initial=0.0))
            before, after = self.current.velocities, reached.velocities
            check_bounded(self.case, self.strip, before, after, problem.dt, self.gas, driven)
            self.current, self._source = reached, self.density.source
            self.done += 1
            self.recent = [*self.recent, reached][-self.schedule.phases :]
        return self.current

    def shown(self, step: Step) -> FlowField:
        """The field reached, whatever the step."""
        return self.current

    def mean(self) -> FlowField:
        """Mean over the last cycle marched."""
        return mean_field(self.recent or [self.current])

    def _motion(self, step: Step) -> StepMotion:
        return step_motion(self.bed_motion, step.since, step.since + step.whole)

    def _ports(self, steps: int) -> PortState:
        """Those of the field after so many steps."""
        return (1.0, self._motion(self.schedule.step(steps - 1)).frame_velocity_y) if steps else CLOSED_PORTS

    def stored(self) -> dict[str, Any]:
        """Arrays of a restart state, in grid order on rank 0 (None elsewhere); collective."""
        own, scatter = self.strip.owned, self.strip.scatter
        return {
            **self.density.stored(),
            "fields": stored_fields([self.current, *self.recent], scatter, own),
            "found_in": self.density.store(self.found_in),
            "source": scatter.to_root(self._source),
            "done": self.done,
        }

    def restore(self, stored: dict[str, Any], steps: int) -> None:
        """The inverse of `stored`, on every rank."""
        self.density.restore(stored)
        self.current, *self.recent = [FlowField.restored(self.strip, field) for field in stored["fields"]]
        self.found_in = self.density.restored(stored["found_in"])
        self._source = stored["source"][self.strip.cell[: self.strip.owned]]
        self.done, self._problems = int(stored["done"]), {}
