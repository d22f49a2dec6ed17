"""How the reactor and the bed move: vibration, the bed's piecewise velocity, and their integrals over time steps.

The mesh rides rigidly on the reactor, displaced by X(t) = (A_x, A_y) sin(w t) with A_y = Gamma g / w^2; `t` counts from the start of
the vibration. Along x solids move with the reactor in contact and at constant velocity in flight, as a table says, or as their forces make
them (`mpm.physics.bed_cycle`, of which the distance is taken as it is, in closed form); along y they are locked to the reactor all the
time, so the bed neither lifts nor loosens. A gap below it is not modelled: a bed under its own forces has none at Gamma 0.30 of the base
case, 1.4 um at 0.45 and 7.9 um at 0.60, and opening the gap of the preset "thesis" in the mesh has changed the mean coverage of the box
at 24 s by +0.010 (Gamma 0.30) and -0.009 (0.60). Everything that drives the gas or the bed is given as a mean
over a time step, so that sums over a cycle are exact whatever the number of steps.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.constants import TURN

if TYPE_CHECKING:
    from mpm.case.motion import Motion
    from mpm.case.profile import BedProfile
    from mpm.physics.bed_cycle import BedCycle

BISECTIONS = 60  # to the last digit; scipy.optimize would cost every rank 50 MB


@dataclass(frozen=True, kw_only=True)
class Vibration:
    """Sinusoidal displacement of the reactor: amplitudes `ax`, `ay` [m], angular frequency `omega` [1/s]."""

    ax: float
    ay: float
    omega: float

    @classmethod
    def from_motion(cls, motion: Motion) -> Vibration:
        """A_y = Gamma g / w^2; the angle is counted from the horizontal or from the vertical."""
        ax, ay, omega = motion.amplitudes
        return cls(ax=ax, ay=ay, omega=omega)

    @property
    def period(self) -> float:
        return TURN / self.omega

    def displacement(self, t: float) -> tuple[float, float]:
        """X(t) [m]."""
        s = float(np.sin(self.omega * t))
        return self.ax * s, self.ay * s

    def velocity(self, t: float) -> tuple[float, float]:
        """dX/dt [m/s]."""
        c = float(self.omega * np.cos(self.omega * t))
        return self.ax * c, self.ay * c


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Bed that moves with the reactor from phase `contact` to `liftoff` [rad, in [0, 2 pi)] and flies at `velocity` [m/s] along x else."""

    vibration: Vibration
    liftoff: float
    contact: float
    velocity: float

    def is_airborne(self, phase: float) -> bool:
        return (phase - self.liftoff) % TURN < (self.contact - self.liftoff) % TURN

    def distance(self, phase: float) -> float:
        """Distance travelled in the lab's frame from phase 0 to `phase` <= 2 pi [m]."""
        distance = 0.0
        for a, b in itertools.pairwise(sorted({0.0, self.liftoff, self.contact, phase})):
            if b > phase:
                break
            if self.is_airborne(0.5 * (a + b)):
                distance += self.velocity * (b - a) / self.vibration.omega
            else:
                distance += self.vibration.ax * (np.sin(b) - np.sin(a))
        return float(distance)


class Tabulated:
    """Bed that moves as a profile file says, at an angular frequency `omega` [1/s]: `velocity` [m/s], linear between phases [rad]."""

    def __init__(self, profile: BedProfile, omega: float):
        self.omega = omega
        self.phase, self.velocity = np.array(profile.phase), np.array(profile.velocity)
        between = 0.5 * np.diff(self.phase) * (self.velocity[1:] + self.velocity[:-1])
        self._reached = np.concatenate([[0.0], np.cumsum(between)]) / omega

    def distance(self, phase: float) -> float:
        """Distance travelled in the lab's frame from phase 0 to `phase` <= 2 pi [m]."""
        i = min(int(np.searchsorted(self.phase, phase, side="right")) - 1, len(self.phase) - 2)
        u, (start, stop) = self.velocity[i], self.phase[i : i + 2]
        v = u + (self.velocity[i + 1] - u) * (phase - start) / (stop - start)
        return float(self._reached[i] + 0.5 * (u + v) * (phase - start) / self.omega)


def thesis_phases(vibration: Vibration, liftoff_velocity: float) -> tuple[float, float]:
    """Lift-off and contact phase [rad] of the preset "thesis": this project's reading of the one number that is printed.

    Table 5.3 has a "liftoff y-velocity" of -0.40 cm/s and the text a piecewise horizontal velocity; no phases are given. Here lift-off is
    where the reactor's falling vertical velocity reaches `liftoff_velocity` [m/s, negative]; the bed keeps that
    velocity until the reactor comes up to meet it. At base conditions 97.85 and 18.71 degrees. The reactor must move that fast, as
    `Motion` checks.
    """
    slope = liftoff_velocity / (vibration.ay * vibration.omega)
    liftoff = float(np.arccos(slope))

    def gap(phase: float) -> float:
        """Bed above reactor, over A_y."""
        return float(np.sin(liftoff) + slope * (phase - liftoff) - np.sin(phase))

    # the reactor turns upwards and overtakes the bed within one turn of lift-off: gap opens, then closes once
    lowest = TURN - np.arccos(slope)  # reactor's upward-going instant of equal velocity: largest gap
    before, after = lowest, liftoff + TURN
    for _ in range(BISECTIONS):
        middle = 0.5 * (before + after)
        before, after = (middle, after) if gap(middle) > 0.0 else (before, middle)
    contact = float(after)
    return liftoff, contact % TURN


def flight_velocity(vibration: Vibration, *, liftoff: float, contact: float, mean: float) -> float:
    """Horizontal velocity in flight [m/s] that makes the cycle mean equal to `mean`.

    mean T = A_x (sin(liftoff) - sin(contact)) + u T_flight.
    """
    flight_time = ((contact - liftoff) % TURN) / vibration.omega
    carried = vibration.ax * (np.sin(liftoff) - np.sin(contact))
    return float((mean * vibration.period - carried) / flight_time)


class BedMotion:
    """Position of the bed relative to the reactor (the mesh), s(t) [m], from the start of the vibration.

    `course` is how it moves within a cycle, None where nothing vibrates. `mean` [m/s] is the mean conveying velocity, negative to the left
    (`Motion.mean_velocity`). `at(t)` gives s(t) exactly; v_s averaged over a step is (s(t1) - s(t0)) / (t1 - t0).
    """

    def __init__(self, motion: Motion):
        self.vibration = vibration = Vibration.from_motion(motion)
        self.mean = mean = motion.mean_velocity
        self.course: Flight | Tabulated | BedCycle | None = None
        if motion.balance is not None:
            self.course = motion.balance
        elif motion.table is not None:
            self.course = Tabulated(motion.table, vibration.omega)
        elif motion.gamma > 0.0 and not motion.balances:
            liftoff, contact = motion.phases or thesis_phases(vibration, motion.liftoff_velocity)
            velocity = flight_velocity(vibration, liftoff=liftoff, contact=contact, mean=mean)
            self.course = Flight(vibration=vibration, liftoff=liftoff, contact=contact, velocity=velocity)

    def at(self, t: float) -> float:
        """Distance the bed has slid relative to the reactor since the vibration started, s(t) with s(0) = 0 [m]."""
        if t <= 0.0:
            return 0.0
        if self.course is None:
            return self.mean * t
        cycles, rest = divmod(self.vibration.omega * t, TURN)
        lab = cycles * self.mean * self.vibration.period + self.course.distance(rest)
        return float(lab - self.vibration.ax * np.sin(self.vibration.omega * t))


@dataclass(frozen=True, kw_only=True)
class StepMotion:
    """Means over one time step: bed velocity relative to the mesh, frame acceleration a_x and a_y, frame velocity V_y; slide = distance."""

    bed_velocity: float = 0.0
    acceleration: float = 0.0
    acceleration_y: float = 0.0
    frame_velocity_y: float = 0.0
    slide: float = 0.0


REST = StepMotion()


def step_motion(bed: BedMotion, t0: float, t1: float) -> StepMotion:
    """Means over the step from `t0` to `t1` [s since the vibration started; not across the start]."""
    if t1 <= 0.0:
        return REST
    dt = t1 - t0
    vibration = bed.vibration
    slide = bed.at(t1) - bed.at(t0)
    after, before = vibration.velocity(t1), vibration.velocity(t0)
    return StepMotion(
        bed_velocity=slide / dt,
        acceleration=(after[0] - before[0]) / dt,
        acceleration_y=(after[1] - before[1]) / dt,
        frame_velocity_y=(vibration.displacement(t1)[1] - vibration.displacement(t0)[1]) / dt,
        slide=slide,
    )
