"""The fields of a run for the page's viewer: which ones, how they look, and the table that its script reads."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mpm.arrays import Floats
from mpm.output.results import Run
from mpm.output.vtu import Snapshot
from mpm.page.fields import (
    FEWEST_TIMES,
    MOST_JOINED,
    Encoded,
    Film,
    Look,
    Maker,
    encode,
    fewer_cells,
    fewer_times,
    read_film,
)
from mpm.pictures.outline import MM
from mpm.report.dosing import made_sites
from mpm.report.fieldnames import field_name

BUDGET = 5_000_000
"""Bytes of fields that a page carries at most, beside 2 MB of plotly."""
STOPS = 33
"""Places of a colour map that plotly does not know; between them it mixes."""
VALUES = 6_000_000
"""Numbers of each field that are looked at for a page, cells times times."""


def looks(run: Run) -> dict[str, tuple[Look, Maker]]:
    """Fields of a run that a page can show, what to do to get them, in the order in which they are offered."""
    sites = [f"theta_{site}" for site in made_sites(run.case)]
    species = [f"x_{name}" for name in run.case.mechanism.species_names]
    found: dict[str, tuple[Look, Maker]] = {}
    warmth = () if run.case.energy is None else ("temperature", "density")
    for name in (*sites, *species, *warmth, "velocity", "pressure", "cvd_rate"):
        what = field_name(name)
        look = Look(
            name=name,
            label=what.label,
            unit=what.unit_shown,
            factor=what.factor,
            logarithmic=what.scale == "log",
            colours=plotly_colours(what.colours),
        )
        found[name] = (look, _porous(name) if what.porous else _speed if name == "velocity" else _cells(name))
    return found


def plotly_colours(name: str) -> str | tuple[tuple[float, str], ...]:
    """A colour map of matplotlib for plotly: by its name where plotly has it, else as STOPS places and colours."""
    if name in ("viridis", "cividis"):
        return name.capitalize()
    import matplotlib as mpl
    from matplotlib.colors import to_hex

    places = np.linspace(0.0, 1.0, STOPS)
    return tuple(
        (float(place), to_hex(colour))
        for place, colour in zip(places, mpl.colormaps[name](places), strict=True)
    )


def _cells(name: str) -> Maker:
    return lambda run, snapshot: run.field(snapshot, name)


def _porous(name: str) -> Maker:
    def make(run: Run, snapshot: Snapshot) -> Floats:
        solid = run.grid.per_row(lambda _: 1.0, gas=0.0) > 0.0
        return np.where(solid[:, None], run.field(snapshot, name), np.nan)

    return make


def _speed(run: Run, snapshot: Snapshot) -> Floats:
    return np.asarray(np.hypot(*np.moveaxis(run.field(snapshot, "velocity"), -1, 0)))


def stream_maker() -> Maker:
    """The stream function at the corners of the cells; found again only where the flow has changed since the snapshot before."""
    from mpm.pictures.streamlines import carried, stream_function

    before: list[Floats] = []

    def make(run: Run, snapshot: Snapshot) -> Floats:
        velocity = carried(snapshot.cell_data)
        if not before or not np.array_equal(velocity, before[0]):
            before[:] = [velocity, stream_function(run.grid, velocity)]
        return before[1]

    return make


STREAMS = Look(name="streams", label="streamlines", unit="", factor=1.0, logarithmic=False, colours="Greys")


def viewer(
    run: Run,
    budget: int,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> dict[str, Any] | None:
    """The fields for the page's script, as many times and cells as `budget` bytes allow; None when none are stored and whole.

    `bounds`: colour ranges (in shown units) by field, to compare runs; other fields that are zero throughout are left out.
    """
    known = looks(run)
    wanted = {name: make for name, (_, make) in known.items()} | {"streams": stream_maker()}
    shown = read_film(run, wanted, known, VALUES, say)
    if not shown.times:
        return None
    while True:
        found = encoded(shown, {name: look for name, (look, _) in known.items()}, bounds or {})
        if sum(len(one.data) for one in found) <= budget or shown.joined >= MOST_JOINED:
            return table(run, shown, found)
        shown = fewer_times(shown) if len(shown.times) > 2 * FEWEST_TIMES else fewer_cells(shown)


def encoded(
    shown: Film, known: Mapping[str, Look], bounds: Mapping[str, tuple[float, float]]
) -> list[Encoded]:
    """Every field of a film that has a range in `bounds` or is not zero throughout."""
    found = []
    for name, series in shown.series.items():
        look = known.get(name, STREAMS)
        if name in bounds or any(np.nanmax(np.abs(values), initial=0.0) > 0.0 for values in series):
            found.append(encode(look, series, bounds.get(name)))
    return found


def table(run: Run, shown: Film, found: list[Encoded]) -> dict[str, Any]:
    """As the page's script reads it; lengths in mm."""
    from mpm.pictures.streamlines import stream_levels

    last = shown.series["streams"][-1].astype(float)
    geometry = run.case.geometry
    edges = [float(run.grid.y[run.grid.layer_rows(name).stop]) * MM for name in run.grid.layer_names]
    return {
        "x": [round(float(v) * MM, 6) for v in shown.x],
        "y": [round(float(v) * MM, 6) for v in shown.y],
        "times": list(shown.times),
        "steady": run.case.fidelity == "steady",
        "every": shown.every,
        "joined": shown.joined,
        "fields": [one.table() for one in found],
        "streamLevels": [float(v) for v in stream_levels(run.grid, last)],
        "layers": [{"name": name, "top": top} for name, top in zip(run.grid.layer_names, edges, strict=True)],
        "ports": [
            {
                "name": port.name,
                "x0": port.x0 * MM,
                "x1": port.x1 * MM,
                "side": port.side,
                "inlet": port in geometry.inlets,
            }
            for port in (*geometry.inlets, *geometry.outlets)
        ],
        "zones": [zone.end * MM for zone in geometry.zones[:-1]],
    }
