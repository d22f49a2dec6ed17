"""`mpm dem` from the command line on boxes of test size: results, resume, MPI, bad input, missing LAMMPS."""

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from mpm.cli import main
from mpm.dem.case import load_case
from mpm.dem.run import last_words, process_log

TINY = """
title = "test"
powder = "GL50"
[waveform]
kind = "seed"
harmonics = 1
[box]
length = 5
depth = 3
height = 4
stiffness = "3 N/m"
[run]
seeds = 2
cycles = 3
discard = 1
updates_per_cycle = 128
samples_per_cycle = 64
dump_per_cycle = 4
"""


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def state(directory: Path, seed: int = 1) -> dict[str, np.ndarray]:
    with np.load(directory / f"seed_{seed}" / "state.npz") as archive:
        return dict(archive)


@pytest.mark.lammps
def test_run_writes_everything_and_resumes(tiny: Path, tmp_path: Path) -> None:
    """One run in detail: files, finite SI summary, consistent means; then refusal, resume with more cycles."""
    out = tmp_path / "out"
    assert main(["dem", str(tiny), "-o", str(out), "-q", "-j", "1"]) == 0
    summary = json.loads((out / "summary.json").read_text(), parse_constant=pytest.fail)
    assert summary["status"] == "done" and summary["seeds"] == [1, 2]
    names = {p.name for p in out.iterdir()} | {p.name for p in (out / "plots").iterdir()}
    assert names >= {
        "profile.csv",
        "profile_fit.csv",
        "voidage.csv",
        "depth.csv",
        "residence_times.csv",
        "case.toml",
    }
    assert names >= {"velocity.png", "voidage.png", "depth.png", "residence.png", "bed.png"}
    rows = np.genfromtxt(out / "profile.csv", delimiter=",", names=True, deletechars="", comments="#")
    mean = summary["mean_velocity"]
    assert len(rows) == 64 and np.mean(mean["seeds"]) == pytest.approx(mean["mean"])
    # the sampled velocity and the displacement of the centre of mass are two measurements of one thing
    assert rows["u_x_m/s"].mean() == pytest.approx(mean["mean"], abs=3e-4)
    assert rows["u_y_m/s"].mean() == pytest.approx(0.0, abs=2e-4)
    voidage = np.genfromtxt(out / "voidage.csv", delimiter=",", skip_header=1)
    assert voidage.shape[1] == 65 and voidage[:, 1:].min() > 0.2 and voidage[:, 1:].max() == 1.0
    frames = (out / "seed_1" / "trajectory.lammpstrj").read_text().count("ITEM: TIMESTEP")
    assert frames == 12

    before = state(out)
    assert main(["dem", str(tiny), "-o", str(out), "-q"]) == 2  # not empty
    assert main(["dem", str(tiny), "-o", str(out), "-q", "--resume", "--set", "run.cycles=4", "-j", "2"]) == 0
    after = state(out)
    assert after["cycles"] == 4 and len(after["velocity"]) == 4 * 64
    assert (after["velocity"][: 3 * 64] == before["velocity"]).all()
    assert (after["cycle_end"][:4] == before["cycle_end"]).all()
    # contact history starts anew on resume, velocities do not: no jump beyond what a sample changes anyway
    jumps = np.abs(np.diff(after["velocity"][:, 0]))
    assert jumps[3 * 64 - 1] < 3 * jumps.max(initial=0.0, where=np.arange(len(jumps)) != 3 * 64 - 1)
    assert main(["dem", str(tiny), "-o", str(out), "-q", "--resume", "--set", "box.length=6"]) == 2


@pytest.mark.lammps
@pytest.mark.skipif(shutil.which("mpirun", path=str(Path(sys.executable).parent)) is None, reason="no mpirun")
@pytest.mark.skipif("PMI_SIZE" in os.environ, reason="starts its own mpirun")
def test_ranks_share_the_seeds_or_one_box(tiny: Path, tmp_path: Path) -> None:
    """mpirun -n 2: two seeds side by side give bit for bit the serial result; one seed over two ranks agrees at
    first (round-off grows in a granular bed) and runs to the end, drag and frit included."""
    short = ["--set", "run.cycles=1", "--set", "run.discard=0"]
    serial, split, shared = (tmp_path / name for name in ("serial", "split", "shared"))
    assert main(["dem", str(tiny), "-o", str(serial), "-q", "-j", "1", *short]) == 0
    mpirun = [
        str(Path(sys.executable).parent / "mpirun"),
        "-n",
        "2",
        sys.executable,
        "-m",
        "mpm",
        "dem",
        str(tiny),
        "-q",
    ]
    # ranks that wait must not poll away the core that the others need
    quiet = {**os.environ, "MPIR_CVAR_ENABLE_HEAVY_YIELD": "1"}
    subprocess.run([*mpirun, "-o", str(split), *short], check=True, timeout=300, env=quiet)
    for seed in (1, 2):
        assert (state(serial, seed)["velocity"] == state(split, seed)["velocity"]).all()
    one_box = ["--set", "run.seeds=1", "--set", "gas.velocity='0 cm/s'", "--set", "box.base=frit"]
    subprocess.run([*mpirun, "-o", str(shared), *short, *one_box], check=True, timeout=300, env=quiet)
    assert np.isfinite(state(shared)["velocity"]).all() and len(state(shared)["velocity"]) == 64


def measured(tmp_path: Path, name: str, **overrides: Any) -> tuple[float, dict[str, np.ndarray]]:
    """Mean velocity and records of one seed."""
    from mpm.dem.simulate import Simulation

    case = load_case({"powder": "GL50", "waveform": {"kind": "seed", "harmonics": 1}}, {
        "box.length": 5, "box.depth": 3, "box.height": 4, "box.stiffness": "3 N/m", "run.dump_per_cycle": 0,
        "run.updates_per_cycle": 128, "run.samples_per_cycle": 64, "run.cycles": 3, "run.discard": 1, **overrides,
    })  # fmt: skip
    arrays = Simulation(case, 1, tmp_path / name).run()
    assert arrays is not None
    return float(arrays["velocity"][64:, 0].mean()), arrays


@pytest.mark.lammps
def test_a_declined_bed_flows_faster(tmp_path: Path) -> None:
    """Nine degrees down add velocity (section 4.4.3); fails if gravity is turned the wrong way."""
    level, _ = measured(tmp_path, "level", **{"waveform.gamma": 0.7})
    down, _ = measured(tmp_path, "down", **{"waveform.gamma": 0.7, "box.declination": "9 deg"})
    up, _ = measured(tmp_path, "up", **{"waveform.gamma": 0.7, "box.declination": "-9 deg"})
    assert up < level < down


@pytest.mark.lammps
def test_gas_at_rest_in_the_lab_lifts_a_fine_bed(tmp_path: Path) -> None:
    """GL56 at Gamma 0.30 over a frit has no flight without gas and flies in air at rest."""
    common = {
        "powder": "GL56", "waveform": {"kind": "sine", "gamma": 0.3, "frequency": "16 Hz"}, "box.size_classes": 1,
        "box.base": "frit", "run.cycles": 2, "box.length": 4, "box.height": 6, "box.stiffness": "1 N/m",
    }  # fmt: skip
    _, still = measured(tmp_path, "vacuum", **common)
    _, air = measured(tmp_path, "air", **common, **{"gas.velocity": "0 cm/s"})
    d = 56e-6
    assert np.ptp(still["gap_height"][64:]) < 0.1 * d < 0.5 * d < np.ptp(air["gap_height"][64:])


@pytest.mark.lammps
def test_a_baffle_holds_the_bed(tmp_path: Path) -> None:
    """Two sizes of coarse glass over a small sawtooth: none falls through the glued layer, the bed slows down."""
    common = {
        "powder": "GL223", "waveform": {"kind": "sine", "gamma": 0.5, "frequency": "16 Hz", "angle_from": "vertical"},
        "box.length": 10, "box.frit_diameter": "125 um", "box.size_classes": 2,
    }  # fmt: skip
    flat, _ = measured(tmp_path, "frit", **common, **{"box.base": "frit"})
    tooth = {"box.base": "sawtooth", "box.baffle_height": "0.5 mm", "box.baffle_width": "0.5 mm"}
    over, arrays = measured(tmp_path, "saw", **common, **tooth)
    assert arrays["cycle_end"][-1][:, 2].min() > 0.0
    assert over < flat


@pytest.mark.lammps
@pytest.mark.parametrize("setting", ["box.steps_per_collision=1", "box.stiffness='1e-4 N/m'"])
def test_an_exploding_box_ends_with_status_3_and_its_cause(
    tiny: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], setting: str
) -> None:
    """An unstable time step and a spring that cannot carry the bed: one line, with what to change."""
    out = tmp_path / "o"
    assert main(["dem", str(tiny), "-o", str(out), "-q", "-j", "2", "--set", setting]) == 3
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and "seed " in error and "raise" in error
    assert ("exploded" in error or "collapsed" in error) and setting.partition("=")[0] in error
    assert not (out / "summary.json").exists()


def test_without_lammps_it_says_how_to_get_it(tiny: Path, tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['lammps'] = None; from mpm.cli import main; "
        f"sys.exit(main(['dem', {str(tiny)!r}, '-o', {str(tmp_path / 'o')!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "pip install 'mpm[dem]'" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "o").exists()


@pytest.mark.lammps
def test_a_run_says_that_it_settles_and_what_came_out(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Fails when the minutes before the first cycle look like a standstill, or a number of the result has no unit and is no ratio."""
    monkeypatch.setattr("mpm.dem.screen.BETWEEN", 0.0)
    command = ["dem", str(tiny), "-o", str(tmp_path / "o"), "-j", "1", "--set", "run.seeds=1"]
    assert main([*command, "--set", "run.cycles=1", "--set", "run.discard=0"]) == 0
    out, err = capfd.readouterr()
    lines = [line for line in err.splitlines() if line.startswith("seed 1: ")]
    assert re.fullmatch(r"seed 1: settling, still at [\d.]+ mm/s \(rest: 0.11 mm/s\)", lines[0])
    assert lines[-1] == "seed 1: 1.0 of 1 cycles"
    told = [" ".join(line.split()) for line in out.splitlines()]
    assert any(re.fullmatch(r"mean of a cycle -?[\d.]+ cm/s", line) for line in told)
    assert (
        "limit of a straight drop 1.117 cm/s" in told and "gamma: peak acceleration over gravity 1.05" in told
    )
    assert f'motion.profile = "{tmp_path / "o" / "profile.csv"}"' in out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["missing.toml"], "missing.toml"),
        (["tiny.toml", "--set", "box.lenght=3"], "box.lenght"),
        (["tiny.toml", "--set", "box"], "KEY=VALUE"),
        (["tiny.toml", "--resume", "--overwrite"], "--resume"),
        (["tiny.toml", "--set", "waveform={kind='table', file='none.csv'}"], "none.csv"),
        (["waveform", "none.csv"], "none.csv"),
    ],
)
def test_bad_input_ends_with_status_2_in_one_line(
    tiny: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    arguments: list[str],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["dem", *arguments]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and says in error
    assert not (tmp_path / "results").exists()


def test_waveform_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Accelerometer data in, a section for a powder file out: the file reads back to the same motion."""
    t = np.arange(4096) / 1600.0
    a = np.column_stack(
        [t, 5 * np.cos(2 * math.pi * 48 * t - 1.0), 9.81 + 7 * np.cos(2 * math.pi * 48 * t - 1.0)]
    )
    np.savetxt(tmp_path / "data.csv", a, delimiter=",", header="t,a_y,a_z", comments="")
    assert main(["dem", "waveform", str(tmp_path / "data.csv"), "-o", str(tmp_path / "w"), "-n", "1"]) == 0
    assert "48.000 Hz" in capfd.readouterr().out
    assert {p.name for p in (tmp_path / "w").iterdir()} == {"waveform.json", "waveform.toml", "waveform.png"}
    powder = tmp_path / "p.toml"
    powder.write_text('powder = "GL50"\n' + (tmp_path / "w" / "waveform.toml").read_text())
    wave = load_case(powder).build_waveform()
    assert wave.acceleration(np.array([1 / 48 / 4]))[:, 0] == pytest.approx([-5.0, -7.0], rel=1e-3)


@pytest.mark.lammps
def test_interrupted_run_goes_on(tiny: Path, tmp_path: Path) -> None:
    """SIGINT while two seeds run side by side: status 130, no child left, and --resume ends the run."""
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-m",
        "mpm",
        "dem",
        str(tiny),
        "-o",
        str(out),
        "-q",
        "-j",
        "2",
        "--set",
        "box.height=2",
    ]
    long = subprocess.Popen([*command, "--set", "run.cycles=400"], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not all((out / f"seed_{s}" / "state.npz").exists() for s in (1, 2)):
        assert time.monotonic() < deadline and long.poll() is None
        time.sleep(0.2)
    children = psutil.Process(long.pid).children(recursive=True)
    long.send_signal(signal.SIGINT)
    assert long.wait(timeout=60) == 130
    assert long.stderr is not None and "--resume" in long.stderr.read()
    assert psutil.wait_procs(children, timeout=10)[1] == []
    assert not (out / "summary.json").exists()
    done = int(max(state(out, s)["cycles"] for s in (1, 2)))
    assert main([*command[3:], "--resume", "--set", f"run.cycles={max(done, 2)}"]) == 0
    assert json.loads((out / "summary.json").read_text())["status"] == "done"


CRASH = """
import ctypes, json, queue, sys
from pathlib import Path
import mpm.dem.run as run

class Simulation:
    def __init__(self, *_): pass
    def run(self, *_):
        print("ERROR on proc 0: Molecule count changed (src/x.cpp:1)", flush=True)
        if sys.argv[2] == "segfault":
            ctypes.string_at(0)
        raise ValueError("Some input data are greater than the size of the periodic box.")

run.Simulation = Simulation
messages = queue.SimpleQueue()
run._work(Path(sys.argv[1]), 1, False, messages)
Path(sys.argv[1]).with_name("message").write_text(json.dumps(messages.get()))
"""


@pytest.mark.parametrize("how", ["exception", "segfault"])
def test_a_seed_that_crashes_leaves_its_last_words(tiny: Path, how: str) -> None:
    """Fails when the cause of a crash in a process of its own is missing in its log or in the line that tells of it."""
    done = subprocess.run([sys.executable, "-c", CRASH, str(tiny), how], capture_output=True, text=True)
    log = process_log(tiny.parent, 1)
    text = log.read_text()
    assert "Molecule count changed" in text and not done.stdout and not done.stderr
    if how == "segfault":
        assert done.returncode == -signal.SIGSEGV
        assert "Segmentation fault" in text
        assert "was killed by SIGSEGV" in last_words(log, done.returncode) and str(log) in last_words(
            log, -11
        )
    else:
        seed, kind, content = json.loads((tiny.parent / "message").read_text())
        assert (seed, kind) == (1, "crashed") and content.startswith("ValueError: Some input data")
        assert "Traceback" in text


def test_how_a_process_ended_is_said_in_words(tmp_path: Path) -> None:
    """Fails when an exit code or a signal is not told, or a log without text is quoted."""
    assert (
        last_words(tmp_path / "none", -9)
        == "its process was killed by SIGKILL (out of memory?) and without a word"
    )
    (tmp_path / "log").write_text("first\nAbort(1): no room\n\n")
    words = last_words(tmp_path / "log", 1)
    assert words == f"its process ended with exit code 1: Abort(1): no room (see {tmp_path / 'log'})"
