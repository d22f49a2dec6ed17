"""The state of a sweep as its files tell it: a verdict and a summary per point, the table, the provenance."""

import contextlib
import json
import math
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib import metadata
from typing import Any

from mpm.files import write_atomically
from mpm.report.quantities import unit_of
from mpm.report.trees import flatten
from mpm.sweep.layout import Layout, read_json
from mpm.sweep.plan import Point
from mpm.sweep.point import error_of, program, status_of
from mpm.sweep.sweepfile import DEFAULT_COLUMNS, Sweep
from mpm.sweep.table import Row, choose, write_csv, write_parquet
from mpm.sweep.values import to_number

PACKAGES = (
    "mpm",
    "numpy",
    "scipy",
    "dolfinx-solver-real",
    "fenics-dolfinx",
    "mpi4py",
    "distributed",
    "dask-jobqueue",
)


class Results:
    """The table of a sweep, kept up to date from the points' own files."""

    def __init__(self, sweep: Sweep, points: Sequence[Point], layout: Layout) -> None:
        self.sweep = sweep
        self.points = points
        self.layout = layout
        self.records: dict[str, dict[str, Any]] = {}
        self.states: dict[str, str] = {}
        """One word per point, see `mpm.sweep.point.status_of`; points that the case refused are bad_input."""
        self.errors: dict[str, str] = {}
        self._numbers: dict[str, dict[str, float]] = {}
        for point in points:
            self.note(point.name, read_json(layout.record(point.name)))
            if point.case is None:
                self.states[point.name], self.errors[point.name] = "bad_input", point.error

    def note(self, name: str, record: dict[str, Any]) -> None:
        """Take over a point's verdict and, when it is done, its summary."""
        run = self.layout.run(name)
        self.records[name] = record
        self.states[name] = status_of(record, run)
        self.errors[name] = error_of(record, self.layout, name)
        done = self.states[name] == "done"
        self._numbers[name] = flatten(read_json(run / "summary.json")) if done else {}

    def columns(self) -> dict[str, str]:
        """Every column of the table with its SI unit ("" for words)."""
        steady = self.sweep.base.fidelity == "steady"
        available = [name for numbers in self._numbers.values() for name in numbers]
        chosen = choose(self.sweep.columns, available)
        kinds = zip(self.sweep.axes, self.points[0].numbers, strict=True)
        axes = {axis.name: "" if isinstance(one, str) else axis.si_unit or "1" for axis, one in kinds}
        numbers = {name: unit_of(name, steady) for name in chosen if name not in axes}
        return {**axes, "status": "", **numbers, "error": "", "point": ""}

    def rows(self) -> list[Row]:
        """A row per point of the plan, in its order."""
        rows = []
        for point in self.points:
            name = point.name
            row: Row = dict(zip((axis.name for axis in self.sweep.axes), point.numbers, strict=True))
            row |= {"status": self.states[name], **self._numbers[name]}
            rows.append(row | {"error": self.errors[name], "point": name})
        return rows

    def counts(self) -> Counter[str]:
        """How many rows have which status."""
        return Counter(self.states[point.name] for point in self.points)

    def missing_columns(self) -> list[str]:
        """Columns that the sweep file asks for by their full name and no finished point has."""
        if self.sweep.columns == DEFAULT_COLUMNS:
            return []
        known = {name for numbers in self._numbers.values() for name in numbers}
        return [name for name in choose(self.sweep.columns, ()) if known and name not in known]

    def save(self, about: Mapping[str, Any]) -> None:
        """Write results.csv and sweep.json."""
        text = json.dumps(provenance(self) | dict(about), indent=1)
        write_csv(self.layout.root / "results.csv", self.columns(), self.rows())
        write_atomically(self.layout.root / "sweep.json", text + "\n")

    def save_parquet(self) -> bool:
        """Write results.parquet; False when pyarrow is not installed."""
        about = {"title": self.sweep.title, "program": program()}
        return write_parquet(self.layout.root / "results.parquet", self.columns(), self.rows(), about)


def provenance(results: Results) -> dict[str, Any]:
    """Content of sweep.json: what was asked, of which program, and what came of every point."""
    sweep = results.sweep
    versions = {"python": platform.python_version()}
    for package in PACKAGES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[package] = metadata.version(package)
    axes = [
        {
            "name": axis.name,
            "keys": axis.keys,
            "unit": axis.si_unit,
            "written_unit": axis.unit,
            "kind": "word" if isinstance(results.points[0].numbers[index], str) else "number",
            "logarithmic": axis.logarithmic,
            "numbers": [None if number == math.inf else number for number, _ in map(to_number, axis.levels)],
        }
        for index, axis in enumerate(sweep.axes)
    ]
    points = [
        {
            "point": point.name,
            "levels": point.levels,
            "status": results.states[point.name],
            **results.records[point.name],
        }
        for point in results.points
    ]
    return {
        "title": sweep.title,
        "file": str(sweep.path),
        "text": sweep.text,
        "case": sweep.case,
        "base_hash": sweep.base.content_hash(),
        "mode": sweep.mode,
        "program": program(),
        "versions": versions,
        "host": platform.node(),
        "counts": results.counts(),
        "axes": axes,
        "columns": {name: {"unit": unit} for name, unit in results.columns().items()},
        "points": points,
    }
