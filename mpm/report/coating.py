"""What comes out coated: coverage where solids leave a zone, the use made of the precursor, the film that has grown.

Every quantity is defined in the docstring of the function that computes it. Amounts are per metre of depth. A number that cannot be
computed is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.mesh.grid import ON_EDGE, Grid
from mpm.report.dosing import zone_of
from mpm.report.records import State, Totals, running_surface

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.zones import Zone


def titrated(case: Case, species: str, theta: Floats) -> Floats:
    """Share of the sites that the half-reactions of `species` have made, from coverages (sites, ...): `Mechanism.titrated_sites` summed.

    It is a share of places, of which a site species may hold several. Where reactions go back it stays below 1. A precursor that leaves the
    sites as they are has made none.
    """
    names = case.mechanism.site_names
    made = [theta[names.index(site)] for site in case.mechanism.titrated_sites(species)]
    return np.sum(made, axis=0) if made else np.zeros(theta.shape[1:])


def titration(case: Case, grid: Grid, state: State) -> dict[str, dict[str, Any]]:
    """Per dosing inlet: coverage of the site species that the half-reactions of its precursor make (`titrated`), 1 when saturated.

    `box_mean`: mean over the moving layer from the end of the inlet's zone at which solids enter it to the inlet's centreline;
    `exit_profile`: the zone's column where they leave it, bottom to top; `exit_mean`, `exit_min` of it. Solids enter at the left and leave
    at the right, a bed that moves backwards the other way (`Case.direction`). Without a moving layer the topmost reactive one counts. A
    precursor that leaves the sites as they are, as in growth that does not stop, has no titration.
    """
    layer = conveyed_layer(case)
    if layer is None:
        return {}
    inside = within(grid, layer, state.reactive_rows)
    heights = grid.dy[state.reactive_rows[inside]]
    result: dict[str, dict[str, Any]] = {}
    for inlet in case.geometry.inlets:
        species, zone = case.precursor(inlet), zone_of(case, inlet)
        if species is None or zone is None or not case.sites_made_by(inlet):
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


def within(grid: Grid, layer: str, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of these rows of the grid lie in a layer."""
    inside = grid.layer_rows(layer)
    return np.asarray((rows >= inside.start) & (rows < inside.stop))


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
    """Per dosing inlet: precursor reacted on surfaces in its zone over what it has fed; net of what comes off the solids there again."""
    result = {}
    for inlet in case.geometry.inlets:
        species, zone = case.precursor(inlet), zone_of(case, inlet)
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


def film(case: Case, grid: Grid, totals: Totals, before: Totals | None) -> dict[str, dict[str, float]]:
    """Per solid product: `amount` [mol/m] on all surfaces since the start and, for the conveyed layer, what has grown since `before`.

    `per_area` [mol/m2]: what has grown in that layer over the particle surface S h s that has been conveyed meanwhile by a distance s;
    in the developed state, growth per cycle. (Steady: both per second.)
    Over the whole surface of the layer where it does not move. `thickness` [m] =
    per_area M / density, where the mechanism's film has both. Absent while nothing is conveyed.
    """
    name = conveyed_layer(case)
    result: dict[str, dict[str, float]] = {}
    rows = np.zeros(len(totals.reactive_rows), dtype=bool)
    area = 0.0
    if name is not None:
        layer = next(l for l in case.geometry.layers if l.name == name)
        rows = within(grid, name, totals.reactive_rows)
        length = grid.length
        if layer.moving and case.fidelity == "steady":
            length = abs(case.motion.mean_velocity)
        elif layer.moving:
            length = case.direction * (totals.slid - (before.slid if before else 0.0))
        area = layer.solid.surface_to_volume * layer.height * length
    for solid in case.mechanism.films:
        amount = grown = 0.0
        for index, reaction in enumerate(running_surface(case, totals.names)):
            count = reaction.film.get(solid.name, 0.0)
            amount += count * float(totals.surface[index].sum())
            grown += count * float(
                totals.surface[index][rows].sum() - (before.surface[index][rows].sum() if before else 0.0)
            )
        entry = {"amount": amount}
        if area > 0.0:
            entry["per_area"] = grown / area
            if solid.density is not None and solid.molar_mass is not None:
                entry["thickness"] = grown / area * solid.molar_mass / solid.density
        result[solid.name] = entry
    return result
