"""The whole chain at test size: accelerometer data -> waveform -> box -> profile -> coarse reactor."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from mpm.case.case import load_case
from mpm.cli import main
from mpm.motion.kinematics import BedMotion

pytestmark = pytest.mark.lammps


def test_from_accelerometer_to_coating(tmp_path: Path) -> None:
    """Every step uses the file of the step before; the reactor's bed must move at the DEM's (scaled) mean.

    Fails if a file format, a frame or a phase convention no longer fits between two steps.
    """
    pytest.importorskip("dolfinx_solver")
    # 1. accelerometer data of a 16 Hz machine, Gamma 0.5 at 45 degrees
    t = np.arange(4000) / 1600.0
    a = 0.5 * 9.81 * np.sin(2 * math.pi * 16.0 * t + 0.7)
    noise = np.random.default_rng(1).normal(0, 0.05, (2, t.size))
    np.savetxt(tmp_path / "data.csv", np.column_stack([t, a + noise[0], a + noise[1]]), delimiter=",")
    assert main(["dem", "waveform", str(tmp_path / "data.csv"), "-o", str(tmp_path / "w"), "-n", "1"]) == 0

    # 2. a box of coarse glass in air over a frit
    powder = tmp_path / "powder.toml"
    powder.write_text(
        'powder = "GL223"\n'
        + (tmp_path / "w" / "waveform.toml").read_text()
        + '[box]\nlength = 5\ndepth = 3\nheight = 5\nstiffness = "3 N/m"\nsize_classes = 1\n'
        'base = "frit"\nfrit_diameter = "125 um"\n[gas]\n'
        "[run]\nseeds = 1\ncycles = 4\ndiscard = 2\nupdates_per_cycle = 128\nsamples_per_cycle = 64\n"
        'dump_per_cycle = 0\n[profile]\nmean_velocity = "1.3 cm/s"\n'
    )
    assert main(["dem", str(powder), "-o", str(tmp_path / "dem"), "-q", "-j", "1"]) == 0
    assert "SCALED" in (tmp_path / "dem" / "profile_scaled.csv").read_text()

    # 3. a coarse single zone over two cycles with that bed
    case = Path(__file__).parents[1] / "cases" / "single_zone.toml"
    fast = {"geometry.cell_width": "7 mm", "time.end": "0.3 s", "time.step": "25 ms", "output.every": "0.1 s"}
    for name, mean in (("profile", None), ("profile_scaled", 0.013)):
        settings = {**fast, "motion.gamma": 0.5, "motion.angle": "45 deg"}
        settings["motion.profile"] = str(tmp_path / "dem" / f"{name}.csv")
        options = [x for key, value in settings.items() for x in ("--set", f"{key}={value}")]
        out = tmp_path / name
        assert main(["run", str(case), "-o", str(out), "-q", *options]) == 0
        summary = json.loads((out / "summary.json").read_text())
        assert summary["status"] == "done" and summary["species"]["TMA"]["reacted"] > 0.0
        table = np.genfromtxt(tmp_path / "dem" / f"{name}.csv", delimiter=",", names=True, deletechars="")
        bed = BedMotion(load_case(str(case), settings).motion)
        assert bed.mean == pytest.approx(table["u_x_m/s"].mean(), rel=1e-6)
        assert mean is None or bed.mean == pytest.approx(mean, rel=1e-6)
