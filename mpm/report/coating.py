"""What a run reports: titration, utilisation, outlet gas, parasitic growth, fronts.

Every quantity is defined in the docstring of the function that computes it and named as in `summary.json`. Amounts are per metre of depth.
A number that cannot be computed is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.mesh.grid import ON_EDGE, Grid

if TYPE_CHECKING:
    from mpm.case.case import Case, Inlet, Zone

Floats = NDArray[np.float64]
NO_FLOW = 1e-12
"""Share of the strip's volume that counts as nothing, per output (steady: per second); ports at 1 nm/s let out 1e-9 of it."""


@dataclass(frozen=True, eq=False)
class Totals:
    """Sums over all ranks since the start of a run [mol/m, m2], by species of the run (`names`).

    `fed` (inlets, species), `out`, `back` (outlets, species), `out_volume`, `back_volume` (outlets,), `stored`, `stored_initially`
    (species,) in the gas; `surface` (reactions, reactive rows, columns) and `gas` (reactions, zones + 1) events, the last by zone number
    (0: none); `reactive_rows` the grid's rows with reactive surface; `slid` the bed's way relative to the reactor [m];
    `sites`, `sites_initially` (site species,) on the solids in the strip, `sites_passed` those that left minus those that entered.
    """

    names: tuple[str, ...]
    fed: Floats
    out: Floats
    back: Floats
    out_volume: Floats
    back_volume: Floats
    stored: Floats
    stored_initially: Floats
    surface: Floats
    gas: Floats
    reactive_rows: NDArray[np.int64]
    slid: float
    sites: Floats
    sites_initially: Floats
    sites_passed: Floats


@dataclass(frozen=True, eq=False)
class State:
    """Numbers of one instant: `theta` (sites, reactive rows, columns) and the CVD rate per zone and at its largest.

    `cvd` is the integral of the rate over each zone's strip (zones + 1,) [mol/m/s], `cvd_max` the largest rate per total volume;
    `concentration` the dosed species by name, (rows, columns) [mol/m3].
    """

    theta: Floats
    reactive_rows: NDArray[np.int64]
    cvd: Floats
    cvd_max: float
    concentration: Mapping[str, Floats]


def running_surface(case: Case, names: tuple[str, ...]) -> list:
    """Surface reactions whose gas is among the species of the run, in the mechanism's order."""
    return [r for r in case.mechanism.surface_reactions if r.gas in names]


def running_gas(case: Case, names: tuple[str, ...]) -> list:
    """Gas reactions whose reactants all are."""
    return [r for r in case.mechanism.gas_reactions if set(r.reactants) <= set(names)]


def dosed_species(case: Case, inlet: Inlet) -> str | None:
    """The precursor an inlet doses: its first species that reacts on surfaces, or None."""
    return case.mechanism.precursor(inlet.mass_fractions)


def titrated(case: Case, species: str, theta: Floats) -> Floats:
    """Share of the sites that the half-reactions of `species` have made, from coverages (sites, ...): `Mechanism.titrated_sites` summed."""
    names = case.mechanism.site_names
    return np.sum([theta[names.index(site)] for site in case.mechanism.titrated_sites(species)], axis=0)


def zone_of(case: Case, inlet: Inlet) -> Zone | None:
    return next((zone for zone in case.geometry.zones if zone.inlet == inlet.name), None)


def titration(case: Case, grid: Grid, state: State) -> dict[str, dict[str, Any]]:
    """Per dosing inlet: coverage of the site species that the half-reactions of its precursor make (`titrated`), 1 when saturated.

    `box_mean`: mean over the moving layer from the end of the inlet's zone at which solids enter it to the inlet's centreline;
    `exit_profile`: the zone's column where they leave it, bottom to top; `exit_mean`, `exit_min` of it. Solids enter at the left and leave
    at the right, a bed that moves backwards the other way (`Case.direction`). Without a moving layer the topmost reactive one counts.
    """
    layer = conveyed_layer(case)
    if layer is None:
        return {}
    rows = grid.layer_rows(layer)
    inside = (state.reactive_rows >= rows.start) & (state.reactive_rows < rows.stop)
    heights = grid.dy[state.reactive_rows[inside]]
    result: dict[str, dict[str, Any]] = {}
    for inlet in case.geometry.inlets:
        species, zone = dosed_species(case, inlet), zone_of(case, inlet)
        if species is None or zone is None:
            continue
        theta = titrated(case, species, state.theta)[inside]
        last = exit_column(case, grid, zone)
        if last is None:
            continue
        box = grid.columns_between(zone.start, zone.end)
        box &= case.direction * (grid.centres - inlet.center) < -ON_EDGE * grid.dx
        profile = theta[:, last]
        entry = {
            "exit_mean": float(profile @ heights / heights.sum()),
            "exit_min": float(profile.min()),
            "exit_profile": [float(v) for v in profile],
        }
        if box.any():
            entry["box_mean"] = float((theta[:, box].mean(axis=1) @ heights) / heights.sum())
        result[inlet.name] = entry
    return result


def exit_column(case: Case, grid: Grid, zone: Zone) -> int | None:
    """The column where solids leave a zone: its last one, or its first where the bed moves to the left; None when it has none."""
    columns = np.flatnonzero(grid.columns_between(zone.start, zone.end))
    return int(columns[-1 if case.direction > 0 else 0]) if len(columns) else None


def conveyed_layer(case: Case) -> str | None:
    """Name of the moving layer, else of the topmost one with reactive surface."""
    reactive = [l for l in case.geometry.layers if l.material and l.material.surface_to_volume > 0.0]
    moving = [l for l in reactive if l.moving]
    chosen = moving or reactive
    return chosen[-1].name if chosen else None


def utilisation(case: Case, grid: Grid, totals: Totals) -> dict[str, float]:
    """Per dosing inlet: precursor reacted on surfaces in its zone over what it has fed."""
    result = {}
    for inlet in case.geometry.inlets:
        species, zone = dosed_species(case, inlet), zone_of(case, inlet)
        if species is None or zone is None:
            continue
        k = case.geometry.inlets.index(inlet)
        fed = float(totals.fed[k, totals.names.index(species)])
        columns = grid.columns_between(zone.start, zone.end)
        used = 0.0
        for index, reaction in enumerate(running_surface(case, totals.names)):
            used -= reaction.nu_gas.get(species, 0.0) * float(totals.surface[index][:, columns].sum())
        if fed > 0.0:
            result[inlet.name] = used / fed
    return result


def outlet_fractions(
    case: Case, totals: Totals, before: Totals | None
) -> dict[str, dict[str, dict[str, float]]]:
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
        result[outlet.name] = {"x": fractions}
    return result


def let_out(case: Case, totals: Totals, before: Totals | None, outlet: int) -> float | None:
    """Volume [m2] that has left through an outlet since `before`; None where it is below NO_FLOW of the strip: rounding of no flow."""
    volume = float(totals.out_volume[outlet] - (before.out_volume[outlet] if before else 0.0))
    strip = case.geometry.length * sum(layer.height for layer in case.geometry.layers)
    return volume if volume > NO_FLOW * strip else None


def cvd(case: Case, grid: Grid, state: State) -> dict[str, Any]:
    """Parasitic gas reactions now: `rate_mean` over the strip, `rate_max` [mol/m3/s per total volume], `share_in_zone` of the integral."""
    if not case.mechanism.gas_reactions:
        return {}
    whole = float(state.cvd.sum())
    area = grid.length * float(grid.y[-1] - grid.y[0])
    result: dict[str, Any] = {"rate_mean": whole / area, "rate_max": state.cvd_max}
    if whole > 0.0:
        result["share_in_zone"] = {
            zone.name: float(state.cvd[number] / whole)
            for number, zone in enumerate(case.geometry.zones, start=1)
        }
    return result


def flatten(tree: Mapping[str, Any], prefix: str = "") -> dict[str, float]:
    """Nested tables as one table with dotted names."""
    flat: dict[str, float] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            flat.update(flatten(value, f"{name}."))
        else:
            flat[name] = value
    return flat


def nested(flat: Mapping[str, float], name: str) -> dict[str, Any]:
    """The table `name` of a flat history row, as nested tables."""
    tree: dict[str, Any] = {}
    for key, value in flat.items():
        parts = key.split(".")
        if parts[0] == name:
            branch = tree
            for part in parts[1:-1]:
                branch = branch.setdefault(part, {})
            branch[parts[-1]] = value
    return tree
