"""Pictures show the data that the run's directory holds, in the right place and unit."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm, to_hex
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.image import imread

from mpm.case.case import Case, load_case
from mpm.errors import InputError
from mpm.files import file_name
from mpm.mesh.grid import Grid
from mpm.output.directory import RunDirectory
from mpm.output.results import Run, load_run
from mpm.pictures.curves import exit_profile_figure, history_figure, outlets_figure, profile_steps
from mpm.pictures.maps import PLAIN, arrows, map_figure
from mpm.pictures.outline import WIDTH, formula, spread
from mpm.pictures.standard import Fields, draw_field, figures, plot_run

SITE = "OAl(CH3)2"
COVERAGE = f"theta_{SITE}"
TIMES = np.linspace(0.0, 2.0, 9)


def centres(grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(0.5 * (grid.x[1:] + grid.x[:-1]), 0.5 * (grid.y[1:] + grid.y[:-1]))
    return x, y


def theta(grid: Grid, t: float) -> np.ndarray:
    """Different in every cell and at every time."""
    x, y = centres(grid)
    return (0.2 + 0.5 * x / grid.x[-1] + 10.0 * y) * t / 2.0


def write_run(path: Path, case: Case, times: np.ndarray = TIMES) -> Run:
    """A directory as a run leaves it, with made-up numbers."""
    directory = RunDirectory(path, precision="Float64")
    directory.prepare()
    directory.write_case(case.to_toml())
    grid = Grid.from_case(case)
    x, y = centres(grid)
    for t in times:
        data: dict[str, np.ndarray] = {f"theta_{SITE}": theta(grid, t), "theta_OH": 1.0 - theta(grid, t)}
        data |= {f"x_{name}": np.exp(-x / 0.01) * 1e-4 for name in case.fed_species}
        data["cvd_rate"] = 1e-3 * np.exp(-((y / 1e-3) ** 2))
        data["pressure"] = 45.0 + 0.0 * y
        gas = {"velocity": np.full((grid.cells, 2), (-0.03, 0.0))}
        stored = {name: values.ravel() for name, values in data.items()}
        directory.write_fields(float(t), grid, {**stored, **gas})
        row: dict[str, float | None] = {"time": float(t), "balance.TMA": -1e-13 * t, "balance.sites": 0.0}
        for number, inlet in enumerate(case.dosing_inlets):
            row |= {f"titration.{inlet.name}.box_mean": t / (4 + number)}
            row |= {f"titration.{inlet.name}.exit_mean": t / 2}
        for number, outlet in enumerate(case.geometry.outlets):
            row |= {
                f"outlets.{outlet.name}.x.{s}": 1e-6 * t * (number + 1) for s in case.mechanism.species_names
            }
        directory.append_history(row)
    directory.write_summary({"status": "done"})
    return load_run(path)


@pytest.fixture
def zone(tmp_path: Path) -> Run:
    return write_run(tmp_path / "zone", load_case("single_zone", {"geometry.cell_width": "5 mm"}))


@pytest.fixture
def cycle(tmp_path: Path) -> Run:
    return write_run(tmp_path / "cycle", load_case("single_cycle", {"geometry.cell_width": "5 mm"}))


def meshes(axes: Axes) -> list[QuadMesh]:
    return [child for child in axes.get_children() if isinstance(child, QuadMesh)]


def drawn(mesh: QuadMesh) -> np.ma.MaskedArray[Any, Any]:
    values = mesh.get_array()
    assert values is not None
    return np.ma.asarray(values)


def texts(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def test_coverage_map_is_to_scale_and_in_place(zone: Run) -> None:
    """Fails when rows or columns are swapped, gas layers are coloured, units are not mm, or the strip is distorted."""
    figure = map_figure(zone, zone.snapshot(), COVERAGE)
    strip, bed = figure.axes[:2]
    (mesh,) = meshes(strip)
    values = drawn(mesh)
    grid = zone.grid
    porous = np.isin(grid.row_layer, [1, 2])
    assert np.array_equal(np.ma.getmaskarray(values)[:, 0], ~porous)
    assert np.array_equal(values[porous], theta(grid, 2.0)[porous])
    corners = np.asarray(mesh.get_coordinates())
    assert np.allclose(corners[0, :, 0], grid.x * 1e3) and np.allclose(corners[:, 0, 1], grid.y * 1e3)
    assert list(corners[-1, -1]) == pytest.approx([139.7, 12.7]) and mesh.get_clim() == (0.0, 1.0)
    assert strip.get_aspect() == 1.0
    (close,) = meshes(bed)
    assert np.array_equal(drawn(close), theta(grid, 2.0)[grid.layer_rows("bed")])
    assert list(np.asarray(close.get_coordinates())[[0, -1], 0, 1]) == pytest.approx([-3.0, 0.0])


def test_strip_takes_its_share_of_the_page(zone: Run) -> None:
    """Fails when the drawn strip is not 22.29/139.7 as high as wide, or is squeezed by labels to less than 6 inches."""
    figure = map_figure(zone, zone.snapshot(), COVERAGE)
    figure.draw_without_rendering()
    box = figure.axes[0].bbox
    assert box.height / box.width == pytest.approx(22.29 / 139.7, rel=0.01)
    assert 6.0 < box.width / figure.dpi <= WIDTH * 1.2


def test_layers_ports_and_zones_are_drawn(cycle: Run) -> None:
    """Fails when a port is missing or off its place, a layer has no name, or the zones' boundary is not drawn."""
    strip = map_figure(cycle, cycle.snapshot(), COVERAGE).axes[0]
    geometry = cycle.case.geometry
    ports = {
        (round(x[0], 6), round(x[1], 6), y[0])
        for line in strip.get_lines()
        if line.get_gid() == "port"
        for x, y in [(np.asarray(line.get_xdata()), np.asarray(line.get_ydata()))]
    }
    expected = {(round(i.x0 * 1e3, 6), round(i.x1 * 1e3, 6), 0.0) for i in geometry.inlets}
    expected |= {(round(o.x0 * 1e3, 6), round(o.x1 * 1e3, 6), 1.0) for o in geometry.outlets}
    assert ports == expected
    labels = texts(strip)
    for port in [*geometry.inlets, *geometry.outlets]:
        assert f"\u2191 {port.name}" in labels
    for layer in geometry.layers:
        assert any(label.startswith(layer.name) for label in labels)
    lines = [
        np.asarray(line.get_xdata(), dtype=float) for line in strip.get_lines() if line.get_gid() != "port"
    ]
    assert any(np.allclose(x, 139.7) for x in lines)


def test_precursor_map_spans_four_decades(cycle: Run) -> None:
    """Fails when another field is drawn, the scale is linear, or the colour range does not follow the data."""
    for name in ("TMA", "H2O"):
        figure = map_figure(cycle, cycle.snapshot(), f"x_{name}")
        (mesh,) = meshes(figure.axes[0])
        values = drawn(mesh)
        assert np.array_equal(values, cycle.field(cycle.snapshot(), f"x_{name}"))
        low, high = mesh.get_clim()
        assert high == values.max() and high / low == pytest.approx(1e4)
        assert figure.axes[1].get_xlabel() == f"mole fraction of {formula(name)}"
    (mesh,) = meshes(map_figure(cycle, cycle.snapshot(), "cvd_rate").axes[0])
    assert drawn(mesh).max() == cycle.field(cycle.snapshot(), "cvd_rate").max()


def test_an_all_zero_field_can_be_drawn(zone: Run) -> None:
    """Fails when a species that has not arrived yet breaks the logarithmic scale."""
    snapshot = zone.snapshot()
    snapshot.cell_data["x_TMA"] = np.zeros(zone.grid.cells)
    figure = map_figure(zone, snapshot, "x_TMA")
    figure.draw_without_rendering()
    assert drawn(meshes(figure.axes[0])[0]).max() == 0.0


def test_a_constant_has_no_colour_scale(zone: Run) -> None:
    """Fails when a field of one value is drawn in the colours of a range, or the value or its unit is not said."""
    figure = map_figure(zone, zone.snapshot(), "pressure")
    assert len(figure.axes) == 1
    (mesh,) = meshes(figure.axes[0])
    assert mesh.get_cmap()(0.0) == mesh.get_cmap()(1.0) and to_hex(mesh.get_cmap()(0.0)) == PLAIN
    assert figure.get_supxlabel() == "pressure of the gas above the outlets, constant: 45 Pa"


def test_streamlines_point_the_way_of_the_gas(zone: Run) -> None:
    """Fails when lines are no contours of the stream function (here level ones), an arrow points upstream, or nothing explains them."""
    figure = map_figure(zone, zone.snapshot(), "velocity_x", streamlines=True)
    strip = figure.axes[0]
    (lines,) = [child for child in strip.get_children() if isinstance(child, ContourSet)]
    paths = [path for level in lines.allsegs for path in level]
    assert len(paths) > 20 and all(np.ptp(path[:, 1]) < 1e-9 for path in paths)
    bottom, top = 1e3 * zone.grid.y[0], 1e3 * zone.grid.y[-1]  # mm
    assert max(path[0, 1] for path in paths) > top - 0.1 * (top - bottom)
    markers: list[Any] = [line.get_marker() for line in strip.get_lines()]
    angles = [marker[-1] for marker in markers if isinstance(marker, tuple)]
    assert len(angles) > 20 and {(angle + 90.0) % 360.0 for angle in angles} == {180.0}
    assert "lines: streamlines of the gas" in strip.get_title()


def test_arrows_lie_along_stretched_lines(zone: Run) -> None:
    """Fails when an arrow has the gas's angle instead of the line's on a page whose heights are stretched, or points against the gas."""
    grid = zone.grid
    rising: Any = SimpleNamespace(cell_data={"velocity": np.full((grid.cells, 2), 0.01)})
    line = np.array([[40.0, -4.0], [44.0, 0.0]])  # mm
    for path in (line, line[::-1]):
        ((x, y, angle),) = arrows(cast(ContourSet, SimpleNamespace(allsegs=[[path]])), grid, rising, 3.0)
        assert angle == pytest.approx(np.degrees(np.arctan2(3.0, 1.0)))
        assert 40.0 <= x <= 44.0 and y == pytest.approx(x - 44.0)


def test_a_steady_picture_speaks_of_no_time(tmp_path: Path) -> None:
    """Fails when "0 s" stands in a picture of a steady state, or a legend explains a single curve."""
    changes = {"geometry.cell_width": "4 mm", "fidelity": "steady"}
    run = write_run(tmp_path / "x", load_case("single_cycle", changes), TIMES[:1])
    for picture, figure in figures(run):
        words = [figure.get_suptitle(), picture.words, *(axes.get_title() for axes in figure.axes)]
        assert not figure.legends and "steady state" in " ".join(words[0].split())
        assert not [line for line in words if re.search(r"\bt = |\d s\b", line)]


def extended(figure: Figure) -> str:
    """Which ends of the colour bar are pointed: values lie beyond them."""
    (mesh,) = meshes(figure.axes[0])
    assert mesh.colorbar is not None
    return mesh.colorbar.extend


def test_any_field_at_any_time_in_any_range(cycle: Run) -> None:
    """Fails when another time than the nearest is drawn, or the chosen range is not that of the colours in the unit of their label."""
    figure = draw_field(cycle, "theta_OH", time=0.6)
    (mesh,) = meshes(figure.axes[0])
    assert np.array_equal(
        drawn(mesh).compressed()[:5], (1.0 - theta(cycle.grid, 0.5))[drawn(mesh).mask == 0][:5]
    )
    assert figure.get_suptitle().endswith("t = 0.5 s")
    figure = draw_field(cycle, "velocity", clim=(0.0, 5.0))
    (mesh,) = meshes(figure.axes[0])
    assert mesh.get_clim() == (0.0, 5.0) and np.allclose(drawn(mesh), 3.0)
    assert extended(figure) == "neither" and extended(draw_field(cycle, "velocity", clim=(0.0, 2.0))) == "max"
    figure = draw_field(cycle, "x_TMA", clim=(1e-6, 1e-4))
    (mesh,) = meshes(figure.axes[0])
    assert isinstance(mesh.norm, LogNorm) and mesh.get_clim() == (1e-6, 1e-4)
    with pytest.raises(InputError, match=r"found 'theta_HO'.*did you mean theta_OH"):
        draw_field(cycle, "theta_HO")


def by_label(figure: Figure, panel: int) -> dict[str, np.ndarray]:
    return {str(line.get_label()): np.asarray(line.get_ydata()) for line in figure.axes[panel].get_lines()}


def test_history_curves(cycle: Run) -> None:
    """Fails when a curve is missing, is another column's, or a balance error loses its magnitude."""
    figure = history_figure(cycle)
    for panel, inlet in enumerate(cycle.case.dosing_inlets):
        curves = by_label(figure, panel)
        assert np.array_equal(curves.pop("in the bed before the inlet, mean"), TIMES / (4 + panel))
        assert np.array_equal(curves.pop("where solids leave the zone, mean"), TIMES / 2)
        assert not curves and figure.axes[panel].get_xlabel() == "time [s]"
        made, species = (formula(SITE), "TMA") if inlet.name == "tma" else ("OH", formula("H2O"))
        assert figure.axes[panel].get_title() == f"{made}, made by {species} from inlet {inlet.name}"
    balance = by_label(figure, 2)
    assert np.allclose(balance.pop("TMA")[1:], 1e-13 * TIMES[1:]) and not balance
    assert figure.axes[2].get_yscale() == "log" and figure.axes[2].get_xlabel() == "time [s]"
    assert figure.get_suptitle().startswith("Single cycle of TMA and water [cycle]: coverage")
    assert not_drawn(figure) == "Not drawn: balance errors that are zero throughout: surface sites"


def not_drawn(figure: Figure) -> str:
    """The note at the foot of a picture."""
    return figure.get_supxlabel()


def test_nothing_but_zero_is_no_picture(zone: Run) -> None:
    """Fails when a run in which nothing is coated and nothing is out of balance gets empty axes for a history, or outlets of rounding."""
    file = zone.directory.path / "history.csv"
    file.write_text("time,balance.TMA,balance.sites,outlets.zone1.x.TMA\n0.0,0.0,0.0,\n1.0,0.0,0.0,1e-22\n")
    assert pictures_of(zone.directory.path)[0] == ALL - {"history", "outlets"}


def test_outlet_curves(cycle: Run) -> None:
    """Fails when an outlet or a species is missing, or curves of two outlets are exchanged."""
    figure = outlets_figure(cycle)
    for panel, outlet in enumerate(cycle.case.geometry.outlets):
        assert figure.axes[panel].get_title() == f"outlet {outlet.name}"
        curves = by_label(figure, panel)
        assert set(curves) == {formula(name) for name in cycle.case.mechanism.species_names}
        for values in curves.values():
            assert np.allclose(values[1:], 1e-6 * TIMES[1:] * (panel + 1))


def test_an_outlet_legend_names_drawn_curves_alone(cycle: Run) -> None:
    """Fails when a legend has an entry without a curve, or a curve that no logarithmic axis can show is not named."""
    columns = dict(cycle.history)
    columns["outlets.zone1.x.TMA"] = np.zeros(len(TIMES))
    columns["outlets.zone2.x.TMA"] = np.full(len(TIMES), 1e-30)
    figure = outlets_figure(replace(cycle, history=columns))
    (legend,) = figure.legends
    assert {text.get_text() for text in legend.get_texts()} == {
        formula(name) for name in cycle.case.mechanism.species_names if name != "TMA"
    }
    assert not_drawn(figure) == "Not drawn: zero throughout: TMA in zone1; below 4e-12: TMA in zone2"


def test_exit_profile_is_the_last_column_of_the_zone(cycle: Run) -> None:
    """Fails when another column, row order, time or site is drawn."""
    figure = exit_profile_figure(cycle, [cycle.snapshot(k) for k in profile_steps(cycle)])
    grid = cycle.grid
    rows = grid.layer_rows("bed")
    y = 0.5 * (grid.y[1:] + grid.y[:-1])[rows] * 1e3
    inlets = cycle.case.dosing_inlets
    assert [cycle.case.sites_made_by(inlet) for inlet in inlets] == [(SITE,), ("OH",)]
    for panel, column in ((0, grid.columns // 2 - 1), (1, grid.columns - 1)):
        last = figure.axes[panel].get_lines()[-1]
        expected = theta(grid, 2.0)[rows, column]
        assert np.allclose(np.asarray(last.get_xdata()), expected if panel == 0 else 1.0 - expected)
        assert np.allclose(np.asarray(last.get_ydata()), y)
        assert last.get_label() == "2 s" and len(figure.axes[panel].get_lines()) == 5


def test_plot_run_writes_every_picture(cycle: Run) -> None:
    """Fails when a picture is missing, or nothing but background is in it."""
    paths = plot_run(cycle.directory.path)
    names = ["coverage", "map_TMA", "map_H2O", "map_cvd", "speed", "pressure"]
    names += ["exit_profile", "history", "outlets"]
    assert [path.stem for path in paths] == names and {path.parent.name for path in paths} == {"plots"}
    for path in paths:
        pixels = (imread(path)[::5, ::5, :3] * 255).astype(int)
        assert len(np.unique(pixels @ [65536, 256, 1])) > 20


def test_run_without_history_or_fields(tmp_path: Path) -> None:
    """A run stopped early, or a steady one: fails when what is there is not drawn or what is not there stops it."""
    case = load_case("single_zone", {"geometry.cell_width": "2 mm"})
    one = write_run(tmp_path / "one", case, TIMES[-1:])
    assert [picture.name for picture, _ in figures(one)] == [
        *("coverage", "map_TMA", "map_cvd", "speed", "pressure", "exit_profile")
    ]
    none = write_run(tmp_path / "none", case, TIMES[:0])
    assert plot_run(none.directory.path) == {}


def test_long_strip_is_stretched_and_says_so(tmp_path: Path) -> None:
    """Four cycles are 1117.6 mm by 22 mm: fails when the strip is drawn as an unreadable line, or names overlap."""
    changes = {"geometry.cell_width": "5 mm", "geometry.length": "1117.6 mm"}
    figure = map_figure(
        run := write_run(tmp_path / "long", load_case("single_zone", changes)), run.snapshot(), COVERAGE
    )
    figure.draw_without_rendering()
    strip = figure.axes[0]
    stretch = strip.get_aspect()
    assert isinstance(stretch, float | int) and stretch >= 2
    assert f"stretched {stretch:.0f} times" in strip.get_title()
    assert strip.bbox.height / figure.dpi > 0.6
    names = [t for t in strip.texts if re.match(r"(plenum|frit|bed|headspace)", t.get_text())]
    boxes = sorted((t.get_window_extent() for t in names), key=lambda box: box.y0)
    assert len(boxes) == 4 and all(a.y1 <= b.y1 - 0.6 * b.height for a, b in pairwise(boxes))


def test_labels_are_spread_no_more_than_needed() -> None:
    """Fails when labels stay closer than asked, or ones with room are moved."""
    assert spread([0.0, 5.0, 10.0], 2.0) == [0.0, 5.0, 10.0]
    moved = spread([0.0, 0.1, 0.2, 9.0], 1.0)
    assert np.all(np.diff(moved) >= 1.0 - 1e-12) and moved[1] == pytest.approx(0.1) and moved[3] == 9.0


def test_formulas() -> None:
    """Fails when digits of a formula stay on the line or those of a name are lowered."""
    assert formula("OAl(CH3)2") == "OAl(CH$_{3}$)$_{2}$"
    assert formula("sites") == "sites"


def test_not_a_run_is_bad_input(tmp_path: Path) -> None:
    """Fails when a directory without a run gives anything but one line."""
    with pytest.raises(InputError, match=r"case\.toml"):
        plot_run(tmp_path)


def test_a_vector_is_read_as_two_components(zone: Run) -> None:
    """Fails when the velocity of a run that is read back has another shape than that of a result, or is no velocity."""
    velocity = zone.field(zone.snapshot(), "velocity")
    assert velocity.shape == (zone.grid.rows, zone.grid.columns, 2)
    assert np.allclose(velocity, (-0.03, 0.0))
    with pytest.raises(InputError, match=r"found 'Velocity'.*did you mean velocity"):
        zone.field(zone.snapshot(), "Velocity")


def test_missing_field_names_those_that_exist(zone: Run) -> None:
    """Fails when the message does not say what could have been asked for."""
    with pytest.raises(InputError, match=r"x_CO.*x_TMA"):
        map_figure(zone, zone.snapshot(), "x_CO")


def pictures_of(path: Path) -> tuple[set[str], str]:
    """Names of the pictures that can be drawn, and everything that was said."""
    said: list[str] = []
    return {picture.name for picture, _ in figures(load_run(path, said.append), said.append)}, "\n".join(said)


ALL = {"coverage", "map_TMA", "map_cvd", "speed", "pressure", "exit_profile", "history", "outlets"}


@pytest.mark.parametrize(
    ("lost", "missing"),
    [
        ("fields/fields_000002.vtu", set()),
        ("fields/fields_000008.vtu", set()),
        ("fields.pvd", ALL - {"history", "outlets"}),
        ("history.csv", {"history", "outlets"}),
        ("summary.json", set()),
    ],
)
@pytest.mark.parametrize("how", ["removed", "cut", "garbage", "empty", "a directory"])
def test_an_incomplete_copy_gives_the_pictures_that_are_left(
    zone: Run, lost: str, missing: set[str], how: str
) -> None:
    """Fails when one lost or damaged file costs more pictures than need it, goes unsaid, or ends in a traceback."""
    file = zone.directory.path / lost
    content = file.read_bytes()
    file.unlink()
    if how == "a directory":
        file.mkdir()
    elif how != "removed":
        file.write_bytes(
            {"cut": content[: len(content) // 2], "garbage": b"\xff\x00?" * 99, "empty": b""}[how]
        )
    drawn_names, said = pictures_of(zone.directory.path)
    if how == "cut" and lost == "history.csv":
        missing = set()  # its whole rows are drawn
    assert ALL - drawn_names == missing
    assert file.name in said or lost == "summary.json" or (how, lost) == ("cut", "history.csv")


def test_a_run_of_which_nothing_is_left_is_one_line(zone: Run) -> None:
    """Fails when a copy without any output file ends as if pictures had been drawn, or the last readable fields are not used."""
    fields = sorted((zone.directory.path / "fields").iterdir())
    for file in fields[1:]:
        file.unlink()
    drawn_names, said = pictures_of(zone.directory.path)
    assert drawn_names == ALL and "(and 7 more files of fields)" in said
    assert figure_times(zone) == {"0 s"}
    fields[0].unlink()
    (zone.directory.path / "history.csv").unlink()
    with pytest.raises(InputError, match="no picture can be drawn"):
        plot_run(zone.directory.path, lambda line: None)


def figure_times(run: Run) -> set[str]:
    """Times that the exit profile shows."""
    figure = exit_profile_figure(run, list(Fields(run).at(profile_steps(run))))
    return {str(line.get_label()) for line in figure.axes[0].get_lines()}


def test_a_history_without_balances_is_no_picture(zone: Run) -> None:
    """Fails when the history of a run without species, which holds no titration and no balance, ends in a traceback."""
    file = zone.directory.path / "history.csv"
    file.write_text("time,cvd.rate_mean\n0.0,0.0\n1.0,0.0\n")
    assert pictures_of(zone.directory.path)[0] == ALL - {"history", "outlets"}


def test_fields_of_another_mesh_are_not_drawn(zone: Run, tmp_path: Path) -> None:
    """Fails when a case.toml of another mesh beside the fields ends in a traceback or in a picture."""
    other = load_case("single_zone", {"geometry.cell_width": "3 mm"})
    zone.directory.write_case(other.to_toml())
    drawn_names, said = pictures_of(zone.directory.path)
    assert drawn_names == {"history", "outlets"} and "cells; accepted" in said


@pytest.mark.parametrize("what", ["nothing", "file", "empty", "sweep", "dem"])
def test_what_is_no_run_is_refused_by_what_it_is(tmp_path: Path, what: str) -> None:
    """Fails when `mpm plot` of something else ends in a traceback or does not say what it was given."""
    path = tmp_path / "x"
    if what == "file":
        path.write_text("")
    elif what != "nothing":
        path.mkdir()
    if what == "sweep":
        (path / "sweep.json").write_text("{}")
    if what == "dem":
        (path / "case.toml").write_text('powder = "GL50"')
        (path / "seed_1").mkdir()
    words = {
        "nothing": "no such",
        "file": "a file",
        "empty": "without case.toml",
        "sweep": "a sweep",
        "dem": "mpm dem",
    }
    with pytest.raises(InputError, match=words[what]):
        load_run(path)


def test_names_are_no_formulas_and_no_paths(tmp_path: Path) -> None:
    """Fails when a dollar sign in a title or a name begins a formula of matplotlib, or a name with a slash leaves plots/."""
    changes = {"geometry.cell_width": "2 mm", "title": r"5 $ and \frac $ more"}
    figure = map_figure(
        run := write_run(tmp_path / "x", load_case("single_zone", changes), TIMES[:2]),
        run.snapshot(),
        COVERAGE,
    )
    figure.draw_without_rendering()
    assert r"5 \$ and" in figure.get_suptitle()
    assert (
        file_name("map_../a b") == "map_..%2Fa%20b"
        and file_name("coverage_OAl(CH3)2") == "coverage_OAl(CH3)2"
    )
