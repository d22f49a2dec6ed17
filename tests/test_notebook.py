"""What a Python session and a notebook show: tables that are well-formed and escape every name, figures, and one live line."""

import importlib
import importlib.util
import sys
import types
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import mpm
from mpm import load_run
from mpm.case.case import Case
from mpm.errors import InputError
from mpm.reactor.reactor import Reactor, Result
from mpm.report.quantities import quantity
from mpm.report.rounding import shown
from mpm.report.trees import flatten

from .cases import MPI, SHORT, TINY, zone

NASTY = "<script>alert(\"1\")</script> & 'co'"
CARRIER = "<i>N2&"


@pytest.fixture(scope="module")
def case() -> Case:
    """A case whose names would be markup if they were not escaped."""
    gas = {"gas.carrier": CARRIER, "gas.molar_mass": "28 g/mol", "gas.viscosity": "2e-5 Pa s"}
    return zone({**SHORT, **gas, "time.end": "0.5 s", "title": NASTY}, TINY)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("notebook") / "run"


@pytest.fixture(scope="module")
def result(case: Case, folder: Path) -> Result:
    return Reactor(case, MPI.COMM_SELF).run(output=folder)


def words(shown_html: str) -> str:
    """The text of well-formed markup that holds no script."""
    tree = ElementTree.fromstring(f"<div>{shown_html}</div>")
    assert not {"script", "i"} & {element.tag for element in tree.iter()}
    return " ".join(" ".join(tree.itertext()).split())


def test_tables_are_well_formed_and_escape_names(case: Case, result: Result, folder: Path) -> None:
    """Fails when a name becomes markup, a number lacks its unit, or what is shown of a case, its check, a result and a run read back are
    not the numbers that were asked for."""
    of_case = words(case._repr_html_())
    for part in (NASTY, CARRIER, "139.7 mm long", "3.5 cm/s over 4 mm", "473 K", "0 s to 0.5 s", "averaged"):
        assert part in of_case
    of_check = words(mpm.check(case)._repr_html_())
    for part in (NASTY, CARRIER, *mpm.check(case)["warnings"]):
        assert part in of_check
    assert words(result._repr_html_()) == words(load_run(folder)._repr_html_())
    of_result, numbers = words(result._repr_html_()), flatten(result.summary)
    for name in ("titration.tma.exit_mean", "utilisation.tma", "dose_ratio.tma"):
        value = shown(name, numbers, False).replace("\u00a0", " ")
        assert f"{quantity(name).label} {value}" in of_result
    assert NASTY in of_result and "mol/m\u00b3/s" in of_result and "balance" in of_result
    assert "powder leaves the zone of tma" in repr(result) and "powder leaves the zone of tma" in repr(
        load_run(folder)
    )


def test_run_without_a_summary_says_so(case: Case, tmp_path: Path) -> None:
    """Fails when a run that is still going ends what shows it."""
    (tmp_path / "case.toml").write_text(case.to_toml())
    (tmp_path / "history.csv").write_text("time\n")
    run = load_run(tmp_path)
    assert "not ended yet" in words(run._repr_html_()) and "not ended yet" in repr(run)


def test_check_prints_and_is_a_mapping(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a report cannot be read as text (or rich, in a notebook, shows it elsewhere), or its numbers not be
    asked for; or when a file, a name or overrides are not taken."""
    found = mpm.check("single_zone", {"motion.gamma": 0.4})
    assert found["motion"]["gamma"] == 0.4 and "inlets" in found and len(dict(found)) == len(found)
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    monkeypatch.setenv("FORCE_COLOR", "1")  # as a kernel has it
    text = str(found)
    assert "\x1b" not in text
    assert "Single TMA zone" in text and "fluidisation" in text and max(map(len, text.splitlines())) <= 80
    assert mpm.check(case).case is case and mpm.check(case.to_dict())["motion"] == mpm.check(case)["motion"]
    with pytest.raises(InputError, match="single_zone"):
        mpm.check("singel_zone")


def test_names_of_the_package_are_functions() -> None:
    """Fails when a module of the package takes the name of a function at its top level, which an import of it would then hide."""
    for name in ("mpm.advice.checks", "mpm.pictures.standard", "mpm.drawing", "mpm.output.results"):
        importlib.import_module(name)
    for name in ("check", "plot", "load_run", "load_sweep", "load_case"):
        assert importlib.util.find_spec(f"mpm.{name}") is None
        assert callable(getattr(mpm, name)) and not isinstance(getattr(mpm, name), types.ModuleType)
        assert name in dir(mpm)


def drawn_values(figure: Figure) -> np.ma.MaskedArray:
    """The values of a map's first panel."""
    arrays = (collection.get_array() for collection in figure.axes[0].collections)
    return np.ma.ravel(next(array for array in arrays if array is not None))


@pytest.mark.usefixtures("result")  # which runs into the folder, in whatever process
@pytest.mark.parametrize(
    ("asked", "meant"),
    [("theta", "theta_OAl(CH3)2"), (None, "theta_OAl(CH3)2"), ("x", "x_TMA"), ("C", "C_TMA"), ("TMA", "x_TMA"), ("OH", "theta_OH"),
     ("pressure", "pressure")],
)  # fmt: skip
def test_plot_of_a_field(asked: str | None, meant: str, folder: Path) -> None:
    """Fails when a short name stands for another field than the files have under the long one."""
    run = load_run(folder)
    values = drawn_values(run.plot(asked))
    expected = np.ma.masked_array(run.field(run.snapshot(), meant).ravel(), np.ma.getmaskarray(values))
    assert values.count() and np.ma.allclose(values, expected, rtol=1e-6, atol=0.0)


def test_plot_in_memory_is_that_of_the_directory(case: Case, result: Result) -> None:
    """Fails when a run that writes nothing cannot be looked at, or shows anything but its last instant."""
    kept = Reactor(case, MPI.COMM_SELF).run()
    assert kept.directory is None
    figure = kept.plot("theta")
    assert np.ma.allclose(drawn_values(figure), drawn_values(result.plot("theta")), atol=1e-6)
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
    assert kept.plot("history").axes and kept.plot("titration.tma.box_mean").axes[0].lines


def test_other_pictures_and_names_that_are_none(result: Result) -> None:
    """Fails when a standard picture or a number of the history is not drawn, an option is lost, or a wrong name is not answered."""
    (line,) = result.plot("titration.tma.exit_mean").axes[0].lines
    np.testing.assert_array_equal(line.get_ydata(), result.history["titration.tma.exit_mean"])
    assert result.plot("history").axes
    first = result.plot("x_TMA", time=0.0)
    assert "t = 0 s" in first.get_suptitle() and "t = 0.5 s" in result.plot("x_TMA").get_suptitle()
    for wrong, right in (
        ("velosity", "velocity"),
        ("titration.tma.exit_maen", "titration.tma.exit_mean"),
        ("histroy", "history"),
    ):
        with pytest.raises(InputError, match=rf"did you mean {right}\?"):
            result.plot(wrong)
    with pytest.raises(InputError, match="time with history"):
        result.plot("history", time=1.0)


def test_plot_of_a_directory(result: Result, folder: Path) -> None:
    """Fails when the pictures of a directory are not what a notebook shows, or options are lost."""
    drawn = mpm.plot(folder, field="x_TMA", time="250 ms")
    (path,) = drawn
    assert path.exists() and "mole fraction of TMA" in repr(drawn) and "0.25 s" in drawn[path]
    tree = ElementTree.fromstring(f"<div>{drawn._repr_html_()}</div>")
    (image,) = tree.iter("img")
    assert image.attrib["src"].startswith("data:image/png;base64,")
    with pytest.raises(InputError, match="no directory"):
        mpm.plot()


class Kernel:
    """Stands in for IPython with a kernel; keeps what it is given to display."""

    def __init__(self) -> None:
        self.shell: Any = types.SimpleNamespace(kernel=object())
        self.first: list[str] = []
        self.updates: list[str] = []

    def display(self, data: dict[str, str], raw: bool, display_id: bool) -> Any:
        assert raw and display_id
        self.first.append(data["text/plain"])
        return self

    def update(self, data: dict[str, str], raw: bool) -> None:
        self.updates.append(data["text/plain"])


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    found = Kernel()
    ipython = types.ModuleType("IPython")
    ipython.get_ipython = lambda: found.shell  # type: ignore[attr-defined]
    shower = types.ModuleType("IPython.display")
    shower.display = found.display  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", shower)
    return found


def test_a_run_shows_one_live_line_in_a_notebook(
    case: Case, kernel: Kernel, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a notebook's cell fills with lines, the last of them is not the end, or a warning is lost."""
    Reactor(case, MPI.COMM_SELF).run()
    assert len(kernel.first) == 1 and "0.50 of 0.5 s" in kernel.updates[-1]
    printed = capsys.readouterr()
    warnings = mpm.check(case)["warnings"]
    assert warnings and printed.out.splitlines() == [f"warning: {text}" for text in warnings]
    assert "steps/s" not in printed.err


def test_nobody_watches_a_pipe(case: Case, kernel: Kernel, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a run in a pipe speaks without being asked to, or IPython on a terminal is taken for a notebook."""
    kernel.shell = types.SimpleNamespace()
    Reactor(case, MPI.COMM_SELF).run()
    assert not kernel.first and capsys.readouterr() == ("", "")
    Reactor(case, MPI.COMM_SELF).run(progress=True)
    assert "0.50 of 0.5 s" in capsys.readouterr().err
