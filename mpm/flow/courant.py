"""Convection of the gas is explicit: how far the gas goes in a step, and when a flow has left all bounds because it goes too far."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GRAVITY
from mpm.errors import ConvergenceError
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import Vibration
from mpm.parallel import largest

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.flow.state import GasState

BOUND = 10.0  # times the speed that ports and motion give: no flow of a strip gets there, a diverging one passes it within some steps


def driving_speed(case: Case, gas: GasState | None = None) -> float:
    """The speed that ports and motion give the gas [m/s]: the fastest port, or the reactor's swing with the bed's mean on top.

    Hot gas in cold gas rises at up to sqrt(g H dT/T); temperatures are those that the case gives, and those of the local cells of `gas`,
    which fluxes and reactions may heat beyond. What the inlets feed, and what the swing displaces in the height of the strip, may
    have to leave through the narrowest outlet.
    """
    geometry, vibration = case.geometry, Vibration.from_motion(case.motion)
    swing = math.hypot(vibration.ax, vibration.ay) * vibration.omega
    moved = swing + abs(case.conveying_velocity)
    low, high = case.temperatures[0], case.temperatures[-1]
    if gas is not None and len(gas.temperature):
        low, high = min(low, float(gas.temperature.min())), max(high, float(gas.temperature.max()))
    rising = math.sqrt(GRAVITY * geometry.height * (high - low) / low)
    fastest = max([moved, rising, *(abs(inlet.velocity) + swing for inlet in geometry.inlets)])
    if not geometry.outlets:
        return fastest
    volume = sum(abs(inlet.velocity) * inlet.width for inlet in geometry.inlets) + moved * geometry.height
    return max(fastest, volume / min(outlet.width for outlet in geometry.outlets))


def courant_number(strip: Strip, velocities: Floats, step: float) -> float:
    """Largest (|u_x|/dx + |u_y|/dy) step/eps of any cell, from the superficial `velocities` (4, cells) [m/s]; collective."""
    own = strip.owned
    bottom, left, right, top = np.abs(velocities[:, :own])
    rate = np.maximum(left, right) / strip.grid.dx + np.maximum(bottom, top) / strip.height[:own]
    return float(largest(strip.comm, [(rate / strip.porosity[:own]).max(initial=0.0) * step])[0])


def check_bounded(
    case: Case,
    strip: Strip,
    before: Floats,
    after: Floats,
    step: float,
    gas: GasState | None = None,
    driven: float = 0.0,
) -> None:
    """Raise ConvergenceError when the flow `after` a step of `step` [s] is out of all bounds or not a number; collective.

    The message says which `time.steps_per_cycle` brings the Courant number well below 1: that of the flow `before`, slowed down to the
    speed that ports and motion give it, within a factor of 2 because the fastest gas need not be where it would be in a good flow. With
    heat, what it drives out flows at up to `driven` [m/s] on its straight way.
    """
    found = np.abs(after).max(initial=0.0)
    speed, earlier, expected = largest(
        strip.comm,
        [
            found if np.isfinite(found) else np.inf,
            np.abs(before).max(initial=0.0),
            driving_speed(case, gas) + driven,
        ],
    )
    if speed <= BOUND * expected:
        return
    number = courant_number(strip, before, step) * min(1.0, expected / earlier if earlier else 1.0)
    steps = case.time.steps_per_cycle
    raise ConvergenceError(
        f"the flow diverges, gas at {speed:.3g} m/s where ports and motion give {expected:.3g} m/s: it passes {number:.2g} cells in a "
        f"step; take time.steps_per_cycle = {math.ceil(2.0 * steps * max(number, 1.0))} (found {steps}) or more"
    )
