"""What is legal in a case but may not be meant: inputs that contradict each other, or have no effect. One sentence each."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpm.case import Case

SAME_GAMMA = 0.02
"""Relative difference of Gamma that passes between a profile and its use: what an accelerometer resolves."""
SAME_ANGLE = math.radians(1.0)
"""The same for the angle of vibration [rad]."""


def profile_caveats(case: Case) -> list[str]:
    """Whether the profile file, its vibration and `motion.bed_velocity` belong together.

    Another frequency is refused when the case is read. Another acceleration or angle is common practice (a profile of a DEM scaled to a
    measured mean, used in a sweep over gamma) and keeps the mean, but in contact the bed then no longer rides with the plate.
    """
    motion = case.motion
    name = Path(motion.profile).name
    if motion.gamma == 0.0 and motion.profile not in ("thesis", "phases"):
        return [
            f"motion.profile, {name}, has no effect: without vibration (gamma = 0) the bed moves at bed_velocity"
        ]
    if motion.table is None:
        return []
    found = []
    if "bed_velocity" in motion.model_fields_set:
        found.append(
            f"motion.bed_velocity, {motion.bed_velocity * 100:.3g} cm/s, has no effect: the bed moves as {name} says, "
            f"{motion.mean_velocity * 100:.3g} cm/s in the mean"
        )
    made = motion.table.conditions
    if made is None:
        return [
            *found,
            f"{name} does not say under which vibration it was made (mpm dem writes a comment `conditions`): "
            "nothing can tell whether it belongs to this one",
        ]
    slides = "in contact its bed does not ride with this plate, only the mean is kept"
    if made.waveform != "sine":
        found.append(
            f"{name} was made with a {made.waveform} waveform, the reactor vibrates in a sine: {slides}"
        )
        return found
    if abs(made.gamma - motion.gamma) > SAME_GAMMA * motion.gamma:
        found.append(
            f"{name} was made at gamma {made.gamma:.3g}, the reactor vibrates at {motion.gamma:.3g}: {slides}"
        )
    angle = motion.angle if motion.angle_from == "horizontal" else 0.5 * math.pi - motion.angle
    if abs(made.angle - angle) > SAME_ANGLE:
        found.append(
            f"{name} was made at {math.degrees(made.angle):.3g} deg from the horizontal, the reactor vibrates at "
            f"{math.degrees(angle):.3g} deg: {slides}"
        )
    return found
