"""What a system holds, gathered from all ranks for reports, files and people; every function is collective."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.errors import InputError
from mpm.parallel import largest, total
from mpm.report.records import State, Totals

if TYPE_CHECKING:
    from mpm.reactor.system import System


def totals(system: System) -> Totals:
    """What has passed so far."""
    transport, coverage, comm, grid = system.transport, system.coverage, system.comm, system.grid
    ledger = transport.ledger
    surface = coverage.scatter.to_all(ledger.surface)
    count = len(system.case.geometry.zones) + 1
    gas = np.array([np.bincount(_zones(system), events, count) for events in ledger.gas]).reshape(-1, count)
    return Totals(
        names=transport.names,
        **vars(ledger.totals(comm)),
        stored=system.stored_gas(),
        stored_initially=system.stored_initially,
        surface=surface.reshape(len(ledger.surface), len(coverage.rows), grid.columns),
        gas=total(comm, gas),
        reactive_rows=coverage.rows,
        slid=coverage.distance,
        sites=total(comm, coverage.content()),
        sites_initially=system.sites_initially,
        sites_passed=coverage.passed,
        heat=None if system.thermal is None else system.thermal.totals(),
    )


def state(system: System) -> State:
    """Coverage, dosed species and gas reaction rates now."""
    transport, strip, grid, comm = system.transport, system.strip, system.grid, system.comm
    rate = cvd_rate(system)
    volume = strip.volume[: strip.owned]
    per_zone = np.bincount(_zones(system), rate * volume, len(system.case.geometry.zones) + 1)
    dosed = np.flatnonzero((transport.ports.feed > 0.0).any(axis=0))
    fields = strip.scatter.to_all(transport.concentration[dosed]).reshape(-1, grid.rows, grid.columns)
    return State(
        theta=system.coverage.whole(),
        reactive_rows=system.coverage.rows,
        cvd=total(comm, per_zone),
        cvd_max=float(largest(comm, [rate.max(initial=0.0)])[0]),
        concentration={transport.names[i]: field for i, field in zip(dosed, fields, strict=True)},
        temperature=_temperature(system),
    )


def _temperature(system: System) -> Floats | None:
    """Of gas and solids, (rows, columns) [K] on every rank."""
    if system.thermal is None:
        return None
    grid = system.grid
    return system.strip.scatter.to_all(system.thermal.heat.temperature).reshape(grid.rows, grid.columns)


def _zones(system: System) -> NDArray[np.int64]:
    """Number of the zone of each own cell."""
    strip = system.strip
    return np.asarray(strip.grid.zone_of_column[strip.column[: strip.owned]])


def cvd_rate(system: System) -> Floats:
    """Events of gas reactions that do not go back (`Mechanism.parasitic_reactions`) per total volume in own cells [mol/m3/s]."""
    transport, strip = system.transport, system.strip
    rates, _ = transport.reactions.gas.rates(transport.concentration[: transport.coupled])
    share = transport.reactions.reacting_volume / strip.volume[: strip.owned]
    parasitic = [r.backward is None for r in transport.reactions.gas.reactions]
    return np.asarray(rates[np.array(parasitic, dtype=bool)].sum(axis=0) * share)


def local_fields(system: System) -> dict[str, Floats]:
    """Everything that can be shown, own cells: names as in the files."""
    case, transport, coverage, own = system.case, system.transport, system.coverage, system.strip.owned
    velocity = system.velocity
    concentration = dict(zip(transport.names, transport.concentration, strict=True))
    fields: dict[str, Floats] = {}
    warm = system.thermal
    relative = np.ones(own) if warm is None else warm.gas.relative[:own]  # density over that of the case
    whole = case.gas.molar_density * relative
    carrier = np.ones(own)
    for name in case.mechanism.species_names:
        c = concentration.get(name, np.zeros(own))
        fields[f"C_{name}"], fields[f"x_{name}"] = c, c / whole
        carrier -= c / whole
    fields[f"x_{case.gas.carrier}"] = carrier
    for k, site in enumerate(case.mechanism.site_names):
        fields[f"theta_{site}"] = np.zeros(own)
        fields[f"theta_{site}"][coverage.cells] = coverage.theta[k]
    fields["cvd_rate"] = cvd_rate(system)
    fields["velocity_x"], fields["velocity_y"] = velocity.in_cells(own) / relative
    fields["pressure"] = velocity.pressure[:own]
    if warm is not None:
        fields["temperature"] = warm.heat.temperature
        fields["density"] = warm.gas.density[:own]
    return fields


def fields(system: System, precision: str = "Float64") -> dict[str, Floats]:
    """All cell fields for the files, in the grid's order and in the `precision` of the files, on rank 0 (empty elsewhere)."""
    local = local_fields(system)
    with np.errstate(over="ignore"):  # who writes the files says it
        stacked = np.stack(list(local.values()), dtype=precision.lower(), casting="same_kind")
    values = system.strip.scatter.to_root(stacked)
    if values is None:
        return {}
    whole = dict(zip(local, values, strict=True))
    x, y = whole.pop("velocity_x"), whole.pop("velocity_y")
    return {**whole, "velocity": np.column_stack([x, y])}


def field(system: System, name: str) -> Floats:
    """One cell field as (rows, columns) on every rank, or (rows, columns, 2) for `velocity`.

    Names are those of the files: C_TMA, x_CH4, theta_OH, cvd_rate, velocity, pressure. Raises InputError for another.
    """
    local, scatter = local_fields(system), system.strip.scatter
    shape = (system.grid.rows, system.grid.columns)
    if name == "velocity":
        both = scatter.to_all(np.stack([local["velocity_x"], local["velocity_y"]]))
        return np.moveaxis(both.reshape(2, *shape), 0, -1)
    if name not in local:
        raise InputError(
            f"no field {name!r}; there are velocity, {', '.join(n for n in local if 'velocity' not in n)}"
        )
    return scatter.to_all(local[name]).reshape(shape)


def coverage(system: System, layer: str, site: str) -> Floats:
    """Coverage of `site` in `layer` as (rows, columns), bottom row first. Raises InputError for unknown names."""
    sites, solids = system.case.mechanism.site_names, system.coverage
    if layer not in system.grid.layer_names:
        raise InputError(f"no layer {layer!r}; there are {', '.join(system.grid.layer_names)}")
    if site not in sites:
        raise InputError(f"no site {site!r}; there are {', '.join(sites)}")
    rows = system.grid.layer_rows(layer)
    chosen = (solids.rows >= rows.start) & (solids.rows < rows.stop)
    return np.asarray(solids.whole()[sites.index(site)][chosen])
