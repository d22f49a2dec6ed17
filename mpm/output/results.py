"""A finished run, read back from the files in its directory alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.case.case import Case, load_case
from mpm.case.kinds import RUN, kind_of_directory, what_it_is
from mpm.errors import InputError, MpmError
from mpm.mesh.grid import Grid
from mpm.output.directory import RunDirectory
from mpm.output.vtu import Snapshot, grid_points, grid_quads

if TYPE_CHECKING:
    from mpm.case.case import Inlet

Floats = NDArray[np.float64]


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

    def snapshot(self, index: int = -1) -> Snapshot:
        """One of the stored fields. Raises InputError when its file is missing, cut, or of another mesh."""
        file = self.directory.path / self.steps[index][1]
        try:
            found = self.directory.read_fields(index)
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

    def snapshot(self, index: int = -1) -> Snapshot:
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


def fed_by(inlet: Inlet, species: Sequence[str]) -> list[str]:
    """Those of the `species` that an inlet feeds, in their order."""
    return [name for name in species if inlet.mass_fractions.get(name, 0.0) > 0.0]


def dosing_inlets(case: Case) -> list[Inlet]:
    """Inlets that feed a species of the mechanism."""
    return [inlet for inlet in case.geometry.inlets if fed_by(inlet, case.mechanism.species_names)]


def fed_species(case: Case) -> list[str]:
    """Species fed by any inlet, in the mechanism's order."""
    fed = {name for inlet in case.geometry.inlets for name in fed_by(inlet, case.mechanism.species_names)}
    return [name for name in case.mechanism.species_names if name in fed]


def sites_made_by(case: Case, inlet: Inlet) -> tuple[str, ...]:
    """Site species whose coverage this inlet's titration counts; empty when nothing it feeds reacts on the surface."""
    species = case.mechanism.precursor(inlet.mass_fractions)
    return () if species is None else case.mechanism.titrated_sites(species)


def made_sites(case: Case) -> list[str]:
    """Site species worth a map: of two that add up to one, the one the first dosing inlet makes."""
    made = list(dict.fromkeys(site for inlet in dosing_inlets(case) for site in sites_made_by(case, inlet)))
    return made[:1] if len(case.mechanism.site_names) == 2 else made
