"""Fields on disk at several times: `<name>.pvd` lists the files `<name>/<name>_*.vtu`, all on one grid of cells."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpm.errors import ConvergenceError, InputError
from mpm.files import write_atomically
from mpm.output import vtu

if TYPE_CHECKING:
    from mpm.mesh.grid import Grid


class Mesh(NamedTuple):
    """What a file says of its grid: points (n, 3) [m], corners of the cells (cells, 4), numbers of their zones and layers (cells,)."""

    points: NDArray[np.float64]
    quads: NDArray[np.int32]
    zone: NDArray[np.int32]
    layer: NDArray[np.int32]

    @classmethod
    def of(cls, grid: Grid, displacement: Sequence[float]) -> Mesh:
        """Arrays that nobody can change: the same ones need to be packed only once."""
        made = cls(
            vtu.grid_points(grid.x, grid.y, displacement),
            vtu.grid_quads(grid.columns, grid.rows),
            np.tile(grid.zone_of_column, grid.rows).astype(np.int32),
            np.repeat(grid.row_layer, grid.columns).astype(np.int32),
        )
        for array in made:
            array.flags.writeable = False
        return made


class Series:
    """The series `name` in the directory of a run; `precision` (Float32, Float64) is that of the fields on disk."""

    def __init__(self, directory: Path, name: str, precision: str):
        self.directory, self.name, self.precision = directory, name, precision
        self._steps: list[tuple[float, str]] | None = None
        self._packer, self._unpacker = vtu.Packer(), vtu.Unpacker()
        self._written: tuple[Grid, tuple[float, ...], Mesh] | None = None  # the mesh of the last file

    @property
    def pvd(self) -> Path:
        return self.directory / f"{self.name}.pvd"

    @property
    def steps(self) -> list[tuple[float, str]]:
        """Time [s] and file name of what has been written so far, relative to the directory."""
        if self._steps is None:
            listed = vtu.read_pvd(self.pvd)
            self._steps = [(time, str(path.relative_to(self.directory))) for time, path in listed]
        return self._steps

    def write(
        self,
        time: float,
        grid: Grid,
        cell_data: Mapping[str, ArrayLike],
        displacement: Sequence[float] = (0.0, 0.0),
        number: int | None = None,
    ) -> None:
        """Write one time and list it.

        `cell_data`: name -> (cells,) or (cells, 2), cells in the grid's order. `zone` and `layer` (numbers, see
        `Grid`) are added. `displacement` [m] of the reactor moves the points of this time. `number` goes into the file's name, by default
        how many there were before.
        """
        name = f"{self.name}/{self.name}_{len(self.steps) if number is None else number:06d}.vtu"
        mesh = self._mesh(grid, tuple(displacement))
        for key, values in cell_data.items():
            check_finite(values, f"{name}: {key}")
        data = {"zone": mesh.zone, "layer": mesh.layer, **cell_data}
        content = vtu.encode_vtu(mesh.points, mesh.quads, data, float(time), self.precision, self._packer)
        (self.directory / self.name).mkdir(exist_ok=True)
        write_atomically(self.directory / name, content)
        self.steps.append((float(time), name))
        vtu.add_to_pvd(self.pvd, self.steps)

    def _mesh(self, grid: Grid, displacement: tuple[float, ...]) -> Mesh:
        """That of a time; the last one where that is the same."""
        if self._written is None or self._written[0] is not grid or self._written[1] != displacement:
            self._written = grid, displacement, Mesh.of(grid, displacement)
        return self._written[2]

    def read(self, index: int = -1, wanted: Collection[str] | None = None) -> vtu.Snapshot:
        """One of the listed times, the last one by default; of its cells' data all, or those that are `wanted`."""
        if not self.steps:
            raise InputError(f"{self.pvd}: no {self.name} have been written")
        return vtu.read_vtu(self.directory / self.steps[index][1], self._unpacker, wanted)

    def keep(self, wanted: Callable[[int, float], bool]) -> None:
        """Keep the times whose place in the list and time [s] are `wanted`; files that are then listed no more, or unfinished, go."""
        kept = [step for place, step in enumerate(self.steps) if wanted(place, step[0])]
        if not kept:
            self.pvd.unlink(missing_ok=True)
        elif kept != self.steps:
            write_atomically(self.pvd, vtu.encode_pvd(kept))
        self._steps = kept
        listed = {self.directory / name for _, name in kept}
        folder = self.directory / self.name
        for path in [*folder.glob(f"{self.name}_*.vtu"), *folder.glob("*.tmp")]:
            if path not in listed:
                path.unlink()

    def forget(self) -> None:
        """Read the list anew when it is next asked for: the files have been removed."""
        self._steps = None


def check_finite(values: ArrayLike, name: str) -> None:
    """Raise ConvergenceError when a number is not one."""
    array = np.asarray(values)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise ConvergenceError(f"{name} is not finite; nothing of it has been written")
