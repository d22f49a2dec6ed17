"""Pictures of a sweep: they show the table, in words and units, and explain what has no result."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_hex
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure

from mpm.errors import InputError
from mpm.pictures.maps import PLAIN
from mpm.sweep.pictures import Scale, draw, edges, heat_map, line, parallel_coordinates, spaced

DOSE = Scale("dose", np.repeat([1e-4, 2e-4, 4e-4], 2), (), True)
SPEED = Scale("speed [cm/s]", np.tile([1.0, 2.0], 3), (), False)
VALUES = np.array([1.0, 2.0, 3.0, np.nan, 5.0, 6.0])


def drawn(mesh: QuadMesh) -> list[list[float]]:
    """Values of the cells; -1 where there is none."""
    values = mesh.get_array()
    assert values is not None
    return np.ma.filled(values, -1.0).tolist()


def test_cells_meet_halfway() -> None:
    """Fails when a border is not halfway between two levels on the scale of its axis, or the outer cells are not symmetric."""
    assert edges(np.array([1.0, 3.0, 7.0]), False).tolist() == [0.0, 2.0, 5.0, 9.0]
    assert edges(np.array([1e-4, 1e-2]), True) == pytest.approx([1e-5, 1e-3, 1e-1])


def test_cells_show_the_values_of_their_points() -> None:
    """Fails when a cell has another point's value, lines run across cells that say otherwise, or a hatching is not explained."""
    figure = Figure()
    heat_map(figure, DOSE, SPEED, VALUES, "number")
    axes = figure.axes[0]
    (mesh,) = [child for child in axes.get_children() if isinstance(child, QuadMesh)]
    assert drawn(mesh) == [[1.0, 3.0, 5.0], [2.0, -1.0, 6.0]]
    written = {(round(x, 6), y): text.get_text() for text in axes.texts for x, y in [text.get_position()]}
    assert len(written) == 5 and written[(4e-4, 1.0)] == "5"
    assert not [child for child in axes.get_children() if isinstance(child, ContourSet)]
    (legend,) = figure.legends
    assert legend.get_texts()[0].get_text().startswith("no result")
    whole = Figure()
    heat_map(whole, DOSE, SPEED, np.arange(6.0), "number")
    assert not whole.legends


def test_one_value_everywhere_has_no_scale() -> None:
    """Fails when a number that does not change is drawn in the colours of a range."""
    figure = Figure()
    heat_map(figure, DOSE, SPEED, np.full(6, 0.25), "number")
    (axes,) = figure.axes
    (mesh,) = [child for child in axes.get_children() if isinstance(child, QuadMesh)]
    assert axes.get_title() == "number: 0.25 everywhere" and to_hex(mesh.get_cmap()(0.0)) == PLAIN
    figure = Figure()
    parallel_coordinates(figure, [DOSE, SPEED], np.full(6, 0.25), "number")
    assert [axes.get_title() for axes in figure.axes] == ["number: 0.25 everywhere"]


@pytest.mark.parametrize("count", [1, 2, 5, 30])
@pytest.mark.parametrize("logarithmic", [False, True])
def test_labels_of_ticks_do_not_overlap(count: int, logarithmic: bool) -> None:
    """Fails when labels of neighbouring levels run into each other, or the ends of the axis have none."""
    levels = np.geomspace(2e-4, 1e-3, count)
    figure = Figure(figsize=(6.8, 5.0), layout="constrained")
    line(figure, Scale("dose", levels, (), logarithmic), np.arange(float(count)), "number")
    figure.draw_without_rendering()
    axis = figure.axes[0].xaxis
    labels = [tick.label1 for tick in axis.get_major_ticks() if tick.label1.get_text()]
    assert labels[0].get_text() == "0.0002" and (count == 1 or labels[-1].get_text() == "0.001")
    boxes = sorted((label.get_window_extent() for label in labels), key=lambda box: box.x0)
    assert all(left.x1 < right.x0 for left, right in pairwise(boxes))
    assert not axis.get_minorticklocs().size


def test_ticks_keep_both_ends() -> None:
    """Fails when the last level loses its label to the one before it."""
    assert spaced(np.array([0.0, 0.5, 0.95, 1.0]), 0.1) == [0, 1, 3]
    assert spaced(np.array([2.0]), 0.1) == [0]


ABOUT = {
    "title": "Speeds",
    "mode": "grid",
    "text": '[sweep]\npictures = ["species.*.fed", "front.*"]\n',
    "axes": [
        {
            "name": "geometry.inlet.tma.velocity", "keys": ["geometry.inlet.tma.velocity"],
            "written_unit": "cm/s", "kind": "number", "logarithmic": False,
        },
        {"name": "how", "keys": ["motion.profile"], "written_unit": "", "kind": "word", "logarithmic": False},
    ],
    "columns": {
        "geometry.inlet.tma.velocity": {"unit": "m/s"}, "how": {"unit": ""}, "status": {"unit": ""},
        "species.TMA.fed": {"unit": "mol/m/s"}, "front.tma.height": {"unit": "m"}, "error": {"unit": ""}, "point": {"unit": ""},
    },
}  # fmt: skip
TABLE = (
    "geometry.inlet.tma.velocity,how,status,species.TMA.fed,front.tma.height,error,point\n"
    "0.01,thesis,done,1e-6,,,a\n0.02,thesis,done,2e-6,,,b\n0.01,phases,failed,,,no,c\n0.02,phases,done,4e-6,,,d\n"
)


@pytest.fixture
def sweep(tmp_path: Path) -> Path:
    (tmp_path / "sweep.json").write_text(json.dumps(ABOUT))
    (tmp_path / "results.csv").write_text(TABLE)
    return tmp_path


def test_a_sweep_is_drawn_from_its_files(sweep: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a number has no words or unit, axes are not in the unit of the sweep file, or a column without numbers is drawn."""
    kept: list[Figure] = []
    monkeypatch.setattr("mpm.sweep.pictures.write_picture", lambda path, figure, **_: kept.append(figure))
    files = draw(sweep)
    assert files == {
        sweep / "plots" / "species.TMA.fed.png": "TMA fed [umol/m/s] over inlet tma velocity, how (profile)"
    }
    axes, bar = kept[0].axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("inlet tma velocity [cm/s]", "how (profile)")
    (mesh,) = [child for child in axes.get_children() if isinstance(child, QuadMesh)]
    assert drawn(mesh) == pytest.approx(np.array([[1.0, 2.0], [-1.0, 4.0]]))
    assert bar.get_ylabel() == "TMA fed [umol/m/s]" and [t.get_text() for t in axes.get_yticklabels()] == [
        "thesis",
        "phases",
    ]
    assert kept[0].get_suptitle() == f"Speeds [{sweep.name}]"


@pytest.mark.parametrize(
    ("name", "content"), [("sweep.json", "{"), ("results.csv", TABLE[:-30]), ("results.csv", "")]
)
def test_a_damaged_sweep_is_one_line(sweep: Path, name: str, content: str) -> None:
    """Fails when a sweep that is cut ends in a traceback or in a picture of half of it."""
    (sweep / name).write_text(content)
    with pytest.raises(InputError, match=r"no sweep|a table that is cut"):
        draw(sweep)
