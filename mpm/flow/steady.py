"""The steady gas flow under constant forcing, convection included.

Creeping flow is linear and always has a solution; what inertia adds is found by Newton's method. How far it has come is judged by the
velocities: a residual says little, because the drag of a tight solid outweighs the shear of the gas beside it by any factor.
"""

from __future__ import annotations

import numpy as np

from mpm.errors import ConvergenceError
from mpm.flow.fields import FlowField
from mpm.flow.problem import NEWTON_TOLERANCE, FlowProblem
from mpm.motion.kinematics import REST, StepMotion

CONVERGED = 1e-10  # what is left to change of a velocity, relative to the fastest
# tolerance of the linear solves on the way there: what they leave the next step finds. One that has enough after a step or two takes the
# finer one of `FlowProblem.newton_update`
INNER = 1e-3
# change that is accepted once it no longer shrinks: what rounding of the pressure leaves, 1e-8 where a powder of a micron holds back 1 bar
ROUNDING = 1e-5
LIMIT = 15  # Newton steps from a creeping flow
SHARE_LIMIT = 12  # and from a flow with less convection
FIRST_SHARE, LEAST_SHARE = 0.25, 1.0 / 64.0  # steps of the share of convection


def steady_flow(
    problem: FlowProblem,
    motion: StepMotion = REST,
    guess: FlowField | None = None,
    enough: float = 0.0,
) -> FlowField:
    """Steady flow with convection under constant forcing; leaves it in `problem`. A last change of velocities below `enough` will do.

    Newton's method from a `guess` with the same ports, or from the creeping flow, with the factored creeping operator as preconditioner, so
    that one factor serves. Where that does not arrive (ports at a Reynolds number of a hundred), the convection grows in steps. Raises
    ConvergenceError.
    """
    if guess is None:
        _creep(problem, motion)
    else:
        problem.start_from(guess, (1.0, motion.frame_velocity_y))
    try:
        _newton(problem, motion, LIMIT, enough=enough)
    except ConvergenceError:
        _grow(problem, motion)
    problem.weigh(motion)
    return problem.field()


def _creep(problem: FlowProblem, motion: StepMotion) -> None:
    """The flow without convection."""
    force = problem.convective_force()
    force.set(0.0)
    problem.solve_steady(motion, force)


def _newton(
    problem: FlowProblem, motion: StepMotion, limit: int, exact: bool = False, enough: float = 0.0
) -> None:
    """Newton's method until the change that it would still make is small: the next one shrinks like the last, or like the inner error."""
    change, inner = np.inf, NEWTON_TOLERANCE if enough else INNER
    for _ in range(limit):
        last, change = change, problem.newton_update(motion, exact=exact, tolerance=inner)
        left = change * max(inner, change / last)
        if left < CONVERGED or change < enough or (change < ROUNDING and change > 0.5 * last):
            return
        if not np.isfinite(change):
            break
    raise ConvergenceError(f"steady flow: velocities still change by {change:.3g} after {limit} Newton steps")


def _grow(problem: FlowProblem, motion: StepMotion) -> None:
    """Follow the flow from none of its convection to all of it, each time with a factor of the Jacobian itself."""
    problem.release()
    _creep(problem, motion)
    problem.release()
    share, step = 0.0, FIRST_SHARE
    try:
        while share < 1.0:
            aim, before = min(share + step, 1.0), problem.values.copy()
            problem.convection_share = aim
            try:
                _newton(problem, motion, SHARE_LIMIT, exact=True)
                share, step = aim, 1.5 * step
            except ConvergenceError as error:
                problem.values[:] = before
                step *= 0.5
                if step < LEAST_SHARE:
                    raise ConvergenceError(
                        f"steady flow: found with {share:.0%} of the gas's inertia, not with more; it may have no steady state at this "
                        "speed: slower or wider ports, narrower cells there, or fidelity resolved with startup impulsive"
                    ) from error
    finally:
        problem.convection_share = 1.0
