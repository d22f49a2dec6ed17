"""The directory of one run: the only place that writes into it, for rank 0 alone.

| file | content |
|---|---|
| `case.toml` | the resolved case, runnable again |
| `fields.pvd`, `fields/fields_000000.vtu` ... | all fields on one grid, one file per output time |
| `history.csv` | one row per output time, first column `time` |
| `summary.json` | the numbers of the finished run, SI units |
| `flux.csv` | gas velocity through the upper face of every layer along x, mean of a cycle |
| `checkpoint.npz` | restart state |
| `run.log`, `plots/*.png` | log; pictures |

Plain Python and numpy; the arrays that come in are global and in the grid's order. Every file is replaced as a whole
(`mpm.files.write_atomically`), so a run killed at any moment leaves a directory that can be read and resumed.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm import vtu
from mpm.errors import InputError, MpmError
from mpm.files import write_atomically

if TYPE_CHECKING:
    from mpm.geometry import Grid

OWN_FILES = (
    "case.toml",
    "fields.pvd",
    "history.csv",
    "summary.json",
    "flux.csv",
    "checkpoint.npz",
    "run.log",
)
OWN_PATTERNS = ("fields/fields_*.vtu", "plots/*.png", "*.tmp", "fields/*.tmp", "plots/*.tmp")
META = "__meta__"


class RunDirectory:
    """Files of the run in `path`; `precision` (Float32, Float64) is that of the fields on disk."""

    def __init__(self, path: str | Path, precision: str = "Float32"):
        self.path = Path(path)
        self.precision = precision
        self._steps: list[tuple[float, str]] | None = None
        self._history: list[dict[str, float]] | None = None

    @property
    def log(self) -> Path:
        return self.path / "run.log"

    @property
    def pvd(self) -> Path:
        return self.path / "fields.pvd"

    @property
    def plots(self) -> Path:
        return self.path / "plots"

    def prepare(self, resume: bool = False, overwrite: bool = False) -> None:
        """Create the directory; refuse one that holds files, unless they are to be resumed or overwritten.

        `overwrite` removes the files of an earlier run (those in this module's table) and nothing else.
        Raises InputError.
        """
        try:
            if self.path.is_dir() and any(self.path.iterdir()):
                if overwrite:
                    self._remove_own_files()
                elif not resume:
                    raise InputError(
                        f"{self.path}: not empty; use --resume, --overwrite or another directory (-o)"
                    )
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be used as output directory ({error.strerror})") from error

    def _remove_own_files(self) -> None:
        for name in OWN_FILES:
            (self.path / name).unlink(missing_ok=True)
        for pattern in OWN_PATTERNS:
            for path in self.path.glob(pattern):
                path.unlink()
        self._steps = self._history = None

    def write_case(self, text: str) -> None:
        """Write `case.toml`."""
        write_atomically(self.path / "case.toml", text)

    # ------------------------------------------------------------------ fields

    @property
    def steps(self) -> list[tuple[float, str]]:
        """Time [s] and file name of the fields written so far, relative to the directory."""
        if self._steps is None:
            self._steps = [(time, str(path.relative_to(self.path))) for time, path in vtu.read_pvd(self.pvd)]
        return self._steps

    def write_fields(
        self,
        time: float,
        grid: Grid,
        cell_data: Mapping[str, ArrayLike],
        displacement: Sequence[float] = (0.0, 0.0),
    ) -> None:
        """Write one time step and list it in `fields.pvd`.

        `cell_data`: name -> (cells,) or (cells, 2), cells in the grid's order. `zone` and `layer` (numbers, see
        `Grid`) are added. `displacement` [m] of the reactor moves the points of this step; velocities stay relative
        to the reactor.
        """
        name = f"fields/fields_{len(self.steps):06d}.vtu"
        data = {
            "zone": np.tile(grid.zone_of_column, grid.rows),
            "layer": np.repeat(grid.row_layer, grid.columns),
            **cell_data,
        }
        points = vtu.grid_points(grid.x, grid.y, displacement)
        content = vtu.encode_vtu(
            points, vtu.grid_quads(grid.columns, grid.rows), data, float(time), self.precision
        )
        (self.path / "fields").mkdir(exist_ok=True)
        write_atomically(self.path / name, content)
        self.steps.append((float(time), name))
        write_atomically(self.pvd, vtu.encode_pvd(self.steps))

    def read_fields(self, index: int = -1) -> vtu.Snapshot:
        """One of the time steps listed in `fields.pvd`, the last one by default."""
        if not self.steps:
            raise MpmError(f"{self.pvd}: no fields have been written")
        return vtu.read_vtu(self.path / self.steps[index][1])

    # ------------------------------------------------------------------ history and summary

    def append_history(self, row: Mapping[str, float | None]) -> None:
        """Add a row to `history.csv`; `time` [s] comes first, then columns in the order they were first seen.

        A number that could not be computed is None or missing and leaves its cell empty; one that is not finite is an
        error (MpmError).
        """
        kept = {key: float(value) for key, value in row.items() if value is not None}
        wrong = [key for key, value in kept.items() if not math.isfinite(value)]
        if "time" not in kept or wrong:
            raise MpmError(
                "history.csv: " + (f"{wrong[0]} is {kept[wrong[0]]}" if wrong else "a row without time")
            )
        self._rows().append(kept)
        self._write_history()

    def _rows(self) -> list[dict[str, float]]:
        if self._history is None:
            path = self.path / "history.csv"
            self._history = []
            if path.exists():
                with open(path, newline="", encoding="utf-8") as stream:
                    for row in csv.DictReader(stream):
                        self._history.append({key: float(value) for key, value in row.items() if value})
        return self._history

    def _write_history(self) -> None:
        rows = self._rows()
        columns = list(dict.fromkeys(["time", *(key for row in rows for key in row)]))
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows({key: repr(value) for key, value in row.items()} for row in rows)
        write_atomically(self.path / "history.csv", text.getvalue())

    def history(self) -> dict[str, NDArray[np.float64]]:
        """Columns of `history.csv`; NaN where a cell is empty."""
        rows = self._rows()
        columns = dict.fromkeys(key for row in rows for key in row)
        return {key: np.array([row.get(key, math.nan) for row in rows]) for key in columns}

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write `summary.json`: None is dropped; a number that is not finite is an error (MpmError)."""
        text = json.dumps(plain(summary, "summary.json"), indent=2, allow_nan=False)
        write_atomically(self.path / "summary.json", text + "\n", sync=True)

    def write_flux(self, profiles: Mapping[str, NDArray[np.float64]]) -> None:
        """Write `flux.csv`, columns of equal length (`mpm.flownumbers.flux_profiles`)."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(profiles)
        writer.writerows(zip(*(map(repr, map(float, column)) for column in profiles.values()), strict=True))
        write_atomically(self.path / "flux.csv", text.getvalue())

    def read_summary(self) -> dict[str, Any] | None:
        """Contents of `summary.json`, None when there is none."""
        path = self.path / "summary.json"
        return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None

    # ------------------------------------------------------------------ restart

    def write_checkpoint(self, arrays: Mapping[str, ArrayLike], meta: Mapping[str, Any]) -> None:
        """Replace `checkpoint.npz`: named arrays in full precision, and `meta`, which must be JSON (numbers exact)."""
        buffer = io.BytesIO()
        text = json.dumps(plain(meta, "checkpoint.npz"), allow_nan=False)
        stored: dict[str, Any] = {name: np.asarray(values) for name, values in arrays.items()}
        stored[META] = np.frombuffer(text.encode(), dtype=np.uint8)
        np.savez(buffer, **stored)
        write_atomically(self.path / "checkpoint.npz", buffer.getvalue(), sync=True)

    def read_checkpoint(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]] | None:
        """Arrays and meta of the last restart state, None when there is none."""
        path = self.path / "checkpoint.npz"
        if not path.exists():
            return None
        try:
            with np.load(path, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            return arrays, json.loads(arrays.pop(META).tobytes())
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{path}: not a checkpoint of mpm ({error})") from error

    def cut_back(self, rows: int) -> None:
        """Drop all but the first `rows` output times, those of the restart state; later output continues the numbering.

        Files that `fields.pvd` does not list any more, and unfinished ones, are deleted.
        """
        self._steps = self.steps[:rows]
        if self.pvd.exists():
            write_atomically(self.pvd, vtu.encode_pvd(self._steps))
        listed = {self.path / name for _, name in self._steps}
        for path in [
            *self.path.glob("fields/fields_*.vtu"),
            *self.path.glob("*.tmp"),
            *self.path.glob("fields/*.tmp"),
        ]:
            if path not in listed:
                path.unlink()
        self._history = self._rows()[:rows]
        if (self.path / "history.csv").exists():
            self._write_history()


def plain(value: Any, where: str) -> Any:
    """`value` in JSON's own types: numpy numbers and arrays converted, None dropped; MpmError when not finite."""
    if isinstance(value, Mapping):
        return {str(key): plain(item, f"{where}: {key}") for key, item in value.items() if item is not None}
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), where)
    if isinstance(value, list | tuple):
        return [plain(item, f"{where}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        raise MpmError(f"{where} is {value}")
    if not isinstance(value, bool | int | float | str):
        raise MpmError(f"{where}: {type(value).__name__} is not a number, text, list or table")
    return value
