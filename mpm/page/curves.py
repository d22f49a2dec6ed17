"""The curves of a page as traces and layouts of plotly: plain tables, drawn by its JavaScript in the reader's browser."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.case.case import Case
from mpm.errors import InputError
from mpm.files import read_text
from mpm.output.results import Run
from mpm.pictures.outline import MM, OKABE_ITO
from mpm.report.quantities import quantity

DECADES = 6.0
"""Extent of a logarithmic axis below its largest value."""
DASHES = ("solid", "dash", "dot", "dashdot", "longdash")
Chart = dict[str, Any]


def chart(
    title: str,
    *,
    x: str,
    y: str,
    traces: Sequence[Mapping[str, Any]],
    logarithmic: bool = False,
    x_range: Sequence[float] | None = None,
    y_range: Sequence[float] | None = None,
) -> Chart:
    """A figure: `title`, titles of the axes with their units, traces; a logarithmic axis shows DECADES."""
    across: dict[str, Any] = {"title": {"text": x}, "zeroline": False, "exponentformat": "power"}
    up: dict[str, Any] = {"title": {"text": y}, "zeroline": False, "exponentformat": "power"}
    if logarithmic:
        up |= {"type": "log", "dtick": 1}
        y_range = _decades(traces)
    for axis, ends in ((across, x_range), (up, y_range)):
        if ends is not None:
            axis["range"] = list(ends)
    return {"title": title, "data": list(traces), "layout": {"xaxis": across, "yaxis": up}}


def _decades(traces: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    """Ends of a logarithmic axis, as exponents."""
    top = float(np.log10(max(value for one in traces for value in one["y"] if value is not None)))
    return top - DECADES, top + 0.3


def trace(x: Any, y: Any, name: str, colour: int = 0, dash: int = 0, **more: Any) -> dict[str, Any]:
    """A line; what is not finite is a gap."""
    values = [float(f"{v:.9g}") if np.isfinite(v) else None for v in np.asarray(y, float)]
    return {
        "type": "scatter",
        "mode": "lines",
        "x": [float(f"{v:.7g}") for v in np.asarray(x, float)],
        "y": values,
        "name": name,
        "line": {"color": OKABE_ITO[colour % len(OKABE_ITO)], "dash": DASHES[dash % len(DASHES)], "width": 2},
        **more,
    }


def curves(run: Run, say: Callable[[str], None] = lambda text: None) -> list[Chart]:
    """Everything of a run that is a curve, over time and along the strip; a damaged flux.csv is named to `say` and left out."""
    try:
        rising = flux(run)
    except (InputError, OSError) as error:
        say(str(error))
        rising = None
    found = (coating(run), outlets(run), growth(run), exit_profiles(run), rising)
    return [one for one in found if one is not None]


def _history(run: Run, pattern: str) -> dict[str, Any]:
    if len(run.history.get("time", ())) < 2:
        return {}
    return {key: values for key, values in run.history.items() if re.fullmatch(pattern, key)}


def coating(run: Run) -> Chart | None:
    """Titration of every dosing inlet over time."""
    found = _history(run, r"titration\..+\.(box_mean|exit_mean|exit_min)")
    inlets = list(dict.fromkeys(key.split(".", 1)[1].rpartition(".")[0] for key in found))
    words = {
        "exit_mean": "leaving, mean",
        "exit_min": "leaving, worst row",
        "box_mean": "in the bed before the inlet",
    }
    traces = [
        trace(
            run.history["time"],
            values,
            f"{inlet}: {words[kind]}",
            inlets.index(inlet),
            list(words).index(kind),
        )
        for key, values in found.items()
        for inlet, _, kind in [key.split(".", 1)[1].rpartition(".")]
    ]
    if not traces:
        return None
    return chart(
        "Coverage that each inlet makes",
        x="time [s]",
        y="share of the sites",
        traces=traces,
        y_range=[-0.03, 1.05],
    )


def outlets(run: Run) -> Chart | None:
    """Mole fractions of all species in all outlets; those that are zero throughout are named in the title only."""
    found = _history(run, r"outlets\..+\.x\..+")
    species = list(run.case.mechanism.species_names)
    names = [outlet.name for outlet in run.case.geometry.outlets]
    traces = []
    for key, values in found.items():
        outlet, _, kind = key.removeprefix("outlets.").partition(".x.")
        if kind in species and np.nanmax(values, initial=0.0) > 0.0:
            label = kind if len(names) == 1 else f"{kind} in {outlet}"
            traces.append(
                trace(
                    run.history["time"],
                    np.where(values > 0.0, values, np.nan),
                    label,
                    species.index(kind),
                    names.index(outlet) if outlet in names else 0,
                )
            )
    if not traces:
        return None
    where = f" of {names[0]}" if len(names) == 1 else "s"
    return chart(
        f"Gas in the outlet{where}", x="time [s]", y="mole fraction", traces=traces, logarithmic=True
    )


def growth(run: Run) -> Chart | None:
    """Rate of the parasitic gas reactions over time."""
    found = _history(run, r"cvd\.rate_mean")
    if not any(np.nanmax(values, initial=0.0) > 0.0 for values in found.values()):
        return None
    what = quantity("cvd.rate_mean")
    traces = [trace(run.history["time"], np.where(v > 0.0, v, np.nan), what.label, 1) for v in found.values()]
    return chart(
        "Parasitic growth in the gas",
        x="time [s]",
        y=f"mean rate [{what.unit_shown}]",
        traces=traces,
        logarithmic=True,
    )


def exit_profiles(run: Run) -> Chart | None:
    """Coverage over the height of the bed where it leaves each zone, at the end."""
    rows = _conveyed_rows(run.case, run)
    if rows is None:
        return None
    y = run.grid.row_centres[rows] * MM
    traces = []
    for index, (inlet, entry) in enumerate(run.summary.get("titration", {}).items()):
        profile = entry.get("exit_profile", [])
        if len(profile) == len(y):
            traces.append(trace(profile, y, inlet, index) | {"mode": "lines+markers"})
    if not traces:
        return None
    return chart(
        "Coverage over the height of the bed where it leaves", x="share of the sites",
        y="height y [mm] (0: top of the bed)", traces=traces, x_range=[-0.03, 1.05],
    )  # fmt: skip


def _conveyed_rows(case: Case, run: Run) -> slice | None:
    from mpm.report.coating import conveyed_layer

    name = conveyed_layer(case)
    return None if name is None else run.grid.layer_rows(name)


def read_flux(path: Path) -> dict[str, NDArray[np.float64]]:
    """The columns of flux.csv, `x` [m] first. Raises InputError for another table."""
    try:
        text = read_text(path)
        if not text.endswith("\n"):
            raise ValueError("its last line is not whole")
        names, *rows = csv.reader(text.splitlines())
        columns = dict(zip(names, np.array(rows, float).T, strict=True))
    except ValueError as error:
        raise InputError(f"{path}: not a table of mpm ({error})") from error
    if "x" not in columns or not all(np.isfinite(values).all() for values in columns.values()):
        raise InputError(f"{path}: not a table of mpm; accepted: finite numbers, a column x")
    return columns


def flux(run: Run) -> Chart | None:
    """Gas velocity through the upper face of every layer along x, from flux.csv. Raises InputError when that is damaged."""
    path = run.directory.path / "flux.csv"
    if not path.is_file():
        return None
    columns = read_flux(path)
    x = columns.pop("x")
    faces = {f"velocity_y.{layer.name}": layer.name for layer in run.case.geometry.layers}
    shown = {faces[name]: 100.0 * values for name, values in columns.items() if name in faces}
    if not shown or len(x) < 2:
        return None
    traces = [
        trace(x * MM, values, f"top of {name}", index) for index, (name, values) in enumerate(shown.items())
    ]
    lowest = min(0.0, *(float(values.min()) for values in shown.values()))
    highest = max(0.0, *(float(values.max()) for values in shown.values()))
    ends = (1.05 * lowest, 1.05 * highest or 1.0)  # from zero: rounding must not look like a profile
    return chart(
        "Gas rising through the faces of the layers",
        x="x [mm]",
        y="superficial velocity [cm/s]",
        traces=traces,
        y_range=ends,
    )
