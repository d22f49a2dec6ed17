"""What the page of a sweep shows: maps and lines of its numbers over what was varied; every point opens the page of its run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.case.keys import find_key
from mpm.case.schema import number_text
from mpm.errors import InputError, MpmError
from mpm.page.numbers import shown
from mpm.page.run_page import run_html, run_page
from mpm.page.write import render, write_page
from mpm.report.fieldnames import superscript
from mpm.report.quantities import FIRST, first, quantity
from mpm.report.quantity import RATIO, Quantity
from mpm.report.rounding import without_rounding
from mpm.sweep.layout import Layout, read_json
from mpm.sweep.table import read_results
from mpm.sweep.values import factor

NAME = "report.html"
MOST_PAGES = 200
"""Pages of single runs that come with a sweep's: each takes a second or two and some megabytes."""


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What was varied: `values` of all points of the `keys` in the unit that the sweep file writes; words as they are."""

    name: str
    keys: Sequence[str]
    label: str
    unit: str
    meaning: str
    logarithmic: bool
    values: Sequence[float | str]

    @property
    def levels(self) -> str:
        """Its distinct values, in a line."""
        levels = list(dict.fromkeys(self.values))
        texts = [value if isinstance(value, str) else number_text(value) for value in levels]
        return ", ".join(texts) if len(texts) <= 12 else f"{texts[0]} to {texts[-1]}, {len(texts)} values"


@dataclass(frozen=True, kw_only=True)
class Column:
    """A number of all points, in the unit that people read; None where a point has no result."""

    name: str
    label: str
    unit: str
    meaning: str
    values: Sequence[float | None]

    @property
    def varies(self) -> bool:
        """Whether two points with a result differ in it."""
        return len(set(self.values) - {None}) > 1


@dataclass(frozen=True, kw_only=True)
class Point:
    """A row of the table: `page` is where its run is shown, relative to the sweep; empty where there is none."""

    name: str
    status: str
    error: str
    page: str

    @property
    def words(self) -> str:
        """Its status as people say it."""
        return self.status.replace("_", " ") or "pending"


@dataclass(frozen=True, eq=False)
class SweepPage:
    """A sweep, ready for the template."""

    title: str
    about: dict[str, Any]
    axes: Sequence[Axis]
    columns: Sequence[Column]
    points: Sequence[Point]

    @property
    def counts(self) -> str:
        """How many points there are and how they ended, in words."""
        states = [point.words for point in self.points]
        count = len(states)
        return f"{count} point{'s' if count != 1 else ''}: " + ", ".join(
            f"{states.count(state)} {state}" for state in dict.fromkeys(states)
        )


def sweep_page(directory: str | Path, say: Callable[[str], None] = lambda text: None) -> SweepPage:
    """Read a sweep's directory and write the pages of its runs that are missing or older than their results.

    Raises InputError when it holds no table yet.
    """
    root = Path(directory)
    about, rows = read_results(root)
    steady = _is_steady(root, rows)
    axes = [_axis(axis, [row[axis["name"]] for row in rows]) for axis in about["axes"]]
    numbers = [name for name in about["columns"] if name not in {axis.name for axis in axes}]
    columns = [_column(name, [row.get(name, "") for row in rows], steady) for name in numbers]
    varied = [
        column for column in columns if (len(rows) == 1 or column.varies) and not quantity(column.name).error
    ]
    return SweepPage(
        title=about.get("title") or root.resolve().name,
        about=about,
        axes=axes,
        columns=sorted(varied, key=_place),
        points=_points(root, rows, say),
    )


def _is_steady(root: Path, rows: Sequence[dict[str, str]]) -> bool:
    runs = (Layout(root).run(row["point"]) / "summary.json" for row in rows)
    return next((found.get("fidelity") == "steady" for found in map(read_json, runs) if found), False)


def _axis(axis: dict[str, Any], cells: Sequence[str]) -> Axis:
    unit = axis["written_unit"]
    values = list(cells) if axis["kind"] == "word" else [_tidy(float(cell) / factor(unit)) for cell in cells]
    try:
        meaning = find_key(axis["keys"][0]).description
    except InputError:  # a key of a file that the case names
        meaning = ""
    name = axis["name"]
    label = name if name.count(".") < 2 else ".".join(name.split(".")[-2:])
    return Axis(
        name=name,
        keys=axis["keys"],
        label=label,
        unit=unit,
        meaning=meaning,
        logarithmic=bool(axis["logarithmic"]),
        values=values,
    )


def _tidy(value: float) -> float:
    """Without the digits that the conversion of a unit has left."""
    return float(f"{value:.10g}")


def _column(name: str, cells: Sequence[str], steady: bool) -> Column:
    what = quantity(name, steady)
    values = [
        _clean(float(f"{what.of(float(cell)):.6g}"), what) if _is_number(cell) else None for cell in cells
    ]
    return Column(
        name=name, label=what.label, unit=superscript(what.unit_shown), meaning=what.meaning, values=values
    )


def _clean(value: float, what: Quantity) -> float:
    """Of shares and coverages what is rounding beside 1 is 0, in the charts too."""
    return without_rounding(value, 1.0 if what.unit == RATIO else 0.0)


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _place(column: Column) -> int:
    place = first(column.name)
    return len(FIRST) if place is None else place


def _points(root: Path, rows: Sequence[dict[str, str]], say: Callable[[str], None]) -> list[Point]:
    """The rows with the pages of their runs; those of the first MOST_PAGES finished ones are written."""
    points, written = [], 0
    for row in rows:
        run = Layout(root).run(row["point"])
        page, summary = run / NAME, run / "summary.json"
        if summary.is_file() and written < MOST_PAGES:
            if not page.is_file() or page.stat().st_mtime < summary.stat().st_mtime:
                _write(run, page, say)
            written += 1
        where = f"points/{row['point']}/{NAME}" if page.is_file() else ""
        points.append(Point(name=row["point"], status=row["status"], error=row["error"], page=where))
    if written == MOST_PAGES:
        say(f"{root}: pages of the first {MOST_PAGES} runs; mpm report {root}/points/NAME writes another")
    return points


def _write(run: Path, page: Path, say: Callable[[str], None]) -> None:
    """The page of one run; one that cannot be written leaves the others alone."""
    try:
        write_page(page, run_html(run_page(run, say)))
    except MpmError as error:
        say(str(error))


def sweep_html(page: SweepPage) -> str:
    """The page of a sweep as a file."""
    numbers = [
        {"name": c.name, "label": c.label, "unit": c.unit, "values": list(c.values)} for c in page.columns
    ]
    data = {
        "grid": page.about["mode"] == "grid",
        "axes": [
            {"label": a.label, "unit": a.unit, "log": a.logarithmic, "values": list(a.values)}
            for a in page.axes
        ],
        "numbers": numbers,
        "pages": [point.page for point in page.points],
    }
    return render(
        "sweep.html",
        page.title,
        {"charts": {}, "sweep": data},
        page=page,
        shown=shown,
        number_text=number_text,
    )
