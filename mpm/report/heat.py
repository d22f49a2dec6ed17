"""How warm gas and solids are, where the powder gets there, and whether heat and gas add up; of cases with `[energy]`.

Every quantity is defined in the docstring of the function that computes it. Heat is per metre of depth. A number that cannot be computed
is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.mesh.grid import Grid
from mpm.physics.thermal import volumetric_heat_capacity
from mpm.report.records import HeatTotals, Records, Totals

if TYPE_CHECKING:
    from mpm.case.case import Case

HEAT_TERMS = ("inlets", "outlets", "walls", "solids", "reaction", "heating", "stored")
"""Of the balance of heat: all before the last, into the strip positive, add up to the last."""
TRIFLE = 1e-6  # K: heat that changes all temperatures by no more is none
HELD = 1e-7  # of the heat in the strip: what passes must be known to 1e-9 of that, and floats to 1e-16 of it
RISEN = 0.95  # of the way from the temperature at which solids enter to that at which they leave
HARDLY = 1.0  # K, a way that is none


def temperatures(case: Case, grid: Grid, temperature: Floats | None) -> dict[str, Any]:
    """Per layer `mean` over its volume, `min` and `max` of a temperature (rows, columns) [K]; `bed_exit` of powder that leaves.

    That is the mean over the height of the moving layer in the column at the end of the strip where solids leave it (`Case.direction`);
    absent where none do.
    """
    if temperature is None:
        return {}
    result: dict[str, Any] = {}
    for name in grid.layer_names:
        inside = temperature[grid.layer_rows(name)]
        heights = grid.dy[grid.layer_rows(name)]
        mean = float(heights @ inside.mean(axis=1) / heights.sum())
        result[name] = {"mean": mean, "min": float(inside.min()), "max": float(inside.max())}
    profile = bed_profile(case, grid, temperature)
    if profile is not None:
        result["bed_exit"] = float(profile[-1])
    return result


def bed_profile(case: Case, grid: Grid, temperature: Floats) -> Floats | None:
    """Mean over the height of the moving layer in each column, in the order in which solids pass them; None where they do not move on."""
    if not grid.moving.any() or case.conveying_velocity == 0.0:
        return None
    heights = grid.dy[grid.moving]
    return np.asarray(heights @ temperature[grid.moving] / heights.sum())[:: case.direction]


def heating_length(case: Case, grid: Grid, temperature: Floats | None) -> dict[str, float]:
    """`length` [m] from the end where solids enter to where the bed's column mean first has made 95 % of its way to that at its exit.

    The way begins at `geometry.bed_temperature`, at that end, and may lead down; linear between the centres of columns. Absent where it is
    less than 1 K, and where solids that leave come back in.
    """
    profile = None if temperature is None else bed_profile(case, grid, temperature)
    if profile is None or case.geometry.bed_inflow == "periodic":
        return {}
    distance = np.append(0.0, (np.arange(grid.columns) + 0.5) * grid.dx)
    way = np.append(0.0, profile - case.bed_temperature)
    if abs(way[-1]) < HARDLY:
        return {}
    share = way / way[-1]
    i = int(np.argmax(share >= RISEN))
    part = (RISEN - share[i - 1]) / (share[i] - share[i - 1])
    return {"length": float(distance[i - 1] + part * (distance[i] - distance[i - 1]))}


def heat_capacity(case: Case) -> float:
    """Of gas and solids in the strip at the temperature of `[gas]` [J/K per metre of depth]."""
    gas, whole = case.gas.density * case.gas.heat_capacity, 0.0
    for layer in case.geometry.layers:
        solid, per_volume = layer.material, gas
        if solid is not None:
            per_volume = volumetric_heat_capacity(
                solid.porosity,
                gas=gas,
                density=solid.density or 0.0,
                heat_capacity=solid.heat_capacity or 0.0,
            )
        whole += per_volume * layer.height * case.geometry.length
    return whole


def heat_terms(heat: HeatTotals) -> dict[str, float]:
    """What has passed into the strip by inlets, outlets, walls and solids, was given off by reactions and electrically, and is `stored`.

    [J/m], in a steady state [W/m]. Gas and solids carry what they hold more than at the temperature of `[gas]`; `stored` is final minus
    initial.
    """
    return {
        "inlets": float(heat.inlets.sum()),
        "outlets": float(heat.outlets.sum()),
        "walls": float(heat.walls.sum()),
        "solids": heat.solids,
        "reaction": heat.reaction,
        "heating": heat.heating,
        "stored": heat.stored - heat.stored_initially,
    }


def energy(case: Case, heat: HeatTotals | None) -> dict[str, float]:
    """The terms of the balance of heat (`heat_terms`) and its `balance_error`."""
    return {} if heat is None else {**heat_terms(heat), "balance_error": heat_balance(case, heat)}


def heat_balance(case: Case, heat: HeatTotals) -> float:
    """inlets + outlets + walls + solids + reaction + heating - stored over the largest of them.

    What passes a single port or wall counts, too: what comes in by one wall and leaves by another is much, and nothing in all. Or over what
    warms the strip by 1 uK (steady: per second), or 1e-7 of what it holds, where all are smaller, so that a strip at one temperature has no
    error but rounding of 0.
    """
    terms = heat_terms(heat)
    stored = terms.pop("stored")
    residual = sum(terms.values()) - stored
    single = [*heat.inlets, *heat.outlets, *heat.walls]
    held = HELD * max(abs(heat.stored), abs(heat.stored_initially))
    scale = max(*(abs(v) for v in [*terms.values(), *single, stored]), held, TRIFLE * heat_capacity(case))
    return float(abs(residual) / scale)


def gas_balance(heat: HeatTotals, let_out: float) -> float:
    """Gas that came in less what left and what the strip holds more than at first, over what it holds or has `let_out` [m2], the larger."""
    residual = heat.gas_passed - (heat.gas - heat.gas_initially)
    return abs(residual) / max(heat.gas, heat.gas_initially, let_out)


def heat_and_gas(case: Case, totals: Totals) -> dict[str, float]:
    """Relative errors of both balances, `energy` and `gas`; nothing in a case without `[energy]`, whose gas has one density."""
    heat = totals.heat
    if heat is None:
        return {}
    return {"energy": heat_balance(case, heat), "gas": gas_balance(heat, float(totals.out_volume.sum()))}


def flow_and_gas(records: Records) -> dict[str, Any]:
    """Numbers of the mean flow and, with `[energy]`, how well the gas balances.

    What comes in then differs from what leaves by what gas that warms or cools gives off, so that their mismatch is an error in a steady
    state only.
    """
    errors, numbers = heat_and_gas(records.case, records.totals), dict(records.flow)
    if not errors:
        return numbers
    if records.case.fidelity != "steady":
        numbers.pop("mass_error", None)
    return numbers | {"gas_balance_error": errors["gas"]}
