"""When the bed leaves the base and meets it again, by three criteria."""

import numpy as np

from mpm.arrays import Floats

from .profile import Profile

OPEN_GAP = 0.1
"""Of the mean diameter: the lowest layers count as lifted above it."""
LIFTED = 0.25
"""The same for the centre of mass, which a bed that only dilates raises by 0.15 (15 layers)."""
ACCELERATION_DEVIATION = 1.0
"""The seed's criterion of lift-off [m/s2] (section 3.4.4)."""


def flight_interval(phase: Floats, gap: Floats, limit: float) -> tuple[float, float] | None:
    """(lift-off, contact) phases [deg] of the longest interval in which gap or rise stay above `limit`, or None.

    Crossings are interpolated linearly; the cycle is closed. None also when the gap never closes.
    """
    n = len(phase)
    above = gap > limit
    if not above.any() or above.all():
        return None
    best, run, start = 0, 0, 0
    for i in range(2 * n):
        run = run + 1 if above[i % n] else 0
        if run > best and run < n:
            best, start = run, i - run + 1
    step = 360.0 / n

    def crossing(i: int) -> float:
        low, high = gap[i % n], gap[(i + 1) % n]
        return float((i + (limit - low) / (high - low)) * step % 360.0)

    return crossing(start - 1), crossing(start + best - 1)


def acceleration_liftoff(curve: Profile, base: Floats, period: float) -> tuple[float, float] | None:
    """The seed's criterion: (phase [deg], delay after mid-extension [s]) at which |d(u_bed - u_base)/dt| first
    exceeds 1 m/s2 in two successive samples, after the largest base velocity.

    The search begins where the bed follows the base (velocity within a tenth of the largest, acceleration within
    the criterion, over three samples): a bed may land only after mid-extension. None when it never follows it in
    the half cycle after mid-extension, as a slipping bed, or never deviates.
    """
    relative = curve.velocity[0] - base[0]
    n = len(relative)
    start = int(np.argmax(base[0]))
    rate = np.roll(np.roll(relative, -1) - np.roll(relative, 1), -start) / (2.0 * period / n)
    calm = np.abs(rate) <= ACCELERATION_DEVIATION
    follows = calm & (np.abs(np.roll(relative, -start)) < 0.1 * base[0, start])
    together = np.flatnonzero(
        follows[: n // 2] & np.roll(follows, -1)[: n // 2] & np.roll(follows, -2)[: n // 2]
    )
    if len(together) == 0:
        return None
    deviates = np.flatnonzero(~calm & ~np.roll(calm, -1))
    deviates = deviates[deviates > together[0]]
    if len(deviates) == 0:
        return None
    k = int(deviates[0])
    return float(curve.phase[(start + k) % n]), k * period / n
