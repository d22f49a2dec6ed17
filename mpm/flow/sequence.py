"""Which velocity field belongs to which step of a run: replayed from a cycle that is known, or marched as a transient."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from mpm.arrays import Floats
from mpm.flow.courant import check_bounded
from mpm.flow.cycle import mean_motion, periodic_flow
from mpm.flow.factors import STEADY
from mpm.flow.fields import FlowField, mean_field, stored_fields
from mpm.flow.problem import CLOSED_PORTS, FlowProblem, PortState
from mpm.flow.steady import steady_flow
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import REST, BedMotion, StepMotion, step_motion
from mpm.motion.schedule import RESTING, Schedule, Step

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.parallel import Scatter

Watch = Callable[[int, float], None]  # of a cycle's number and what has changed since the one before
# last change of a velocity, relative to the fastest, of a flow that follows temperatures; Newton's next would be about its square
FOLLOWED = 1e-2
SAME_STEP = 1e-12  # of a step: how far two lengths may lie apart by rounding


class FlowSequence(Protocol):
    """The flow of a run, one field per step."""

    def at(self, step: Step) -> FlowField:
        """The field of `step`; steps are asked for in their order. Raises ConvergenceError, the field before kept."""

    def shown(self, step: Step) -> FlowField:
        """The field of `step`, which has been taken, for those who look at it."""

    def mean(self) -> FlowField:
        """Mean over the cycle, over the last one where they differ."""


def begins_at_rest(case: Case, schedule: Schedule) -> bool:
    """Whether there are steps before the vibration starts, which have a field of their own; the steady state has no beginning."""
    return schedule.resting_steps > 0 and case.fidelity != "steady"


@dataclass(frozen=True, eq=False)
class CyclicFlow:
    """A cycle that repeats: the field `at_rest` where the run begins without vibration, then one per phase, a mean being one phase."""

    at_rest: FlowField | None
    phases: Sequence[FlowField]

    @classmethod
    def solve(
        cls, case: Case, strip: Strip, bed_motion: BedMotion, schedule: Schedule, watch: Watch | None = None
    ) -> CyclicFlow:
        """The resolved cycle, or the steady flow under its mean forcing; without a rest where the fidelity is steady.

        Raises ConvergenceError.
        """
        problem = FlowProblem(case, strip, schedule.dt)
        found = cls.found(problem, bed_motion, schedule, watch)
        problem.release()
        return found

    @classmethod
    def found(
        cls,
        problem: FlowProblem,
        bed_motion: BedMotion,
        schedule: Schedule,
        watch: Watch | None = None,
        guess: CyclicFlow | None = None,
    ) -> CyclicFlow:
        """The same of a problem that is there and keeps its steady factor, starting from a similar flow as a `guess` that it follows.

        A guess without a field at rest asks for none. Raises ConvergenceError.
        """
        case, at_rest, last = problem.case, None, None if guess is None else guess.phases[-1]
        enough = 0.0 if guess is None else FOLLOWED
        if begins_at_rest(case, schedule) and (guess is None or guess.at_rest is not None):
            at_rest = steady_flow(problem, REST, None if guess is None else guess.at_rest, enough)
        if case.fidelity == "resolved":
            return cls(at_rest, periodic_flow(problem, bed_motion, schedule.phases, watch, last, STEADY))
        return cls(at_rest, [steady_flow(problem, mean_motion(bed_motion), last, enough)])

    def at(self, step: Step) -> FlowField:
        """The field of the step's phase."""
        if step.phase == RESTING and self.at_rest is not None:
            return self.at_rest
        return self.phases[max(step.phase, 0)]

    shown = at

    def mean(self) -> FlowField:
        """Mean over the cycle."""
        return mean_field(self.phases)

    def stored(self, scatter: Scatter, own: int) -> Floats | None:
        """The field at rest, where there is one, then the phases (`stored_fields`); collective."""
        first = [] if self.at_rest is None else [self.at_rest]
        return stored_fields([*first, *self.phases], scatter, own)

    @classmethod
    def restored(cls, strip: Strip, stored: Floats, rests: bool) -> CyclicFlow:
        """The inverse of `stored`, from the arrays in grid order."""
        fields = [FlowField.restored(strip, field) for field in stored]
        return cls(fields[0], fields[1:]) if rests else cls(None, fields)


class MarchedFlow:
    """The true transient after an impulsive start: gas at rest when the inlets open at t = 0, the vibration starting later.

    One flow step per time step, refined: a resumed run makes its own factor. `recent` holds the fields of the last full cycle, `done`
    counts the steps marched.
    """

    def __init__(self, case: Case, strip: Strip, bed_motion: BedMotion, schedule: Schedule):
        self.case, self.strip, self.bed_motion, self.schedule = case, strip, bed_motion, schedule
        self._problem = FlowProblem(case, strip, schedule.dt, refined=True)
        resting = schedule.step(0).whole
        same = abs(resting - schedule.dt) < SAME_STEP * schedule.dt
        self._resting = self._problem if same else FlowProblem(case, strip, resting, refined=True)
        self.current = self._problem.field()
        self.recent: list[FlowField] = []
        self.done = 0

    def at(self, step: Step) -> FlowField:
        """March to the end of `step` (once). Raises ConvergenceError, the old field kept."""
        if self.done == step.index:
            problem = self._resting if step.phase == RESTING else self._problem
            problem.start_from(self.current, self._ports(step.index))
            problem.step(self._motion(step))
            reached = problem.field()
            check_bounded(self.case, self.strip, self.current.velocities, reached.velocities, problem.dt)
            self.current = reached
            self.done += 1
            self.recent = [*self.recent, reached][-self.schedule.phases :]
        return self.current

    def _motion(self, step: Step) -> StepMotion:
        return step_motion(self.bed_motion, step.since, step.since + step.whole)

    def _ports(self, steps: int) -> PortState:
        """Those of the field after so many steps."""
        return (1.0, self._motion(self.schedule.step(steps - 1)).frame_velocity_y) if steps else CLOSED_PORTS

    def shown(self, step: Step) -> FlowField:
        """The field reached, whatever the step."""
        return self.current

    def mean(self) -> FlowField:
        """Mean over the last cycle marched."""
        return mean_field(self.recent or [self.current])

    def stored(self, scatter: Scatter, own: int) -> Floats | None:
        """The present field, then those of the last cycle (`stored_fields`); collective."""
        return stored_fields([self.current, *self.recent], scatter, own)

    def restore(self, stored: Floats, done: int) -> None:
        """Go on after `done` steps from the arrays of `stored` in grid order."""
        self.current, *self.recent = [FlowField.restored(self.strip, field) for field in stored]
        self.done = done
