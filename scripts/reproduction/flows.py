"""What the flow rows measure of a vibration cycle, from the flow alone.

`cycle` is a cycle of the developed, periodic state or one of the start-up transient after an impulsive start. Velocities in the
lab's frame are those of the gas in the pores, V + u/eps, with V the reactor's and u the superficial velocity relative to it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpm.case.case import Case
from mpm.flow.cycle import cycle_motions, periodic_flow
from mpm.flow.fields import FlowField
from mpm.flow.problem import FlowProblem
from mpm.flow.sequence import MarchedFlow
from mpm.flow.steady import steady_flow
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion, StepMotion, step_motion
from mpm.motion.schedule import Schedule
from reproduction.store import Arrays, Lab

from mpi4py import MPI  # isort: skip  (after fem)

Floats = NDArray[np.float64]
BOTTOM, LEFT, RIGHT, TOP = range(4)
SHOWN = 16  # phases whose fields are kept for pictures


def at_rest(lab: Lab, case: Case) -> Arrays:
    """Gas flow before the vibration, the bed at rest: steady, and 50 ms after the inlets open."""

    def make() -> Arrays:
        strip = Strip(case, MPI.COMM_SELF)
        schedule, bed = Schedule.from_case(case), BedMotion(case.motion)
        steady = steady_flow(FlowProblem(case, strip, schedule.dt))
        march = MarchedFlow(case, strip, bed, schedule)
        for n in range(schedule.resting_steps):
            march.at(schedule.step(n))
        grids = (_grid(strip, steady), _grid(strip, march.current))
        return {"steady": grids[0], "after_50ms": grids[1]}

    return lab.arrays(case, "rest", make)


def cycle(lab: Lab, case: Case, first: int | None = None) -> Arrays:
    """One cycle of the flow: number `first` after the start of the vibration (0, 1, ...), or the periodic one (None).

    Arrays over the steps of the cycle: `phase` [deg], `frame` (steps, 2) reactor velocity, `bed` velocity of the bed in the lab's frame,
    `ux_<layer>` mean pore velocity along x in the lab's frame, `rms` of the fluctuation per layer (layers,), `inflow` [m2/s],
    `out_<outlet>` (steps, open columns) velocity out of it; `fields` (SHOWN, 4, rows, columns) superficial, relative to the
    reactor, at the steps `shown`.
    """

    def make() -> Arrays:
        strip = Strip(case, MPI.COMM_SELF)
        schedule, bed = Schedule.from_case(case), BedMotion(case.motion)
        if first is None:
            motions = cycle_motions(bed, schedule.dt, schedule.phases)
            fields = periodic_flow(FlowProblem(case, strip, schedule.dt), bed, schedule.phases)
            start = bed.vibration.period
        else:
            march = MarchedFlow(case, strip, bed, schedule)
            count = schedule.resting_steps + (first + 1) * schedule.phases
            for n in range(count):
                march.at(schedule.step(n))
            fields, start = march.recent, first * bed.vibration.period
            motions = [
                step_motion(bed, start + k * schedule.dt, start + (k + 1) * schedule.dt)
                for k in range(schedule.phases)
            ]
        return _reduce(case, strip, bed, schedule.dt, start, fields, motions)

    return lab.arrays(case, "cycle" if first is None else f"cycle {first}", make)


def _grid(strip: Strip, field: FlowField) -> Floats:
    """Velocities (4, rows, columns) in grid order."""
    own = strip.owned
    return strip.scatter.to_all(field.velocities[:, :own]).reshape(4, strip.grid.rows, strip.grid.columns)


def _reduce(
    case: Case,
    strip: Strip,
    bed: BedMotion,
    dt: float,
    start: float,
    fields: list[FlowField],
    motions: list[StepMotion],
) -> Arrays:
    grid, n = strip.grid, len(fields)
    ends = start + dt * np.arange(n + 1)
    places = np.array([bed.vibration.displacement(t) for t in ends])
    frame = np.diff(places, axis=0) / dt
    whole = np.array([_grid(strip, f) for f in fields])
    porosity = grid.per_row(lambda solid: solid.porosity, gas=1.0)
    arrays: Arrays = {
        "phase": np.degrees(bed.vibration.omega * (ends[:-1] + 0.5 * dt)) % 360.0,
        "frame": frame,
        "bed": np.array([m.bed_velocity for m in motions]) + frame[:, 0],
    }
    centre_x, centre_y = 0.5 * (whole[:, LEFT] + whole[:, RIGHT]), 0.5 * (whole[:, BOTTOM] + whole[:, TOP])
    weights = grid.dy[:, None] * np.ones(grid.columns)
    rms = []
    for name in grid.layer_names:
        rows = grid.layer_rows(name)
        w = weights[rows] / weights[rows].sum()
        pore = centre_x[:, rows] / porosity[rows][:, None]
        arrays[f"ux_{name}"] = (pore * w).sum(axis=(1, 2)) + frame[:, 0]
        variance = (centre_x[:, rows].var(axis=0) + centre_y[:, rows].var(axis=0)) * w
        rms.append(np.sqrt(variance.sum()))
    arrays["rms"] = np.array(rms)
    arrays["inflow"] = sum(
        (
            whole[:, BOTTOM, 0, grid.overlap(i) > 0.0].sum(axis=1) * grid.dx
            for i in case.geometry.inlets
            if i.side == "bottom"
        ),
        start=np.zeros(len(whole)),
    )
    for outlet in case.geometry.outlets:
        arrays[f"out_{outlet.name}"] = whole[:, TOP, -1, grid.opening(outlet)]
    shown = np.linspace(0, n, SHOWN, endpoint=False).astype(int)
    arrays["shown"], arrays["fields"] = shown, whole[shown].astype(np.float32)
    return arrays
