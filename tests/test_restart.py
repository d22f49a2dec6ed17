"""Runs that are interrupted, killed, or fail go on to the result of an undisturbed one, on any number of ranks."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case
from mpm.errors import InputError, Interrupted
from mpm.flow.sequence import CyclicFlow
from mpm.output.directory import RunDirectory
from mpm.output.results import load_run
from mpm.parallel import on_root, total
from mpm.reactor import checkpoint
from mpm.reactor.reactor import Reactor, Result

from .cases import HEATED, MPI, SHORT, TINY, assert_laws, assert_same_numbers, cycle, run, zone
from .general import SIX_GASES

COMM = MPI.COMM_WORLD
RESOLVED = {"fidelity": "resolved", "time.end": "0.2 s", "output.every": "50 ms", "time.steps_per_cycle": 16}
MODES = {
    "averaged": zone({"time.end": "0.5 s", "output.every": "0.1 s"}, TINY),
    "resolved": zone(RESOLVED, TINY),
    "impulsive": zone({**RESOLVED, "motion.startup": "impulsive"}, TINY),
    "lab": zone({**RESOLVED, "motion.inlet_frame": "lab", "motion.gamma": 0.6}, TINY),
    "periodic solids": zone(
        {"time.end": "0.8 s", "output.every": "0.1 s", "geometry.bed_inflow": "periodic"}, TINY
    ),
    "heated": zone({"time.end": "0.5 s", "output.every": "0.1 s", **HEATED}, TINY),
    "heated resolved": zone({**RESOLVED, **HEATED, "energy.flow_update": 0.002}, TINY),
    "heated impulsive": zone({**RESOLVED, **HEATED, "motion.startup": "impulsive"}, TINY),
    "six gases": zone({"time.end": "0.5 s", "output.every": "0.1 s", **SIX_GASES}, TINY),
    "both precursors": cycle(
        {
            "time.end": "4 s",
            "time.step": "40 ms",
            "output.every": "1 s",
            "geometry.inlet.water.start": "1 s",
        },
        TINY,
    ),
}


def interrupted(case: Case, folder: Path, after: float, comm: MPI.Comm = COMM) -> None:
    """Run `case` and ask it to stop at the first output time after `after` [s]."""

    def stop(reactor: Reactor) -> None:
        if reactor.time > after:
            reactor.stop()

    with pytest.raises(Interrupted):
        Reactor(case, comm).run(output=folder, callback=stop)


def assert_same_state(one: Result, other: Result, tolerance: float) -> None:
    """Concentrations (over the largest), coverages and temperatures of two results, cell by cell; collective."""
    if one.case.energy is not None:
        np.testing.assert_allclose(one.field("temperature"), other.field("temperature"), rtol=tolerance)
    for name in one.case.mechanism.species_names:
        a, b = one.field(f"C_{name}"), other.field(f"C_{name}")
        np.testing.assert_allclose(a, b, rtol=0.0, atol=tolerance * max(a.max(), 1e-12))
    for layer in ("frit", "bed"):
        for site in one.case.mechanism.site_names:
            np.testing.assert_allclose(
                one.coverage(layer, site), other.coverage(layer, site), rtol=0.0, atol=tolerance
            )


@pytest.mark.parametrize("mode", MODES)
def test_resumed_run_equals_the_uninterrupted_one(mode: str, tmp_path: Path) -> None:
    """Fails when anything that a run needs is missing from its restart state: all must agree to 1e-12."""
    case = MODES[mode]
    _, whole = run(case, output=tmp_path / "whole")
    interrupted(case, tmp_path / "cut", 0.11)
    _, resumed = run(case, output=tmp_path / "cut", resume=True)
    assert_same_numbers(whole.summary, resumed.summary, 1e-12)
    assert_same_state(whole, resumed, 1e-12)
    assert whole.history.keys() == resumed.history.keys()
    for name, values in whole.history.items():
        if not name.startswith("balance.") and not name.endswith("balance_error"):
            np.testing.assert_allclose(resumed.history[name], values, rtol=1e-9, atol=1e-15, err_msg=name)


SHARED, OWN = 1e-12, 1e-9
"""How far two runs on several ranks may lie apart that share their flow, and that factor its matrices anew: MUMPS adds up in the order in
which messages arrive, and what is a trace yet (1e-10 of all sites) feels the last digit of a velocity."""


@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize(
    ("mode", "tolerance"),
    [
        ("resolved", SHARED),
        ("both precursors", SHARED),
        ("impulsive", OWN),
        ("heated", OWN),
        ("heated impulsive", OWN),
    ],
)
def test_restart_state_is_complete_on_several_ranks(mode: str, tolerance: float, tmp_path: Path) -> None:
    """Fails when a run that goes on from a state differs by more than `tolerance` from the run that wrote the state in passing.

    The state holds a developed flow, so both share it. Impulsive and heated runs go on with factors of their own.
    """
    case, directory = MODES[mode], RunDirectory(tmp_path / "state")

    def prepare() -> None:
        directory.prepare(resume=False, overwrite=False)
        directory.write_case(case.to_toml())
        directory.release()

    on_root(COMM, prepare)
    reactor = Reactor(case, COMM)
    written: list[float] = []

    def write(r: Reactor) -> None:
        if r.time > 0.11 and not written:
            written.append(r.time)
            checkpoint.write(r.course, checkpoint.identity(case), directory)

    whole = reactor.run(callback=write)
    assert written and written[0] < 0.8 * reactor.time
    _, resumed = run(case, COMM, output=tmp_path / "state", resume=True)
    assert_same_numbers(whole.summary, resumed.summary, tolerance)
    assert_same_state(whole, resumed, tolerance)


@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize("mode", ["resolved", "both precursors"])
def test_restart_on_another_number_of_ranks(mode: str, tmp_path: Path) -> None:
    """Fails when a restart state depends on the ranks that wrote it: one rank to all and all to one must agree with one to 1e-8."""
    case = MODES[mode]
    _, whole = run(case, MPI.COMM_SELF)
    if COMM.rank == 0:
        interrupted(case, tmp_path / "from-one", 0.11, MPI.COMM_SELF)
    COMM.Barrier()
    _, to_all = run(case, COMM, output=tmp_path / "from-one", resume=True)
    assert_same_numbers(whole.summary, to_all.summary, 1e-8)
    assert_same_state(whole, to_all, 1e-8)

    interrupted(case, tmp_path / "from-all", 0.11)
    if COMM.rank == 0:
        _, to_one = run(case, MPI.COMM_SELF, output=tmp_path / "from-all", resume=True)
        assert_same_numbers(whole.summary, to_one.summary, 1e-8)
    assert total(COMM, [1.0])[0] == COMM.size


@pytest.mark.parametrize("mode", ["averaged", "resolved", "impulsive"])
def test_resume_accepts_a_later_end(mode: str, tmp_path: Path) -> None:
    """Fails when a run that ended within a step and between two output times cannot be prolonged, or the prolonged one is not the run of
    that length to the last digit."""
    longer = MODES[mode].with_({"time.end": "0.33 s"})
    _, whole = run(longer)
    reactor, first = run(longer.with_({"time.end": "0.237 s"}), output=tmp_path / "run")
    assert first.summary["simulated_seconds"] == first.history["time"][-1] == 0.237
    assert reactor.system.schedule.step(reactor.steps - 1).cut
    assert first.summary["species"]["TMA"]["fed"] == pytest.approx(
        0.237 / 0.33 * whole.summary["species"]["TMA"]["fed"], rel=1e-9
    )
    _, prolonged = run(longer, output=tmp_path / "run", resume=True)
    assert_same_numbers(whole.summary, prolonged.summary, 0.0)
    assert whole.history.keys() == prolonged.history.keys()
    for name, values in whole.history.items():
        np.testing.assert_array_equal(prolonged.history[name], values, err_msg=name)
    _, same = run(longer, output=tmp_path / "run", resume=True)
    assert_same_numbers(whole.summary, same.summary, 0.0)


def test_resume_refuses_another_case(tmp_path: Path) -> None:
    """Fails when an end before the restart state, or another change, is accepted."""
    case = MODES["averaged"]
    run(case, output=tmp_path / "run")
    for key, value in {"motion.gamma": 0.4, "time.end": "0.3 s"}.items():
        with pytest.raises(InputError, match=key.replace(".", r"\.")):
            Reactor(case.with_({key: value}), MPI.COMM_SELF).run(output=tmp_path / "run", resume=True)


def test_a_state_knows_its_case(tmp_path: Path) -> None:
    """Fails when a state goes on under another case that it has been put beside: mesh, coarser or finer, or motion; or one of another
    format."""
    case = MODES["averaged"]
    run(case, output=tmp_path / "run")
    longer = case.with_({"time.end": "1 s", "title": "renamed", "output.every": "0.2 s"})
    others = {
        "geometry.cell_width": ["4 mm", "10 mm"],
        "motion.bed_velocity": ["2.6 cm/s"],
        "time.step": ["5 ms"],
    }
    foreign = tmp_path / "foreign"
    for key, values in others.items():
        for value in values:
            foreign.mkdir()
            shutil.copy(tmp_path / "run" / "checkpoint.npz", foreign)
            with pytest.raises(InputError, match=r"checkpoint\.npz: the state of another case"):
                Reactor(longer.with_({key: value}), MPI.COMM_SELF).run(output=foreign, resume=True)
            assert [path.name for path in foreign.iterdir()] == ["checkpoint.npz"]
            shutil.rmtree(foreign)
    foreign.mkdir()
    shutil.copy(tmp_path / "run" / "checkpoint.npz", foreign)
    _, resumed = run(longer, output=foreign, resume=True)
    assert resumed.summary["simulated_seconds"] == 1.0
    directory = RunDirectory(tmp_path / "run")
    state = directory.read_checkpoint()
    assert state is not None
    directory.write_checkpoint(state[0], {**state[1], "format": 1})
    with pytest.raises(InputError, match="another version of mpm"):
        Reactor(case, MPI.COMM_SELF).run(output=tmp_path / "run", resume=True)


def test_a_state_knows_its_profile(tmp_path: Path) -> None:
    """Fails when a motion profile that was replaced under its name is mixed with the one that the run began with, or when the same profile
    under another name is refused."""
    profile = tmp_path / "profile.csv"
    shape = "".join(f"{i * 10},{0.013 + 0.01 * np.sin(np.deg2rad(i * 10)):.6g}\n" for i in range(36))
    profile.write_text(f"phase_deg,u_x_m/s\n{shape}")
    case = MODES["averaged"].with_({"motion.profile": str(profile)})
    run(case.with_({"time.end": "0.2 s"}), output=tmp_path / "run")
    again = tmp_path / "again.csv"
    shutil.copy(profile, again)
    run(
        case.with_({"time.end": "0.25 s", "motion.profile": str(again)}), output=tmp_path / "run", resume=True
    )
    again.write_text(again.read_text().replace("0.013\n", "0.014\n", 1))
    changed = case.with_({"motion.profile": str(again)})
    with pytest.raises(InputError, match=r"again\.csv: the motion profile has changed"):
        Reactor(changed, MPI.COMM_SELF).run(output=tmp_path / "run", resume=True)


def test_resume_of_a_directory_without_a_state_starts_anew(tmp_path: Path) -> None:
    """Fails when a run that was killed before its first restart state cannot be resumed."""
    case = MODES["averaged"]
    _, whole = run(case, output=tmp_path / "whole")
    run(case, output=tmp_path / "cut")
    (tmp_path / "cut" / "checkpoint.npz").unlink()
    _, again = run(case, output=tmp_path / "cut", resume=True)
    assert_same_numbers(whole.summary, again.summary, 1e-12)
    np.testing.assert_array_equal(again.history["time"], whole.history["time"])


def test_a_flow_once_found_is_not_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a run that dies before its first restart state is due has to find its flow again."""
    case = MODES["resolved"].with_({"output.checkpoint": "1 h"})
    _, whole = run(case)

    def die(reactor: Reactor) -> None:
        if reactor.time > 0.0:
            raise MemoryError

    with pytest.raises(MemoryError):
        Reactor(case, MPI.COMM_SELF).run(output=tmp_path / "run", callback=die)
    monkeypatch.setattr(CyclicFlow, "solve", None)
    reactor, resumed = run(case, output=tmp_path / "run", resume=True)
    assert reactor.history()["time"].tolist() == whole.history["time"].tolist()
    assert_same_numbers(whole.summary, resumed.summary, 1e-12)


# --- other processes: kill, terminate, fail ---

LONG = {
    **SHORT,
    "fidelity": "resolved",
    "time.end": "4 s",
    "output.every": "0.1 s",
    "output.checkpoint": "0.1 s",
}


def start(
    case: Case, folder: Path, *options: str, prefix: list[str] | None = None, before: str = ""
) -> subprocess.Popen[str]:
    """`mpm run` of `case` into `folder`/run in a process of its own; `before` is Python to execute first."""
    file = folder / "case.toml"
    file.write_text(case.to_toml())
    code = f"import sys; {before or 'pass'}\nfrom mpm.cli import main; sys.exit(main(sys.argv[1:]))"
    arguments = ["run", str(file), "-o", str(folder / "run"), "--quiet", *options]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parents[1])}
    return subprocess.Popen(
        [*(prefix or [sys.executable]), "-c", code, *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, cwd=folder,
    )  # fmt: skip


def wait_for(process: subprocess.Popen[str], file: Path, seconds: float = 120.0) -> None:
    """Wait until `file` is there or the process has ended."""
    deadline = time.monotonic() + seconds
    while not file.exists() and process.poll() is None:
        assert time.monotonic() < deadline, f"no {file.name} after {seconds:g} s"
        time.sleep(0.01)


def finish(process: subprocess.Popen[str], status: int) -> str:
    _, errors = process.communicate(timeout=240)
    assert process.returncode == status, errors
    return errors


def summary_of(folder: Path) -> Mapping[str, Any]:
    return json.loads((folder / "run" / "summary.json").read_text())


def assert_same_files(one: Path, other: Path, tolerance: float) -> None:
    """Final states and tables of two directories."""
    assert_same_numbers(summary_of(one), summary_of(other), tolerance)
    a, b = (np.load(folder / "run" / "checkpoint.npz", allow_pickle=False) for folder in (one, other))
    for name in ("species.concentration", "coverage.theta"):
        scale = float(np.abs(a[name]).max())
        np.testing.assert_allclose(b[name], a[name], rtol=0.0, atol=tolerance * scale, err_msg=name)
    tables = [(folder / "run" / "history.csv").read_text().splitlines() for folder in (one, other)]
    assert [line.split(",")[0] for line in tables[0]] == [line.split(",")[0] for line in tables[1]]


@pytest.mark.slow
def test_killed_at_random_moments(tmp_path: Path, mpirun: Any) -> None:
    """Fails when SIGKILL at any moment leaves a directory that cannot be resumed, or one whose resumed run differs: by more than 1e-12 on
    one rank (and by a byte of history.csv), or more than 1e-8 on two. scripts/kill_test.py does it a hundred times."""
    case, seed = (
        zone({**LONG, "time.end": "20 s"}, TINY),
        random.randrange(10**6),
    )  # longer than all moments together
    print(f"seed of the moments: {seed}")
    moments = random.Random(seed)
    folders = {name: tmp_path / name for name in ("whole", "killed", "two")}
    for folder in folders.values():
        folder.mkdir()
    finish(start(case, folders["whole"]), 0)
    killed = folders["killed"]
    for attempt in range(3):
        process = start(case, killed, *(["--resume"] if attempt else []))
        if (
            attempt != 1
        ):  # the second one may die anywhere: while it imports, meshes, reads the state or writes
            wait_for(process, killed / "run" / "checkpoint.npz")
        time.sleep(moments.uniform(0.0, 4.0 if attempt == 1 else 1.0))
        assert process.poll() is None, process.communicate()
        process.send_signal(signal.SIGKILL)
        process.communicate()
    shutil.copytree(killed / "run", folders["two"] / "run")
    for line in (killed / "run" / "history.csv").read_text().splitlines()[1:]:
        assert np.isfinite([float(v) for v in line.split(",") if v]).all()
    finish(start(case, killed, "--resume"), 0)
    assert_same_files(folders["whole"], killed, 1e-12)
    histories = [(folder / "run" / "history.csv").read_bytes() for folder in (folders["whole"], killed)]
    assert histories[0] == histories[1]
    finish(start(case, folders["two"], "--resume", prefix=mpirun(2)), 0)
    assert_same_files(folders["whole"], folders["two"], 1e-8)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_end_a_run_in_order(number: signal.Signals, tmp_path: Path) -> None:
    """Fails when SIGTERM or Ctrl-C does not end a run with status 130, one line and a directory that can be read and resumed."""
    case = zone(LONG, TINY)
    process = start(case, tmp_path)
    wait_for(process, tmp_path / "run" / "checkpoint.npz")
    process.send_signal(number)
    line = finish(process, 130)
    assert "interrupted at t = " in line and "Traceback" not in line and len(line.strip().splitlines()) == 1
    summary = summary_of(tmp_path)
    assert line.partition(";")[0] in (tmp_path / "run" / "run.log").read_text()
    assert line.count("mpm resume") == 1
    assert summary["status"] == "interrupted" and 0.0 < summary["simulated_seconds"] < 4.0
    found = load_run(tmp_path / "run")
    assert found.snapshot().cell_data["C_TMA"].shape == (found.grid.cells,)
    shorter = case.with_({"time.end": f"{summary['simulated_seconds'] + 0.1!r} s"})
    _, resumed = run(shorter, output=tmp_path / "run", resume=True)
    assert resumed.summary["status"] == "done"


def test_numerical_failure_ends_with_status_3(tmp_path: Path) -> None:
    """Fails when a run that cannot go on does not end with status 3 and one line, or `--resume` does not take it up from the last good
    state (here: Newton's limit is spoilt after 20 steps of the first attempt)."""
    case = zone({**SHORT, "time.end": "0.6 s"}, TINY)
    spoil = (
        "import mpm.transport.species as t; advance = t.Transport.advance\n"
        "def spoilt(self, operators, t0, *more, **options):\n"
        "    t.NEWTON_LIMIT = 1 if t0 > 0.3 else 30\n"
        "    return advance(self, operators, t0, *more, **options)\n"
        "t.Transport.advance = spoilt"
    )
    line = finish(start(case, tmp_path, before=spoil), 3)
    assert (
        "Newton stopped after" in line and "Traceback" not in line and len(line.strip().splitlines()) == 1
    ), line
    summary = summary_of(tmp_path)
    assert summary["status"] == "failed" and 0.3 < summary["simulated_seconds"] < 0.4
    finish(start(case, tmp_path, "--resume"), 0)
    _, whole = run(case)
    assert summary_of(tmp_path)["status"] == "done"
    assert_same_numbers(whole.summary, summary_of(tmp_path), 1e-12)


def test_laws_hold_at_every_step() -> None:
    """Fails when a balance or bound is broken between output times: every single step of a resolved run is looked at."""
    reactor = Reactor(
        zone({**SHORT, "fidelity": "resolved", "time.end": "0.3 s", "output.every": "1 ms"}, TINY),
        MPI.COMM_SELF,
    )
    seen: list[float] = []

    def look(r: Reactor) -> None:
        assert_laws(r)
        seen.append(r.time)

    reactor.run(callback=look)
    assert len(seen) == reactor.system.schedule.steps + 1
