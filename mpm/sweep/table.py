"""The results of a sweep: results.csv, results.parquet, sweep.json, and `load_sweep` that reads them back.

One row per point: the axes, `status`, the chosen numbers of summary.json by dotted name, then `error` (last line of
what went wrong) and `point` (the run's directory below points/). All numbers are SI; the unit of every column is in
sweep.json, in the parquet fields' metadata, and in the attributes of what `load_sweep` returns. A number that a run
did not report is empty, never 0.
"""

import csv
import fnmatch
import io
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpm.errors import InputError
from mpm.files import replacing, write_atomically
from mpm.sweep.layout import Layout, read_json

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Row = dict[str, float | str | None]
WORDS = ("status", "error", "point")
"""Columns that hold no numbers, whatever was varied."""


def choose(patterns: Sequence[str], available: Iterable[str]) -> list[str]:
    """The columns that the patterns name, in their order.

    A plain name is a column whether or not a run has it yet; `*` stands for anything but single list entries.
    """
    names = list(dict.fromkeys(available))
    columns: dict[str, None] = {}
    for pattern in patterns:
        if not re.search(r"[*?\[]", pattern):
            columns[pattern] = None
        else:
            found = [name for name in names if fnmatch.fnmatchcase(name, pattern)]
            listed = re.compile(r"\.\d+$")
            columns |= dict.fromkeys(
                name for name in found if listed.search(pattern) or not listed.search(name)
            )
    return list(columns)


def csv_text(columns: Sequence[str], rows: Sequence[Row]) -> str:
    """The rows as CSV; floats as their shortest exact text, missing values empty."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    for row in rows:
        writer.writerow(
            {key: repr(value) if isinstance(value, float) else value for key, value in row.items()}
        )
    return stream.getvalue()


def write_parquet(
    path: Path, units: Mapping[str, str], rows: Sequence[Row], about: Mapping[str, Any]
) -> bool:
    """The same rows typed, with units; False when pyarrow (extra `sweep`) is not installed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        return False
    fields, arrays = [], []
    for column, unit in units.items():
        values = [row.get(column) for row in rows]
        text = any(isinstance(value, str) for value in values) or column in WORDS
        kind = pa.string() if text else pa.float64()
        arrays.append(pa.array(values, kind))
        fields.append(pa.field(column, kind, metadata={"unit": unit} if unit else None))
    schema = pa.schema(fields, metadata={"mpm.sweep": json.dumps(about)})
    with replacing(path) as aside:
        pq.write_table(pa.Table.from_arrays(arrays, schema=schema), aside)
    return True


def write_csv(path: Path, columns: Iterable[str], rows: Sequence[Row]) -> None:
    """Replace results.csv in one step."""
    write_atomically(path, csv_text(list(columns), rows))


def read_results(directory: str | Path) -> tuple[dict[str, Any], list[dict[str, str]]]:
    """sweep.json and the rows of results.csv. Raises InputError when one is missing or they do not belong together."""
    root = Layout(Path(directory)).root
    about, table = read_json(root / "sweep.json"), root / "results.csv"
    if not about or not table.exists():
        raise InputError.at(
            directory, "", "no sweep", "a directory that `mpm sweep` wrote, with sweep.json and results.csv"
        )
    text = table.read_text(encoding="utf-8")
    rows = list(csv.DictReader(io.StringIO(text)))
    foreign = any(None in row.values() or set(about["columns"]) - row.keys() for row in rows)
    if not text.endswith("\n") or not rows or foreign:
        raise InputError.at(
            table, "", "a table that is cut or is not of this sweep.json", "the table that `mpm sweep` wrote"
        )
    return about, rows


def load_sweep(directory: str | Path) -> "xr.Dataset | pd.DataFrame":
    """A sweep's results: for a grid an xarray Dataset over its axes, for zip and samples a pandas DataFrame.

    Dataset: one dimension per axis, coordinates and numbers in SI units with `attrs["units"]`; `status`, `error` and
    `point` are variables too; combinations that were dropped or are not finished hold NaN or "". DataFrame: the rows
    of results.csv, units in `attrs["units"]`. The attributes of both carry title, base case and program.
    Raises InputError when `directory` holds no sweep.
    """
    import pandas as pd

    about, rows = read_results(directory)
    words = {*WORDS, *(axis["name"] for axis in about["axes"] if axis["kind"] == "word")}
    frame = pd.DataFrame(
        {
            column: [row[column] if column in words else float(row[column] or "nan") for row in rows]
            for column in about["columns"]
        }
    )
    units = {column: item["unit"] for column, item in about["columns"].items() if item["unit"]}
    attributes = {key: about[key] for key in ("title", "case", "program", "mode")}
    if about["mode"] != "grid":
        frame.attrs = {**attributes, "units": units}
        return frame
    return _dataset(frame, about, units, attributes)


def _dataset(
    frame: Any, about: Mapping[str, Any], units: Mapping[str, str], attributes: Mapping[str, Any]
) -> Any:
    """The rows of a grid as a Dataset; see `load_sweep`."""
    import numpy as np
    import xarray as xr

    names = [axis["name"] for axis in about["axes"]]
    levels = {axis["name"]: list(dict.fromkeys(axis["numbers"])) for axis in about["axes"]}
    place = tuple(
        frame[name].map({level: i for i, level in enumerate(levels[name])}).to_numpy() for name in names
    )
    shape = tuple(len(levels[name]) for name in names)
    variables = {}
    for column in frame.columns:
        if column not in names:
            text = column in WORDS
            values = np.full(shape, "", dtype=object) if text else np.full(shape, np.nan)
            values[place] = frame[column].to_numpy()
            variables[column] = (names, values, {"units": units[column]} if column in units else {})
    coordinates = {
        name: (name, np.array(levels[name]), {"units": units[name]} if name in units else {})
        for name in names
    }
    return xr.Dataset(variables, coordinates, attributes)
