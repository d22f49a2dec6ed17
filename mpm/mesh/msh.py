"""The strip as a gmsh file, for other programs: transfinite quadrilaterals with the layers and ports as physical groups.

One rectangle per layer; the bottom and top walls are split at the columns that a port touches, so that a port's group holds every
facet it covers, wholly or in part (the share itself is `Grid.overlap`). A run makes the same cells from the grid (`mpm.mesh.strip`).
"""

from __future__ import annotations

import errno
import itertools
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.case.geometry import WALLS
from mpm.errors import InputError
from mpm.files import replacing
from mpm.mesh.grid import Grid

if TYPE_CHECKING:
    from mpm.case.case import Case

END = b"$EndElements\n"  # of a .msh file without periodic parts or data
LINE, QUADRILATERAL = 1, 3  # gmsh's element types
Blocks = list[tuple[str, NDArray[np.int64]]]
Lines = dict[str, NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class QuadMesh:
    """Quadrilaterals in the grid's order, corners as lower left, lower right, upper left, upper right.

    `points` (n, 2) [m]; `cells` (cells, 4); `layer` (cells,) index into `layer_names`; `ports` maps a port's name to its columns.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    layer: NDArray[np.int64]
    layer_names: tuple[str, ...]
    ports: dict[str, NDArray[np.int64]]


def build_mesh(case: Case, path: Path | None = None) -> QuadMesh:
    """Mesh the strip of `case` with gmsh and, when asked, write it to `path` (.msh 4.1).

    Raises InputError when gmsh cannot write `path`.
    """
    grid = Grid.from_case(case)
    with _gmsh_model(case.title) as gmsh:
        _draw(gmsh, case, grid)
        gmsh.model.mesh.generate(2)
        if path is not None:
            _write(gmsh, path)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        points = np.zeros((int(tags.max()) + 1, 2))
        points[tags.astype(np.int64)] = coordinates.reshape(-1, 3)[:, :2]
        blocks: Blocks = []
        lines: Lines = {}
        for dim, tag in gmsh.model.getPhysicalGroups():
            name = gmsh.model.getPhysicalName(dim, tag)
            entities = gmsh.model.getEntitiesForPhysicalGroup(dim, tag)
            kind = QUADRILATERAL if dim == 2 else LINE
            nodes = np.concatenate([_element_nodes(gmsh, dim, entity, kind) for entity in entities])
            if dim == 2:
                blocks.append((name, nodes))
            else:
                lines[name] = nodes
    return _in_grid_order(grid, points, blocks, lines)


def _write(gmsh: Any, path: Path) -> None:
    """Write gmsh's mesh to `path`. gmsh does not notice when the disk is full; then the end of the file is missing."""
    with replacing(path, ".tmp.msh") as aside:
        try:
            gmsh.write(str(aside))
        except Exception as error:  # gmsh raises bare Exception
            raise InputError(
                f"{path}: cannot write the mesh: {str(error).replace(aside.name, path.name)}"
            ) from error
        with open(aside, "rb") as stream:
            stream.seek(max(aside.stat().st_size - len(END), 0))
            if stream.read() != END:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def write_msh(case: Case, path: Path) -> QuadMesh:
    """Mesh `case` and write the gmsh file `path`."""
    if path.suffix != ".msh":
        raise InputError(f"{path}: the mesh file must end in .msh")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no such directory {path.parent}")
    return build_mesh(case, path)


def read_msh(case: Case, path: Path) -> QuadMesh:
    """Read a .msh file back (through meshio) and check that it is the mesh of `case`."""
    import meshio

    if not path.is_file():
        raise InputError(f"{path}: no such mesh file")
    try:
        raw = meshio.gmsh.read(path)  # meshio.read ends the whole program when it fails
    except (meshio.ReadError, ValueError, IndexError, KeyError) as error:
        raise InputError(f"{path}: not a readable gmsh file ({error})") from error
    blocks: Blocks = []
    lines: Lines = {}
    for name, per_block in raw.cell_sets.items():
        for block, members in zip(raw.cells, per_block, strict=True):
            if members is None or not len(members) or name.startswith("gmsh:"):
                continue
            if block.type == "quad":
                blocks.append((name, block.data[members]))
            elif block.type == "line":
                nodes = block.data[members]
                lines[name] = np.vstack([lines[name], nodes]) if name in lines else nodes
    return _in_grid_order(Grid.from_case(case), raw.points[:, :2], blocks, lines)


@contextmanager
def _gmsh_model(title: str) -> Iterator[Any]:
    import gmsh

    gmsh.initialize(interruptible=False)  # the default takes SIGINT away from Python
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.model.add(title)
        yield gmsh
    finally:
        gmsh.finalize()


def _draw(gmsh: Any, case: Case, grid: Grid) -> None:
    """Rectangles, transfinite curves and surfaces, physical groups."""
    geo = gmsh.model.geo
    layers = case.geometry.layers
    edges = [float(grid.y[grid.layer_rows(name).start]) for name in grid.layer_names] + [float(grid.y[-1])]
    ports = [*case.geometry.inlets, *case.geometry.outlets]
    levels = []
    groups: dict[str, list[int]] = {}
    for level, y in enumerate(edges):
        side = {0: "bottom", len(layers): "top"}.get(level)
        spans = {
            port.name: np.flatnonzero(grid.overlap(port) > 0.0)
            for port in ports
            if side and port.side == side
        }
        breaks = sorted(
            {0, grid.columns, *(int(c[0]) for c in spans.values()), *(int(c[-1]) + 1 for c in spans.values())}
        )
        points = [geo.addPoint(float(grid.x[b]), y, 0.0) for b in breaks]
        curves = []
        for (first, last), (a, b) in zip(_pairs(breaks), _pairs(points), strict=True):
            curve = geo.addLine(a, b)
            geo.mesh.setTransfiniteCurve(curve, last - first + 1)
            curves.append(curve)
            for name, columns in spans.items():
                if columns[0] <= first and last <= columns[-1] + 1:
                    groups.setdefault(name, []).append(curve)
            if side and not any(c[0] <= first and last <= c[-1] + 1 for c in spans.values()):
                groups.setdefault(f"{side}_wall", []).append(curve)
        levels.append((points, curves))
    surfaces = {}
    sides: dict[str, list[int]] = {"left": [], "right": []}
    for layer, (below, above) in zip(layers, _pairs(levels), strict=True):
        left, right = geo.addLine(below[0][0], above[0][0]), geo.addLine(below[0][-1], above[0][-1])
        ratio = layer.grading ** (1.0 / max(layer.cells - 1, 1))
        for name, curve in (("left", left), ("right", right)):
            geo.mesh.setTransfiniteCurve(curve, layer.cells + 1, "Progression", ratio)
            sides[name].append(curve)
        loop = geo.addCurveLoop([*below[1], right, *(-c for c in reversed(above[1])), -left])
        surface = geo.addPlaneSurface([loop])
        geo.mesh.setTransfiniteSurface(
            surface, "Left", [below[0][0], below[0][-1], above[0][-1], above[0][0]]
        )
        geo.mesh.setRecombine(2, surface)
        surfaces[layer.name] = surface
    geo.synchronize()
    for name, surface in surfaces.items():
        gmsh.model.addPhysicalGroup(2, [surface], name=name)
    for name, curves in {**groups, **sides}.items():
        gmsh.model.addPhysicalGroup(1, curves, name=name)


def _pairs[Item](items: list[Item]) -> list[tuple[Item, Item]]:
    return list(itertools.pairwise(items))


def _element_nodes(gmsh: Any, dim: int, entity: int, kind: int) -> NDArray[np.int64]:
    types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
    if list(types) != [kind]:
        raise InputError(f"gmsh made elements of type {list(types)} where only type {kind} was asked for")
    return np.asarray(nodes[0], dtype=np.int64).reshape(-1, 4 if kind == QUADRILATERAL else 2)


def _in_grid_order(
    grid: Grid,
    points: NDArray[np.float64],
    blocks: Blocks,
    lines: Lines,
) -> QuadMesh:
    """Sort cells and corners into the grid's numbering and check them against the grid's edges."""
    names = grid.layer_names
    cells = np.vstack([nodes for _, nodes in blocks])
    layer = np.concatenate([np.full(len(nodes), names.index(name)) for name, nodes in blocks])
    centres = points[cells].mean(axis=1)
    column = np.searchsorted(grid.x, centres[:, 0]) - 1
    row = np.searchsorted(grid.y, centres[:, 1]) - 1
    order = np.argsort(row * grid.columns + column)
    cells, layer = cells[order], layer[order]
    corners = points[cells]
    # lower left first: sort corners by y, then by x, relative to the cell's centre
    above = corners[:, :, 1] > corners[:, :, 1].mean(axis=1, keepdims=True)
    right = corners[:, :, 0] > corners[:, :, 0].mean(axis=1, keepdims=True)
    cells = np.take_along_axis(cells, np.argsort(2 * above + right, axis=1), axis=1)
    _check(grid, points[cells], len(cells), layer)
    used, compact = np.unique(cells, return_inverse=True)
    ports = {
        name: np.unique(np.searchsorted(grid.x, points[nodes].mean(axis=1)[:, 0]) - 1)
        for name, nodes in lines.items()
        if name not in WALLS
    }
    return QuadMesh(points[used], compact.reshape(cells.shape), layer, names, ports)


def _check(grid: Grid, corners: NDArray[np.float64], count: int, layer: NDArray[np.int64]) -> None:
    if count != grid.cells:
        raise InputError(f"the mesh has {count} cells, the case {grid.cells}")
    x = corners[:, :, 0].reshape(grid.rows, grid.columns, 4)
    y = corners[:, :, 1].reshape(grid.rows, grid.columns, 4)
    off = max(
        np.abs(x[:, :, [0, 2]] - grid.x[None, :-1, None]).max(),
        np.abs(x[:, :, [1, 3]] - grid.x[None, 1:, None]).max(),
        np.abs(y[:, :, [0, 1]] - grid.y[:-1, None, None]).max(),
        np.abs(y[:, :, [2, 3]] - grid.y[1:, None, None]).max(),
    )
    if off > 1e-4 * min(grid.dx, grid.dy.min()):  # gmsh places graded nodes to about 1e-8 of the layer
        raise InputError(f"the mesh is not the case's grid: a node lies {off:.3g} m off")
    if np.any(layer.reshape(grid.rows, grid.columns) != grid.row_layer[:, None]):
        raise InputError("the mesh's layers are not those of the case")
