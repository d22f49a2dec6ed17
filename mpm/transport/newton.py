"""The linear systems of Newton's method on the reacting species, and how exactly each needs to be solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats
from mpm.numerics.box_matrix import BoxMatrix, BoxSolver
from mpm.parallel import largest, total_and_largest
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
# share of a change that comes back to the same unknown by way of others in its cell, above which a factor takes up all of them together
MUTUAL = 0.1
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


def quality(ports: Ports, residual: Floats, carried: float, made: Floats, new: Floats) -> Quality:
    """What to think of concentrations `new` (coupled, own) with this `residual` [mol/m/s]; collective.

    Measured by the feed, or by what is `made` [mol/m/s] where solids let gas go by themselves. `carried` [mol/m/s]: sum of the terms.
    """
    comm = ports.strip.comm
    (size, carried, turned), (lowest, most) = total_and_largest(
        comm,
        [np.abs(residual).sum(), carried, np.abs(made).sum()],
        [-new.min(initial=0.0), new.max(initial=ports.largest_feed)],
    )
    scale = max(ports.feed_rate, float(turned), NO_FEED)
    worst = float(size / scale)
    converged = worst < max(RESIDUAL, ROUNDING * carried / scale)
    return Quality(worst, bool(converged), -float(lowest), bool(lowest <= UNDERSHOOT * most))


class NewtonSystem:
    """The linear systems of Newton's method on the species that take part in `reactions`.

    Reactions couple species in every cell, but mostly one way, or so weakly that each can have an incomplete factor of its own.
    """

    def __init__(self, reactions: Reactions):
        self._comm = reactions.strip.comm
        self._matrix = BoxMatrix(reactions.strip.box, reactions.coupled)
        self._solver = BoxSolver(self._matrix, "reacting species")
        self._versions: list[int] = []

    def set_fluxes(self, matrices: Sequence[StepMatrix]) -> None:
        """Enter the fluxes of the unknowns, those of their step's matrices."""
        versions = [matrix.version for matrix in matrices]
        if versions != self._versions:
            for couplings, matrix in zip(self._matrix.couplings, matrices, strict=True):
                couplings[:] = matrix.couplings
            self._versions = versions

    def solve(self, blocks: Floats, residual: Floats, tolerance: float) -> Floats:
        """The step (unknowns, own) with `blocks` (own, unknowns, unknowns) on the diagonal; collective."""
        self._matrix.blocks[:] = blocks
        mutual = 0.0
        if self._matrix.unknowns > 1:
            mutual = float(largest(self._comm, [mutual_coupling(blocks)])[0])
        self._solver.factorise(mutual > MUTUAL, NEGLIGIBLE)
        return self._solver.solve(residual, tolerance)[0]


def mutual_coupling(blocks: Floats) -> float:
    """Largest share of a change of an unknown that comes back to it by way of others of its cell, in `blocks` (cells, unknowns, unknowns)
    of any cell."""
    unknowns = blocks.shape[1]
    if unknowns == 2:
        back = (blocks[:, 0, 1] * blocks[:, 1, 0]) / (blocks[:, 0, 0] * blocks[:, 1, 1])
        return float(np.abs(back).max(initial=0.0))
    share = np.abs(blocks / np.einsum("njj->nj", blocks)[:, None, :])
    np.einsum("njj->nj", share)[:] = 0.0
    share = share[share.max(axis=(1, 2), initial=0.0) > MUTUAL]
    most, path = 0.0, share
    for _ in range(unknowns - 1):
        path = path @ share
        most = max(most, float(np.einsum("njj->nj", path).max(initial=0.0)))
    return most


def forcing(residual: float) -> float:
    """Inner tolerance that keeps Newton's quadratic convergence (Eisenstat and Walker 1996, choice 2 in spirit): nothing is gained below
    LAST."""
    return min(max(QUADRATIC * residual, LAST / residual), FORCING)
