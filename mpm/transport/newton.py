"""The linear systems of Newton's method on the reacting species, and how exactly each needs to be solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats
from mpm.mesh.strip import Strip
from mpm.numerics.linear import KrylovSolver
from mpm.parallel import largest, total
from mpm.transport.cell_matrix import CellMatrix, interleaved
from mpm.transport.fluxes import FluxOperator
from mpm.transport.ports import Ports

RESIDUAL = (
    1e-12  # sum of |residual| over all cells that Newton's method ends with, relative to the largest feed
)
FORCING = 1e-2  # loosest inner tolerance of the inexact Newton iteration
QUADRATIC = 0.3  # inner tolerance over the residual, whose next value is about its square in any case
# what the inner tolerance aims at, and no further: traces far from their inlet are reported too
LAST = 1e-5 * RESIDUAL
# Krylov iterations with the factor of an earlier matrix after which the next system gets its own, which costs as much as three of them
PATIENCE = 5
# levels of fill-in of the incomplete factors, for reacting species and for products: with `resolved` every step has a matrix of its own
FILL = {"resolved": (1, 0), "averaged": (2, 2), "steady": (2, 2)}
# reacting species up to which a second level pays: factors of blocks of six take three times as long and save one iteration in ten
FEW = 2
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
    size, carried, turned = total(comm, [np.abs(residual).sum(), carried, np.abs(made).sum()])
    lowest, most = largest(comm, [-new.min(initial=0.0), new.max(initial=ports.largest_feed)])
    scale = max(ports.feed_rate, float(turned), NO_FEED)
    worst = float(size / scale)
    converged = worst < max(RESIDUAL, ROUNDING * carried / scale)
    return Quality(worst, bool(converged), -float(lowest), bool(lowest <= UNDERSHOOT * most))


class NewtonSystem:
    """The linear systems of Newton's method on the reacting species."""

    def __init__(self, strip: Strip, unknowns: int, fill: int):
        self.unknowns = unknowns
        self.order = interleaved(strip.row[: strip.owned], strip.column[: strip.owned])
        self.cells = CellMatrix(strip, unknowns, self.order)
        self.krylov = KrylovSolver(self.cells.matrix, "reacting species", FORCING, fill=fill)
        self.step, self.rhs = self.cells.matrix.createVecs()
        self._iterations = 0  # of the last solve

    def set_fluxes(self, operators: Sequence[FluxOperator]) -> Floats:
        """Enter the fluxes of the unknowns; returns what they add to the diagonal, (unknowns, own) [m2/s]."""
        return self.cells.set_fluxes(operators)

    def solve(self, blocks: Floats, residual: Floats, tolerance: float, first: bool) -> Floats:
        """The step (unknowns, own) with `blocks` (own, unknowns, unknowns) on the diagonal, the `first` of an iteration or not; collective.

        The factor of the first matrix serves as long as it serves well: cells in which sites run out change the matrix.
        """
        self.cells.assemble(blocks)
        self.rhs.array[:] = residual[:, self.order].T.ravel()
        refactor = first or self._iterations > PATIENCE
        self._iterations = self.krylov.solve(self.rhs, self.step, tolerance, refactor=refactor)
        step = np.empty_like(residual)
        step[:, self.order] = self.step.array.reshape(-1, self.unknowns).T
        return step


def forcing(residual: float) -> float:
    """Inner tolerance that keeps Newton's quadratic convergence (Eisenstat and Walker 1996, choice 2 in spirit): nothing is gained below
    LAST."""
    return min(max(QUADRATIC * residual, LAST / residual), FORCING)


def fill_levels(fidelity: str, coupled: int) -> tuple[int, int]:
    """Levels of fill-in of the incomplete factors for so many `coupled` species, and for each species that is only made."""
    fill, product_fill = FILL[fidelity]
    return fill if coupled <= FEW else min(fill, 1), product_fill
