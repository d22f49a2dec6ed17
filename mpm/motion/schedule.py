"""The steps of a run: those before the vibration starts, and those on the grid of its cycles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil, floor
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpm.case.case import Case

RESTING = -1
SLACK = 1e-9  # of a step or an output interval: times that agree to this are equal


@dataclass(frozen=True, kw_only=True)
class Step:
    """One time step from `t0` over `dt` to `t1` [s]; `phase` numbers it within its cycle, RESTING before the vibration starts.

    `since` [s] is its beginning counted from the start of the vibration. `dt` is the same to the last digit for all steps of a kind, which
    the rounding of t1 - t0 is not: solvers know by it that their matrices still hold. `whole` [s] is `dt` unless the run ends within the
    step: the velocity field of a step is that of the whole step.
    """

    index: int
    t0: float
    t1: float
    dt: float
    whole: float
    phase: int
    since: float

    @property
    def cut(self) -> bool:
        """The run ends within this step."""
        return self.dt < self.whole


def aligned_step(step: float, *, column: float, speed: float) -> float:
    """The longest step up to `step` [s] that is commensurate with the bed's motion: whole steps per column, or whole columns per step.

    Every column then meets the gas of a cell for equally long, where otherwise some would stay a step longer than their neighbours.
    A shift takes `column` / `speed` [m, m/s].
    """
    if speed == 0.0:
        return step
    shift = column / speed
    if shift >= step:
        return shift / ceil(shift / step - SLACK)
    return shift * floor(step / shift + SLACK)


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Equal steps of `dt` [s] from the start of the vibration on, `phases` of them per cycle (1: every step is alike).

    Before the start the steps are as equal as they can be and not longer than `dt`, so that the cycle's grid stays aligned. The last
    step is cut so that the run ends at `end`.
    """

    dt: float
    phases: int
    start: float
    end: float

    @classmethod
    def from_case(cls, case: Case) -> Schedule:
        if case.fidelity == "resolved":
            n = case.time.steps_per_cycle
            phases = n if case.motion.gamma > 0.0 else 1
            return cls(
                dt=1.0 / case.motion.frequency / n, phases=phases, start=case.motion.start, end=case.time.end
            )
        column = case.geometry.dx
        step = aligned_step(case.time.step, column=column, speed=abs(case.conveying_velocity))
        return cls(dt=step, phases=1, start=case.motion.start, end=case.time.end)

    @property
    def resting_steps(self) -> int:
        """Steps before the vibration starts, were the run long enough."""
        return ceil(self.start / self.dt - SLACK)

    @property
    def steps(self) -> int:
        """Steps of the whole run."""
        rest = self.resting_steps
        if self.end <= self.start * (1.0 + SLACK) and rest:
            return ceil(self.end / (self.start / rest) - SLACK)
        return rest + max(ceil((self.end - self.start) / self.dt - SLACK), 0)

    def step(self, index: int) -> Step:
        """Step `index`, counted from 0; the last one ends at `end`."""
        step = self._whole_step(index)
        if index != self.steps - 1:
            return step
        dt = self.end - step.t0
        return replace(step, t1=self.end, dt=dt if dt < step.whole * (1.0 - SLACK) else step.whole)

    def _whole_step(self, index: int) -> Step:
        rest = self.resting_steps
        if index < rest:
            dt = self.start / rest
            t0, t1, phase, since = index * dt, (index + 1) * dt, RESTING, index * dt - self.start
        else:
            k, dt = index - rest, self.dt
            t0, t1, phase, since = self.start + k * dt, self.start + (k + 1) * dt, k % self.phases, k * dt
        return Step(index=index, t0=t0, t1=t1, dt=dt, whole=dt, phase=phase, since=since)

    def from_step(self, index: int) -> Iterator[Step]:
        """All steps from `index` on."""
        return (self.step(n) for n in range(index, self.steps))

    def is_output(self, step: Step, every: float) -> bool:
        """True when `step` is the first to reach a multiple of `every` [s]."""
        return floor(step.t1 / every + SLACK) > floor(step.t0 / every + SLACK)
