"""`mpm paraview`: scripts with which ParaView opens a run as a picture: field, range over all times, vertical scale, label of the time.

A file opened by hand comes up grey, its colours stretched over what the first time holds, which is nothing yet. The scripts use what
ParaView 5.11 knows, and numbers read from the files: nothing is worked out again when they are opened.
"""

from __future__ import annotations

import math
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from pprint import pformat
from typing import Any

import numpy as np

from mpm.errors import InputError, printable
from mpm.files import write_atomically
from mpm.output.results import Run, load_run
from mpm.output.series import Series
from mpm.report.dosing import made_sites
from mpm.report.fieldnames import FieldName, colour_limits, field_name, superscript
from mpm.report.quantity import RATIO

VIEW, VIBRATION = "view.py", "vibration.py"
TALLEST = 0.8
"""Height over length, at most, of all drawn strips: they fill a window."""
CROWDED = 2.5
"""Ratio of two numbers on a logarithmic bar that leaves room for both."""
MOST = 6.5
"""Steps between the ends of a linear bar, at most."""
NUMBERED = ("zone", "layer")
PRESETS = {
    "viridis": "Viridis (matplotlib)", "cividis": "Cividis", "PuOr_r": "PuOr", "inferno": "Inferno (matplotlib)",
}  # fmt: skip
"""ParaView's names of matplotlib's colour maps."""


@dataclass(frozen=True)
class Script:
    """A script in the directory of a run, and what it shows."""

    path: Path
    shows: str

    @property
    def command(self) -> list[str]:
        """What starts ParaView with it."""
        return ["paraview", f"--script={self.path}"]

    @property
    def typed(self) -> str:
        """The same as people type it."""
        return shlex.join(self.command)


def write_scripts(directory: str | Path, say: Callable[[str], None]) -> list[Script]:
    """Write `view.py` for the output times of a run, and `vibration.py` where it has phases.

    Files that cannot be read are named to `say`, and the ranges are those of the others. Raises InputError for a directory without fields.
    """
    run = load_run(directory, say)
    sites, species, files = made_sites(run.case)[:1], run.case.fed_species[:1], run.directory
    panels = [f"theta_{name}" for name in sites] + [f"x_{name}" for name in species]
    panels += ["temperature"] if run.case.energy is not None else []
    written = [_write(run, files.fields, VIEW, panels or ["velocity"], say)]
    if files.phases.steps:
        written.append(_write(run, files.phases, VIBRATION, ["velocity_lab", "velocity"], say))
    else:
        (files.path / VIBRATION).unlink(missing_ok=True)
    return written


def _write(run: Run, series: Series, name: str, panels: Sequence[str], say: Callable[[str], None]) -> Script:
    ranges = ranges_over_time(series, say)
    shown = [panel for panel in panels if panel in ranges]
    path = run.directory.path / name
    write_atomically(path, script(run, series, name, shown, ranges))
    words = " and ".join(field_name(panel).label for panel in shown)
    if name == VIBRATION:
        what = f"The vibration in {len(series.steps)} phases"
    else:
        what = "The steady state" if run.case.fidelity == "steady" else "The run over time"
    return Script(path, printable(f"{what}: {words}"))


def ranges_over_time(series: Series, say: Callable[[str], None]) -> dict[str, tuple[float, float]]:
    """Least and largest value of every field over all its times, of vectors of their length. Raises InputError where there is none."""
    ranges: dict[str, tuple[float, float]] = {}
    for index in range(len(series.steps)):
        try:
            snapshot = series.read(index)
        except (InputError, OSError) as error:
            say(str(error))
            continue
        for name, values in snapshot.cell_data.items():
            if name not in NUMBERED:
                size = values if values.ndim == 1 else np.linalg.norm(values, axis=1)
                low, high = ranges.get(name, (np.inf, -np.inf))
                least = float(size.min()) if values.ndim == 1 else 0.0  # a speed counts from rest
                ranges[name] = (min(low, least), max(high, float(size.max())))
    if not ranges:
        raise InputError(f"{series.pvd}: lists no fields that can be read, so that there is nothing to show")
    return ranges


def colours(name: str, low: float, high: float) -> dict[str, Any]:
    """How the script colours a field whose values lie between `low` and `high` [SI]: ends of the scale, map, title of the bar."""
    field: FieldName = field_name(name)
    ends = colour_limits(replace(field, limits=None), low, high)
    unit = "" if field.unit in (RATIO, "") else f" [{superscript(field.unit)}]"
    low, high = ends.low, ends.high if ends.high > ends.low else ends.low + (abs(ends.low) or 1.0)
    return {
        "low": low,
        "high": high,
        "log": ends.log,
        "labels": bar_labels(low, high, ends.log),
        "map": PRESETS[field.colours],
        "title": printable(field.label) + unit,
    }


def bar_labels(low: float, high: float, log: bool) -> list[float]:
    """Numbers at a colour bar: its ends, and between them decades or round steps that do not crowd them."""
    if log:
        decades = [10.0**k for k in range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)]
        return [low, *(d for d in decades if CROWDED * low < d < high / CROWDED), high]
    coarse = 10.0 ** math.floor(math.log10(high - low))
    steps = (part * coarse for part in (0.1, 0.2, 0.5, 1.0, 2.0))
    step = next(step for step in steps if high - low <= MOST * step)
    places = range(math.ceil(low / step), math.floor(high / step) + 1)
    return [low, *(k * step for k in places if low + 0.5 * step < k * step < high - 0.5 * step), high]


def shortened(text: str, longest: int = 60) -> str:
    """`text`, cut where a window would cut it."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def vertical_scale(*, length: float, height: float, panels: int) -> int:
    """How many times higher than it is a strip is drawn, so that its layers can be told apart, in each of so many pictures of it."""
    return max(1, int(TALLEST / panels * length / height))


def script(
    run: Run, series: Series, name: str, panels: Sequence[str], ranges: dict[str, tuple[float, float]]
) -> str:
    """The text of a script."""
    grid, motion = run.grid, run.case.motion
    times = [time for time, _ in series.steps]
    high = vertical_scale(length=grid.length, height=grid.height, panels=len(panels))
    label = "'t = %.4g s' % time_value"
    if name == VIBRATION:
        phase = f"(time_value - {motion.start!r}) * {360.0 * motion.frequency!r} % 360.0"
        label = f"'phase of the vibration: %.1f deg' % ({phase})"
    if len(times) == 1:
        label = "''"
    constants = {
        "FILE": series.pvd.name,
        "SCALE": high,
        "ENDS": (float(grid.x[0]), float(grid.x[-1])),
        "FACES": [
            float(grid.y[0]),
            *(float(grid.y[grid.layer_rows(name).stop]) for name in grid.layer_names),
        ],
        "LOOP": int(name == VIBRATION),
        "PANELS": list(panels),
        "SHOWN": times[-1],
        "TITLE": shortened(printable(run.case.title) or run.directory.path.name),
        "LABEL": label,
        "COLOURS": {key: colours(key, *ends) for key, ends in ranges.items()},
    }
    lines = [f"{key} = {pformat(value, width=110, sort_dicts=False)}" for key, value in constants.items()]
    text = _SCRIPT.replace("@NAME@", name).replace("@CONSTANTS@", "\n".join(lines))
    return text.replace("@FOLDER@", repr(str(run.directory.path.resolve())))


def open_script(scripts: Sequence[Script], vibration: bool) -> int:
    """Start ParaView with the script of the run, or of its `vibration`, and wait for its end; gives its exit status.

    Raises InputError where there are no phases, or ParaView is not installed.
    """
    if vibration and len(scripts) < 2:
        raise InputError(
            f"{scripts[0].path.parent}: no phases of the vibration in it; a run with fidelity resolved and output.phases = 16 writes them"
        )
    chosen = scripts[int(vibration)]
    program = shutil.which(chosen.command[0])
    if program is None:
        raise InputError(
            f"paraview: not found on the PATH; install it (https://www.paraview.org/download), then type: {chosen.typed}"
        )
    return subprocess.run([program, *chosen.command[1:]], check=False).returncode


_SCRIPT = '''"""This run in ParaView 5.11 or newer, written by `mpm paraview`: paraview --script=@NAME@"""

import os

from paraview import simple as pv

FOLDER = os.path.dirname(os.path.abspath(__file__)) if "__file__" in globals() else @FOLDER@
# heights are drawn SCALE times; ENDS, FACES: of the strip and its layers [m]; COLOURS: ranges over all times, for every field
@CONSTANTS@

pv._DisableFirstRenderCameraReset()  # cameras are placed below
pv.LoadPalette("WhiteBackground")
reader = pv.PVDReader(registrationName=FILE, FileName=os.path.join(FOLDER, FILE))
scene = pv.GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
scene.AnimationTime, scene.Loop = SHOWN, LOOP

left, right, bottom, top = *ENDS, SCALE * FACES[0], SCALE * FACES[-1]
line = [(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)]
for face in FACES[1:-1]:  # in one stroke, left edge and back
    line += [(left, SCALE * face), (right, SCALE * face), (left, SCALE * face)]
points = [number for x, y in line for number in (x, y, 1e-3 * (right - left))]
outline = pv.PolyLineSource(registrationName="layers at rest", Points=points)
label = pv.PythonAnnotation(registrationName="label", Input=reader, Expression=LABEL)
title = pv.Text(registrationName="title", Text=TITLE)
first = pv.GetActiveViewOrCreate("RenderView")
layout = pv.GetLayout(first)
views = [first]
while len(views) < len(PANELS):
    views.append(pv.CreateView("RenderView"))
    pv.AssignViewToLayout(view=views[-1], layout=layout, hint=layout.SplitVertical(0, 0.5) + 1)
for view, name in zip(views, PANELS):
    strip = pv.Show(reader, view)
    strip.Scale = [1.0, SCALE, 1.0]
    strip.Ambient, strip.Diffuse = 1.0, 0.0  # no light and shade: colours are those of the bar
    pv.ColorBy(strip, ("CELLS", name))
    edge = pv.Show(outline, view)
    edge.AmbientColor = edge.DiffuseColor = [0.6, 0.6, 0.6]
    bar = pv.GetScalarBar(pv.GetColorTransferFunction(name), view)
    bar.Title = bar.ComponentTitle = ""
    bar.Orientation, bar.WindowLocation, bar.ScalarBarLength = "Vertical", "Lower Right Corner", 0.7
    bar.AutomaticLabelFormat, bar.LabelFormat, bar.RangeLabelFormat = 0, "%.3g", "%.3g"
    bar.AddRangeLabels, bar.UseCustomLabels, bar.CustomLabels = 0, 1, COLOURS[name]["labels"]
    strip.SetScalarBarVisibility(view, True)
    field = pv.Text(registrationName=name, Text=f"{COLOURS[name]['title']}; heights drawn {SCALE} times")
    for text, place in (label, "Upper Left Corner"), (title, "Upper Center"), (field, "Lower Center"):
        shown = pv.Show(text, view)
        shown.WindowLocation, shown.FontSize = place, 14
    view.InteractionMode, view.OrientationAxesVisibility = "2D", 0
    view.CameraParallelProjection = 1
    view.CameraFocalPoint = [0.5 * (left + right), 0.5 * (bottom + top), 0.0]
    view.CameraPosition = [0.5 * (left + right), 0.5 * (bottom + top), right - left]
    view.CameraParallelScale = max(0.7 * (top - bottom), 0.4 * (right - left) / len(PANELS))
for name, entry in COLOURS.items():  # now: showing a field stretches its colours over the present time
    colours = pv.GetColorTransferFunction(name)
    colours.AutomaticRescaleRangeMode = "Never"
    colours.ApplyPreset(entry["map"], True)
    colours.RescaleTransferFunction(entry["low"], entry["high"])
    if entry["log"]:
        colours.MapControlPointsToLogSpace()
        colours.UseLogScale = 1
pv.SetActiveSource(reader)
pv.RenderAllViews()
'''
