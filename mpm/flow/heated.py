"""The flow of gas whose temperature changes slowly against a cycle: a mean or a cycle that follows it.

It belongs to the temperatures at which it was found, and is found anew when these have moved by more than `energy.flow_update`; until then
what heating drives out of the cells (`mpm.flow.density`) and what buoyancy gains are added as creeping flow. Mass is kept to rounding in
every step; which way that gas takes is found anew when it has changed by WAY, or after AGE steps.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.flow.density import Density, moved
from mpm.flow.factors import STEADY
from mpm.flow.fields import FlowField
from mpm.flow.given import spreading
from mpm.flow.problem import FlowProblem
from mpm.flow.sequence import CyclicFlow, Watch
from mpm.flow.state import GasState
from mpm.motion.kinematics import BedMotion, StepMotion
from mpm.motion.schedule import RESTING, Schedule, Step
from mpm.parallel import total
from mpm.physics.mixture import Fractions

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.mesh.strip import Strip

WAY = 0.1  # change of what is driven out, over that and what inlets blow, after which its way is found anew
LONGEST = 16  # times `energy.flow_update` that temperatures may move while no flow is found
AGE = 10  # steps after which it is in any case, and with it what buoyancy gains


class HeatedCycle:
    """A mean flow or a cycle that follows the temperature (`averaged`, `resolved`)."""

    def __init__(
        self,
        case: Case,
        strip: Strip,
        bed_motion: BedMotion,
        schedule: Schedule,
        temperature: Floats,
        watch: Watch | None = None,
    ):
        self.case, self.strip, self.bed_motion, self.schedule = case, strip, bed_motion, schedule
        self.watch = watch
        self._update = 0.0 if case.energy is None else case.energy.flow_update
        self.density = Density(case, strip, temperature)
        self.found_in = self.density.gas
        self._problem: FlowProblem | None = None
        self.cycle: CyclicFlow | None = None
        self._more: Floats | None = None  # velocities (4, local cells) beside those of the cycle
        self._driven = False  # gas is being given off
        self._way = np.zeros(
            (4, strip.local)
        )  # of what is added, beside the straight way of what is driven out
        self._source, self._age = (
            np.zeros(strip.owned),
            AGE,
        )  # for which that was found, and so many steps ago
        self._fields: dict[FlowField, FlowField] = {}
        self._wait = 1  # times `energy.flow_update`, after which the flow is found anew
        self._blown = sum(inlet.velocity * inlet.width for inlet in case.geometry.inlets)

    @property
    def gas(self) -> GasState:
        return self.density.gas

    @property
    def changed(self) -> bool:
        """Whether fields and density are others than in the step before."""
        return self.density.changed or self._driven

    def find(self, watch: Watch | None = None, vibrates: bool = False) -> CyclicFlow:
        """Find the flow in the present state of the gas, from the one before; a reactor that `vibrates` needs no field at rest any more.

        Raises ConvergenceError, the flow before kept.
        """
        problem, guess = self._new_problem(self.gas), self.cycle
        if guess is not None and vibrates:
            guess = CyclicFlow(None, guess.phases)
        try:
            self.cycle = CyclicFlow.found(problem, self.bed_motion, self.schedule, watch, guess)
        except ConvergenceError:
            problem.destroy()
            raise
        problem.release(kept=STEADY)
        self._take(problem)
        self._more, self._fields, self._age = None, {}, AGE
        return self.cycle

    def adopt(self, field: FlowField, motion: StepMotion) -> None:
        """Take over a `field` under a constant `motion` as the flow in the present state of the gas; collective."""
        self.cycle = CyclicFlow(None, [field])
        problem = self._new_problem(self.gas)
        problem.start_from(field, (1.0, motion.frame_velocity_y))
        self._take(problem)
        self._more, self._fields = None, {}

    def _take(self, problem: FlowProblem) -> None:
        """Let `problem` be that of the present state of the gas, in place of the one before."""
        if self._problem is not None:
            self._problem.destroy()
        self._problem, self.found_in = problem, self.gas

    def _new_problem(self, gas: GasState) -> FlowProblem:
        return FlowProblem(self.case, self.strip, self.schedule.dt, refined=True, gas=gas)

    @property
    def problem(self) -> FlowProblem:
        """The problem in the state of the gas in which the flow was found."""
        if self._problem is None:
            self._problem = self._new_problem(self.found_in)
        return self._problem

    def follow(self, temperature: Floats, fractions: Fractions, step: Step) -> None:
        """Let the density follow the `temperature` of own cells [K] and the mole `fractions` of a mixture during `step`; collective. Raises
        ConvergenceError."""
        density, was_driven = self.density, self._driven
        density.follow(temperature, fractions, step.dt)
        self._driven = density.changed
        if not (density.changed or was_driven):
            return
        if moved(self.strip, self.gas, self.found_in) > self._wait * self._update:
            self._find_again(step)
        self._drive(density.source)

    def _find_again(self, step: Step) -> None:
        """Find the flow anew; where it is not found the one before goes on, until temperatures have moved twice as far, and so on.

        Gas that turns over may have no steady flow at some temperatures, and one again a little later. Raises ConvergenceError beyond
        LONGEST.
        """
        try:
            self.find(vibrates=step.phase != RESTING)
            self._wait = 1
        except ConvergenceError:
            self._wait *= 2
            if self._wait > LONGEST:
                raise

    def _drive(self, source: Floats) -> None:
        """Let the cells give off `source` (own,) [m2/s] beside the flow that was found; collective."""
        problem = self.problem
        straight = problem.space.velocities(spreading(problem.space, source))
        off, whole = total(self.strip.comm, [np.abs(source - self._source).sum(), np.abs(source).sum()])
        self._age += 1
        if self._age >= AGE or off > WAY * (whole + self._blown):
            driven = problem.driven(source, problem.lighter(self.gas))
            self._way = problem.space.velocities(driven) - straight
            self._source, self._age = source, 0
        self._more, self._fields = straight + self._way, {}

    def at(self, step: Step) -> FlowField:
        """The field of the step's phase, and what is added to it."""
        return self._with_more(self._cycle.at(step))

    shown = at

    @property
    def _cycle(self) -> CyclicFlow:
        return self.cycle if self.cycle is not None else self.find(self.watch)

    def _with_more(self, field: FlowField) -> FlowField:
        if self._more is None:
            return field
        if field not in self._fields:
            self._fields[field] = replace(field, velocities=field.velocities + self._more)
        return self._fields[field]

    def mean(self) -> FlowField:
        """Mean over the cycle as it is now."""
        return self._with_more(self._cycle.mean())

    # --- restart ---

    def stored(self) -> dict[str, Any]:
        """Arrays of a restart state, in grid order on rank 0 (None elsewhere); collective."""
        own, scatter = self.strip.owned, self.strip.scatter
        cycle = self._cycle
        more = np.zeros((4, own)) if self._more is None else self._more[:, :own]
        return {
            **self.density.stored(),
            "fields": cycle.stored(scatter, own),
            "rests": cycle.at_rest is not None,
            "found_in": self.density.store(self.found_in),
            "more": scatter.to_root(more),
            "driven": self._driven,
            "way": scatter.to_root(np.vstack([self._way[:, :own], self._source])),
            "age": self._age,
            "wait": self._wait,
        }

    def restore(self, stored: dict[str, Any], steps: int) -> None:
        """The inverse of `stored`, on every rank, after `steps`."""
        self.density.restore(stored)
        self.cycle = CyclicFlow.restored(self.strip, stored["fields"], bool(stored["rests"]))
        self.found_in = self.density.restored(stored["found_in"])
        more = np.ascontiguousarray(stored["more"][:, self.strip.cell])
        self._more = more if stored["more"].any() else None
        self._driven, self._age = bool(stored["driven"]), int(stored["age"])
        self._wait = int(stored["wait"])
        way = np.ascontiguousarray(stored["way"][:, self.strip.cell])
        self._way, self._source = way[:4], way[4, : self.strip.owned]
        self._problem, self._fields = None, {}
