"""gmsh's mesh, the .msh file through meshio, and the periodic topology in dolfinx."""

import signal
from pathlib import Path

import meshio
import numpy as np
import pytest

from mpm.case.case import Case
from mpm.errors import InputError
from mpm.mesh.grid import Grid
from mpm.mesh.msh import build_mesh, read_msh, write_msh
from mpm.mesh.strip import BOTTOM, LEFT, RIGHT, TOP, Strip, cell_nodes, node_places
from mpm.parallel import total

from .cases import COARSE, MPI, TINY, cycle, zone

COMM = MPI.COMM_WORLD
GRADED = {**COARSE, "geometry.layer.headspace.grading": 8.0, "geometry.layer.plenum.grading": 0.25}


@pytest.mark.parametrize("periodic", [True, False])
def test_gmsh_gives_the_cells_that_the_solver_makes(periodic: bool) -> None:
    """Fails when the file of `mpm mesh` is another mesh than that of a run: a node elsewhere, cells in another order or joined otherwise, a
    layer's group that is not the layer."""
    case = zone({"geometry.periodic": periodic}, GRADED)
    grid, quads = Grid.from_case(case), build_mesh(case)
    cells, places = cell_nodes(grid), node_places(grid)
    found = quads.points[quads.cells]
    seam = np.isclose(found[:, :, 0], grid.x[-1]) & periodic
    found[seam, 0] = 0.0
    np.testing.assert_allclose(found, places[cells], atol=1e-9)
    pairs = np.unique(np.column_stack([quads.cells[~seam], cells[~seam]]), axis=0)
    assert len(pairs) == len(np.unique(pairs[:, 0])) == len(places)
    assert np.array_equal(quads.layer, np.repeat(grid.row_layer, grid.columns))


@pytest.mark.parametrize(
    ("height", "grading", "rows"),
    [
        ("12.7 mm", 100.0, 2),
        ("12.7 mm", 100.0, 10),
        ("12.7 mm", 100.0, 100),
        ("12.7 mm", 0.01, 10),
        ("30 nm", 1.0, 2),
    ],
)
def test_what_a_case_accepts_can_be_meshed(height: str, grading: float, rows: int) -> None:
    """Fails when a layer at the limits of what is accepted, steep or thin, is refused when the run has begun."""
    layer = "geometry.layer.headspace"
    case = zone({f"{layer}.height": height, f"{layer}.grading": grading, f"{layer}.cells": rows}, TINY)
    assert len(build_mesh(case).cells) == Grid.from_case(case).cells


@pytest.mark.parametrize("case", [zone(), cycle(), zone(mesh=GRADED)], ids=["zone", "cycle", "graded"])
def test_ports_are_named_groups(case: Case) -> None:
    """Fails when the group of a port misses a facet that the port covers in part, or holds one it does not touch."""
    grid, quads = Grid.from_case(case), build_mesh(case)
    for port in (*case.geometry.inlets, *case.geometry.outlets):
        assert np.array_equal(quads.ports[port.name], np.flatnonzero(grid.overlap(port) > 0.0)), port.name


def test_msh_file_comes_back(tmp_path: Path) -> None:
    """Fails when the written .msh is not readable by meshio, lacks a physical name, or reads back as another mesh."""
    case, path = zone(mesh=GRADED), tmp_path / "zone.msh"
    written, back = write_msh(case, path), read_msh(case, path)
    np.testing.assert_allclose(back.points[back.cells], written.points[written.cells], atol=1e-12)
    assert np.array_equal(back.layer, written.layer)
    assert {k: v.tolist() for k, v in back.ports.items()} == {k: v.tolist() for k, v in written.ports.items()}
    raw = meshio.read(path)
    layers, ports = {"plenum", "frit", "bed", "headspace"}, {"purge", "tma", "zone1"}
    assert layers | ports | {"bottom_wall", "top_wall", "left", "right"} <= set(raw.cell_sets)
    assert sum(len(b.data) for b in raw.cells if b.type == "quad") == Grid.from_case(case).cells


def test_mesh_files_that_cannot_be_used(tmp_path: Path) -> None:
    """Fails when a wrong suffix, a missing directory or file, junk, or the mesh of another case is accepted or ends in a traceback."""
    case = zone()
    with pytest.raises(InputError, match=r"must end in \.msh"):
        write_msh(case, tmp_path / "zone.vtk")
    with pytest.raises(InputError, match="no such directory"):
        write_msh(case, tmp_path / "nowhere" / "zone.msh")
    with pytest.raises(InputError, match="no such mesh file"):
        read_msh(case, tmp_path / "zone.msh")
    junk = tmp_path / "junk.msh"
    junk.write_text("not a mesh\n")
    with pytest.raises(InputError, match="not a readable gmsh file"):
        read_msh(case, junk)
    write_msh(case, tmp_path / "zone.msh")
    with pytest.raises(InputError, match="cells, the case"):
        read_msh(zone({"geometry.layer.bed.cells": 5}), tmp_path / "zone.msh")
    with pytest.raises(InputError, match="not the case's grid"):
        read_msh(zone({"geometry.layer.headspace.height": "12 mm"}), tmp_path / "zone.msh")


def test_gmsh_leaves_ctrl_c_to_python() -> None:
    """Fails when meshing takes SIGINT away: Ctrl-C would no longer end a run in order."""
    before = signal.getsignal(signal.SIGINT)
    build_mesh(zone())
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parallel
def test_periodic_topology() -> None:
    """Fails when the strip does not close on itself: facets and vertices must be those of a cylinder, on any number of ranks."""
    strip = Strip(zone(), COMM)
    grid, topology = strip.grid, strip.mesh.topology
    topology.create_connectivity(0, 2)
    assert topology.index_map(2).size_global == grid.cells
    assert topology.index_map(1).size_global == grid.cells + (grid.rows + 1) * grid.columns
    assert topology.index_map(0).size_global == (grid.rows + 1) * grid.columns
    assert len(strip.end_facets()) == 0


@pytest.mark.parallel
def test_walls_instead_of_periodic_gas() -> None:
    """Fails when `periodic = false` still glues the ends, or misses one of their facets."""
    strip = Strip(zone({"geometry.periodic": False}), COMM)
    grid, topology = strip.grid, strip.mesh.topology
    assert (
        topology.index_map(1).size_global == grid.rows * (grid.columns + 1) + (grid.rows + 1) * grid.columns
    )
    assert total(COMM, [len(strip.end_facets())])[0] == 2 * grid.rows


@pytest.mark.parallel
def test_neighbours_and_places() -> None:
    """Fails when a face joins the wrong cells (above all across the seam), or a cell's geometry is not its place in the grid."""
    strip = Strip(zone(mesh=GRADED), COMM)
    grid, faces = strip.grid, strip.faces
    behind, ahead = strip.cell[faces.behind], strip.cell[faces.ahead]
    up = faces.vertical_flow
    assert np.array_equal(ahead[up], behind[up] + grid.columns)
    row, column = np.divmod(behind[~up], grid.columns)
    assert np.array_equal(ahead[~up], row * grid.columns + (column + 1) % grid.columns)
    mine = faces.behind < strip.owned
    count = total(COMM, [np.count_nonzero(mine & up), np.count_nonzero(mine & ~up)])
    assert count.tolist() == [(grid.rows - 1) * grid.columns, grid.cells]

    corners = strip.mesh.geometry.x[strip.mesh.geometry.dofmaps[0]][strip.mesh_cell]
    expected = np.column_stack([grid.x[strip.column], grid.y[strip.row], 0.0 * strip.row])
    np.testing.assert_allclose(corners[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(corners[:, 3, 0] - corners[:, 0, 0], grid.dx, rtol=1e-6)
    np.testing.assert_allclose(corners[:, 3, 1] - corners[:, 0, 1], strip.height, rtol=1e-6)


@pytest.mark.parallel
def test_local_facets_are_bottom_left_right_top() -> None:
    """Fails when dolfinx numbers a cell's facets otherwise than the solver assumes: velocities would be read from the wrong sides."""
    strip = Strip(zone(mesh=TINY), COMM)
    facet_of = {side: strip.facets[:, side] for side in (BOTTOM, LEFT, RIGHT, TOP)}
    right_of = dict(zip(strip.cell, facet_of[RIGHT], strict=True))
    top_of = dict(zip(strip.cell, facet_of[TOP], strict=True))
    columns = strip.grid.columns
    for cell, left, bottom in zip(strip.cell, facet_of[LEFT], facet_of[BOTTOM], strict=True):
        row, column = divmod(int(cell), columns)
        neighbour = row * columns + (column - 1) % columns
        assert right_of.get(neighbour, left) == left
        assert top_of.get(cell - columns, bottom) == bottom


@pytest.mark.parallel
def test_every_cell_has_one_owner_and_scatter_orders_them() -> None:
    """Fails when gathering loses, repeats or misplaces a cell."""
    strip = Strip(zone(mesh=TINY), COMM)
    whole = strip.scatter.to_all(strip.cell[: strip.owned].astype(float))
    assert np.array_equal(whole, np.arange(strip.grid.cells))
    assert np.array_equal(strip.scatter.to_local(whole), strip.cell[: strip.owned])
