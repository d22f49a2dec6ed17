"""The numbers of the gas flow that a run reports: flows through ports, pressure drops of layers, the flux through their faces along x.

All are of one velocity field, the mean of a cycle where the flow is periodic. Every function is collective.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.flow.fields import FlowField, boundary_flows, face_flow
from mpm.mesh.strip import BOTTOM, TOP, Strip
from mpm.parallel import total

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.flow.state import GasState


def flow_numbers(case: Case, strip: Strip, mean: FlowField, gas: GasState | None = None) -> dict[str, Any]:
    """The table `flow` of summary.json; of gas in another state than that of the case, `gas`, volumes are those in the state of the case.

    `inflow`, `outflow` through all inlets and outlets and `outlets.<name>` through each [m2/s, m3/s per metre of depth; net of what it
    draws back in], `mass_error` their mismatch over the inflow, `bed_superficial_velocity` of the gas in the moving layer [m/s],
    `pressure_drop.<layer>` of every porous layer [Pa] (see `pressure_drops`); `bed_pressure_drop` is that of the moving layer and
    `frit_pressure_drop` that of the first one at rest.
    """
    flows = boundary_flows(case, strip, face_flow(strip, mean.velocities))
    outlets = {o.name: -flows[o.name] for o in case.geometry.outlets}
    inflow, outflow = sum(flows[i.name] for i in case.geometry.inlets), sum(outlets.values())
    numbers: dict[str, Any] = {"inflow": inflow, "outflow": outflow, "outlets": outlets}
    if inflow:
        numbers["mass_error"] = abs(inflow - outflow) / abs(inflow)
    moving = case.geometry.moving_layer
    if moving is not None:
        numbers["bed_superficial_velocity"] = layer_velocity(strip, mean, moving.name)
    drops = pressure_drops(case, strip, mean, gas)
    for layer in case.geometry.layers:
        if layer.name in drops:
            name = "bed_pressure_drop" if layer.moving else "frit_pressure_drop"
            numbers.setdefault(name, drops[layer.name])
    numbers["pressure_drop"] = drops
    return {key: value for key, value in numbers.items() if value != {}}


def layer_velocity(strip: Strip, field: FlowField, layer: str) -> list[float]:
    """Superficial velocity of the gas in a layer, mean over its volume, [u_x, u_y] [m/s]."""
    own, rows = strip.owned, strip.grid.layer_rows(layer)
    inside = (strip.row[:own] >= rows.start) & (strip.row[:own] < rows.stop)
    weights = np.where(inside, strip.volume[:own], 0.0)
    along, up, volume = total(strip.comm, [*(field.in_cells(own) @ weights), weights.sum()])
    return [float(along / volume), float(up / volume)]


def pressure_drops(
    case: Case, strip: Strip, field: FlowField, gas: GasState | None = None
) -> dict[str, float]:
    """Pressure below each porous layer less that above it, at its faces, mean along x [Pa], by name.

    From the layer's own cells: between the centres of its first and last row their difference, from there to the faces Darcy's law,
    mu u_y h/(2 K_y). What the neighbours are made of, and how finely they are divided, does not enter.
    """
    own, grid = strip.owned, strip.grid
    row, columns = strip.row[:own], grid.columns
    # viscosity times velocity, of which the fields hold mass fluxes over the density of the case
    viscous = case.gas.viscosity if gas is None else (gas.viscosity / gas.relative)[:own]
    shear = viscous * field.velocities[:, :own]
    per_row = [field.pressure[:own], shear[BOTTOM], shear[TOP]]
    pressure, below, above = total(strip.comm, [np.bincount(row, v, grid.rows) for v in per_row]) / columns
    drops = {}
    for layer in case.geometry.layers:
        if layer.material is None:
            continue
        rows = grid.layer_rows(layer.name)
        first, last = rows.start, rows.stop - 1
        to_faces = 0.5 * (grid.dy[first] * below[first] + grid.dy[last] * above[last])
        permeability = layer.material.slip_permeability(case.gas.mean_free_path)[1]
        drops[layer.name] = float(pressure[first] - pressure[last] + to_faces / permeability)
    return drops


def flux_profiles(strip: Strip, field: FlowField) -> dict[str, Floats]:
    """Gas velocity upwards through the upper face of every layer but the last, along the strip: columns of flux.csv.

    `x` of the columns' centres [m], then `velocity_y.<layer>` (columns,) [m/s], superficial.
    """
    own, grid = strip.owned, strip.grid
    profiles = {"x": grid.centres}
    for name in grid.layer_names[:-1]:
        top = strip.row[:own] == grid.layer_rows(name).stop - 1
        upwards = np.bincount(strip.column[:own][top], field.velocities[TOP, :own][top], grid.columns)
        profiles[f"velocity_y.{name}"] = total(strip.comm, upwards)
    return profiles
