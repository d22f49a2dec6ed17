"""What becomes of the gas: what leaves through the outlets, what is drawn back, what reacts where it should not, what strays.

Every quantity is defined in the docstring of the function that computes it. Amounts are per metre of depth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpm.mesh.grid import Grid
from mpm.report.records import State, Totals, running_gas, running_surface

if TYPE_CHECKING:
    from mpm.case.case import Case

NO_FLOW = 1e-12
"""Share of the strip's volume that counts as nothing, per output (steady: per second); ports at 1 nm/s let out 1e-9 of it."""


def outlet_gas(case: Case, totals: Totals, before: Totals | None) -> dict[str, dict[str, Any]]:
    """Per outlet that has let out anything since `before`: mole fractions `x` and `backflow`."""
    fractions, drawn = outlet_fractions(case, totals, before), backflow(case, totals, before)
    return {name: {"x": x, "backflow": drawn[name]} for name, x in fractions.items()}


def outlet_fractions(case: Case, totals: Totals, before: Totals | None) -> dict[str, dict[str, float]]:
    """Flux-weighted mole fractions of what left each outlet since `before` (the previous output; None: since the start).

    Amount of the species over amount of gas (volume times p/(R T)); the carrier by difference. Gas drawn back in does not count. An
    outlet that has let out nothing (`let_out`) has none.
    """
    molar_density = case.gas.molar_density
    result = {}
    for k, outlet in enumerate(case.geometry.outlets):
        volume = let_out(case, totals, before, k)
        if volume is None:
            continue
        amounts = totals.out[k] - (before.out[k] if before else 0.0)
        fractions = dict.fromkeys(case.mechanism.species_names, 0.0)
        for name, amount in zip(totals.names, amounts, strict=True):
            fractions[name] = float(amount / (volume * molar_density))
        fractions[case.gas.carrier] = 1.0 - sum(fractions.values())
        result[outlet.name] = fractions
    return result


def backflow(case: Case, totals: Totals, before: Totals | None) -> dict[str, float]:
    """Per outlet: volume drawn back in over volume let out since `before` (None: since the start). A one-way outlet has 0."""
    result = {}
    for k, outlet in enumerate(case.geometry.outlets):
        out = let_out(case, totals, before, k)
        back = totals.back_volume[k] - (before.back_volume[k] if before else 0.0)
        if out is not None:
            result[outlet.name] = float(back / out)
    return result


def let_out(case: Case, totals: Totals, before: Totals | None, outlet: int) -> float | None:
    """Volume [m2] that has left through an outlet since `before`; None where it is below NO_FLOW of the strip: rounding of no flow."""
    volume = float(totals.out_volume[outlet] - (before.out_volume[outlet] if before else 0.0))
    strip = case.geometry.length * case.geometry.height
    return volume if volume > NO_FLOW * strip else None


def cvd(case: Case, grid: Grid, state: State) -> dict[str, Any]:
    """Parasitic gas reactions now: `rate_mean` over the strip, `rate_max` [mol/m3/s per total volume], `share_in_zone` of the integral.

    Those that do not go back (`Mechanism.parasitic_reactions`).
    """
    if not case.mechanism.parasitic_reactions:
        return {}
    whole = float(state.cvd.sum())
    area = grid.length * grid.height
    result: dict[str, Any] = {"rate_mean": whole / area, "rate_max": state.cvd_max}
    if whole > 0.0:
        result["share_in_zone"] = {
            zone.name: float(state.cvd[number] / whole)
            for number, zone in enumerate(case.geometry.zones, start=1)
        }
    return result


def cvd_totals(case: Case, totals: Totals) -> dict[str, Any]:
    """Events of the parasitic gas reactions over the run [mol/m]: `total`, and `total_in_zone` by zone.

    Of several such reactions also what they have `used` of each species: their events differ in what they take.
    """
    found = [(i, r) for i, r in enumerate(running_gas(case, totals.names)) if r.backward is None]
    if not found:
        return {}
    per_zone = totals.gas[[i for i, _ in found]].sum(axis=0)
    zones = {zone.name: float(per_zone[number]) for number, zone in enumerate(case.geometry.zones, start=1)}
    numbers: dict[str, Any] = {"total": float(per_zone.sum()), "total_in_zone": zones}
    if len(case.mechanism.parasitic_reactions) > 1:
        taken = {
            name: -sum(r.nu_gas.get(name, 0.0) * float(totals.gas[i].sum()) for i, r in found)
            for name in totals.names
        }
        numbers["used"] = {name: amount for name, amount in taken.items() if amount > 0.0}
    return numbers


def contamination(case: Case, grid: Grid, totals: Totals, state: State) -> dict[str, dict[str, float]]:
    """Per zone and per precursor that this zone's own inlet does not dose: what has come over from other zones / all that has been fed.

    What has come over is what the zone has consumed on surfaces and in the gas, has let out through its outlets and holds now in its
    gas. It equals what has crossed the zone's ends, since the zone holds none at first. In the steady state, where amounts are per
    second, what it holds does not count. An outlet belongs to the zone that holds its centre.
    """
    result: dict[str, dict[str, float]] = {}
    weight = grid.per_row(lambda material: material.porosity, gas=1.0) * grid.dy * grid.dx
    for species, field in state.concentration.items():
        i = totals.names.index(species)
        fed = float(totals.fed[:, i].sum())
        if fed <= 0.0:
            continue
        for number, zone in enumerate(case.geometry.zones, start=1):
            own = next((inlet for inlet in case.geometry.inlets if inlet.name == zone.inlet), None)
            if own is not None and species in own.feed:
                continue
            columns = grid.zone_of_column == number
            amount = 0.0 if case.fidelity == "steady" else float(weight @ field[:, columns].sum(axis=1))
            for index, reaction in enumerate(running_surface(case, totals.names)):
                amount -= reaction.nu_gas.get(species, 0.0) * float(totals.surface[index][:, columns].sum())
            for index, gas in enumerate(running_gas(case, totals.names)):
                amount -= gas.nu_gas.get(species, 0.0) * float(totals.gas[index, number])
            for k, outlet in enumerate(case.geometry.outlets):
                if zone.start <= outlet.center < zone.end:
                    amount += float(totals.out[k, i] - totals.back[k, i])
            result.setdefault(zone.name, {})[species] = max(amount, 0.0) / fed
    return result
