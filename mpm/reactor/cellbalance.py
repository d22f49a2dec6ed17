"""Balance of each cell by itself: what Newton's method needs to move fronts thinner than a cell.

    D C - nu r(C, theta_in) = S     with S the inflow [mol/m/s] from the neighbours, D [m2/s] what carries C out of the cell

The uptake r of a cell rises steeply with C until its sites are used up and not at all from there on. A linear system sees only one of
the two and sends a front far too far or not at all; but it predicts the inflow S well. So the concentrations that it gives are
replaced by those at which every cell balances with that inflow: uptake up to what the sites can take, the rest stays in the gas.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.numerics.local_newton import LOWEST, balance_locally

if TYPE_CHECKING:
    from mpm.reactor.steady_system import SteadySystem

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
NEGLIGIBLE = 1e-18  # of the largest feed, over the number of cells: a residual that needs no work


def balance_cells(system: SteadySystem, predicted: Floats, step: float) -> None:
    """Replace the system's concentrations by those that balance with the inflow under the `predicted` ones (coupled, own cells).

    Solids enter with the system's present coverage. A cell that does not come to rest keeps its last iterate: this is a guess.
    """
    transport = system.transport
    coupled = system.operators[: system.b]
    drawn = transport.outlet_means(coupled, predicted)
    storage = transport.gas_volume / step
    inflow = system.diagonal * predicted - transport.flux_product(coupled, predicted)
    inflow += transport.supply(coupled, system.shares, drawn) + storage * system.old[0]
    np.maximum(inflow, 0.0, out=inflow)
    span, entering = system.entering(step)
    start = np.maximum(np.where(predicted > 0.0, predicted, system.concentration), LOWEST)
    idle = NEGLIGIBLE * transport.feed_rate / max(transport.strip.grid.cells, 1)
    system.concentration = balance_locally(
        start,
        system.diagonal + storage,
        inflow,
        lambda c, active: _sources(system, c, active, entering, span, step),
        idle,
    )


def _sources(
    system: SteadySystem, concentration: Floats, active: Ints, entering: Floats, span: float, step: float
) -> tuple[Floats, Floats]:
    """What reactions make in the `active` cells (coupled, n) [mol/m/s], and its derivatives (n, coupled, coupled) [m2/s]."""
    transport, b, c = system.transport, system.b, concentration
    source, slope = np.zeros_like(c), np.zeros((len(active), b, b))
    if len(transport.gas.reactions):
        nu = transport.nu_gas[:, :b]
        rates, slopes = transport.gas.rates(c)
        volume = transport.gas_volume[active]
        source += nu.T @ rates * volume
        slope += np.einsum("ri,rjn->nij", nu, slopes) * volume[:, None, None]
    nu = transport.nu_surface[:, :b]
    reactive = np.flatnonzero(system.place[active] >= 0)
    moving = system.is_moving[system.place[active[reactive]]]
    for chosen, moves in ((reactive[moving], True), (reactive[~moving], False)):
        cells = system.place[active[chosen]]
        part = transport.surface.part(cells)
        if moves:
            conveyed = part.conveyed(c[:, chosen], entering[:, system.place_moving[cells]], span)
            rates, slopes = conveyed.rates, conveyed.rates_c
        else:
            rates, slopes = part.rates(c[:, chosen], system.old[1][:, cells], step)
        area = transport.active_area[cells]
        source[:, chosen] += nu.T @ rates * area
        slope[chosen] += np.einsum("ri,rjn->nij", nu, slopes) * area[:, None, None]
    return source, slope
