"""`mpm plot`: what is drawn of what, where it goes, and what is said of wishes that cannot be met."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import animation
from matplotlib.collections import QuadMesh
from PIL import Image
from typer.testing import CliRunner

from mpm.case.case import load_case
from mpm.cli.base import app
from mpm.drawing import Wish, draw, parse_clim, parse_time
from mpm.errors import InputError
from mpm.output.results import Run
from mpm.pictures.beside import beside_figure
from mpm.pictures.maps import Map, limits_of
from tests.test_plot import COVERAGE, TIMES, drawn, meshes, write_run

COARSE = {"geometry.cell_width": "5 mm"}


@pytest.fixture
def zone(tmp_path: Path) -> Run:
    return write_run(tmp_path / "zone", load_case("single_zone", COARSE), TIMES[::2])


@pytest.fixture
def other(tmp_path: Path) -> Run:
    return write_run(tmp_path / "other", load_case("single_zone", COARSE), TIMES[:5])


def said(run: Run, **wish: object) -> tuple[list[Path], str]:
    """The files that were drawn, each there, and the words."""
    found = draw([run.directory.path], Wish(**wish), lambda line: None)  # type: ignore[arg-type]
    assert all(path.stat().st_size > 3000 for path in found)
    return list(found), "\n".join(found.values())


def test_a_field_of_choice(zone: Run, tmp_path: Path) -> None:
    """Fails when the file does not say field and time, the words are not those of the field, or -o is not followed."""
    (path,), words = said(zone, field="x_TMA", time=0.6)
    assert path == zone.directory.plots / "x_TMA_0.5s.png"
    assert words == "mole fraction of TMA, t = 0.5 s (stored nearest to 0.6 s)"
    (path,), words = said(zone, streamlines=True, output=tmp_path / "gas.svg")
    assert path.read_text().startswith("<?xml") and words.startswith("speed of the gas")
    assert words.endswith("with streamlines, t = 2 s")
    paths, words = said(zone, time=1.0)
    assert [path.stem for path in paths] == [
        "coverage_1s",
        "map_TMA_1s",
        "map_cvd_1s",
        "speed_1s",
        "pressure_1s",
    ]
    assert words.count("t = 1 s") == 5


def frames(film: Any) -> int:
    return int(film.n_frames)


def test_a_movie_has_all_times_and_one_scale(zone: Run) -> None:
    """Fails when a stored time is missing, the picture does not change, or the colours of a value change with time."""
    (path,), words = said(zone, movie=True, field="x_TMA", clim=(1e-6, 1e-4))
    with Image.open(path) as film:
        assert frames(film) in (1, 5)  # equal pictures may be joined
    (path,), words = said(zone, movie=True)
    assert path.name == "theta_OAl(CH3)2.gif" and words.endswith("movie of 5 stored times from 0 to 2 s")
    with Image.open(path) as film:
        assert frames(film) == 5
    everything = [zone.snapshot(k) for k in range(5)]
    limits = limits_of(zone, everything, "theta_OH")
    moving = Map(zone, "theta_OH", limits)
    shown = []
    for snapshot in everything:
        (mesh,) = meshes(moving.show(snapshot).axes[0])
        shown.append((drawn(mesh).mean(), mesh.get_clim()))
    assert len({value for value, _ in shown}) == 5 and {clim for _, clim in shown} == {(0.0, 1.0)}


def test_mp4_without_ffmpeg_is_one_line(zone: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a missing ffmpeg is a traceback, or leaves a file behind."""
    monkeypatch.setattr(animation.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(InputError, match=r"film\.mp4: MP4 needs ffmpeg.*-o film\.gif"):
        said(zone, movie=True, output=tmp_path / "film.mp4")
    assert not list(tmp_path.glob("film*"))


def test_two_runs_share_the_scale_and_show_their_difference(zone: Run, other: Run) -> None:
    """Fails when the strips have scales of their own, or the difference is not the second minus the first."""
    pair = [(zone, zone.snapshot()), (other, other.snapshot())]
    figure = beside_figure(pair, "x_TMA", streamlines=True)
    found = [mesh for axes in figure.axes for mesh in meshes(axes) if isinstance(mesh, QuadMesh)]
    strips = [mesh for mesh in found if drawn(mesh).size == zone.grid.cells]
    assert len(strips) == 3 and strips[0].get_clim() == strips[1].get_clim()
    figure = beside_figure(pair, COVERAGE)
    strips = [mesh for axes in figure.axes for mesh in meshes(axes) if drawn(mesh).size == zone.grid.cells]
    difference = drawn(strips[1]) - drawn(strips[0])
    assert np.allclose(drawn(strips[2]).compressed(), difference.compressed()) and difference.min() < -0.1
    low, high = strips[2].get_clim()
    assert low == -high == pytest.approx(difference.min())
    titles = [axes.get_title() for axes in figure.axes]
    assert any(title.startswith("other (t = 1 s) minus zone (t = 2 s)") for title in titles)


def test_runs_of_different_grids_have_no_difference(zone: Run, tmp_path: Path) -> None:
    """Fails when grids that do not match end in a traceback, or the missing difference goes unsaid."""
    cycle = write_run(tmp_path / "cycle", load_case("single_cycle", COARSE), TIMES[:2])
    told: list[str] = []
    found = draw([zone.directory.path, cycle.directory.path], Wish(field="pressure"), told.append)
    assert [path.name for path in found] == ["pressure_beside_cycle.png"]
    assert told == ["zone and cycle have different grids: no map of the difference"]


def test_a_dem_directory_names_its_pictures(tmp_path: Path) -> None:
    """Fails when what `mpm dem` drew is not pointed to, or its absence is no error."""
    (tmp_path / "seed_1").mkdir()
    (tmp_path / "case.toml").write_text('powder = "GL50"')
    with pytest.raises(InputError, match="without pictures yet"):
        draw([tmp_path], Wish(), print)
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "depth_profile.png").touch()
    assert draw([tmp_path], Wish(), print) == {
        tmp_path / "plots" / "depth_profile.png": "drawn by `mpm dem`: depth profile"
    }


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--field", "x_TNA"], r"found 'x_TNA'; accepted: .*did you mean x_TMA"),
        (["--clim", "0,1"], "--clim: found no --field"),
        (["-o", "a.png"], "-o: found no --field"),
        (["--field", "x_TMA", "--clim", "1,0"], "two numbers that rise"),
        (["--field", "x_TMA", "--clim", "1"], "two numbers that rise"),
        (["--field", "x_TMA", "--time", "3 m"], "--time: found '3 m'"),
        (["--field", "x_TMA", "--time", "nan"], "--time: found 'nan'"),
        (["--field", "x_TMA", "-o", "a.bmp"], r"ends in \.png, \.pdf, \.svg"),
        (["--movie", "-o", "a.png"], r"ends in \.gif, \.mp4"),
        (["--movie", "--time", "1"], "a movie shows all times"),
    ],
)
def test_a_wish_that_cannot_be_met_is_one_line(zone: Run, options: list[str], words: str) -> None:
    """Fails when a slip in an option is a traceback, or silently something else is drawn."""
    result = CliRunner().invoke(app, ["plot", str(zone.directory.path), *options])
    assert isinstance(result.exception, InputError) and "\n" not in str(result.exception)
    assert re.search(words, str(result.exception))
    assert not zone.directory.plots.exists() or not list(zone.directory.plots.iterdir())


def test_a_movie_needs_two_times(tmp_path: Path) -> None:
    """Fails when a steady state becomes a movie of one picture, or nothing says why not."""
    steady = write_run(tmp_path / "x", load_case("single_zone", {**COARSE, "fidelity": "steady"}), TIMES[:1])
    with pytest.raises(InputError, match="a run with at least two"):
        said(steady, movie=True)


def test_a_run_before_its_first_output_is_one_line(tmp_path: Path) -> None:
    """Fails when a run without stored fields ends in a traceback."""
    none = write_run(tmp_path / "none", load_case("single_zone", COARSE), TIMES[:0])
    with pytest.raises(InputError, match="no fields have been written"):
        said(none, field="pressure")


def test_the_screen_names_every_picture(zone: Run) -> None:
    """Fails when `mpm plot` does not say in words what it drew, and where."""
    result = CliRunner().invoke(app, ["plot", str(zone.directory.path)])
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    folder = zone.directory.plots
    assert f"{folder}/coverage.png: coverage of OAl(CH3)2, t = 2 s" in lines
    assert {Path(line.partition(": ")[0]) for line in lines} == set(folder.glob("*.png")) and len(lines) == 8


def test_what_the_documentation_tells_to_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a command or the program of docs/pictures.md does not work as printed."""
    text = (Path(__file__).parents[1] / "docs" / "pictures.md").read_text(encoding="utf-8")
    commands = re.findall(r"^    mpm (plot .*?) +#", text, re.MULTILINE)
    (tmp_path / "results").mkdir()
    for name in ("single_zone", "slow"):
        write_run(tmp_path / "results" / name, load_case("single_zone", COARSE), TIMES[:3])
    monkeypatch.chdir(tmp_path)
    typed = [command.split() for command in commands if "--field" in command]
    assert len(commands) == 6 and len(typed) == 3
    for arguments in typed:
        assert CliRunner().invoke(app, arguments).exit_code == 0
    (program,) = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    exec(program, {})
    assert (tmp_path / "speed.png").stat().st_size > 3000


def test_times_and_ranges() -> None:
    """Fails when a unit of time is not converted, or a negative end is refused."""
    assert (parse_time("1.5"), parse_time("250 ms")) == (1.5, 0.25)
    assert parse_clim("-3,3.5") == (-3.0, 3.5)
