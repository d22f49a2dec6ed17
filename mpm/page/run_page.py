"""What the page of one run shows, gathered from the files in its directory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mpm.checks import check_case
from mpm.checkscreen import case_sheet
from mpm.fieldnames import field_name
from mpm.keys import values
from mpm.marks import MARKS, Marked
from mpm.page.curves import Chart, curves
from mpm.page.fields import (
    FEWEST_TIMES,
    MOST_JOINED,
    Encoded,
    Film,
    Floats,
    Look,
    Maker,
    encode,
    fewer_cells,
    fewer_times,
    read_film,
)
from mpm.page.numbers import Account, Row, accounts, errors, groups
from mpm.page.strip import Drawing, drawing
from mpm.page.write import render
from mpm.results import Run, load_run, made_sites
from mpm.screen import HARD_SPACE, Listing, entry
from mpm.verdict import verdict
from mpm.vtu import Snapshot

BUDGET = 5_000_000
"""Bytes of fields that a page carries at most, beside 2 MB of plotly."""
VALUES = 6_000_000
"""Numbers of each field that are looked at for a page, cells times times."""
MM = 1e3


@dataclass(frozen=True)
class Input:
    """A value of the case; `origin` is empty where the run does not say."""

    key: str
    text: str
    meaning: str
    origin: str


@dataclass(frozen=True, eq=False)
class RunPage:
    """One run, ready for the template."""

    run: Run
    name: str
    verdict: str
    warnings: list[str]
    notes: list[str]
    idle: list[str]
    asked: list[tuple[str, list[tuple[str, str]]]]
    strip: Drawing
    groups: list[tuple[str, list[Row]]]
    accounts: list[Account]
    errors: list[Row]
    charts: list[Chart]
    viewer: dict[str, Any] | None
    reproduce: dict[str, Any]
    inputs: list[tuple[str, list[Input]]]

    @property
    def note(self) -> str:
        """What the reader must know about the pictures."""
        if self.viewer is None:
            return ""
        parts = ["The colour range is that of all times. Drag in a map to zoom in, double click to go back."]
        if self.viewer["every"] > 1:
            parts.append(f"Of the stored times one in {self.viewer['every']} is here.")
        if self.viewer["joined"] > 1:
            parts.append(f"{self.viewer['joined']} x {self.viewer['joined']} cells are joined to one here.")
        return " ".join([*parts, "All of it is in fields.pvd, for ParaView."])


def run_page(
    directory: str | Path, say: Callable[[str], None] = lambda text: None, fields: bool = True
) -> RunPage:
    """Read a run's directory. Raises InputError when it is not one; what is damaged is named to `say` and left out.

    Without `fields` the maps are left out, which take most of the time.
    """
    run = load_run(directory, say)
    report = check_case(run.case)
    return RunPage(
        run=run,
        name=run.directory.path.resolve().name,
        verdict=verdict(run.case, run.summary)
        if run.summary
        else "This run has not reported its numbers yet.",
        warnings=list(report["warnings"]),
        notes=list(report["notes"]),
        idle=list(report["without_effect"]),
        asked=asked(run, report),
        strip=drawing(run.case),
        groups=groups(run.summary),
        accounts=accounts(run.summary),
        errors=errors(run.summary),
        charts=curves(run),
        viewer=viewer(run) if fields else None,
        reproduce=reproduce(run),
        inputs=inputs(run),
    )


TITLES = (
    ("Model and time", ("title", "fidelity", "time.", "output.", "transport.")),
    ("Geometry", ("geometry.",)),
    ("Motion", ("motion.",)),
    ("Materials", ("material.",)),
    ("Gas", ("gas.",)),
    ("Chemistry", ("chemistry.",)),
)
"""Headings of the case's values, and the keys below them."""


def inputs(run: Run) -> list[tuple[str, list[Input]]]:
    """Every value of the case under a heading, with its meaning and where it came from when the run was started."""
    found = [Input(v.name, v.text, v.key.description, run.origins.get(v.name, "")) for v in values(run.case)]
    groups = [(title, [one for one in found if one.key.startswith(keys)]) for title, keys in TITLES]
    told = {one.key for _, rows in groups for one in rows}
    rest = [one for one in found if one.key not in told]
    return [(title, rows) for title, rows in (*groups, ("Other", rest)) if rows]


def asked(run: Run, report: dict[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """The groups of `mpm check`: the case and what an engineer asks first, rows of label and value."""
    groups = []
    for heading, rows in case_sheet(run.case, report, Marked(run.case, run.origins)).groups:
        lines: list[tuple[str, str]] = []
        for row in rows:
            if isinstance(row, Listing):
                lines += [(name, _pairs(row.headings[1:], cells)) for name, *cells in row.rows]
            else:
                lines.append((_spaced(row[0]), _spaced(row[1])))
        if lines:
            groups.append((heading, lines))
    return groups


def _pairs(headings: Sequence[str], cells: Sequence[str]) -> str:
    return _spaced(
        ", ".join(entry(heading, cell) for heading, cell in zip(headings, cells, strict=False) if cell)
    )


def _spaced(text: str) -> str:
    """As a browser breaks it: a screen keeps numbers and their units together with a space of its own."""
    return text.replace(HARD_SPACE, "\u00a0")


def reproduce(run: Run) -> dict[str, Any]:
    """What somebody needs to get the same numbers."""
    ranks = run.summary.get("ranks", 1)
    command = "mpm run case.toml -o again"
    return {
        "command": command if ranks == 1 else f"mpirun -n {ranks} python -m {command}",
        "case": (run.directory.path / "case.toml").read_text(encoding="utf-8"),
        "versions": run.summary.get("versions", {}),
        "revision": run.summary.get("revision", ""),
    }


# ---------------------------------------------------------------- fields


def looks(run: Run) -> dict[str, tuple[Look, Maker]]:
    """Fields of a run that a page can show, what to do to get them, in the order in which they are offered."""
    sites = [f"theta_{site}" for site in made_sites(run.case)]
    species = [f"x_{name}" for name in run.case.mechanism.species_names]
    found: dict[str, tuple[Look, Maker]] = {}
    for name in (*sites, *species, "velocity", "pressure", "cvd_rate"):
        what = field_name(name)
        look = Look(
            name, what.label, what.unit_shown, what.factor, what.scale == "log", what.colours.capitalize()
        )
        found[name] = (look, _porous(name) if what.porous else _speed if name == "velocity" else _cells(name))
    return found


def _cells(name: str) -> Maker:
    return lambda run, snapshot: run.field(snapshot, name)


def _porous(name: str) -> Maker:
    def make(run: Run, snapshot: Snapshot) -> Floats:
        solid = np.array([layer.material is not None for layer in run.case.geometry.layers])[
            run.grid.row_layer
        ]
        return np.where(solid[:, None], run.field(snapshot, name), np.nan)

    return make


def _velocity(run: Run, snapshot: Snapshot) -> Floats:
    return snapshot.cell_data["velocity"].astype(float).reshape(run.grid.rows, run.grid.columns, -1)[..., :2]


def _speed(run: Run, snapshot: Snapshot) -> Floats:
    return np.asarray(np.hypot(*np.moveaxis(_velocity(run, snapshot), -1, 0)))


def stream_maker() -> Maker:
    """The stream function at the corners of the cells; found again only where the flow has changed since the snapshot before."""
    from mpm.streamlines import stream_function

    before: list[Floats] = []

    def make(run: Run, snapshot: Snapshot) -> Floats:
        velocity = _velocity(run, snapshot)
        if not before or not np.array_equal(velocity, before[0]):
            before[:] = [velocity, stream_function(run.grid, velocity)]
        return before[1]

    return make


STREAMS = Look("streams", "streamlines", "", 1.0, False, "Greys")


def viewer(
    run: Run, bounds: Mapping[str, tuple[float, float]] | None = None, budget: int = BUDGET
) -> dict[str, Any] | None:
    """The fields for the page's script, as many times and cells as `budget` bytes allow; None when none are stored.

    `bounds`: colour ranges (in shown units) by field, to compare runs; fields that are zero throughout are left out.
    """
    if not run.times:
        return None
    known = looks(run)
    wanted = {name: make for name, (_, make) in known.items()} | {"streams": stream_maker()}
    shown = read_film(run, wanted, VALUES)
    while True:
        found = encoded(shown, {name: look for name, (look, _) in known.items()}, bounds or {})
        if sum(len(one.data) for one in found) <= budget or shown.joined >= MOST_JOINED:
            return table(run, shown, found)
        shown = fewer_times(shown) if len(shown.times) > 2 * FEWEST_TIMES else fewer_cells(shown)


def encoded(
    shown: Film, known: Mapping[str, Look], bounds: Mapping[str, tuple[float, float]]
) -> list[Encoded]:
    """Every field of a film that is not zero throughout."""
    found = []
    for name, series in shown.series.items():
        look = known.get(name, STREAMS)
        if any(np.nanmax(np.abs(values), initial=0.0) > 0.0 for values in series):
            found.append(encode(look, series, bounds.get(name)))
    return found


def table(run: Run, shown: Film, found: list[Encoded]) -> dict[str, Any]:
    """As the page's script reads it; lengths in mm."""
    from mpm.streamlines import stream_levels

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
        "moving": next((layer.name for layer in geometry.layers if layer.moving), None),
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


def run_html(page: RunPage) -> str:
    """The page of one run as a file."""
    data = {
        "charts": {str(index): chart for index, chart in enumerate(page.charts)},
        "viewers": {"viewer": page.viewer} if page.viewer else {},
    }
    return render("run.html", page.run.case.title or page.name, data, page=page, marks=MARKS)
