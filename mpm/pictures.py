"""Pictures of a finished run, drawn from the files in its directory alone.

| picture | shows |
|---|---|
| `coverage.png` | the strip to scale with its layers and ports, coverage in the porous layers; the bed again, stretched |
| `map_<SPECIES>.png` | mole fraction of each precursor that is fed, four decades |
| `map_cvd.png` | rate of the parasitic gas-phase reaction, where there is one |
| `history.png` | titration of each dosing inlet, balances on a logarithmic axis |
| `outlets.png` | mole fractions in each outlet |
| `exit_profile.png` | coverage over the height of the bed where it leaves each dosing zone |

The colours are those of Okabe and Ito (2008) and matplotlib's cividis and viridis: all stay apart for colour-blind readers.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mpm.diagnostics import exit_column
from mpm.errors import InputError
from mpm.files import file_name, write_picture
from mpm.labels import literal
from mpm.maps import MM, OKABE_ITO, coverage_figure, cvd_figure, formula, species_figure
from mpm.results import Run, dosing_inlets, fed_species, load_run, made_sites, sites_made_by
from mpm.vtu import Snapshot

Floats = NDArray[np.float64]
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


def plot_run(directory: str | Path, say: Callable[[str], None] = log.warning) -> list[Path]:
    """Draw all pictures that the files of a run allow, into its `plots/`; returns their paths.

    What is missing or damaged is told to `say`, a sentence each. Raises InputError when `directory` is no run's, `plots/` cannot be
    written, or nothing can be drawn of what is left.
    """
    troubles: list[str] = []

    def note(trouble: str) -> None:
        troubles.append(trouble)
        say(trouble)

    run = load_run(directory, note)
    try:
        run.directory.plots.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{run.directory.plots}: pictures cannot be written here ({error.strerror})"
        ) from None
    paths = []
    with style.context(STYLE):
        for name, figure in figures(run, note):
            paths.append(run.directory.plots / f"{name}.png")
            write_picture(paths[-1], figure)
    if troubles and not paths:
        raise InputError(f"{run.directory.path}: no picture can be drawn of what is there")
    return paths


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


def figures(run: Run, say: Callable[[str], None] = log.warning) -> Iterator[tuple[str, Figure]]:
    """Name (of its file) and figure of every picture; a run without stored fields, or with a single output time, has fewer.

    A picture that cannot be drawn is named to `say` with the reason.
    """
    fields = Fields(run)
    for name, draw in pictures(run, fields, say):
        try:
            yield file_name(name), draw()
        except InputError as error:
            say(f"{name}: not drawn: {error}")
    if fields.lost:
        first, *more = fields.lost.values()
        say(first + (f" (and {len(more)} more files of fields)" if more else ""))


def pictures(
    run: Run, fields: Fields, say: Callable[[str], None]
) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """What there is to draw, and how."""
    if not run.times and any(run.directory.path.glob("fields/*.vtu")):
        say(f"{run.directory.pvd}: missing or damaged, no maps without it")
    snapshot = fields.last()
    if snapshot is not None:
        for site in made_sites(run.case):
            name = "coverage" if site == made_sites(run.case)[0] else f"coverage_{site}"
            yield name, partial(coverage_figure, run, snapshot, site)
        for species in fed_species(run.case):
            yield f"map_{species}", partial(species_figure, run, snapshot, species)
        if np.any(snapshot.cell_data.get("cvd_rate", np.zeros(1))):
            yield "map_cvd", partial(cvd_figure, run, snapshot)
        if exits(run):
            yield "exit_profile", partial(exit_profile_figure, run, fields)
    if len(run.history.get("time", ())) > 1:
        if any(key.startswith(("titration.", "balance.", "elements.")) for key in run.history):
            yield "history", partial(history_figure, run)
        if any(outlet_species(run, outlet.name) for outlet in run.case.geometry.outlets):
            yield "outlets", partial(outlets_figure, run)
    elif len(run.times) > 1:
        say(f"{run.directory.path / 'history.csv'}: missing or empty, no curves over time without it")


def history_figure(run: Run) -> Figure:
    """Titration of every dosing inlet over time, and the magnitude of every balance error."""
    time = run.history["time"]
    titration = [
        key for key in run.history if re.fullmatch(r"titration\..+\.(box_mean|exit_mean|exit_min)", key)
    ]
    balances = [key for key in run.history if key.startswith(("balance.", "elements."))]
    panels = [keys for keys in (titration, balances) if keys]
    figure = Figure(figsize=(7.0, 2.9 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    dashes = {"box_mean": "-", "exit_mean": "--", "exit_min": ":"}
    inlets = list(dict.fromkeys(key.split(".", 1)[1].rsplit(".", 1)[0] for key in titration))
    for panel, keys in zip(axes, panels, strict=True):
        for key in keys:
            values = run.history[key]
            if keys is titration:
                _, rest = key.split(".", 1)
                inlet, kind = rest.rsplit(".", 1)
                colour = OKABE_ITO[inlets.index(inlet) % len(OKABE_ITO)]
                text = f"{literal(inlet)}: {kind.replace('_', ' ')}"
                panel.plot(time, values, dashes[kind], color=colour, label=text)
            else:
                plot_log(panel, time, np.abs(values), formula(key.split(".", 1)[1]))
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        panel.grid(alpha=0.25)
    if titration:
        axes[0].set_ylim(-0.03, 1.03)
        axes[0].set_ylabel("coverage made by the inlet")
    if balances:
        axes[-1].set_ylabel("balance error, relative")
    axes[-1].set_xlabel("time [s]")
    return figure


def outlets_figure(run: Run) -> Figure:
    """Flux-weighted mole fraction of every species in every outlet; the carrier, nearly one, is left out."""
    names = [outlet.name for outlet in run.case.geometry.outlets if outlet_species(run, outlet.name)]
    columns = min(2, len(names))
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(0.8 + 3.9 * columns, 0.4 + 2.6 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    largest = max(np.nanmax(values) for name in names for values in outlet_species(run, name).values())
    species = run.case.mechanism.species_names
    for panel, name in zip(axes.flat, names, strict=False):
        for one, values in outlet_species(run, name).items():
            colour = OKABE_ITO[list(species).index(one) % len(OKABE_ITO)]
            plot_log(panel, run.history["time"], values, formula(one), colour)
        panel.set_title(literal(f"outlet {name}"), fontsize=9)
        panel.grid(alpha=0.25)
    if largest > 0.0:
        axes[0, 0].set_ylim(largest * 1e-6, largest * 3.0)
    for panel in axes.flat[len(names) :]:
        panel.set_visible(False)
    for panel in axes[:, 0]:
        panel.set_ylabel("mole fraction")
    for panel in axes[-1]:
        panel.set_xlabel("time [s]")
    handles = {line.get_label(): line for panel in axes.flat for line in panel.get_lines()}
    figure.legend(handles.values(), handles.keys(), loc="outside right upper", fontsize=8)
    return figure


def outlet_species(run: Run, outlet: str) -> dict[str, Floats]:
    """Histories of the mole fractions in one outlet by species, carrier excepted."""
    keys = {name: f"outlets.{outlet}.x.{name}" for name in run.case.mechanism.species_names}
    return {name: run.history[key] for name, key in keys.items() if key in run.history}


def plot_log(axes: Axes, time: Floats, values: Floats, label: str, colour: str | None = None) -> None:
    """A curve on a logarithmic axis, with gaps where it is zero; the label says so of one that is zero throughout."""
    shown = np.where(values > 0.0, values, np.nan)
    axes.semilogy(time, shown, color=colour, label=label if np.isfinite(shown).any() else f"{label} (zero)")


def exits(run: Run) -> list[tuple[str, str, tuple[str, ...], int]]:
    """Zone, inlet, site species that its precursor makes, and the column where solids leave, of each zone that doses a moving bed."""
    if not any(layer.moving for layer in run.case.geometry.layers):
        return []
    inlets = {inlet.name: sites_made_by(run.case, inlet) for inlet in dosing_inlets(run.case)}
    found = []
    for zone in run.case.geometry.zones:
        sites = inlets.get(zone.inlet, ()) if zone.inlet else ()
        column = exit_column(run.case, run.grid, zone)
        if zone.inlet and sites and column is not None:
            found.append((zone.name, zone.inlet, sites, column))
    return found


def exit_profile_figure(run: Run, fields: Fields, count: int = 5) -> Figure:
    """Coverage over height where solids leave each dosing zone, at up to `count` output times."""
    shown = exits(run)
    rows = run.grid.layer_rows(next(layer.name for layer in run.case.geometry.layers if layer.moving))
    y = 0.5 * (run.grid.y[1:] + run.grid.y[:-1])[rows] * MM
    steps = np.unique(np.linspace(0, len(run.times) - 1, count).round().astype(int))
    columns = min(4, len(shown))
    lines = -(-len(shown) // columns)
    figure = Figure(figsize=(1.6 + 2.9 * columns, 0.2 + 3.0 * lines), layout="constrained")
    axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    shades = mpl.colormaps["cividis_r"](np.linspace(0.15, 1.0, len(steps)))
    for snapshot, colour in zip(fields.at(steps.tolist()), shades, strict=False):
        for panel, (_, _, sites, column) in zip(axes.flat, shown, strict=False):
            theta = np.sum([run.field(snapshot, f"theta_{site}")[rows, column] for site in sites], axis=0)
            panel.plot(theta, y, "o-", markersize=3, color=colour, label=f"{snapshot.time:.4g} s")
    for panel, (zone, inlet, sites, _) in zip(axes.flat, shown, strict=False):
        panel.set_title(literal(f"exit of zone {zone} (inlet {inlet})"), fontsize=9)
        panel.set_xlabel(f"coverage of {', '.join(formula(site) for site in sites)}")
        panel.set_xlim(-0.03, 1.03)
        panel.grid(alpha=0.25)
    for panel in axes.flat[len(shown) :]:
        panel.set_visible(False)
    for panel in axes[:, 0]:
        panel.set_ylabel("height y [mm] (0: top of bed)")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside right upper", title="time", fontsize=8
    )
    return figure
