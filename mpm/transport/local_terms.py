"""What reactions add to the equations of one time step in every cell: how far an iterate is off, how that changes with the gas of the
same cell, and at which concentrations the cell balances by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.numerics.local_newton import LOWEST, balance_locally
from mpm.physics.kinetics import SurfaceKinetics
from mpm.transport.reactions import Events, Reactions

IDLE = 1e-15  # of the feed: a residual of a cell that needs no work
TRIES = 2  # Newton iterations of a cell that balances by itself under an inflow that is not the last one
TURNED = 16.0  # times all places per step, from whose coverages the events of general laws follow: what rounding is of
# share of a change that comes back to the same unknown by way of others in its cell, above which a factor takes up all of them together
MUTUAL = 0.1


@dataclass(frozen=True, eq=False)
class StepEquations:
    """fluxes(C) + storage = rhs + made(C), of the reacting species over a step of `dt` [s] from coverages `theta` (sites, reactive cells).

    `diagonal` [m2/s] has storage and outflow of every cell, `rhs` [mol/m/s] what was there and what is supplied; both (coupled, own). All
    are contiguous.
    """

    diagonal: Floats
    rhs: Floats
    theta: Floats
    dt: float


@dataclass(frozen=True, eq=False)
class Weighed:
    """An iterate on this rank: the `events` at it, the `residual` (coupled, own) [mol/m/s] that it leaves, the sum of that, of what cells
    hold (`carried`) and of what is `made` where gas is let go without any, each by magnitude [mol/m/s]; the `lowest` and the `largest`
    concentration [mol/m3]."""

    events: Events
    residual: Floats
    missed: float
    carried: float
    made: float
    lowest: float
    largest: float


class LocalTerms:
    """Reactions by any law, whose slopes go to `blocks` (own, coupled, coupled) [m2/s] of the matrix that Newton's method solves."""

    def __init__(self, reactions: Reactions, blocks: Floats):
        self.reactions, self.blocks = reactions, blocks
        self.closed = isinstance(reactions.surface, SurfaceKinetics)

    def weigh(self, step: StepEquations, new: Floats, flux: Floats) -> Weighed:
        """The iterate `new` (coupled, own), of which `flux` (coupled, own) [mol/m/s] is the product with storage and fluxes.

        Both contiguous; the residual may take the place of `flux`.
        """
        reactions, coupled = self.reactions, self.reactions.coupled
        rates, slopes = reactions.surface.rates(
            new.take(reactions.coverage.cells, axis=1), step.theta, step.dt
        )
        gas_rates, gas_slopes = reactions.gas.rates(new)
        events = reactions.events(rates, gas_rates)
        made = reactions.made(events, slice(coupled))
        residual = flux - step.rhs - made
        np.negative(reactions.slopes(slopes, gas_slopes), out=self.blocks)
        for i in range(coupled):
            self.blocks[:, i, i] += step.diagonal[i]
        turned = 0.0 if self.closed else TURNED * reactions.coverage.capacity.sum() / step.dt
        return Weighed(
            events,
            residual,
            missed=float(np.abs(residual).sum()),
            carried=float(np.abs(step.diagonal * new).sum() + turned),
            made=float(np.abs(made).sum()) if reactions.start_by_themselves else 0.0,
            lowest=float(new.min(initial=np.inf)),
            largest=float(new.max(initial=-np.inf)),
        )

    def mutual(self) -> float:
        """Largest share of a change that comes back to its unknown by way of others in a cell, of the iterate weighed last."""
        return mutual_coupling(self.blocks)

    def balance(self, step: StepEquations, new: Floats, flux: Floats, feed: float) -> None:
        """Change the iterate `new` in cells whose sites run out, so that they balance with their inflow under it; `feed` [mol/m/s].

        A linear step sends the front too far or not far enough, because it does not see the sites of a cell run out
        (`mpm.numerics.local_newton`); this takes a third off the Newton iterations. A linear step is right where what comes in would use
        up next to none of the sites.
        """
        reactions, reactive = self.reactions, self.reactions.coverage.cells
        here, before, carried, held = (
            values.take(reactive, axis=1) for values in (step.diagonal, new, flux, step.rhs)
        )
        inflow = np.maximum(here * before - carried + held, 0.0)
        bends = reactions.surface.bends(np.maximum(before, inflow / here), step.theta, step.dt)
        chosen = np.flatnonzero(bends)
        here, before, inflow = (values.take(chosen, axis=1) for values in (here, before, inflow))

        def sources(c: Floats, active: NDArray[np.intp]) -> tuple[Floats, Floats]:
            return reactions.in_cells(chosen[active], c, step.theta, step.dt)

        balanced = balance_locally(np.maximum(before, LOWEST), here, inflow, sources, IDLE * feed, TRIES)
        new[:, reactive[chosen]] = np.where(inflow > 0.0, balanced, 0.0)


def mutual_coupling(blocks: Floats) -> float:
    """Largest share of a change of an unknown that comes back to it by way of others of its cell, in `blocks` (cells, unknowns, unknowns)
    of any cell."""
    unknowns = blocks.shape[1]
    if unknowns == 1:
        return 0.0
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
