"""Curves of a run: what is coated and how well it balances over time, the gas in the outlets, the coverage over the height of the bed."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.labels import literal
from mpm.output.results import Run
from mpm.output.vtu import Snapshot
from mpm.pictures.maps import name_of, values_of
from mpm.pictures.outline import MM, OKABE_ITO, formula
from mpm.report.balances import LIMIT
from mpm.report.coating import exit_column
from mpm.report.fieldnames import NOTHING

TITRATION = {
    "box_mean": ("-", "in the bed before the inlet, mean", "in the zone before the inlet, mean"),
    "exit_mean": ("--", "where solids leave the zone, mean", "in the last column of the zone, mean"),
    "exit_min": (":", "where solids leave the zone, worst row", "in the last column of the zone, worst row"),
}
"""Line and words of the columns of a titration, where a bed is conveyed and where nothing moves."""
OF_NO_SPECIES = {"sites": "surface sites", "energy": "heat", "gas": "gas"}
"""Words for what is balanced beside the species."""
BELOW = 1e-6
"""Part of the largest mole fraction in any outlet below which curves are named and not drawn."""


def history_figure(run: Run) -> Figure:
    """A panel for each inlet that doses, with the coverage its half-reaction makes; below them every balance error."""
    panels = titrations(run)
    balances = {words: np.abs(values) for words, values in balance_curves(run).items()}
    drawn = {words: values for words, values in balances.items() if np.any(values > 0.0)}
    columns = min(2, max(1, len(panels)))
    lines = -(-len(panels) // columns)
    heights = [2.3] * lines + [2.6] * bool(drawn)
    figure = Figure(figsize=(9.0, sum(heights) + 1.2), layout="constrained")
    title_of(figure, f"{name_of(run)}: coverage and balance errors over time")
    grid = figure.add_gridspec(max(len(heights), 1), columns, height_ratios=heights or [1.0])
    time = run.history["time"]
    first: Axes | None = None
    for k, (title, curves) in enumerate(panels):
        axes = figure.add_subplot(grid[k // columns, k % columns], sharex=first, sharey=first)
        first = first or axes
        for kind, values in curves.items():
            dash, conveyed, at_rest = TITRATION[kind]
            words = conveyed if run.case.conveying_velocity else at_rest
            axes.plot(time, values, dash, color=OKABE_ITO[list(TITRATION).index(kind)], label=words)
        axes.set(ylim=(-0.03, 1.03), ylabel="coverage", xlabel="time [s]")
        axes.set_title(title, fontsize=9)
        axes.grid(alpha=0.25)
    if first is not None:
        shared_legend(figure, loc="outside right upper")
    if drawn:
        axes = figure.add_subplot(grid[-1, :])
        for words, values in drawn.items():
            plot_log(axes, time, values, words)
        whole_decades(axes, list(drawn.values()))
        axes.set(ylabel="relative error", xlabel="time [s]")
        axes.set_title(
            f"balance errors: what is missing, over the largest term (done: below {LIMIT:g})", fontsize=9
        )
        axes.grid(alpha=0.25)
        figure.legend(handles=axes.get_lines(), loc="outside right lower", fontsize=8)
    note(
        figure,
        {"balance errors that are zero throughout": [words for words in balances if words not in drawn]},
    )
    return figure


def titrations(run: Run) -> list[tuple[str, dict[str, Floats]]]:
    """For each inlet with a titration in the history: what its coverage is of, and the columns by their last name."""
    found = []
    for inlet in run.case.dosing_inlets:
        prefix = f"titration.{inlet.name}."
        curves = {kind: run.history[prefix + kind] for kind in TITRATION if prefix + kind in run.history}
        if curves:
            species = run.case.precursor(inlet)
            sites = " + ".join(map(formula, run.case.sites_made_by(inlet)))
            found.append(
                (f"{sites}, made by {formula(species or '')} from inlet {literal(inlet.name)}", curves)
            )
    return found


def balance_curves(run: Run) -> dict[str, Floats]:
    """Balance errors in the history by what they are of, in words."""
    errors = {key.removeprefix("balance."): v for key, v in run.history.items() if key.startswith("balance.")}
    return {OF_NO_SPECIES.get(name) or formula(name): v for name, v in errors.items()}


def has_history(run: Run) -> bool:
    """Whether there is a curve to draw: a coverage, or a balance error that is not zero."""
    return bool(titrations(run)) or any(np.any(values != 0.0) for values in balance_curves(run).values())


def outlets_figure(run: Run) -> Figure:
    """Flux-weighted mole fraction of every species in every outlet; the carrier, nearly one, is left out."""
    names = [outlet.name for outlet in run.case.geometry.outlets if outlet_species(run, outlet.name)]
    largest = largest_fraction(run)
    columns = min(2, len(names))
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(1.6 + 3.9 * columns, 1.0 + 2.6 * rows), layout="constrained")
    title_of(figure, f"{name_of(run)}: gas that leaves the outlets (flux-weighted)")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    species = list(run.case.mechanism.species_names)
    missing: dict[str, dict[str, list[str]]] = {}
    for panel, name in zip(axes.flat, names, strict=False):
        for one, values in outlet_species(run, name).items():
            if np.any(values > BELOW * largest):
                plot_log(
                    panel,
                    run.history["time"],
                    values,
                    formula(one),
                    OKABE_ITO[species.index(one) % len(OKABE_ITO)],
                )
            else:
                why = f"below {BELOW * largest:.0e}" if np.any(values > 0.0) else "zero throughout"
                missing.setdefault(why, {}).setdefault(formula(one), []).append(literal(name))
        panel.set_title(literal(f"outlet {name}"), fontsize=9)
        panel.grid(alpha=0.25)
    axes[0, 0].set_ylim(largest * BELOW, largest * 3.0)
    blank_rest(axes, len(names), "time [s]")
    for panel in axes[:, 0]:
        panel.set_ylabel("mole fraction")
    shared_legend(figure)
    told = {
        why: [
            f"{one} {'anywhere' if len(where) == len(names) else 'in ' + ', '.join(where)}"
            for one, where in found.items()
        ]
        for why, found in missing.items()
    }
    note(figure, told)
    return figure


def largest_fraction(run: Run) -> float:
    """Largest mole fraction of a species in any outlet at any time; 0 when nothing but carrier (and rounding) leaves."""
    everything = [
        values for outlet in run.case.geometry.outlets for values in outlet_species(run, outlet.name).values()
    ]
    largest = float(np.nanmax(everything, initial=0.0)) if everything else 0.0
    return largest if largest > NOTHING else 0.0


def outlet_species(run: Run, outlet: str) -> dict[str, Floats]:
    """Histories of the mole fractions in one outlet by species, carrier excepted."""
    keys = {name: f"outlets.{outlet}.x.{name}" for name in run.case.mechanism.species_names}
    return {name: run.history[key] for name, key in keys.items() if key in run.history}


def exits(run: Run) -> list[tuple[str, str, tuple[str, ...], int]]:
    """Zone, inlet, site species that its precursor makes, and the column where solids leave, of each zone that doses a moving bed."""
    if not any(layer.moving for layer in run.case.geometry.layers):
        return []
    inlets = {inlet.name: run.case.sites_made_by(inlet) for inlet in run.case.dosing_inlets}
    found = []
    for zone in run.case.geometry.zones:
        sites = inlets.get(zone.inlet, ()) if zone.inlet else ()
        column = exit_column(run.case, run.grid, zone)
        if zone.inlet and sites and column is not None:
            found.append((zone.name, zone.inlet, sites, column))
    return found


def exit_profile_figure(run: Run, snapshots: Sequence[Snapshot]) -> Figure:
    """Coverage over height where solids leave each dosing zone, a curve for each of the snapshots."""
    shown = exits(run)
    rows = run.grid.layer_rows(next(layer.name for layer in run.case.geometry.layers if layer.moving))
    y = run.grid.row_centres[rows] * MM
    columns = min(4, len(shown))
    lines = -(-len(shown) // columns)
    figure = Figure(figsize=(max(6.0, 1.6 + 2.9 * columns), 0.6 + 3.0 * lines), layout="constrained")
    steady = run.case.fidelity == "steady"
    title_of(figure, f"{name_of(run)}: bed that leaves a zone{', steady state' if steady else ''}")
    axes = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    shades = mpl.colormaps["cividis_r"](np.linspace(1.0, 0.15, len(snapshots))[::-1])
    for snapshot, colour in zip(snapshots, shades, strict=True):
        for panel, (_, _, sites, column) in zip(axes.flat, shown, strict=False):
            theta = np.sum(
                [values_of(run, snapshot, f"theta_{site}")[rows, column] for site in sites], axis=0
            )
            panel.plot(theta, y, "o-", markersize=3, color=colour, label=f"{snapshot.time:.4g} s")
    for panel, (zone, inlet, sites, _) in zip(axes.flat, shown, strict=False):
        panel.set_title(literal(f"exit of {zone} (inlet {inlet})"), fontsize=9)
        panel.set_xlabel(f"coverage of {' + '.join(formula(site) for site in sites)}")
        panel.set_xlim(-0.03, 1.03)
        panel.grid(alpha=0.25)
    blank_rest(axes, len(shown))
    for panel in axes[:, 0]:
        panel.set_ylabel("height y [mm] (0: top of bed)")
    if not steady:
        shared_legend(figure, "time")
    return figure


def profile_steps(run: Run, count: int = 5) -> list[int]:
    """Up to `count` of the output times, evenly over the run."""
    return [int(k) for k in np.unique(np.linspace(0, len(run.times) - 1, count).round())]


def plot_log(axes: Axes, time: Floats, values: Floats, label: str, colour: str | None = None) -> None:
    """A curve on a logarithmic axis, with gaps where it is zero; a single point is a dot."""
    shown = np.where(values > 0.0, values, np.nan)
    alone = np.isfinite(shown).sum() == 1
    axes.semilogy(time, shown, "o" if alone else "-", markersize=4, color=colour, label=label)


def whole_decades(axes: Axes, curves: Sequence[Floats]) -> None:
    """Let a logarithmic axis end at powers of ten, a decade or more apart: labels of parts of a decade overlap."""
    values = np.concatenate(curves)
    values = values[values > 0.0]
    axes.set_ylim(10.0 ** np.floor(np.log10(values.min())), 10.0 ** (np.floor(np.log10(values.max())) + 1.0))


def title_of(figure: Figure, text: str) -> None:
    """A title from the left edge, in lines that end before a legend at the right."""
    lines = textwrap.wrap(text, int(13.0 * (figure.get_figwidth() - 2.2)))
    figure.suptitle("\n".join(lines), x=0.01, ha="left", fontsize=10)


def shared_legend(
    figure: Figure,
    title: str = "",
    loc: Literal["outside right center", "outside right upper"] = "outside right center",
) -> None:
    """One legend at the right for the curves of all panels, each once."""
    handles = {str(line.get_label()): line for panel in figure.axes for line in panel.get_lines()}
    if handles:
        figure.legend(list(handles.values()), list(handles), loc=loc, title=title or None, fontsize=8)


def blank_rest(axes: NDArray[np.object_], used: int, xlabel: str = "") -> None:
    """Hide the panels that nothing is drawn in, and give the lowest of every column its label and ticks."""
    for panel in axes.flat[used:]:
        panel.set_visible(False)
    for column in range(axes.shape[1]):
        lowest = [row for row in range(axes.shape[0]) if row * axes.shape[1] + column < used][-1]
        axes[lowest, column].tick_params(labelbottom=True)
        if xlabel:
            axes[lowest, column].set_xlabel(xlabel)


def note(figure: Figure, missing: Mapping[str, Sequence[str]]) -> None:
    """Below the picture, in lines of its width: curves that a logarithmic axis cannot show, by the reason."""
    told = "; ".join(f"{why}: {', '.join(names)}" for why, names in missing.items() if names)
    if told:
        lines = textwrap.wrap(f"Not drawn: {told}", int(15.0 * figure.get_figwidth()))
        figure.supxlabel("\n".join(lines), fontsize=7.5, color="0.35")
