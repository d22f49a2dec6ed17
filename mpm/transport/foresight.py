"""What the last steps let one expect of the next: where its solvers start, never part of the answer."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from mpm.arrays import Floats

# states that a polynomial in time goes through besides the present one: phases of a cycle follow each other smoothly (49,731 cells:
# 2.4 Newton steps instead of 3.0), steps of many cycles do not (a parabola misses by a quarter more than a line)
REMEMBERED = {"resolved": 3, "averaged": 1, "steady": 1}


@dataclass(frozen=True, eq=False)
class Past:
    """States at the beginning of the last steps, newest first, those steps all of `dt` [s]; at most `limit` of them."""

    limit: int
    states: tuple[Floats, ...] = ()
    dt: float = 1.0

    def followed_by(self, state: Floats, dt: float) -> Past:
        """The past after a step of `dt` [s] from `state`; steps of another length are forgotten."""
        before = self.states if dt == self.dt else ()
        return Past(self.limit, (state, *before)[: self.limit], dt)

    def foreseen(self, now: Floats, dt: float) -> Floats:
        """The state `dt` [s] after `now`: on a polynomial in time through it and those remembered; a step of another length, on a line."""
        if not self.states:
            return now
        if dt != self.dt:
            return now + dt / self.dt * (now - self.states[0])
        count = len(self.states) + 1
        then = count * now
        part = np.empty_like(then)
        for k, state in enumerate(self.states, 2):
            then += np.multiply(-((-1) ** k) * comb(count, k), state, out=part)
        return then


def possible(then: Floats, now: Floats) -> Floats:
    """What was foreseen, where that is more than nothing, and else what there is `now`."""
    return np.where(then > 0.0, then, now)
