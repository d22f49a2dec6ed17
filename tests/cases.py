"""Small cases, the laws that every run must obey, and convergence rates: what the tests of the solver share."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import mpm.numerics.fem  # noqa: F401  (loads the finite-element stack before mpi4py)
from mpm.case.case import Case, load_case
from mpm.flow.fields import FlowField, boundary_flows, face_flow
from mpm.flow.sequence import CyclicFlow
from mpm.mesh.strip import Strip
from mpm.parallel import largest
from mpm.reactor.reactor import Reactor, Result
from mpm.report.balances import FLOOR, TERMS, element_balances, site_balance, species_balances
from mpm.report.records import HeatTotals

from mpi4py import MPI as MPI  # isort: skip  (after mpm.numerics.fem)

CASES = Path(__file__).parents[1] / "cases"

COARSE = {
    "geometry.cell_width": "2.33 mm",
    "geometry.layer.plenum.cells": 4,
    "geometry.layer.frit.cells": 3,
    "geometry.layer.bed.cells": 4,
    "geometry.layer.headspace.cells": 8,
}
TINY = {
    "geometry.cell_width": "5 mm",
    "geometry.layer.plenum.cells": 3,
    "geometry.layer.frit.cells": 2,
    "geometry.layer.bed.cells": 3,
    "geometry.layer.headspace.cells": 4,
}
SHORT = {"time.end": "1 s", "time.step": "14 ms", "output.every": "0.25 s"}


def zone(changes: Mapping[str, Any] | None = None, mesh: Mapping[str, Any] = COARSE) -> Case:
    """The single TMA zone on a coarse mesh."""
    return load_case(CASES / "single_zone.toml", {**mesh, **(changes or {})})


def cycle(changes: Mapping[str, Any] | None = None, mesh: Mapping[str, Any] = COARSE) -> Case:
    """The single cycle of TMA and water on a coarse mesh: both half-reactions and the gas reaction."""
    return load_case(
        CASES / "single_cycle.toml", {**mesh, "geometry.cell_width": "4.66 mm", **(changes or {})}
    )


def strip_case(
    layers: Sequence[Mapping[str, Any]], columns: int = 3, length: float = 3e-3, **tables: Any
) -> Case:
    """A strip of `length` [m] with these layers and no ports unless `geometry` brings them; the rest by table."""
    geometry = {
        "length": f"{length!r} m",
        "cell_width": f"{length / columns!r} m",
        "layer": [dict(layer) for layer in layers],
        **tables.pop("geometry", {}),
    }
    return load_case({"geometry": geometry, "motion": {"gamma": 0.0, "bed_velocity": "0 m/s"}, **tables})


def column_case(
    height: float, cells: int, velocity: float, material: Mapping[str, Any], **tables: Any
) -> Case:
    """Plug flow upwards: one porous layer, an inlet as wide as the strip below it and an outlet as wide above it."""
    length = 3e-3
    port = {"center": f"{0.5 * length!r} m", "width": f"{length!r} m"}
    inlet = {"name": "in", "velocity": f"{velocity!r} m/s", **port, **tables.pop("inlet", {})}
    geometry = {"inlet": [inlet], "outlet": [{"name": "out", **port}], **tables.pop("geometry", {})}
    layer = {"name": "packing", "height": f"{height!r} m", "cells": cells, "material": "packing"}
    return strip_case(
        [layer], length=length, geometry=geometry, material={"packing": dict(material)}, **tables
    )


def assert_laws(reactor: Reactor) -> None:
    """Assert what holds in every run at any time; collective, and usable as the callback of a run.

    Species, sites and elements balance to 1e-9, traces below 1e-6 of the feed to 1e-13 of that, which is what the rounding of reactions
    that go both ways makes of them; no concentration lies below -1e-14 of the feed; coverages lie in [0, 1] and sum to 1; div u
    of any cell is below 1e-10 of the inflow, in every velocity field in use; what flows in flows out. With heat, heat closes to 1e-9 of its
    largest term and the gas itself to 1e-12.
    """
    case, comm, strip = reactor.case, reactor.comm, reactor.system.strip
    totals = reactor.totals()
    balances = species_balances(case, totals)
    little = FLOOR * float(totals.fed.sum(axis=0).max(initial=0.0))
    traces = {name for name, one in balances.items() if max(map(abs, (one[term] for term in TERMS))) < little}
    errors = {name: one["balance_error"] for name, one in balances.items()}
    errors |= {"sites": site_balance(case, totals), **element_balances(case, totals)}
    off = {name: error for name, error in errors.items() if not error <= (1e-7 if name in traces else 1e-9)}
    assert not off, f"t = {reactor.time:g} s: balances {off}"

    transport, theta = reactor.system.transport, reactor.system.coverage.theta
    lowest = -largest(comm, [-transport.concentration.min(initial=0.0)])[0]
    assert lowest >= -1e-14 * transport.ports.largest_feed, (
        f"t = {reactor.time:g} s: concentration {lowest:g} mol/m3"
    )
    assert np.all(np.isfinite(transport.concentration))
    assert theta.min(initial=0.0) >= 0.0 and theta.max(initial=0.0) <= 1.0, (
        f"coverage {theta.min()} ... {theta.max()}"
    )
    np.testing.assert_allclose(theta.sum(axis=0), 1.0, rtol=0.0, atol=1e-11)

    if totals.heat is not None:
        assert_heat_balances(reactor)
        return  # gas that is heated flows apart
    sequence = reactor.flow.sequence
    fields = [reactor.system.velocity]
    if isinstance(sequence, CyclicFlow):
        fields = [*sequence.phases, *([] if sequence.at_rest is None else [sequence.at_rest])]
    for field in fields:
        assert_free_of_divergence(case, strip, field)
        flows = boundary_flows(case, strip, face_flow(strip, field.velocities))
        assert abs(sum(flows.values())) <= 1e-10 * flow_scale(case, strip, field), f"port flows {flows}"


def heat_of(reactor: Reactor) -> HeatTotals:
    """What heat has passed in a run with [energy]; collective."""
    heat = reactor.totals().heat
    assert heat is not None
    return heat


def assert_heat_balances(reactor: Reactor) -> None:
    """Assert that heat closes to 1e-9 of its largest term and the gas to 1e-12; collective, and usable as the callback of a run."""
    heat = heat_of(reactor)
    terms = [*heat.inlets, *heat.outlets, *heat.walls, heat.solids, heat.heating, heat.reaction]
    stored = heat.stored - heat.stored_initially
    residual, scale = sum(terms) - stored, max(map(abs, [*terms, stored, 1e-6]))
    assert abs(residual) <= 1e-9 * scale, (
        f"t = {reactor.time:g} s: heat off by {residual / scale:.2g}, {heat}"
    )
    gas = heat.gas_passed - (heat.gas - heat.gas_initially)
    assert abs(gas) <= 1e-12 * heat.gas, f"t = {reactor.time:g} s: gas off by {gas / heat.gas:.2g}"


def wall(side: str, **condition: Any) -> dict[str, Any]:
    """A whole side of a strip with one condition."""
    return {"name": f"{side}_wall", "side": side, **condition}


HEATED: dict[str, Any] = {
    "energy.initial_temperature": "473 K",
    "geometry.bed_temperature": "298 K",
    "geometry.wall": [
        wall("bottom", temperature="450 K", end="30 mm"),
        wall("top", temperature="473 K", end="95 mm"),
    ],
    "geometry.inlet.tma.temperature": "400 K",
}
"""Cold powder in a hot zone, with a warm feed."""


def flow_scale(case: Case, strip: Strip, field: FlowField) -> float:
    """The inflow of a case, or without one the largest flow through a facet [m2/s]; collective."""
    inflow = sum(i.velocity * i.width for i in case.geometry.inlets)
    fastest = largest(strip.comm, [np.abs(field.velocities[:, : strip.owned]).max(initial=0.0)])[0]
    return float(inflow or fastest * strip.grid.dx)


def assert_free_of_divergence(case: Case, strip: Strip, field: FlowField) -> None:
    """Assert that no cell gains or loses more than 1e-10 of the inflow; collective."""
    own = strip.owned
    bottom, left, right, top = field.velocities[:, :own]
    gains = (right - left) * strip.height[:own] + (top - bottom) * strip.grid.dx  # div u integrated [m2/s]
    worst = largest(strip.comm, [np.abs(gains).max(initial=0.0)])[0]
    scale = flow_scale(case, strip, field)
    assert worst <= 1e-10 * scale, f"div u is {worst / scale:.2g} of the inflow"


def run(case: Case, comm: MPI.Comm = MPI.COMM_SELF, **options: Any) -> tuple[Reactor, Result]:
    """Run `case` and check the laws at every output time."""
    reactor = Reactor(case, comm)
    result = reactor.run(callback=assert_laws, **options)
    assert_laws(reactor)
    return reactor, result


def rate(sizes: Sequence[float], errors: Sequence[float]) -> float:
    """Order of convergence: slope of log(error) over log(size), fitted."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def norm(error: Any, weights: Any = None) -> float:
    """Root mean square of an error, weighted."""
    return float(np.sqrt(np.average(np.square(error), weights=weights)))


BOOKKEEPING = {
    "ranks",
    "wall_seconds",
    "versions",
    "conventions",
    "revision",
    "status",
    "title",
    "fidelity",
    "balance_error",
    "mass_error",
    "gas_balance_error",
}


def physical_numbers(summary: Mapping[str, Any], prefix: str = "") -> dict[str, float]:
    """Flat dotted names of all physical numbers of a summary: what must not depend on the ranks. Errors of balances are rounding."""
    numbers: dict[str, float] = {}
    for key, value in summary.items():
        if key in BOOKKEEPING:
            continue
        if isinstance(value, Mapping):
            numbers |= physical_numbers(value, f"{prefix}{key}.")
        elif isinstance(value, list):
            numbers |= {f"{prefix}{key}.{i}": float(v) for i, v in enumerate(value)}
        else:
            numbers[f"{prefix}{key}"] = float(value)
    return numbers


def assert_same_numbers(one: Mapping[str, Any], other: Mapping[str, Any], tolerance: float) -> None:
    """Assert that two summaries agree in every physical number, relative to the number (floor: 1e-6 of the feed for amounts)."""
    a, b = physical_numbers(one), physical_numbers(other)
    assert a.keys() == b.keys()
    amounts = [v["fed"] for v in one["species"].values()]
    for name, value in a.items():
        floor = 1e-6 * max(amounts) if name.startswith("species.") else 1e-9
        assert abs(value - b[name]) <= tolerance * max(abs(value), abs(b[name]), floor), (
            f"{name}: {value!r}, {b[name]!r}"
        )
