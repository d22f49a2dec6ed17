"""The linear systems of Newton's method on the reacting species, and how exactly each needs to be solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats
from mpm.numerics.box_matrix import BoxMatrix, BoxSolver
from mpm.parallel import largest, total_and_largest
from mpm.transport.local_terms import MUTUAL, Weighed
from mpm.transport.ports import Ports
from mpm.transport.reactions import Reactions
from mpm.transport.step_matrix import StepMatrix

RESIDUAL = (
    1e-12  # sum of |residual| over all cells that Newton's method ends with, relative to the largest feed
)
FORCING = 1e-2  # loosest inner tolerance of the inexact Newton iteration
QUADRATIC = 0.3  # inner tolerance over the residual, whose next value is about its square in any case
# what the inner tolerance aims at, and no further: traces far from their inlet are reported too
LAST = 1e-5 * RESIDUAL
# residual below which reactions change too little from one iterate to the next to need other pivots: no iteration more in any case tried
SETTLED = 1e-2
# share of a change of one unknown that is not missed in another: of a residual every Newton iteration leaves no more than that
NEGLIGIBLE = 1e-12
# backward-error floor, relative to the sum of |diagonal C| and what else the residual is a difference of: below is rounding, and accepted
ROUNDING = float(np.finfo(float).eps)
UNDERSHOOT = 1e-15  # of the largest concentration or feed: no accepted step has anything lower
NO_FEED = 1e-300  # mol/m/s, in place of a feed of nothing where residuals are divided by it


@dataclass(frozen=True)
class Quality:
    """Of an iterate: its `worst` residual over the feed, whether that has `converged`, the `lowest` concentration [mol/m3] and whether it
    counts as `positive`."""

    worst: float
    converged: bool
    lowest: float
    positive: bool


def quality(ports: Ports, iterate: Weighed) -> Quality:
    """What to think of an iterate that every rank has weighed; collective.

    Measured by the feed, or by what is made where solids let gas go by themselves.
    """
    (size, carried, turned), (lowest, most) = total_and_largest(
        ports.strip.comm,
        [iterate.missed, iterate.carried, iterate.made],
        [max(-iterate.lowest, 0.0), max(iterate.largest, ports.largest_feed)],
    )
    scale = max(ports.feed_rate, float(turned), NO_FEED)
    worst = float(size / scale)
    converged = worst < max(RESIDUAL, ROUNDING * carried / scale)
    return Quality(worst, bool(converged), 0.0 - float(lowest), bool(lowest <= UNDERSHOOT * most))


class NewtonSystem:
    """The linear systems of Newton's method on the species that take part in `reactions`.

    Reactions couple species in every cell, but mostly one way, or so weakly that each can have an incomplete factor of its own.
    """

    def __init__(self, reactions: Reactions):
        self._comm = reactions.strip.comm
        self._matrix = BoxMatrix(reactions.strip.box, reactions.coupled)
        self._solver = BoxSolver(self._matrix, "reacting species")
        self._versions: list[int] = []
        # the residual over the feed of the iterate whose pivots the factor has, and which factor that is
        self._pivots_at, self._together = float("inf"), False

    @property
    def blocks(self) -> Floats:
        """What couples the unknowns of each cell, (own, unknowns, unknowns) [m2/s]: written in place by who weighs an iterate."""
        return self._matrix.blocks

    def set_fluxes(self, matrices: Sequence[StepMatrix]) -> None:
        """Enter the fluxes of the unknowns, those of their step's matrices: another step begins."""
        self._pivots_at = float("inf")
        versions = [matrix.version for matrix in matrices]
        if versions != self._versions:
            for couplings, matrix in zip(self._matrix.couplings, matrices, strict=True):
                couplings[:] = matrix.couplings
            self._versions = versions

    def solve(self, residual: Floats, tolerance: float, mutual: float, worst: float = float("inf")) -> Floats:
        """The step (unknowns, own) with the present `blocks`, whose unknowns are coupled by up to `mutual` on this rank; collective.

        Pivots are those of the first iterate of a step that was not further off (`worst`, as in Quality) than SETTLED, until one is again.
        """
        together = self._matrix.unknowns > 1 and float(largest(self._comm, [mutual])[0]) > MUTUAL
        pivots = max(self._pivots_at, worst) > SETTLED or together != self._together
        self._solver.factorise(together, NEGLIGIBLE, pivots)
        if pivots:
            self._pivots_at, self._together = worst, together
        return self._solver.solve(residual, tolerance)[0]


def forcing(residual: float) -> float:
    """Inner tolerance that keeps Newton's quadratic convergence (Eisenstat and Walker 1996, choice 2 in spirit): nothing is gained below
    LAST."""
    return min(max(QUADRATIC * residual, LAST / residual), FORCING)
