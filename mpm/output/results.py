"""A finished run, read back from the files in its directory alone."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.arrays import Floats
from mpm.case.case import Case, load_case
from mpm.case.kinds import RUN, kind_of_directory, what_it_is
from mpm.errors import InputError, MpmError
from mpm.mesh.grid import Grid
from mpm.output.directory import RunDirectory
from mpm.output.vtu import Snapshot, grid_points, grid_quads


@dataclass(frozen=True, eq=False)
class Run:
    """What the directory of a run holds."""

    directory: RunDirectory
    case: Case
    grid: Grid
    history: Mapping[str, Floats]
    summary: Mapping[str, Any]
    steps: Sequence[tuple[float, str]]
    """Time [s] and file of the stored fields."""
    origins: Mapping[str, str]
    """Where each value of the case came from when the run was started, by dotted key (`mpm.case.keys.Value.origin`)."""

    @property
    def times(self) -> list[float]:
        """Times of the stored fields [s]."""
        return [time for time, _ in self.steps]

    def snapshot(self, index: int = -1, wanted: Collection[str] | None = None) -> Snapshot:
        """The stored fields of one time, all or those that are `wanted`. Raises InputError when its file is missing, cut, or of another
        mesh."""
        file = self.directory.path / self.steps[index][1]
        try:
            found = self.directory.read_fields(index, wanted)
        except OSError as error:
            raise InputError(f"{file}: {error.strerror}") from None
        if len(found.quads) != self.grid.cells:
            raise InputError(
                f"{file}: found {len(found.quads)} cells; accepted: the {self.grid.cells} of case.toml"
            )
        return found

    def field(self, snapshot: Snapshot, name: str) -> Floats:
        """A cell field as (rows, columns), bottom row first; of a vector (rows, columns, 2). Raises InputError with the nearest name."""
        if name not in snapshot.cell_data:
            known = list(snapshot.cell_data)
            raise InputError.at(
                self.directory.pvd, "field", repr(name), ", ".join(known), known=known, given=name
            )
        values = snapshot.cell_data[name].astype(float)
        shape = (self.grid.rows, self.grid.columns)
        return values.reshape(shape) if values.ndim == 1 else values[:, :2].reshape(*shape, 2)


@dataclass(frozen=True, eq=False, repr=False)
class LastInstant(Run):
    """A run that has no directory: what is in memory at its end."""

    held: Snapshot

    @classmethod
    def of(
        cls,
        case: Case,
        grid: Grid,
        history: Mapping[str, Floats],
        summary: Mapping[str, Any],
        fields: Mapping[str, Floats],
        time: float,
    ) -> LastInstant:
        """`fields`: those of the last instant, at `time` [s], in the grid's order."""
        points, quads = grid_points(grid.x, grid.y), grid_quads(grid.columns, grid.rows)
        held = Snapshot(points, quads, dict(fields), time)
        where = RunDirectory("last instant")
        return cls(where, case, grid, history, summary, [(time, "")], {}, held)

    def snapshot(self, index: int = -1, wanted: Collection[str] | None = None) -> Snapshot:
        """The last instant, the only one."""
        return self.held


def load_run(directory: str | Path, say: Callable[[str], None] | None = None) -> Run:
    """Read a run's directory. Raises InputError when it is not one, or a file in it is damaged.

    With `say`, a damaged file that the rest can do without is named to it and counts as missing.
    """
    path = Path(directory)
    if kind_of_directory(path) is not RUN:
        raise InputError.at(path, "", what_it_is(path), "the directory of a run")
    files = RunDirectory(path)
    case = load_case(path / "case.toml")

    def unless_damaged[T](read: Callable[[], T], otherwise: T) -> T:
        try:
            return read()
        except (MpmError, OSError, ValueError) as error:
            if say is None:
                raise
            say(str(error))
            return otherwise

    history: dict[str, Floats] = unless_damaged(files.history, {})
    summary = unless_damaged(files.read_summary, None) or {}
    steps: list[tuple[float, str]] = unless_damaged(lambda: files.steps, [])
    origins: dict[str, str] = unless_damaged(files.read_origin, {})
    return Run(files, case, Grid.from_case(case), history, summary, steps, origins)
