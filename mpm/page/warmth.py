"""The curves of temperature on a page: of each layer over time, and along the strip at the end."""

from __future__ import annotations

from mpm.errors import InputError
from mpm.output.results import Run
from mpm.page.curves import Chart, chart, trace
from mpm.pictures.outline import MM
from mpm.pictures.warmth import LEAST, along_strip, over_time

KELVIN = "temperature [K]"


def warmth(run: Run) -> list[Chart]:
    """Both charts of a run with `[energy]`, as far as the files go."""
    return [one for one in (_along(run), _over_time(run)) if one is not None]


def _along(run: Run) -> Chart | None:
    try:
        layers = along_strip(run, run.snapshot()) if run.times else []
    except InputError:  # the maps of the page name what is damaged
        return None
    x = run.grid.centres * MM
    traces = [trace(x, layer.mean, layer.name, index) for index, layer in enumerate(layers)]
    for index, layer in enumerate(layers):
        if layer.moving:
            traces.append(trace(x, layer.low, f"{layer.name}, coldest row", index, 2))
            traces.append(trace(x, layer.high, f"{layer.name}, hottest row", index, 1))
    if not traces:
        return None
    return chart(
        "Temperature along the strip, mean of each layer",
        x="x [mm]",
        y=KELVIN,
        traces=traces,
        y_range=_range(traces),
    )


def _over_time(run: Run) -> Chart | None:
    found = over_time(run) if len(run.history.get("time", ())) > 1 else {}
    if not found:
        return None
    names = run.grid.layer_names
    traces = [
        trace(
            run.history["time"],
            values,
            name,
            names.index(name) if name in names else 6,
            int(name not in names),
        )
        for name, values in found.items()
    ]
    return chart(
        "Temperature over time, mean of each layer",
        x="time [s]",
        y=KELVIN,
        traces=traces,
        y_range=_range(traces),
    )


def _range(traces: list[Chart]) -> tuple[float, float] | None:
    """Ends of an axis that shows no rounding; None where plotly may choose."""
    values = [value for one in traces for value in one["y"] if value is not None]
    low, high = min(values), max(values)
    return (
        None if high - low > LEAST else (0.5 * (low + high) - 0.5 * LEAST, 0.5 * (low + high) + 0.5 * LEAST)
    )
