"""Sweeps of the true reactor on a coarse zone, through the command line."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import mpm

SWEEP = """
[sweep]
case = "single_zone"
columns = ["titration.tma.box_mean", "species.TMA.fed", "species.TMA.balance_error", "steps"]
pictures = ["titration.*"]
[[sweep.axis]]
key = "geometry.inlet.tma.mass_fractions.TMA"
name = "Y_TMA"
values = {doses}
{more}
[sweep.set]
"geometry.cell_width" = "4 mm"
"time.end" = "{end}"
"time.step" = "20 ms"
"output.every" = "1 s"
"output.checkpoint" = "0.2 s"
"""


def command(path: Path, out: str, *more: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "mpm", "sweep", str(path / "doses.toml"), "-o", str(path / out), *more],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, str]:
    _, messages = process.communicate(timeout=300)
    return process.returncode, messages


def test_a_coarse_zone_with_a_failing_and_a_refused_point(tmp_path: Path) -> None:
    """Fails when runs do not start as the driver starts them, numbers land in the wrong row, or a status is another."""
    thin = '[[sweep.axis]]\nkey = "gas.viscosity"\nname = "mu"\n'
    thin += 'values = ["1.72e-5 Pa s", "1.72e-5 Pa s", "1e-12 Pa s", "1.72e-5 Pa s"]\n'
    text = SWEEP.format(doses="[1e-4, 2e-4, 2e-4, 1.5]", end="1 s", more=thin)
    (tmp_path / "doses.toml").write_text(text.replace("[sweep]", '[sweep]\nmode = "zip"'))
    status, messages = finish(command(tmp_path, "out", "-j", "2"))
    assert status == 0, messages
    data = mpm.load_sweep(tmp_path / "out")
    assert data.status.tolist() == ["done", "done", "failed", "bad_input"]
    assert data.error[2].startswith("steady flow") and "1.5" in data.error[3]
    assert data.attrs["units"]["species.TMA.fed"] == "mol/m"
    low, high, *none = data["species.TMA.fed"]
    assert high / low == pytest.approx(2.0, rel=1e-3) and np.isnan(none).all()
    assert (data["species.TMA.balance_error"][:2] < 1e-9).all()
    for point in data.point[:2]:
        run = tmp_path / "out" / "points" / point
        assert {"case.toml", "summary.json", "history.csv", "fields.pvd"} <= {
            file.name for file in run.iterdir()
        }
    assert (tmp_path / "out" / "plots" / "titration.tma.box_mean.png").exists()


@pytest.mark.slow
def test_a_killed_reactor_goes_on_from_its_restart_state(tmp_path: Path) -> None:
    """SIGKILL of the driver while the reactor runs. Fails when the run starts over or ends with other numbers."""
    (tmp_path / "doses.toml").write_text(SWEEP.format(doses="[2e-4]", end="15 s", more=""))
    driver = command(tmp_path, "out", "-j", "1")
    deadline = time.monotonic() + 120
    while not list((tmp_path / "out" / "points").glob("*/checkpoint.npz")):
        assert time.monotonic() < deadline and driver.poll() is None
        time.sleep(0.1)
    driver.kill()
    driver.communicate()
    assert not list((tmp_path / "out" / "points").glob("*/summary.json")), "the run was over before the kill"
    status, messages = finish(command(tmp_path, "out", "-j", "1"))
    assert status == 0, messages
    (record,) = [file.read_text() for file in (tmp_path / "out" / "driver").glob("*.json")]
    assert '"resumed": true' in record and '"attempt": 2' in record
    assert finish(command(tmp_path, "whole", "-j", "1"))[0] == 0
    resumed, whole = mpm.load_sweep(tmp_path / "out"), mpm.load_sweep(tmp_path / "whole")
    for name in ("titration.tma.box_mean", "species.TMA.fed", "steps"):
        assert resumed[name].item() == pytest.approx(whole[name].item(), rel=1e-6), name


def test_the_command_line_ends_with_2_and_one_line(tmp_path: Path) -> None:
    """Fails when `mpm sweep` answers a mistake otherwise than `mpm run` does, or writes anything."""
    (tmp_path / "doses.toml").write_text(SWEEP.format(doses='["1e-4 mm"]', end="1 s", more=""))
    status, messages = finish(command(tmp_path, "out"))
    assert status == 2 and messages.count("\n") == 1
    assert "mass_fractions.TMA: found '1e-4 mm'; accepted: a fraction" in messages
    assert [file.name for file in tmp_path.iterdir()] == ["doses.toml"]
