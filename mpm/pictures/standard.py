"""Pictures of a finished run, drawn from the files in its directory alone.

| picture | shows |
|---|---|
| `coverage.png` | the strip to scale with its layers and ports, coverage in the porous layers; the bed again, stretched |
| `map_<SPECIES>.png` | mole fraction of each precursor that is fed, four decades |
| `map_cvd.png` | rate of the parasitic gas-phase reaction, where there is one |
| `speed.png` | speed of the gas with its streamlines |
| `pressure.png` | pressure of the gas |
| `temperature.png` | temperature of gas and solids, in runs with `[energy]` |
| `heating.png` | temperature of each layer along the strip, and over time |
| `history.png` | titration of each dosing inlet, balances on a logarithmic axis |
| `outlets.png` | mole fractions in each outlet |
| `exit_profile.png` | coverage over the height of the bed where it leaves each dosing zone |

Any other field, time or range: `draw_field`. The colours are those of Okabe and Ito (2008) and matplotlib's cividis, viridis and inferno:
all stay apart for colour-blind readers.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from cycler import cycler
from matplotlib import style
from matplotlib.figure import Figure

from mpm.errors import InputError
from mpm.files import file_name, write_picture
from mpm.output.results import Run, load_run
from mpm.output.vtu import Snapshot
from mpm.pictures.curves import (
    exit_profile_figure,
    exits,
    has_history,
    history_figure,
    largest_fraction,
    outlets_figure,
    profile_steps,
)
from mpm.pictures.maps import ends_of, map_figure, when
from mpm.pictures.outline import OKABE_ITO
from mpm.pictures.warmth import warmth_figure
from mpm.report.dosing import made_sites
from mpm.report.fieldnames import Limits, field_name

log = logging.getLogger("mpm")

STYLE = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": cycler(color=OKABE_ITO),
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "savefig.dpi": 200,
}


@dataclass(frozen=True)
class Picture:
    """One picture of a run: the stem of its file, what it shows in words, and how to draw it."""

    name: str
    words: str
    draw: Callable[[], Figure]


def plot_run(
    directory: str | Path, say: Callable[[str], None] = log.warning, time: float | None = None
) -> dict[Path, str]:
    """Draw all pictures that the files of a run allow, into its `plots/`; returns the path of each and what it shows.

    Maps are of the last stored time, or of the one nearest to `time` [s]. What is missing or damaged is told to `say`, a sentence each.
    Raises InputError when `directory` is no run's, `plots/` cannot be written, or nothing can be drawn of what is left.
    """
    troubles: list[str] = []

    def note(trouble: str) -> None:
        troubles.append(trouble)
        say(trouble)

    run = load_run(directory, note)
    folder = plots_folder(run)
    drawn: dict[Path, str] = {}
    with style.context(STYLE):
        for picture, figure in figures(run, note, time):
            path = folder / f"{picture.name}.png"
            write_picture(path, figure)
            drawn[path] = picture.words
    if troubles and not drawn:
        raise InputError(f"{run.directory.path}: no picture can be drawn of what is there")
    return drawn


def plots_folder(run: Run) -> Path:
    """The directory for pictures, made if need be. Raises InputError when that cannot be."""
    try:
        run.directory.plots.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{run.directory.plots}: pictures cannot be written here ({error.strerror})"
        ) from None
    return run.directory.plots


class Fields:
    """The stored fields of a run, without those that cannot be read; `lost` says why, by index."""

    def __init__(self, run: Run):
        self.run = run
        self.lost: dict[int, str] = {}

    def at(self, indices: Iterable[int]) -> Iterator[Snapshot]:
        """The readable ones of these."""
        for index in indices:
            try:
                yield self.run.snapshot(index)
            except InputError as error:
                self.lost[index] = str(error)

    def last(self) -> Snapshot | None:
        return next(self.at(range(len(self.run.times) - 1, -1, -1)), None)


def figures(
    run: Run, say: Callable[[str], None] = log.warning, time: float | None = None
) -> Iterator[tuple[Picture, Figure]]:
    """Every picture with its figure; a run without stored fields, or with a single output time, has fewer.

    A picture that cannot be drawn is named to `say` with the reason.
    """
    fields = Fields(run)
    for picture in pictures(run, fields, say, time):
        try:
            yield picture, picture.draw()
        except InputError as error:
            say(f"{picture.name}: not drawn: {error}")
    if fields.lost:
        first, *more = fields.lost.values()
        say(first + (f" (and {len(more)} more files of fields)" if more else ""))


def pictures(
    run: Run, fields: Fields, say: Callable[[str], None], time: float | None = None
) -> Iterator[Picture]:
    """What there is to draw, and how; of a chosen `time` [s] the maps alone."""
    if not run.times and any(run.directory.path.glob("fields/*.vtu")):
        say(f"{run.directory.pvd}: missing or damaged, no maps without it")
    snapshot = fields.last() if time is None else snapshot_at(run, time)
    if snapshot is not None:
        yield from maps(run, snapshot, "" if time is None else at_time(run, snapshot))
    if time is not None:
        return
    if snapshot is not None and exits(run):
        profiles = list(fields.at(profile_steps(run)))
        words = "coverage over the height of the bed where it leaves each zone"
        yield Picture("exit_profile", words, partial(exit_profile_figure, run, profiles))
    if run.case.energy is not None and (snapshot is not None or len(run.history.get("time", ())) > 1):
        words = "temperature of each layer along the strip, and over time"
        yield Picture("heating", words, partial(warmth_figure, run, snapshot))
    if len(run.history.get("time", ())) > 1:
        if has_history(run):
            yield Picture(
                "history",
                "coverage made by each inlet, and balance errors, over time",
                partial(history_figure, run),
            )
        if largest_fraction(run) > 0.0:
            yield Picture("outlets", "mole fractions in the outlets over time", partial(outlets_figure, run))
    elif len(run.times) > 1:
        say(f"{run.directory.path / 'history.csv'}: missing or empty, no curves over time without it")


def maps(run: Run, snapshot: Snapshot, suffix: str) -> Iterator[Picture]:
    """Maps of the fields worth one: coverages, precursors, parasitic reaction, the gas."""
    wanted: dict[str, str] = {}
    for site in made_sites(run.case):
        wanted[f"theta_{site}"] = "coverage" if not wanted else f"coverage_{site}"
    wanted |= {f"x_{species}": f"map_{species}" for species in run.case.fed_species}
    if (
        "cvd_rate" in snapshot.cell_data
        and ends_of(run, [snapshot], "cvd_rate")[1] > field_name("cvd_rate").nothing
    ):
        wanted["cvd_rate"] = "map_cvd"
    wanted |= {
        name: stem
        for name, stem in (("velocity", "speed"), ("pressure", "pressure"), ("temperature", "temperature"))
        if name in snapshot.cell_data
    }
    for name, stem in wanted.items():
        lines = name == "velocity"
        words = f"{field_name(name).label}{' with streamlines' if lines else ''}, {when(run, snapshot)}"
        yield Picture(
            file_name(stem + suffix), words, partial(map_figure, run, snapshot, name, streamlines=lines)
        )


def draw_field(
    run: Run,
    field: str,
    time: float | None = None,
    clim: tuple[float, float] | None = None,
    streamlines: bool = False,
) -> Figure:
    """A map of any field of the files at the stored time nearest to `time` [s] (default: the last).

    `clim`: ends of the colour scale in the unit of its label. Raises InputError for a field that is not there (with the nearest name) and
    a run without stored fields.
    """
    snapshot = snapshot_at(run, time)
    with style.context(STYLE):
        return map_figure(
            run, snapshot, field, None if clim is None else chosen_limits(field, clim), streamlines
        )


def chosen_limits(field: str, clim: tuple[float, float]) -> Limits:
    """A scale with chosen ends, given in the unit that is shown; logarithmic where that of the field is and the lower end is positive."""
    entry = field_name(field)
    low, high = clim
    return Limits(low * entry.factor, high * entry.factor, log=entry.scale == "log" and low > 0.0)


def snapshot_at(run: Run, time: float | None) -> Snapshot:
    """The stored fields nearest to `time` [s]; the last without one. Raises InputError when there are none, or they cannot be read."""
    if not run.times:
        raise InputError(f"{run.directory.pvd}: no fields have been written")
    return run.snapshot(-1 if time is None else int(np.argmin(np.abs(np.asarray(run.times) - time))))


def at_time(run: Run, snapshot: Snapshot) -> str:
    """The end of a file's name for a chosen time; nothing in a steady state."""
    return "" if run.case.fidelity == "steady" else f"_{snapshot.time:.4g}s"
