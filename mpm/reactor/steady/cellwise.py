"""Balance of each cell by itself: what Newton's method needs to move fronts thinner than a cell.

    D C - nu r(C, theta_in) = S     with S the inflow [mol/m/s] from the neighbours, D [m2/s] what carries C out of the cell

The uptake r of a cell rises steeply with C until its sites are used up and not at all from there on. A linear system sees only one of
the two and sends a front far too far or not at all; but it predicts the inflow S well. So the concentrations that it gives are
replaced by those at which every cell balances with that inflow: uptake up to what the sites can take, the rest stays in the gas.
"""

from __future__ import annotations

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.numerics.local_newton import LOWEST, balance_locally
from mpm.reactor.steady.system import Iterate, SteadySystem

NEGLIGIBLE = 1e-18  # of the largest feed, over the number of cells: a residual that needs no work


def balanced(system: SteadySystem, predicted: Floats, now: Iterate, old: Iterate, step: float) -> Floats:
    """Concentrations (coupled, own cells) that balance with the inflow under the `predicted` ones; collective.

    Solids enter with the coverage of `now`. A cell that does not come to rest keeps its last iterate: this is a guess.
    """
    ports, storage = system.ports, system.storage / step
    drawn = ports.outlet_means(system.operators, predicted)
    inflow = system.outflow * predicted - system.transport.flux_product(system.operators, predicted)
    inflow += ports.supply(system.operators, system.shares, drawn) + storage * old.concentration
    np.maximum(inflow, 0.0, out=inflow)
    entering = system.conveyor.entering(step, now.theta, old.theta)
    place = np.full(system.own, -1)  # of own cells among the reactive ones
    place[system.coverage.cells] = np.arange(len(system.coverage.cells))

    def sources(c: Floats, active: Ints) -> tuple[Floats, Floats]:
        """What reactions make in the `active` cells (coupled, n) [mol/m/s], and its derivatives (n, coupled, coupled) [m2/s]."""
        source, slope = system.reactions.in_gas(active, c)
        reactive = np.flatnonzero(place[active] >= 0)
        cells = place[active[reactive]]
        if len(reactive):
            on_surfaces = _on_surfaces(system, c[:, reactive], cells, entering, old, step)
            source[:, reactive] += on_surfaces[0]
            slope[reactive] += on_surfaces[1]
        return source, slope

    start = np.maximum(np.where(predicted > 0.0, predicted, now.concentration), LOWEST)
    idle = NEGLIGIBLE * system.scale / max(system.strip.grid.cells, 1)
    return balance_locally(start, system.outflow + storage, inflow, sources, idle)


def _on_surfaces(
    system: SteadySystem, c: Floats, cells: Ints, entering: Floats, old: Iterate, step: float
) -> tuple[Floats, Floats]:
    """What surface reactions make in some reactive `cells` at concentrations (coupled, cells), and its derivatives."""
    conveyor, surface = system.conveyor, system.reactions.surface
    rates = np.empty((len(surface.reactions), len(cells)))
    slopes = np.empty((len(rates), len(c), len(cells)))
    moves = conveyor.is_moving[cells]
    if moves.any():
        chosen = cells[moves]
        solids = entering[:, conveyor.place[chosen]]
        conveyed = surface.part(chosen).conveyed(c[:, moves], solids, conveyor.span(step))
        rates[:, moves], slopes[:, :, moves] = conveyed.rates, conveyed.rates_c
    if not moves.all():
        chosen = cells[~moves]
        rates[:, ~moves], slopes[:, :, ~moves] = surface.part(chosen).rates(
            c[:, ~moves], old.theta[:, chosen], step
        )
    return system.reactions.on_surfaces(cells, rates, slopes)
