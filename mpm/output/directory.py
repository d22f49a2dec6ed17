"""The directory of one run: the only place that writes into it, for rank 0 alone.

| file | content |
|---|---|
| `case.toml` | the resolved case, runnable again |
| `origin.json` | which of its values were typed, and which are defaults |
| `fields.pvd`, `fields/fields_000000.vtu` ... | all fields on one grid, one file per output time |
| `phases.pvd`, `phases/phases_000000.vtu` ... | the last cycle phase by phase, where `output.phases` asks for it |
| `history.csv` | one row per output time, first column `time` |
| `summary.json` | the numbers of the finished run, SI units |
| `flux.csv` | gas velocity through the upper face of every layer along x, mean of a cycle |
| `checkpoint.npz` | restart state |
| `report.html` | one page with everything, for a browser |
| `view.py`, `vibration.py` | scripts that open the run in ParaView |
| `run.log`, `plots/*` | log; pictures and movies |

Plain Python and numpy; the arrays that come in are global and in the grid's order. Files are replaced as a whole
(`mpm.files.write_atomically`) and tables grow in place (`mpm.output.history`, `mpm.output.vtu`), so a run killed at any moment leaves a
directory that can be read and resumed. The log carries the lock that keeps a second run out.
"""

from __future__ import annotations

import csv
import io
import json
import logging
import math
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm.errors import FULL, InputError, MpmError
from mpm.files import flush, load_arrays, load_json, lock, write_atomically, writing
from mpm.output import vtu
from mpm.output.history import History
from mpm.output.series import Series, check_finite
from mpm.plain import json_text, plain

if TYPE_CHECKING:
    from mpm.mesh.grid import Grid

log = logging.getLogger("mpm")
FAILED = "failed: "
"""What the last line of the log of a failed run begins with."""
OWN_FILES = (
    "case.toml",
    "origin.json",
    "report.html",
    "view.py",
    "vibration.py",
    "fields.pvd",
    "phases.pvd",
    "history.csv",
    "summary.json",
    "flux.csv",
    "checkpoint.npz",
)
OWN_PATTERNS = (
    *("fields/fields_*.vtu", "phases/phases_*.vtu", "plots/*.png", "plots/*.gif", "plots/*.mp4"),
    *("*.tmp", "fields/*.tmp", "phases/*.tmp", "plots/*.tmp"),
)
META = "__meta__"
PATIENCE = 3.0  # seconds to wait for a directory whose last run is just being killed


class RunDirectory:
    """Files of the run in `path`; `precision` (Float32, Float64) is that of the fields on disk: `fields` at the output times, `phases`."""

    def __init__(self, path: str | Path, precision: str = "Float32"):
        self.path = Path(path)
        self.fields = Series(self.path, "fields", precision)
        self.phases = Series(self.path, "phases", precision)
        self._history: History | None = None
        self._lock: IO[bytes] | None = None

    @property
    def log(self) -> Path:
        return self.path / "run.log"

    @property
    def pvd(self) -> Path:
        return self.fields.pvd

    @property
    def plots(self) -> Path:
        return self.path / "plots"

    def prepare(self, resume: bool = False, overwrite: bool = False) -> None:
        """Create the directory and keep other runs out of it until `release`; refuse one that holds files, unless they are to be resumed
        or overwritten.

        `overwrite` removes the files of an earlier run (those in this module's table) and nothing else.
        Raises InputError, also when the directory cannot be written or another run is at work in it.
        """
        try:
            if self.path.is_dir() and any(self.path.iterdir()) and not (resume or overwrite):
                raise InputError(
                    f"{self.path}: not empty; --resume goes on with the run in it, --overwrite replaces it, "
                    "-o DIR or --name auto takes another directory"
                )
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock = lock(self.log, PATIENCE)
            if overwrite:
                self._remove_own_files()
        except BlockingIOError:
            raise InputError(f"{self.path}: another run is at work in this directory") from None
        except OSError as error:
            self.release()
            if error.errno in FULL:
                raise
            raise InputError(f"{self.path}: cannot be used as output directory ({error.strerror})") from error

    def release(self) -> None:
        """Let other runs into the directory; a log in which nothing has been written goes."""
        if self._lock is not None:
            if os.fstat(self._lock.fileno()).st_size == 0:
                self.log.unlink(missing_ok=True)
            self._lock.close()
            self._lock = None

    def _remove_own_files(self) -> None:
        for name in OWN_FILES:
            (self.path / name).unlink(missing_ok=True)
        for pattern in OWN_PATTERNS:
            for path in self.path.glob(pattern):
                path.unlink()
        os.truncate(self.log, 0)  # not removed: it carries the lock
        self.fields.forget()
        self.phases.forget()
        self._history = None

    def write_case(self, text: str) -> None:
        """Write `case.toml`."""
        write_atomically(self.path / "case.toml", text)

    def write_origin(self, origins: Mapping[str, str]) -> None:
        """Write `origin.json`: where each value of `case.toml` comes from, by dotted key (`mpm.case.keys.Value.origin`)."""
        write_atomically(self.path / "origin.json", json.dumps(origins, indent=1) + "\n")

    def read_origin(self) -> dict[str, str]:
        """Contents of `origin.json`; empty when there is none."""
        path = self.path / "origin.json"
        return load_json(path) if path.exists() else {}

    # ------------------------------------------------------------------ fields

    @property
    def steps(self) -> list[tuple[float, str]]:
        """Time [s] and file name of the fields written so far, relative to the directory."""
        return self.fields.steps

    def write_fields(self, time: float, grid: Grid, cell_data: Mapping[str, ArrayLike]) -> None:
        """Write the fields of one output time and list it in `fields.pvd`, see `Series.write`."""
        self.fields.write(time, grid, cell_data)

    def read_fields(self, index: int = -1, wanted: Collection[str] | None = None) -> vtu.Snapshot:
        """One of the time steps listed in `fields.pvd`, the last one by default, see `Series.read`."""
        return self.fields.read(index, wanted)

    # ------------------------------------------------------------------ history and summary

    @property
    def table(self) -> History:
        """`history.csv`."""
        if self._history is None:
            self._history = History(self.path / "history.csv")
        return self._history

    def append_history(self, row: Mapping[str, float | None]) -> None:
        """Add a row to `history.csv`, see `History.append`."""
        self.table.append(row)

    def history(self) -> dict[str, NDArray[np.float64]]:
        """Columns of `history.csv`; NaN where a cell is empty."""
        return self.table.by_column()

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write `summary.json`; what could not be computed (None, not finite) is dropped."""
        write_atomically(self.path / "summary.json", json_text(summary, "summary.json", _left_out), sync=True)

    def write_flux(self, profiles: Mapping[str, NDArray[np.float64]]) -> None:
        """Write `flux.csv`, columns of equal length (`mpm.flow.numbers.flux_profiles`)."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(profiles)
        writer.writerows(zip(*(map(repr, map(float, column)) for column in profiles.values()), strict=True))
        write_atomically(self.path / "flux.csv", text.getvalue())

    def read_summary(self) -> dict[str, Any] | None:
        """Contents of `summary.json`, None when there is none."""
        path = self.path / "summary.json"
        return load_json(path) if path.exists() else None

    # ------------------------------------------------------------------ restart

    def write_checkpoint(self, arrays: Mapping[str, ArrayLike], meta: Mapping[str, Any]) -> None:
        """Replace `checkpoint.npz`: named arrays in full precision, and `meta`, which must be JSON (numbers exact).

        The tables are flushed to the disk first: a state must never count rows that a power failure takes away. Raises ConvergenceError
        when an array is not finite; the old state stays.
        """
        for name, values in arrays.items():
            check_finite(values, f"checkpoint.npz: {name}")
        for path in (self.table.path, self.fields.pvd, self.phases.pvd):
            if path.exists():
                flush(path)
        text = json.dumps(plain(meta, "checkpoint.npz", _refused), allow_nan=False)
        stored: dict[str, Any] = {name: np.asarray(values) for name, values in arrays.items()}
        stored[META] = np.frombuffer(text.encode(), dtype=np.uint8)
        with writing(self.path / "checkpoint.npz", sync=True) as stream:
            np.savez(stream, **stored)

    def read_checkpoint(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]] | None:
        """Arrays and meta of the last restart state, None when there is none."""
        path = self.path / "checkpoint.npz"
        if not path.exists():
            return None
        arrays = load_arrays(path, "a checkpoint of mpm")
        try:
            meta = json.loads(arrays.pop(META).tobytes())
        except (KeyError, ValueError) as error:
            raise InputError(f"{path}: not a checkpoint of mpm (no {META})") from error
        return arrays, meta

    def cut_back(self, rows: int, time: float, *, cycle: float = math.inf) -> None:
        """Drop all but the first `rows` output times, those of the restart state at `time` [s]; later output continues the numbering.

        Of the phases those from `cycle` [s], where the last cycle begins, up to the restart state stay. Files that the lists do not name
        any more, unfinished ones, and the summary of an earlier end are deleted. Raises InputError when a table is damaged or lacks some
        of those rows, before anything is changed.
        """
        _ = self.steps, self.phases.steps  # read both lists before anything is changed
        self.table.cut_back(rows, time)
        self.fields.keep(lambda place, _: place < rows)
        self.phases.keep(lambda _, written: cycle < written <= time)
        for name in ("summary.json", "flux.csv"):
            (self.path / name).unlink(missing_ok=True)
        for path in self.path.glob("*.tmp"):
            path.unlink()


def _left_out(where: str, number: float) -> None:
    log.warning("%s is %g, left out", where, number)


def _refused(where: str, number: float) -> None:
    raise MpmError(f"{where} is {number}")
