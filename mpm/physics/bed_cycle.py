"""The cycle that a bed repeats under its own forces (`mpm.physics.bed_balance`), and its mean speed where it repeats none."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

from mpm.constants import TURN
from mpm.physics.bed_balance import Kind, Stretch, at_rest, in_contact, successor
from mpm.physics.bed_forces import BedForces
from mpm.physics.waves import root

CYCLES = 2000
"""Cycles within which a bed comes to rise and fall alike in each, or does not."""
PATIENCE = 200
"""Cycles after which the speed that it repeats is looked for, where friction is too small to have brought it there."""
REPEATS = 1e-12
"""Change from one cycle to the next, relative to the base's own velocity and amplitude, below which they are one."""
MOST_STRETCHES = 200
"""Stretches of one cycle beyond which something is wrong."""


class NoCycle(ValueError):
    """A bed that does not move alike in every cycle."""


@dataclass(frozen=True, kw_only=True)
class Segment:
    """A part of the cycle from phase `start` to `stop` in [0, 2 pi] in which the bed sticks, slides or flies, as `stretch` has it."""

    start: float
    stop: float
    stretch: Stretch

    @property
    def kind(self) -> Kind:
        return self.stretch.kind


@dataclass(frozen=True)
class BedCycle:
    """One cycle of a bed's motion, the same from then on: its `segments` from phase 0 to 2 pi, one beginning where the last one ends."""

    forces: BedForces
    segments: tuple[Segment, ...]

    def _segment(self, phase: float) -> Segment:
        return next((s for s in self.segments if phase <= s.stop), self.segments[-1])

    def distance(self, phase: float) -> float:
        """Distance travelled in the lab's frame from phase 0 to `phase` <= 2 pi [m]."""
        parts = itertools.takewhile(lambda s: s.start < phase, self.segments)
        return sum(s.stretch.travel(s.start, min(s.stop, phase)) for s in parts)

    def velocity(self, phase: float) -> float:
        """Horizontal velocity in the lab's frame [m/s]."""
        return self._segment(phase).stretch.velocity(phase)

    def contact_force(self, phase: float) -> float:
        """Force between bed and base [Pa]: 0 in flight, negative where adhesion holds; without the impulse of a landing."""
        return 0.0 if self._segment(phase).kind == "flight" else self.forces.contact.at(phase)

    def rising(self, phase: float) -> float:
        """Vertical velocity relative to the base [m/s]."""
        return self._segment(phase).stretch.rising(phase)

    def gap(self, phase: float) -> float:
        """Gap between bed and base [m]."""
        return self._segment(phase).stretch.height(phase)

    @property
    def rides(self) -> bool:
        """Whether the bed moves with the base all the time."""
        return all(s.kind == "stick" for s in self.segments)

    @property
    def mean(self) -> float:
        """Mean conveying velocity [m/s], negative to the left; exactly 0 where the bed stays."""
        forces = self.forces
        mean = self.distance(TURN) * forces.omega / TURN
        scale = max(forces.ax, forces.ay) * forces.omega
        return 0.0 if self.rides or abs(mean) <= REPEATS * scale else mean

    @property
    def flights(self) -> tuple[tuple[float, float], ...]:
        """Phases of lift-off and landing [rad, in [0, 2 pi)] of every flight, in the order of the cycle."""
        ended = {
            s.stretch.end % TURN: s.stretch
            for s in self.segments
            if s.kind == "flight" and s.stretch.end <= TURN
        }
        return tuple((flight.begin % TURN, end) for end, flight in sorted(ended.items()))

    @property
    def largest_gap(self) -> float:
        """Largest gap in the cycle [m]; 0 where it never lifts off."""
        return max((s.stretch.gap for s in self.segments if s.kind == "flight"), default=0.0)

    @property
    def contact_range(self) -> tuple[float, float]:
        """Smallest and largest contact force of the cycle [Pa], 0 in flight."""
        ranges = [
            (0.0, 0.0) if s.kind == "flight" else self.forces.contact.range(s.start, s.stop)
            for s in self.segments
        ]
        return min(low for low, _ in ranges), max(high for _, high in ranges)

    def share(self, kind: Kind) -> float:
        """Share of the cycle that the bed sticks, slides or flies."""
        return sum(s.stop - s.start for s in self.segments if s.kind == kind) / TURN


def bed_cycle(forces: BedForces) -> BedCycle:
    """The cycle that the bed comes to repeat, from being carried along at phase 0.

    Raises Carried where gas takes the bed away, NoCycle where no cycle is like the one before (a bed thrown high without gas, whose
    flights last longer than cycles).
    """
    speed, height = max(forces.ax, forces.ay) * forces.omega, forces.ay
    before: tuple[float, float, float] | None = None
    for number, (segments, end) in enumerate(itertools.islice(_cycles(at_rest(forces)), CYCLES)):
        now = (
            (end.velocity(0.0) / speed, end.rising(0.0) / speed, end.height(0.0) / height)
            if speed
            else (0.0,) * 3
        )
        if before is not None:
            along, *vertical = (abs(a - b) <= REPEATS for a, b in zip(now, before, strict=True))
            if along and all(vertical):
                return BedCycle(forces, segments)
            if number >= PATIENCE and all(vertical):
                return _repeated(end)
        before = now
    raise NoCycle(f"no cycle like the one before in {CYCLES}")


def _repeated(start: Stretch) -> BedCycle:
    """The cycle at whose end the bed is as fast as at its beginning; it begins with `start` at phase 0, at another speed.

    Rise and fall do not depend on the speed. Of two beds the one that is faster at first is never the slower one afterwards, and friction
    brings them together: what a cycle adds falls with the speed that it begins with. One faster than the base ever is loses, one slower
    gains, so that one speed between is repeated. Found by bisection it needs some 60 cycles, however small friction is.
    """
    forces = start.forces

    def cycle(speed: float) -> tuple[tuple[Segment, ...], Stretch]:
        flies = start.kind == "flight"
        return next(_cycles(replace(start, speed=speed) if flies else in_contact(forces, 0.0, speed)))

    def added(speed: float) -> float:
        return cycle(speed)[1].velocity(0.0) - speed

    peak = forces.ax * forces.omega
    segments, _ = cycle(root(added, -peak, peak))
    return BedCycle(forces, segments)


def mean_speed(forces: BedForces, *, skip: int, cycles: int) -> float:
    """Mean conveying velocity [m/s] over so many cycles after the first `skip`, whether they are alike or not."""
    some = itertools.islice(_cycles(at_rest(forces)), skip, skip + cycles)
    way = sum(BedCycle(forces, segments).distance(TURN) for segments, _ in some)
    return way * forces.omega / (cycles * TURN)


def _cycles(stretch: Stretch) -> Iterator[tuple[tuple[Segment, ...], Stretch]]:
    """Cycle after cycle from the stretch at phase 0 on: its segments, and the stretch under way at its end, counted from the next one."""
    while True:
        segments, start = [], 0.0
        while stretch.end < TURN:
            segments.append(Segment(start=start, stop=stretch.end, stretch=stretch))
            if len(segments) > MOST_STRETCHES:
                raise NoCycle(f"more than {MOST_STRETCHES} stretches in a cycle")
            start, stretch = stretch.end, successor(stretch)
        segments.append(Segment(start=start, stop=TURN, stretch=stretch))
        stretch = replace(stretch, begin=stretch.begin - TURN, end=stretch.end - TURN)
        yield tuple(segments), stretch
