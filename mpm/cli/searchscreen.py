"""What `mpm optimise` shows: each steady state in a line, what was found in words, and a picture of the search."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mpm.advice.checks import check_case
from mpm.files import write_picture
from mpm.optimise import SLACK, Point, Search, states
from mpm.report.quantities import quantity
from mpm.screen import number, print_steps, print_warnings, say, together

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console


def print_task(search: Search, limit: int, console: Console) -> None:
    """What `mpm check` warns of, and what is looked for."""
    print_warnings(console, check_case(search.case)["warnings"])
    inlets = dict.fromkeys(dose.key.split(".")[2] for dose in search.doses)
    say(
        console,
        f"Looking for the doses of {', '.join(inlets)} with which a share of {search.target:g} of the sites is covered at every exit, for "
        f"the least precursor; 1 mol of parasitic CVD counts as {together(f'{search.weight:g} mol')} of it. At most {states(limit)}.",
    )


def print_point(search: Search, point: Point, console: Console) -> None:
    """One steady state: how much is dosed, and what comes out."""
    verdict = _reached(search, point) if point.reaches(search.target) else "too lean"
    say(
        console,
        f"{len(search.points)}: {_by_inlet('dose ratio', point.ratios)}; {_by_inlet('coverage at the exit', point.exits)}; "
        f"CVD {_cvd(point)}; {verdict}",
    )


def print_found(search: Search, directory: Path, console: Console) -> None:
    """What the search has found, in words, and what to type next."""
    best, name = search.found(), shlex.quote(str(directory))
    short = _reached(search, best).removeprefix("reaches it")
    console.print()
    say(
        console,
        f"Found in {states(len(search.points))}: the target coverage of {search.target:g} is reached{short} at every exit with",
    )
    for inlet in best.exits:
        prefix = f"geometry.inlet.{inlet}."
        doses = [
            f"{dose.key.removeprefix(prefix)} = {together(f'{best.doses[dose.key]:.4g} {dose.unit}'.strip())}"
            for dose in search.doses
            if dose.key.startswith(prefix)
        ]
        say(
            console,
            f"{inlet}: {', '.join(doses)}: {_dose(best, inlet)}, coverage at the exit {best.exits[inlet]:.4f}",
            2,
        )
    fed = quantity("species.X.fed", steady=True)
    say(
        console,
        f"Precursor fed {number(fed.of(best.fed), fed.unit_shown)}, {100.0 * (best.fed / search.points[0].fed - 1.0):+.2g} % against the "
        f"start, where {_start(search)}; parasitic CVD {_cvd(best)}.",
        2,
    )
    console.print()
    say(console, f"Results: {directory}: case.toml (the case with these doses), points.csv, plots/search.png")
    print_steps([(f"mpm run {name}/case.toml -o {name}/run", "the case with these doses")], console)


def _start(search: Search) -> str:
    """What the first doses are."""
    if search.case.mechanism.is_first_order:
        return "every dose ratio is the target"
    return "each feed by itself would just reach the target"


def _dose(point: Point, inlet: str) -> str:
    """What an inlet feeds, by saturation and by sites; the former may not exist at these doses."""
    feeds = f"{point.excess[inlet]:.4g} molecules per site"
    return f"dose ratio {point.ratios[inlet]:.4g} ({feeds})" if inlet in point.ratios else feeds


def _reached(search: Search, point: Point) -> str:
    """That a point reaches the target: some round of the search may end a little below it."""
    return "reaches it" + ("" if min(point.exits.values()) >= search.target else f" to {SLACK:g}")


def _by_inlet(words: str, values: Mapping[str, float]) -> str:
    return f"{words} " + ", ".join(together(f"{inlet} {value:.4f}") for inlet, value in values.items())


def _cvd(point: Point) -> str:
    meant = quantity("cvd.total", steady=True)
    return number(meant.of(point.cvd), meant.unit_shown, 3)


def draw_search(directory: Path, search: Search) -> Path:
    """Write plots/search.png."""
    path = directory / "plots" / "search.png"
    path.parent.mkdir(exist_ok=True)
    write_picture(path, search_figure(search), dpi=150)
    return path


def search_figure(search: Search) -> Figure:
    """The path of the search: for each inlet the coverage at its exit and the CVD over its dose ratio, in the order of the steady states.

    The slanting line is a zone that takes up everything: its coverage is the dose ratio. Where the reactions are such that what saturation
    needs depends on the dose, they are shown over the molecules fed per site, without that line.
    """
    from matplotlib.figure import Figure

    from mpm.labels import literal

    inlets, points, best = list(search.points[0].exits), search.points, search.best()
    counted = search.case.mechanism.is_first_order
    figure = Figure(figsize=(1.2 + 4.2 * len(inlets), 6.6), layout="constrained")
    title = search.case.title or "search"
    figure.suptitle(literal(f"{title}: doses that cover {search.target:g} of the sites"), fontsize=11)
    grid = figure.subplots(2, len(inlets), squeeze=False, sharex="col", sharey="row")
    cvd = quantity("cvd.total", steady=True)
    most = cvd.of(max(p.cvd for p in points))
    power = 3 * math.floor(math.log10(most) / 3.0) if most > 0.0 else 0
    order = list(range(1, len(points) + 1))
    for (upper, lower), inlet in zip(grid.T, inlets, strict=True):
        ratios = [(p.ratios if counted else p.excess)[inlet] for p in points]
        span = sorted({min(ratios), min(max(min(ratios), 1.0), max(ratios)), max(ratios)})
        for axes, values in (
            (upper, [p.exits[inlet] for p in points]),
            (lower, [cvd.of(p.cvd) / 10.0**power for p in points]),
        ):
            axes.plot(ratios, values, "-", color="0.75", lw=0.8, zorder=1)
            dots = axes.scatter(
                ratios, values, c=order, cmap="viridis", s=26, zorder=2, label="steady states"
            )
            if best is not None:
                at = points.index(best)
                axes.plot(ratios[at], values[at], "*", color="#d55e00", ms=13, zorder=3, label="best")
            axes.grid(alpha=0.25)
        if counted:
            upper.plot(span, [min(r, 1.0) for r in span], ":", color="0.4", label="everything is taken up")
        upper.axhline(search.target, color="k", ls="--", lw=1.0, label=f"target {search.target:g}")
        upper.set_title(literal(inlet), fontsize=10)
        lower.set_xlabel(
            "dose ratio: fed over what saturation needs" if counted else "molecules fed per passing site"
        )
    grid[0, 0].set_ylabel("coverage at the exit, mean")
    grid[1, 0].set_ylabel(f"parasitic CVD [{f'$10^{{{power}}}$ ' if power else ''}{cvd.unit_shown}]")
    figure.colorbar(dots, ax=grid[:, -1], label="steady state, in the order of the search", aspect=40)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    return figure
