"""What the page of several runs shows: changed keys and numbers side by side, the fields in one colour scale, and their difference."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.case.keys import values
from mpm.errors import InputError
from mpm.output.compare import changed_keys, changed_numbers
from mpm.output.results import Run
from mpm.page.fields import Look, extent, read_film, value_range
from mpm.page.numbers import rounded
from mpm.page.run_page import RunPage, run_page
from mpm.page.viewer import BUDGET, VALUES, looks, viewer
from mpm.page.write import render
from mpm.report.fieldnames import superscript
from mpm.report.quantities import quantity
from mpm.report.quantity import Quantity
from mpm.report.rounding import natural_scale
from mpm.report.trees import flatten

MOST_RUNS = 6
"""Beyond that a sweep says more than runs side by side."""


@dataclass(frozen=True, kw_only=True)
class Changed:
    """A line of a table of runs: what it is, a text per run, and how far the others are from the first."""

    label: str
    texts: Sequence[str]
    meaning: str = ""
    unit: str = ""
    values: Sequence[float | None] = ()
    relative: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class ComparePage:
    """Several runs, ready for the template; the first is what the others are compared with."""

    runs: Sequence[RunPage]
    names: Sequence[str]
    keys: Sequence[Changed]
    numbers: Sequence[Changed]
    films: Sequence[dict[str, Any]]


def compare_page(
    directories: Sequence[str | Path], say: Callable[[str], None] = lambda text: None
) -> ComparePage:
    """Read the runs. Raises InputError when one is none, or when there are more than MOST_RUNS."""
    if len(directories) > MOST_RUNS:
        raise InputError.at(
            "report",
            "",
            f"{len(directories)} runs",
            f"at most {MOST_RUNS} side by side, or the directory of a sweep",
        )
    pages = [run_page(directory, say, budget=0) for directory in directories]
    runs = [page.run for page in pages]
    bounds = shared_bounds(runs)
    films = [viewer(run, BUDGET // len(runs), bounds, say) for run in runs]
    return ComparePage(
        runs=pages,
        names=told_apart([page.run.directory.path.resolve() for page in pages]),
        keys=key_table(runs),
        numbers=number_table(runs),
        films=[] if None in films else [one for one in films if one is not None],
    )


def told_apart(paths: Sequence[Path]) -> list[str]:
    """The shortest ends of the paths that differ from each other."""
    for length in range(1, max(len(path.parts) for path in paths) + 1):
        names = ["/".join(path.parts[-length:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    return [f"{path.name} ({number})" for number, path in enumerate(paths, start=1)]


def shared_bounds(runs: Sequence[Run]) -> dict[str, tuple[float, float]]:
    """One colour range for each field, that of all runs and times together; fields that are zero throughout in all runs have none."""
    found: dict[str, tuple[Look, list[float]]] = {}
    for run in runs:
        known = looks(run)
        film = read_film(run, {name: make for name, (_, make) in known.items()}, known, VALUES)
        for name, series in film.series.items():
            look = known[name][0]
            found.setdefault(name, (look, []))[1].extend(extent(look, series))
    return {
        name: value_range(look, min(ends), max(ends)) for name, (look, ends) in found.items() if any(ends)
    }


def key_table(runs: Sequence[Run]) -> list[Changed]:
    """Keys of the resolved cases in which a run differs from the first."""
    people = [{value.name: value.text for value in values(run.case)} for run in runs]
    texts: dict[str, list[str]] = {}
    for place, run in enumerate(runs[1:], start=1):
        for change in changed_keys(runs[0].case, run.case):
            first, second = (
                people[i].get(change.key, raw) or "" for i, raw in ((0, change.first), (place, change.second))
            )
            texts.setdefault(change.key, [first] * len(runs))[place] = second
    return [Changed(label=key, texts=line) for key, line in texts.items()]


def number_table(runs: Sequence[Run]) -> list[Changed]:
    """Reported numbers in which a run differs from the first by more than rounding; 0 beside nothing is no difference."""
    found: dict[tuple[str, str], Quantity] = {}
    for run in runs[1:]:
        for change in changed_numbers(runs[0].summary, run.summary):
            found.setdefault((change.quantity.name, change.quantity.unit), change.quantity)
    lines = []
    for what in found.values():
        reports = [_has(what, run.summary.get("fidelity") == "steady") for run in runs]
        numbers = [flatten(run.summary) if has else {} for run, has in zip(runs, reports, strict=True)]
        lines.append(_number_line(what, numbers))
    return [line for line in lines if set(line.texts) - {"", "0"}]


def _has(what: Quantity, steady: bool) -> bool:
    """Whether a run of this kind reports the number in this unit: amounts of steady states are per second."""
    return what.unit == quantity(what.name, steady).unit


def _number_line(what: Quantity, numbers: Sequence[Mapping[str, float]]) -> Changed:
    """Values of one number in every run, and how far they are from the first; what is rounding in its run is 0."""
    values = [found.get(what.name) for found in numbers]
    texts = [
        "" if value is None else rounded(what, value, natural_scale(what.name, found))
        for value, found in zip(values, numbers, strict=True)
    ]
    first = values[0]
    relative = [
        ""
        if value is None or not first or texts[0] == "0"
        else "0 %"
        if value == first
        else f"{100.0 * (value - first) / abs(first):+.3g} %"
        for value in values[1:]
    ]
    return Changed(
        label=what.label,
        meaning=f"{what.meaning} ({what.name})",
        unit=superscript(what.unit_shown),
        texts=texts,
        values=values,
        relative=relative,
    )


def comparison_data(page: ComparePage) -> Mapping[str, Any]:
    """For the page's script."""
    return {"names": list(page.names), "films": list(page.films)}


def compare_html(page: ComparePage) -> str:
    """The page of several runs as a file."""
    return render(
        "compare.html",
        " and ".join(page.names),
        {"charts": {}, "comparison": comparison_data(page)},
        page=page,
    )
