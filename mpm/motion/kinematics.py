"""How the reactor and the bed move: vibration, the bed's piecewise velocity, and their integrals over time steps.

The mesh rides rigidly on the reactor, displaced by X(t) = (A_x, A_y) sin(w t) with A_y = Gamma g / w^2; `t` counts from the start of
the vibration. Along x solids move with the reactor in contact and at constant velocity in flight (or as a table says); along y they are
locked to the reactor all the time, so the bed neither lifts nor loosens. Everything that drives the gas or the bed is given as a mean
over a time step, so that sums over a cycle are exact whatever the number of steps.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.constants import GRAVITY
from mpm.errors import InputError

if TYPE_CHECKING:
    from mpm.case.case import Motion

Floats = NDArray[np.float64]

TURN = 2.0 * np.pi
BISECTIONS = 60  # to the last digit; scipy.optimize would cost every rank 50 MB


@dataclass(frozen=True)
class Vibration:
    """Sinusoidal displacement of the reactor: amplitudes `ax`, `ay` [m], angular frequency `omega` [1/s]."""

    ax: float
    ay: float
    omega: float

    @classmethod
    def from_motion(cls, motion: Motion) -> Vibration:
        """A_y = Gamma g / w^2; the angle is counted from the horizontal or from the vertical."""
        omega = TURN * motion.frequency
        ay = motion.gamma * GRAVITY / omega**2
        slope = np.tan(motion.angle)
        return cls(
            float(ay / slope if motion.angle_from == "horizontal" else ay * slope), float(ay), float(omega)
        )

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


@dataclass(frozen=True)
class Flight:
    """Bed in contact from `contact` to `liftoff` (phases in [0, 2 pi)) and else flying at horizontal velocity `velocity` [m/s]."""

    liftoff: float
    contact: float
    velocity: float


def thesis_phases(vibration: Vibration, liftoff_velocity: float) -> tuple[float, float]:
    """Lift-off and contact phase [rad] of the preset "thesis": this project's reading of the one number that is printed.

    Table 5.3 has a "liftoff y-velocity" of -0.40 cm/s and the text a piecewise horizontal velocity; no phases are given. Here lift-off is
    where the reactor's falling vertical velocity reaches `liftoff_velocity` [m/s, negative]; the bed keeps that
    velocity until the reactor comes up to meet it. At base conditions 97.85 and 18.71 degrees.

    Raises InputError when the reactor never moves that fast.
    """
    peak = vibration.ay * vibration.omega
    if not -peak < liftoff_velocity < 0.0:
        raise InputError(
            f"motion.liftoff_velocity: found {liftoff_velocity:g} m/s; accepted: between {-peak:.4g} m/s (the reactor's peak) and 0 m/s"
        )
    liftoff = float(np.arccos(liftoff_velocity / peak))
    slope = liftoff_velocity / peak

    def gap(phase: float) -> float:
        """Bed above reactor, over A_y."""
        return np.sin(liftoff) + slope * (phase - liftoff) - np.sin(phase)

    # the reactor turns upwards and overtakes the bed within one turn of lift-off: gap opens, then closes once
    lowest = TURN - np.arccos(slope)  # reactor's upward-going instant of equal velocity: largest gap
    before, after = lowest, liftoff + TURN
    for _ in range(BISECTIONS):
        middle = 0.5 * (before + after)
        before, after = (middle, after) if gap(middle) > 0.0 else (before, middle)
    contact = float(after)
    return liftoff, contact % TURN


def flight_velocity(vibration: Vibration, liftoff: float, contact: float, mean: float) -> float:
    """Horizontal velocity in flight [m/s] that makes the cycle mean equal to `mean`.

    mean T = A_x (sin(liftoff) - sin(contact)) + u T_flight.
    """
    flight_time = ((contact - liftoff) % TURN) / vibration.omega
    carried = vibration.ax * (np.sin(liftoff) - np.sin(contact))
    return float((mean * vibration.period - carried) / flight_time)


class BedMotion:
    """Position of the bed relative to the reactor (the mesh), s(t) [m], from the start of the vibration.

    `mean` [m/s] is the mean conveying velocity, negative to the left (`Motion.mean_velocity`). `at(t)` gives s(t) exactly; v_s averaged
    over a step is (s(t1) - s(t0)) / (t1 - t0).
    """

    def __init__(self, motion: Motion):
        self.vibration = Vibration.from_motion(motion)
        self.start = motion.start
        self.flight: Flight | None = None
        self._table: tuple[Floats, Floats, Floats] | None = None
        self.mean = motion.mean_velocity
        table = motion.table
        if motion.gamma > 0.0 and table is None:
            if motion.profile == "thesis":
                liftoff, contact = thesis_phases(self.vibration, motion.liftoff_velocity)
            else:
                assert motion.liftoff_phase is not None and motion.contact_phase is not None
                liftoff, contact = motion.liftoff_phase, motion.contact_phase
            self.flight = Flight(
                liftoff, contact, flight_velocity(self.vibration, liftoff, contact, self.mean)
            )
        elif table is not None:
            phase, velocity = np.array(table.phase), np.array(table.velocity)
            distance = np.concatenate(
                [[0.0], np.cumsum(0.5 * np.diff(phase) * (velocity[1:] + velocity[:-1]))]
            )
            self._table = (phase, velocity, distance / self.vibration.omega)

    @property
    def moving(self) -> bool:
        """False when the bed never leaves the reactor's frame."""
        return (
            self.vibration.ax != 0.0 and (self.flight is not None or self._table is not None)
        ) or self.mean != 0.0

    def at(self, t: float) -> float:
        """Distance the bed has slid relative to the reactor since the vibration started, s(t) with s(0) = 0 [m]."""
        if t <= 0.0:
            return 0.0
        if self.flight is None and self._table is None:
            return self.mean * t
        cycles, rest = divmod(self.vibration.omega * t, TURN)
        lab = cycles * self.mean * self.vibration.period + self._lab_distance(rest)
        return float(lab - self.vibration.ax * np.sin(self.vibration.omega * t))

    def _lab_distance(self, phase: float) -> float:
        """Distance travelled in the lab's frame from phase 0 to `phase` <= 2 pi."""
        if self._table is not None:
            phases, velocities, distances = self._table
            i = min(int(np.searchsorted(phases, phase, side="right")) - 1, len(phases) - 2)
            v = velocities[i] + (velocities[i + 1] - velocities[i]) * (phase - phases[i]) / (
                phases[i + 1] - phases[i]
            )
            return float(
                distances[i] + 0.5 * (velocities[i] + v) * (phase - phases[i]) / self.vibration.omega
            )
        assert self.flight is not None
        flight = self.flight
        # walk through the intervals of one turn that starts at phase 0
        edges = sorted({0.0, flight.liftoff, flight.contact, phase})
        distance = 0.0
        for a, b in itertools.pairwise(edges):
            if b > phase:
                break
            middle = 0.5 * (a + b)
            flying = (middle - flight.liftoff) % TURN < (flight.contact - flight.liftoff) % TURN
            if flying:
                distance += flight.velocity * (b - a) / self.vibration.omega
            else:
                distance += self.vibration.ax * (np.sin(b) - np.sin(a))
        return float(distance)

    def lab_velocity(self, t: float) -> float:
        """Horizontal velocity of the bed in the lab's frame at time `t` of the vibration [m/s]."""
        phase = (self.vibration.omega * t) % TURN
        if self._table is not None:
            return float(np.interp(phase, self._table[0], self._table[1]))
        if self.flight is None:
            return self.mean + self.vibration.velocity(t)[0]
        flying = (phase - self.flight.liftoff) % TURN < (self.flight.contact - self.flight.liftoff) % TURN
        return self.flight.velocity if flying else self.vibration.velocity(t)[0]


@dataclass(frozen=True)
class StepMotion:
    """Means over one time step: bed velocity relative to the mesh, frame acceleration a_x, frame velocity V_y; slide = distance."""

    bed_velocity: float
    acceleration: float
    frame_velocity_y: float
    slide: float


REST = StepMotion(0.0, 0.0, 0.0, 0.0)


def step_motion(bed: BedMotion, t0: float, t1: float) -> StepMotion:
    """Means over the step from `t0` to `t1` [s since the vibration started; not across the start]."""
    if t1 <= 0.0:
        return REST
    dt = t1 - t0
    vibration = bed.vibration
    slide = bed.at(t1) - bed.at(t0)
    return StepMotion(
        slide / dt,
        (vibration.velocity(t1)[0] - vibration.velocity(t0)[0]) / dt,
        (vibration.displacement(t1)[1] - vibration.displacement(t0)[1]) / dt,
        slide,
    )
