"""Which velocity field belongs to which step: replayed from a list, or marched as a transient."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.flow.courant import check_bounded
from mpm.flow.cycle import mean_field, mean_motion, periodic_flow
from mpm.flow.problem import FlowProblem, face_flow
from mpm.flow.steady import FlowField, steady_flow
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion, step_motion
from mpm.motion.schedule import RESTING, Schedule, Step
from mpm.transport.species import Transport

if TYPE_CHECKING:
    from mpm.case.case import Case

Floats = NDArray[np.float64]


class Replay:
    """A list of fields: first the one at rest where the run needs it, then one per phase.

    `dispersion` (diffusivities, 2, local cells) [m2/s] is what the vibration adds to diffusion where a mean stands for the cycle.
    """

    def __init__(self, strip: Strip, fields: list[FlowField], rests: bool, dispersion: Floats | None = None):
        self.strip, self.fields, self.rests, self.dispersion = strip, fields, rests, dispersion

    @classmethod
    def solve(
        cls,
        case: Case,
        strip: Strip,
        bed: BedMotion,
        schedule: Schedule,
        watch: Callable[[int, float], None] | None,
    ) -> Replay:
        """Find the fields of a developed run: the resolved cycle, or the steady flow under its mean forcing (alone where the
        fidelity is steady)."""
        problem = FlowProblem(case, strip, schedule.dt)
        rests = schedule.resting_steps > 0 and case.fidelity != "steady"
        fields = [steady_flow(problem)] if rests else []
        if case.fidelity == "resolved":
            fields += periodic_flow(problem, bed, schedule.phases, watch)
        else:
            fields.append(steady_flow(problem, mean_motion(bed)))
        problem.release()
        return cls(strip, fields, rests)

    def register(self, transport: Transport) -> None:
        """Make the transport's operators; they are numbered as the fields. At rest nothing disperses."""
        for number, field in enumerate(self.fields):
            if number == int(self.rests) and self.dispersion is not None:
                transport.disperse(self.dispersion)
            transport.add_flow(face_flow(self.strip, field.velocities))

    def number(self, step: Step, transport: Transport) -> int:
        return 0 if step.phase == RESTING else step.phase + int(self.rests)

    def field(self, step: Step) -> FlowField:
        return self.fields[0 if step.phase == RESTING else step.phase + int(self.rests)]

    def mean(self) -> FlowField:
        """Mean over the cycle."""
        return mean_field(self.fields[int(self.rests) :])

    def stored(self) -> Floats:
        """Everything needed to replay, (fields, 5, own cells): four velocities and the pressure of each field."""
        own = self.strip.owned
        return np.stack([np.vstack([f.velocities[:, :own], f.pressure[None, :own]]) for f in self.fields])


class March:
    """The true transient after an impulsive start: gas at rest when the inlets open at t = 0, the vibration starting later.

    One flow step per time step, refined: a resumed run makes its own factor. `recent` holds the fields of the last full cycle.
    """

    def __init__(self, case: Case, strip: Strip, bed: BedMotion, schedule: Schedule):
        self.case, self.strip, self.bed, self.schedule = case, strip, bed, schedule
        self.problem = FlowProblem(case, strip, schedule.dt, refined=True)
        resting = schedule.step(0).whole
        same = abs(resting - schedule.dt) < 1e-12 * schedule.dt
        self.resting = self.problem if same else FlowProblem(case, strip, resting, refined=True)
        self.current = FlowField.of(self.problem)
        self.recent: list[FlowField] = []
        self.done = 0  # steps marched

    def register(self, transport: Transport) -> None:
        transport.add_flow(face_flow(self.strip, self.current.velocities))

    def number(self, step: Step, transport: Transport) -> int:
        """March to the end of `step` (once) and hand its field to the transport. Raises ConvergenceError, the old field kept."""
        if self.done == step.index:
            problem = self.resting if step.phase == RESTING else self.problem
            problem.set_state(self.current.velocities, self.current.pressure)
            problem.step(step_motion(self.bed, step.since, step.since + step.whole))
            reached = FlowField.of(problem)
            check_bounded(self.case, self.strip, self.current.velocities, reached.velocities, problem.dt)
            self.current = reached
            self.done += 1
            self.recent = (
                [*self.recent[1 - self.schedule.phases :], self.current]
                if self.schedule.phases > 1
                else [self.current]
            )
        transport.replace_flow(0, face_flow(self.strip, self.current.velocities))
        return 0

    def field(self, step: Step) -> FlowField:
        return self.current

    def mean(self) -> FlowField:
        """Mean over the last cycle marched."""
        return mean_field(self.recent or [self.current])

    def stored(self) -> Floats:
        """The present field, then those of the last cycle, (fields, 5, own cells)."""
        own = self.strip.owned
        fields = [self.current, *self.recent]
        return np.stack([np.vstack([f.velocities[:, :own], f.pressure[None, :own]]) for f in fields])

    def restore(self, fields: list[FlowField], done: int) -> None:
        self.current, self.recent, self.done = fields[0], fields[1:], done


def unpack(strip: Strip, stored: Floats) -> list[FlowField]:
    """Fields from the global array of `stored()` in grid order, ghosts included."""
    return [FlowField(np.ascontiguousarray(f[:4, strip.cell]), f[4, strip.cell].copy()) for f in stored]
