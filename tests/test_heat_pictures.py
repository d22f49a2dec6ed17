"""What pictures, the page, ParaView and the verdict show of temperature, against made-up fields whose answer is known."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_rgb

from mpm.case.case import Case, load_case
from mpm.mesh.grid import Grid
from mpm.output.directory import RunDirectory
from mpm.output.following import Moment
from mpm.output.results import Run, load_run
from mpm.page.compare_page import number_table
from mpm.page.curves import Chart
from mpm.page.strip import drawing
from mpm.page.viewer import looks, plotly_colours
from mpm.page.warmth import warmth
from mpm.pictures.maps import map_figure
from mpm.pictures.outline import MM
from mpm.pictures.paraview import VIEW, write_scripts
from mpm.pictures.standard import Fields, figures, pictures
from mpm.pictures.streamlines import carried, stream_function
from mpm.pictures.warmth import warm_length, warmth_figure
from mpm.report.quantities import FIRST, first
from mpm.report.verdict import verdict

from .cases import TINY

WALLS = [
    {"side": "top", "start": "0 mm", "end": "95 mm", "temperature": "473 K"},
    {"side": "bottom", "start": "40 mm", "end": "100 mm", "heat_flux": "100 W/m^2"},
    {
        "side": "bottom",
        "start": "0 mm",
        "end": "30 mm",
        "heat_transfer_coefficient": "10 W/m^2/K",
        "ambient": "300 K",
    },
]
WARM = {"energy": {}, "geometry.bed_temperature": "300 K", "geometry.wall": WALLS}


def warm(changes: dict[str, Any] | None = None) -> Case:
    return load_case("single_zone", {**TINY, **WARM, **(changes or {})})


def field(grid: Grid, time: float) -> np.ndarray:
    """300 K + 100 K x/length, 10 K more in every row, 5 K more per second."""
    along = 300.0 + 100.0 * grid.centres / grid.length + 5.0 * time
    return np.asarray(along[None, :] + 10.0 * np.arange(grid.rows)[:, None])


def write_run(path: Path, case: Case) -> Run:
    """A directory as a run leaves it."""
    directory = RunDirectory(path, precision="Float64")
    directory.prepare()
    directory.write_case(case.to_toml())
    grid = Grid.from_case(case)
    for time in (0.0, 1.0, 2.0):
        temperature = field(grid, time).ravel()
        stored = {
            "temperature": temperature,
            "density": 350.0 / temperature,
            "pressure": np.full(grid.cells, 3.0),
        }
        directory.write_fields(time, grid, {**stored, "velocity": np.full((grid.cells, 2), (-0.03, 0.0))})
        row: dict[str, float | None] = {
            "time": time,
            "temperature.bed_exit": 400.0 + time,
            "balance.energy": 1e-13,
        }
        row |= {
            f"temperature.{name}.mean": 300.0 + 10.0 * i + time for i, name in enumerate(grid.layer_names)
        }
        directory.append_history(row)
    directory.write_summary({"status": "done", "temperature": {"bed_exit": 402.0}, "fidelity": case.fidelity})
    return load_run(path)


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return write_run(tmp_path / "warm", warm())


def test_standard_pictures_have_a_map_and_curves(run: Run, tmp_path: Path) -> None:
    """Fails when a run with [energy] lacks a picture of it, one without gets it, or a picture cannot be drawn."""
    drawn = {picture.name for picture, _ in figures(run, lambda line: None)}
    assert {"temperature", "heating", "speed", "history"} <= drawn
    cool = write_run(tmp_path / "cool", load_case("single_zone", TINY))
    assert "heating" not in {picture.name for picture in pictures(cool, Fields(cool), pytest.fail)}


def curves_of(axes: Axes) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Places and values of the lines of a panel, by their label."""
    return {
        str(line.get_label()): (np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float))
        for line in axes.get_lines()
    }


def test_curves_are_those_of_the_files(run: Run) -> None:
    """Fails when the curve of the bed is not the mean over its height, its band misses a row, or a layer has no curve over time."""
    figure = warmth_figure(run, run.snapshot())
    along, times = figure.axes
    curves = curves_of(along)
    values = field(run.grid, 2.0)[run.grid.layer_rows("bed")]
    assert np.allclose(curves["bed"][0], run.grid.centres * MM)
    assert np.allclose(curves["bed"][1], values.mean(axis=0))
    (band,) = [c.get_paths()[0] for c in along.collections if c.get_alpha() == 0.18]
    heights = np.asarray(band.vertices, dtype=float)[:, 1]
    assert (heights.min(), heights.max()) == pytest.approx((values.min(), values.max()))
    over = curves_of(times)
    assert set(over) == {*run.grid.layer_names, "powder that leaves"}
    assert over["powder that leaves"][1].tolist() == [400.0, 401.0, 402.0]
    at = warm_length(run, run.snapshot())
    profile = values.mean(axis=0) - 300.0
    assert at is not None
    assert np.interp(at, run.grid.centres, profile) == pytest.approx(0.95 * profile[-1])


def test_a_strip_at_one_temperature_shows_no_rounding(run: Run, tmp_path: Path) -> None:
    """Fails when an axis is stretched over differences of 1e-9 K."""
    snapshot = run.snapshot()
    cells = {**snapshot.cell_data, "temperature": 473.0 + 1e-9 * np.arange(run.grid.cells)}
    even = cast(Any, SimpleNamespace(cell_data=cells, time=2.0))
    low, high = warmth_figure(run, even).axes[0].get_ylim()
    assert high - low >= 1.0 and low < 473.0 < high


def test_the_map_of_temperature_has_its_colours_and_walls(run: Run) -> None:
    """Fails when walls are not drawn at their place, or the scale is not that of the values."""
    figure = map_figure(run, run.snapshot(), "temperature")
    walls = [line for line in figure.axes[0].get_lines() if line.get_gid() == "wall"]
    assert [list(np.asarray(wall.get_xdata(), float)) for wall in walls] == [
        [0.0, 95.0],
        [40.0, 100.0],
        [0.0, 30.0],
    ]
    assert [float(np.asarray(wall.get_ydata(), float)[0]) for wall in walls] == [1.0, 0.0, 0.0]
    assert "walls that give or take heat" in figure.axes[0].get_title()
    (mesh,) = [c for c in figure.axes[0].collections if isinstance(c, QuadMesh)]
    values = field(run.grid, 2.0)
    assert mesh.get_cmap().name == "inferno"
    assert np.allclose(mesh.get_clim(), (values.min(), values.max()))


def test_streamlines_follow_the_mass() -> None:
    """A flux of mass that is the same everywhere: its stream function is even where that of the velocity is not."""
    grid = Grid.from_case(load_case("single_zone", TINY))
    density = np.repeat(np.linspace(0.5, 1.5, grid.columns)[None, :], grid.rows, 0).ravel()
    data = {"velocity": np.column_stack([1.0 / density, np.zeros(grid.cells)]), "density": density}
    flux = carried(data)
    assert np.allclose(flux[:, 0], 1.0 / density.mean())
    psi = stream_function(grid, flux)
    assert np.allclose(psi, psi[:, :1], atol=1e-12)
    assert carried({"velocity": data["velocity"]}) == pytest.approx(data["velocity"])


def test_the_page_offers_fields_and_charts(run: Run) -> None:
    """Fails when the viewer has no temperature, colours that plotly does not know, or a chart lost a layer."""
    found = looks(run)
    assert {"temperature", "density"} <= set(found)
    stops = found["temperature"][0].colours
    assert not isinstance(stops, str) and stops[0][0] == 0.0 and stops[-1][0] == 1.0
    assert max(map(abs, np.subtract(to_rgb(stops[-1][1]), (0.988, 1.0, 0.645)))) < 0.01
    assert plotly_colours("viridis") == "Viridis"
    charts: list[Chart] = warmth(run)
    assert [chart["layout"]["yaxis"]["title"]["text"] for chart in charts] == ["temperature [K]"] * 2
    names = [{one["name"] for one in chart["data"]} for chart in charts]
    assert names[0] >= {"bed", "bed, coldest row", "bed, hottest row", "headspace"}
    assert names[1] == {*run.grid.layer_names, "powder that leaves"}


def test_the_drawing_tells_walls_and_temperatures() -> None:
    """Fails when a wall is drawn elsewhere, or what it does is not said; a case without [energy] has none of it."""
    strip = drawing(warm({"geometry.inlet.tma.temperature": "400 K"}))
    top, flux, loss = strip.walls
    assert top.y0 == top.y1 == 0.0 and top.x1 == pytest.approx(95.0 / 139.7 * strip.width)
    assert flux.y0 == pytest.approx(strip.height) and "gives 100 W/m\u00b2" in flux.text
    assert "10 W/m\u00b2/K to surroundings at 300 K" in loss.text and "at 473 K" in top.text
    assert "solids that come in have 300 K" in strip.warmth
    assert any("at 400 K + TMA" in line for port in strip.ports for line in port.lines)
    cool = drawing(load_case("single_zone", TINY))
    assert (
        cool.walls == []
        and cool.warmth == ""
        and not any(" K" in line for p in cool.ports for line in p.lines)
    )


def test_paraview_shows_the_temperature(run: Run) -> None:
    """Fails when the script has no picture of it, or a colour map that ParaView does not know."""
    write_scripts(run.directory.path, pytest.fail)
    text = (run.directory.path / VIEW).read_text(encoding="utf-8")
    assert "'temperature'" in text.partition("PANELS = ")[2].partition("\n")[0]
    assert "Inferno (matplotlib)" in text and "temperature of gas and solids [K]" in text


def test_the_verdict_tells_with_what_temperature_powder_leaves() -> None:
    """Fails when the sentence lacks it, tells the entry of solids that come back, or speaks of it without [energy]."""
    summary = {
        "status": "done",
        "fidelity": "steady",
        "temperature": {"bed_exit": 461.4},
        "heating": {"length": 0.0432},
    }
    said = verdict(warm(), summary)
    assert "powder that enters at 300 K leaves at 461 K, most of the way made after 43 mm" in said
    assert "powder leaves at 461 K" in verdict(warm({"geometry.bed_inflow": "periodic"}), summary)
    assert " K" not in verdict(load_case("single_zone", TINY), {"status": "done", "fidelity": "steady"})


def test_what_is_asked_first_may_be_one_number() -> None:
    """Fails when the exit of the bed is lost among the layers, or an order has changed."""
    assert first("temperature.bed_exit") == FIRST.index("temperature.bed_exit")
    assert first("heating.length") == FIRST.index("heating") and first("temperature.bed.mean") is None
    assert first("titration.tma.exit_mean") == 0 and first("titrations") is None


def test_watching_a_run_tells_it() -> None:
    """Fails when `mpm watch` leaves out how warm powder leaves."""
    said = Moment("t = 1 s", 0.0, {"temperature.bed_exit": 461.0, "temperature.bed.mean": 400.0}).text()
    assert said[1:] == ["temperature of the powder that leaves: 461\u00a0K"]


def test_steady_runs_are_compared_in_watts() -> None:
    """Fails when heat of a steady state, in W/m, is not found in the second run, or is read as heat of a run in time."""
    case = warm({"fidelity": "steady"})
    runs = [
        cast(Run, SimpleNamespace(case=case, summary={"fidelity": kind, "energy": {"walls": value}}))
        for kind, value in (("steady", 50.0), ("steady", 60.0), ("averaged", 70.0))
    ]
    lines = {line.unit: line.texts for line in number_table(runs)}
    assert lines == {"W/m": ["50", "60", ""], "J/m": ["", "", "70"]}
