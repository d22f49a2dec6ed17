"""The linear systems of Newton's method on the reacting species, and how exactly each needs to be solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np

from mpm.arrays import Floats
from mpm.numerics.linear import KrylovSolver
from mpm.parallel import largest, total
from mpm.transport.cell_matrix import CellMatrix
from mpm.transport.fluxes import FluxOperator
from mpm.transport.ports import Ports
from mpm.transport.reactions import Reactions

RESIDUAL = (
    1e-12  # sum of |residual| over all cells that Newton's method ends with, relative to the largest feed
)
FORCING = 1e-2  # loosest inner tolerance of the inexact Newton iteration
QUADRATIC = 0.3  # inner tolerance over the residual, whose next value is about its square in any case
# what the inner tolerance aims at, and no further: traces far from their inlet are reported too
LAST = 1e-5 * RESIDUAL
# Krylov iterations with the factor of an earlier matrix after which the next system gets its own, which costs as much as three of them
PATIENCE = 5
PATIENCE_COUPLED = 1  # the same of several species
# coupling of two species by reactions in the gas (`NewtonSystem._coupling`): what an incomplete factor can do without, and what the matrix
# can, since every Newton iteration leaves no more than that share of a residual
WEAK, NEGLIGIBLE = 0.1, 1e-6
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
    """The linear systems of Newton's method on the species that take part in `reactions`; with incomplete factors of `fill` levels.

    Reactions in the gas couple species in every cell, mostly so weakly that the incomplete factor, and even the matrix, can do without:
    both then have fewer entries, and the time of an iteration is that of reading them.
    """

    def __init__(self, reactions: Reactions, fill: int):
        self.unknowns = unknowns = reactions.coupled
        self._strip, self._fill, self._surfaces = reactions.strip, fill, reactions.coverage.cells
        self._thin = CellMatrix(
            self._strip, unknowns, self._surfaces
        )  # species are coupled on surfaces alone
        self._gas = unknowns > 1 and bool(reactions.gas.reactions)
        self._matrix = self._like = self._thin  # that of the system, and that of its incomplete factor
        self._solvers: dict[tuple[CellMatrix, CellMatrix], KrylovSolver] = {}
        self._coupled = 0.0  # in this step so far
        self._operators: Sequence[FluxOperator] = ()
        self.step, self.rhs = self._thin.matrix.createVecs()
        self._patience = PATIENCE if unknowns == 1 else PATIENCE_COUPLED
        self._iterations = 0  # of the last solve

    def set_fluxes(self, operators: Sequence[FluxOperator]) -> Floats:
        """Enter the fluxes of the unknowns; returns what they add to the diagonal, (unknowns, own) [m2/s]."""
        self._operators = operators
        return self._thin.set_fluxes(operators)

    def solve(self, blocks: Floats, residual: Floats, tolerance: float, first: bool) -> Floats:
        """The step (unknowns, own) with `blocks` (own, unknowns, unknowns) on the diagonal, the `first` of an iteration or not; collective.

        The factor of the first matrix serves as long as it serves well: cells in which sites run out change the matrix.
        """
        changed = self._gas and self._choose(blocks, first)
        refactor = first or changed or self._iterations > self._patience
        for cells in dict.fromkeys((self._matrix, self._like) if refactor else (self._matrix,)):
            cells.set_fluxes(self._operators)
            cells.assemble(blocks)
        step = np.empty_like(residual)
        _copy(residual, self.rhs.array.reshape(-1, self.unknowns).T)
        self._iterations = self._solver().solve(self.rhs, self.step, tolerance, refactor=refactor)
        _copy(self.step.array.reshape(-1, self.unknowns).T, step)
        return step

    @cached_property
    def _full(self) -> CellMatrix:
        """With all couplings; rarely needed."""
        return CellMatrix(self._strip, self.unknowns)

    def _solver(self) -> KrylovSolver:
        """The one of the present matrix and that whose incomplete factor it takes."""
        pair = self._matrix, self._like
        if pair not in self._solvers:
            matrix, like = pair[0].matrix, pair[1].matrix
            self._solvers[pair] = KrylovSolver(matrix, "reacting species", FORCING, self._fill, like)
        return self._solvers[pair]

    def _choose(self, blocks: Floats, first: bool) -> bool:
        """Take the matrices for the coupling in `blocks`, later in a step for the strongest so far; tells whether they are others.
        Collective."""
        before, now = (self._matrix, self._like), self._coupling(blocks)
        self._coupled = now if first else max(self._coupled, now)
        self._matrix = self._thin if self._coupled < NEGLIGIBLE else self._full
        self._like = self._thin if self._coupled < WEAK else self._full
        return (self._matrix, self._like) != before

    def _coupling(self, blocks: Floats) -> float:
        """Largest |b_ij / b_jj| of two unknowns in cells without a reactive surface: what share of a change of j comes back as a residual
        of i. Collective."""
        most = 0.0
        for i, j in permutations(range(self.unknowns), 2):
            share = np.abs(blocks[:, i, j] / blocks[:, j, j])
            share[self._surfaces] = 0.0
            most = max(most, share.max(initial=0.0))
        return float(largest(self._strip.comm, [most])[0])


def _copy(values: Floats, into: Floats) -> None:
    """Row by row, six times as fast as numpy turns an array about."""
    for one, there in zip(values, into, strict=True):
        there[:] = one


def forcing(residual: float) -> float:
    """Inner tolerance that keeps Newton's quadratic convergence (Eisenstat and Walker 1996, choice 2 in spirit): nothing is gained below
    LAST."""
    return min(max(QUADRATIC * residual, LAST / residual), FORCING)


def fill_levels(fidelity: str, coupled: int) -> tuple[int, int]:
    """Levels of fill-in of the incomplete factors for so many `coupled` species, and for each species that is only made."""
    fill, product_fill = FILL[fidelity]
    return fill if coupled <= FEW else min(fill, 1), product_fill
