"""Velocity fields of a run: at rest, the mean of a cycle, and the cycle itself.

The gas does not feel the dilute species, so its flow is found first and replayed: `resolved` uses one field per phase of the periodic
cycle, `averaged` its mean, both after the field at rest. An impulsive start marches the true transient instead.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.flow.courant import check_bounded
from mpm.flow.fields import FlowField
from mpm.flow.problem import FlowProblem
from mpm.flow.steady import steady_flow
from mpm.motion.kinematics import BedMotion, StepMotion, step_motion
from mpm.numerics.fem import PETSc
from mpm.parallel import largest

_State = tuple[Floats, Floats]  # fluxes and pressure
PERIODIC = 1e-6  # change of the velocities from one cycle to the next, relative to the fastest
CYCLE_LIMIT = 200
TOLERANCE = 1e-3  # of the correction after a cycle, which leaves a fiftieth of what it lacks in any case
# error that the end of a cycle keeps, as a function of the mean error m of the cycle and of one implicit step of DECAY cycles from it:
# AT_ONCE m + (1 - AT_ONCE) m/(1 + DECAY x), x the decay per cycle, is off by less than 0.017 of the error with which the cycle began
# (the best two numbers for 32 steps per cycle, by minimax; 0.04 for 8, 0.02 for many)
AT_ONCE, DECAY = -0.42, 0.41


def cycle_motions(bed_motion: BedMotion, dt: float, phases: int) -> list[StepMotion]:
    """Forcing of each step of a cycle in the periodic state (the second cycle: the first begins at the start of the motion)."""
    offset = bed_motion.vibration.period if phases > 1 else 0.0
    return [step_motion(bed_motion, offset + k * dt, offset + (k + 1) * dt) for k in range(phases)]


def mean_motion(bed_motion: BedMotion) -> StepMotion:
    """Forcing averaged over a cycle: the frame's means vanish, the bed's mean velocity remains."""
    return StepMotion(bed_velocity=bed_motion.mean)


def periodic_flow(
    problem: FlowProblem,
    bed_motion: BedMotion,
    phases: int,
    watch: Callable[[int, float], None] | None = None,
    guess: FlowField | None = None,
    kept: float | None = None,
) -> list[FlowField]:
    """The cycle that the flow repeats, one field per step; `problem.dt` is a cycle over `phases`.

    Marches from a `guess` of its end, or from the steady flow under the mean forcing. Summed over a periodic cycle of backward Euler the
    storage cancels, so the cycle's mean satisfies the steady equations with the cycle's mean convection. What it lacks after a cycle, above
    all the slow start-up drift of the headspace (about 0.7 s), a Newton step on those equations finds at once, where marching would take
    100 cycles. Of that mean error `_at_the_end` tells what is left at the end of the cycle, which then begins anew without it. A factor for
    the step `kept` [s] is not released. Periodicity is judged on velocities alone. `watch(cycle, change)` is called after every cycle.
    Raises ConvergenceError after CYCLE_LIMIT cycles, or as soon as the flow diverges because its steps are too long.
    """
    motions = cycle_motions(bed_motion, problem.dt, phases)
    if guess is None or phases == 1:
        steady_flow(problem, mean_motion(bed_motion), guess)
    else:
        problem.start_from(guess, (1.0, motions[-1].frame_velocity_y))
    if phases == 1:
        return [problem.field()]
    mean = StepMotion(
        bed_velocity=float(np.mean([m.bed_velocity for m in motions])),
        acceleration=float(np.mean([m.acceleration for m in motions])),
        frame_velocity_y=float(np.mean([m.frame_velocity_y for m in motions])),
    )
    # the next cycle takes the place of the last one's states, because two of them would be much to hold beside the factors
    states: list[_State] = []
    for cycle in range(CYCLE_LIMIT):
        change, state_mean, convective_mean = _march(problem, motions, states)
        if watch is not None:
            watch(cycle, change)
        if change < PERIODIC:
            problem.release(kept)  # before the fields take their place
            return [FlowField(problem.space.velocities(fluxes), pressure) for fluxes, pressure in states]
        end, lacking = problem.values.copy(), np.zeros_like(problem.values)
        problem.values[:] = state_mean
        with suppress(ConvergenceError):  # a flow that is about to diverge: the next cycle says it better
            problem.newton_update(mean, convective_mean, tolerance=TOLERANCE)
            lacking = _at_the_end(problem, problem.values - state_mean, phases)
        problem.values[:] = end + lacking
        convective_mean.destroy()
    raise ConvergenceError(
        f"periodic flow: velocities still change by {change:.3g} per cycle after {CYCLE_LIMIT} cycles"
    )


def _at_the_end(problem: FlowProblem, mean: Floats, phases: int) -> Floats:
    """What is left at the end of a cycle of a decaying error whose mean over the cycle is `mean` (local fluxes,); collective.

    Of an error that decays with exp(-x) over a cycle, that is x/(exp(x) - 1) of its mean: all of what is slow, nothing of what is fast.
    """
    decayed = problem.decayed(mean, DECAY * phases * problem.dt, TOLERANCE)
    return AT_ONCE * mean + (1.0 - AT_ONCE) * decayed


def _march(
    problem: FlowProblem, motions: list[StepMotion], states: list[_State]
) -> tuple[float, Floats, PETSc.Vec]:
    """March through one cycle and put its fluxes and pressures into `states`, those of the cycle before, or none.

    Returns the largest change of a velocity since the cycle before, relative to the fastest (infinite without one), and the cycle's means
    of the fluxes and of the convective force. Raises ConvergenceError when the flow leaves all bounds.
    """
    phases, first = len(motions), not states
    convective_mean = problem.convective_force().duplicate()
    convective_mean.set(0.0)
    state_mean = np.zeros_like(problem.values)
    change = speed = 0.0
    velocities = problem.space.velocities(problem.values)
    for phase, motion in enumerate(motions):
        force = problem.convective_force()
        convective_mean.axpy(1.0 / phases, force)
        problem.step(motion, force)
        before, velocities = velocities, problem.space.velocities(problem.values)
        check_bounded(problem.case, problem.strip, before, velocities, problem.dt)
        state_mean += problem.values / phases
        state = problem.values.copy(), problem.pressure()
        speed = max(speed, problem.space.fastest(state[0]))
        if first:
            states.append(state)
        else:
            change = max(change, problem.space.fastest(state[0] - states[phase][0]))
            states[phase] = state
    return np.inf if first else _relative(problem, change, speed), state_mean, convective_mean


def _relative(problem: FlowProblem, change: float, speed: float) -> float:
    """Largest `change` of a velocity since the cycle before on any rank, over the largest `speed`."""
    change, speed = largest(problem.strip.comm, [change, speed])
    return float(change / speed) if speed > 0.0 else 0.0
