"""`mpm paraview`: the scripts hold what the files hold, and ParaView (where it is installed) draws them."""

import ast
import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import matplotlib.image as mpimg
import numpy as np
import pytest

from mpm.cli import main
from mpm.errors import InputError
from mpm.output.directory import RunDirectory
from mpm.pictures.paraview import VIBRATION, VIEW, bar_labels, vertical_scale, write_scripts
from mpm.reactor.reactor import Reactor

from .cases import MPI, TINY, zone

TITLE = "The \"bed\" and its 'gas' $5 \\ 100 % {x}"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A resolved run of a second, with phases and a title that no text may take for code."""
    folder = tmp_path_factory.mktemp("a run") / "run"
    changes = {
        "title": TITLE,
        "fidelity": "resolved",
        "time.end": "0.6 s",
        "time.steps_per_cycle": 8,
        "output.every": "0.2 s",
        "output.phases": 4,
    }
    Reactor(zone(changes, TINY), MPI.COMM_SELF).run(output=folder)
    return folder


def constants(script: Path) -> dict[str, Any]:
    """What the script sets in capitals; it must be Python."""
    found = {}
    for node in ast.parse(script.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name = node.targets[0].id
            if name.isupper() and name != "FOLDER":
                found[name] = ast.literal_eval(node.value)
    return found


@pytest.mark.parametrize("name", [VIEW, VIBRATION])
def test_script_holds_what_the_files_hold(name: str, run: Path) -> None:
    """Fails when a script is no Python, opens another file, names a field that is not there, or its ranges are not those of all times."""
    write_scripts(run, pytest.fail)
    said = constants(run / name)
    series = RunDirectory(run).fields if name == VIEW else RunDirectory(run).phases
    assert (run / said["FILE"]) == series.pvd and series.pvd.exists()
    snapshots = [series.read(index) for index in range(len(series.steps))]
    assert said["SHOWN"] == snapshots[-1].time
    first = {VIEW: "theta_OAl(CH3)2", VIBRATION: "velocity_lab"}[name]
    assert said["PANELS"][0] == first and set(said["PANELS"]) <= set(snapshots[0].cell_data)
    assert said["COLOURS"].keys() == snapshots[0].cell_data.keys() - {"zone", "layer"}
    for field, entry in said["COLOURS"].items():
        values = np.array([snapshot.cell_data[field] for snapshot in snapshots], dtype=float)
        if values.ndim == 3:
            values = np.append(np.linalg.norm(values, axis=2), 0.0)
        spread = values.max() > values.min() * (1.0 + 1e-6)
        if entry["log"]:
            assert (
                entry["high"] == pytest.approx(values.max()) and entry["low"] >= 0.99e-4 * values.max() > 0.0
            )
        elif spread and values.min() >= 0.0:
            low = 0.0 if values.min() < 0.1 * values.max() else values.min()  # as in every picture
            assert (entry["low"], entry["high"]) == pytest.approx((low, values.max()))
        assert entry["low"] < entry["high"]
        assert entry["labels"][0] == entry["low"] and entry["labels"][-1] == pytest.approx(entry["high"])
    assert said["TITLE"] == TITLE
    assert "[m/s]" in said["COLOURS"]["velocity"]["title"] and said["LOOP"] == (name == VIBRATION)
    assert said["ENDS"][1] == pytest.approx(0.1397) and said["FACES"] == sorted(said["FACES"])
    label = eval(said["LABEL"], {"time_value": snapshots[-1].time})
    expected = (snapshots[-1].time - 0.05) * 16.0 % 1.0 * 360.0
    assert label == ("t = 0.6 s" if name == VIEW else f"phase of the vibration: {expected:.1f} deg")


def test_verb_says_what_to_type(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a command that is printed does not name the script, as a shell must have it."""
    assert main(["paraview", str(run)]) == 0
    printed = capsys.readouterr().out
    for name in (VIEW, VIBRATION):
        assert f"paraview '--script={run / name}'" in printed  # the path has a blank in it


def test_open_starts_paraview(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when --open does not start the program with the script that was asked for, or its absence ends in a traceback."""
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["paraview", str(run), "--open"]) == 2
    assert "paraview: not found on the PATH" in capsys.readouterr().err
    program = tmp_path / "paraview"
    program.write_text(f'#!/bin/sh\nprintf "%s" "$1" > "{tmp_path}/called"\nexit 7\n')
    program.chmod(0o755)
    for options, name in (([], VIEW), (["--vibration"], VIBRATION)):
        assert main(["paraview", str(run), "--open", *options]) == 7
        assert (tmp_path / "called").read_text() == f"--script={run / name}"


def test_what_is_missing_or_damaged(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a damaged file ends the script of the others, or what holds no fields or phases is not one line."""
    other = shutil.copytree(run, tmp_path / "other")
    shutil.rmtree(other / "phases")
    (other / "phases.pvd").unlink()
    (other / "fields" / "fields_000001.vtu").write_bytes(b"cut")
    said: list[str] = []
    assert [script.path.name for script in write_scripts(other, said.append)] == [VIEW]
    assert len(said) == 1 and "fields_000001.vtu" in said[0]
    assert not (other / VIBRATION).exists()
    assert main(["paraview", str(other), "--open", "--vibration"]) == 2
    assert "output.phases = 16" in capsys.readouterr().err
    shutil.rmtree(other / "fields")
    with pytest.raises(InputError, match=r"fields\.pvd: lists no fields"):
        write_scripts(other, said.append)
    assert main(["paraview", str(tmp_path)]) == 2


def test_scale_and_numbers_of_a_bar() -> None:
    """Fails when a strip is drawn flatter than it is or out of the window, or numbers at a bar crowd each other."""
    assert [vertical_scale(length=length, height=0.02, panels=2) for length in (0.001, 0.02, 0.14, 2.0)] == [
        1,
        1,
        2,
        40,
    ]
    assert vertical_scale(length=0.14, height=0.02, panels=1) == 5
    assert bar_labels(0.0, 1.0, False) == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert bar_labels(0.0, 0.0655, False) == pytest.approx([0.0, 0.02, 0.04, 0.0655])
    assert bar_labels(0.0, 0.04, False) == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04])
    assert bar_labels(-3.0, 57.0, False) == pytest.approx([-3.0, 10.0, 20.0, 30.0, 40.0, 50.0, 57.0])
    assert bar_labels(9e-9, 9e-5, True) == pytest.approx([9e-9, 1e-7, 1e-6, 1e-5, 9e-5])
    assert bar_labels(1e-8, 1e-4, True) == pytest.approx([1e-8, 1e-7, 1e-6, 1e-5, 1e-4])


@pytest.mark.skipif(
    shutil.which("pvbatch") is None or shutil.which("xvfb-run") is None, reason="ParaView is not installed"
)
def test_paraview_draws_them(run: Path, tmp_path: Path) -> None:
    """Fails when ParaView stumbles over a script, or shows a strip in one colour."""
    scripts, batches = write_scripts(run, pytest.fail), []
    for script in scripts:
        path, picture = str(script.path), str(tmp_path / f"{script.path.stem}.png")
        batches.append(tmp_path / f"draw_{script.path.name}")
        batches[-1].write_text(
            f"path = {path!r}\nexec(compile(open(path).read(), path, 'exec'), {{'__file__': path}})\n"
            "from paraview import simple\n"
            f"simple.SaveScreenshot({picture!r}, simple.GetLayout(), ImageResolution=[800, 500])\n"
        )
    calls = " && ".join(shlex.join(["pvbatch", str(batch)]) for batch in batches)
    done = subprocess.run(
        ["xvfb-run", "-a", "sh", "-c", calls],
        capture_output=True,
        text=True,
        timeout=180,
        env={k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "VTK"))},
    )
    if "bad X server connection" in done.stderr:
        pytest.skip("no X server came up for ParaView")
    assert done.returncode == 0 and "Error" not in done.stderr and "Failed" not in done.stderr, done.stderr
    for script in scripts:
        image = mpimg.imread(tmp_path / f"{script.path.stem}.png")[..., :3]
        coloured = np.ptp(image, axis=2) > 0.15  # neither the white around it nor the grey of its edges
        assert len(np.unique((image[coloured] * 20).astype(int), axis=0)) > 20
