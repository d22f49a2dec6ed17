"""Sinusoids of a phase with a mean, c + a sin(phase) + b cos(phase): where they pass zero, in closed form, and roots between two phases."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from mpm.constants import TURN

BISECTIONS = 80
"""Halvings of a bracket: to the last digit."""
NEXT = 1e-9
"""Phase [rad] within which an instant is the one that has just been: what rounding makes of it."""
TOUCH = 1e-12
"""Share of its mean by which a wave must pass zero to do so: less is rounding."""


@dataclass(frozen=True)
class Wave:
    """c + a sin(phase) + b cos(phase), phases in rad."""

    c: float
    a: float
    b: float

    def at(self, phase: float) -> float:
        return self.c + self.a * math.sin(phase) + self.b * math.cos(phase)

    @property
    def amplitude(self) -> float:
        """Half of the difference between its largest and its smallest value."""
        return math.hypot(self.a, self.b)

    @property
    def dips(self) -> bool:
        """Whether it is ever negative."""
        return self.c <= 0.0 or math.isfinite(self.fall(0.0))

    def negative(self, phase: float) -> bool:
        """Whether it is negative at a phase, in earnest: not where it touches zero but for rounding."""
        return self.dips and self.at(phase) < 0.0

    def rise(self, after: float) -> float:
        """First phase beyond `after` at which it passes zero upwards; inf where it never does."""
        if self.amplitude <= abs(self.c) * (1.0 + TOUCH):
            return math.inf
        # c + A sin(phase + d), A > 0: zero with a positive slope where the argument is asin(-c/A)
        return _beyond(math.asin(-self.c / self.amplitude) - math.atan2(self.b, self.a), after)

    def fall(self, after: float) -> float:
        """First phase beyond `after` at which it passes zero downwards; inf where it never does."""
        return Wave(-self.c, -self.a, -self.b).rise(after)

    def crossing(self, after: float) -> float:
        """First phase beyond `after` at which it passes zero."""
        return min(self.rise(after), self.fall(after))

    def range(self, start: float, stop: float) -> tuple[float, float]:
        """Smallest and largest value from phase `start` to `stop`."""
        top = _beyond(math.atan2(self.a, self.b), start)
        bottom = _beyond(math.atan2(-self.a, -self.b), start)
        values = [self.at(phase) for phase in (start, stop, *(p for p in (top, bottom) if p < stop))]
        return min(values), max(values)


def _beyond(phase: float, after: float) -> float:
    """`phase` plus as many turns as take it beyond `after`."""
    return phase + TURN * math.ceil((after + NEXT - phase) / TURN)


def root(function: Callable[[float], float], start: float, stop: float) -> float:
    """Where a function that changes its sign once between `start` and `stop` does, by bisection."""
    positive = function(start) > 0.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (start + stop)
        if middle in (start, stop):
            break
        start, stop = (middle, stop) if (function(middle) > 0.0) == positive else (start, middle)
    return stop
