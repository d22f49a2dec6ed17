"""The last cycle of a resolved run phase by phase: which phases, where the points are, and velocities in the lab's frame."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.advice.checks import check_case
from mpm.advice.idle import idle_keys
from mpm.case.case import Case
from mpm.errors import ConvergenceError, InputError, Interrupted
from mpm.mesh.grid import Grid
from mpm.motion.kinematics import BedMotion
from mpm.motion.schedule import Schedule
from mpm.output.directory import RunDirectory
from mpm.output.phases import LastCycle, phase_fields
from mpm.output.vtu import Snapshot
from mpm.reactor import records
from mpm.reactor.reactor import Reactor
from mpm.reactor.system import System

from .cases import MPI, TINY, assert_same_numbers, zone

COMM = MPI.COMM_WORLD
RESOLVED = {
    "fidelity": "resolved",
    "time.end": "0.25 s",
    "time.steps_per_cycle": 16,
    "output.every": "0.1 s",
    "output.phases": 8,
    "motion.start": "20 ms",
}
PERIOD = 1.0 / 16.0


def resolved(**changes: Any) -> Case:
    return zone({**RESOLVED, **{key.replace("__", "."): value for key, value in changes.items()}}, TINY)


def phases(folder: Path) -> list[Snapshot]:
    series = RunDirectory(folder).phases
    return [series.read(index) for index in range(len(series.steps))]


@pytest.mark.parametrize("name", ["fields", "phases"])
def test_what_is_beyond_the_precision_of_the_files_ends_the_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, recwarn: pytest.WarningsRecorder
) -> None:
    """Fails when a number beyond single precision is written as infinite, among fields or phases, or numpy has the word."""
    usual, limit = records.local_fields, 0.0 if name == "fields" else 0.2

    def enormous(system: System) -> dict[str, np.ndarray]:
        fields = usual(system)
        return {**fields, "pressure": 1e39 + fields["pressure"]} if reactor.time > limit else fields

    monkeypatch.setattr(records, "local_fields", enormous)
    reactor = Reactor(resolved(output__every="0.25 s" if name == "phases" else "0.1 s"), COMM)
    with pytest.raises(ConvergenceError, match=rf"{name}_\d+\.vtu: pressure is not finite"):
        reactor.run(output=tmp_path / "run")
    assert not [warning for warning in recwarn if issubclass(warning.category, RuntimeWarning)]


def assert_same_phases(one: Path, other: Path, tolerance: float = 0.0) -> None:
    a, b = phases(one), phases(other)
    assert len(a) == len(b) > 0
    for mine, yours in zip(a, b, strict=True):
        assert mine.time == pytest.approx(yours.time, abs=1e-12)
        np.testing.assert_allclose(mine.points, yours.points, rtol=0.0, atol=1e-12)
        assert mine.cell_data.keys() == yours.cell_data.keys()
        for name, values in mine.cell_data.items():
            scale = float(np.abs(values).max(initial=0.0))
            np.testing.assert_allclose(
                np.asarray(yours.cell_data[name], float),
                np.asarray(values, float),
                rtol=0.0,
                atol=tolerance * scale,
                err_msg=name,
            )


@pytest.mark.parallel
def test_last_cycle_is_written_phase_by_phase(tmp_path: Path) -> None:
    """Fails when the phases are not those of the last cycle at equal distances, the points are not where the reactor has carried them, two
    phases are alike, the files depend on the number of ranks, or writing them changes a result."""
    case = resolved()
    result = Reactor(case, COMM).run(output=tmp_path / "all")
    if COMM.rank != 0:
        return
    alone = Reactor(case.with_({"output.phases": 0}), MPI.COMM_SELF).run(output=tmp_path / "without")
    assert_same_numbers(result.summary, alone.summary, 0.0 if COMM.size == 1 else 1e-8)
    assert not (tmp_path / "without" / "phases.pvd").exists()
    found, grid = phases(tmp_path / "all"), Grid.from_case(case)
    times = np.array([snapshot.time for snapshot in found])
    assert len(found) == 8 and times[0] > 0.25 - PERIOD and 0.25 - PERIOD / 8 < times[-1] <= 0.25
    np.testing.assert_allclose(np.diff(times), PERIOD / 8, rtol=1e-9)
    turns = (times - 0.02) / PERIOD * 8
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    vibration = BedMotion(case.motion).vibration
    for snapshot, (_, file) in zip(found, RunDirectory(tmp_path / "all").phases.steps, strict=True):
        phase = 2.0 * np.pi * 16.0 * (snapshot.time - 0.02)
        moved = snapshot.points.reshape(grid.rows + 1, grid.columns + 1, 3)
        np.testing.assert_allclose(moved[0, :, 0], grid.x + vibration.ax * np.sin(phase), atol=1e-12)
        np.testing.assert_allclose(moved[:, 0, 1], grid.y + vibration.ay * np.sin(phase), atol=1e-12)
        assert round(phase / (2.0 * np.pi) * 8) % 8 == int(file[-10:-4])
    mean = np.mean([snapshot.points for snapshot in found], axis=0)
    np.testing.assert_allclose(mean[0, :2], [grid.x[0], grid.y[0]], atol=1e-12)
    upwards = [np.asarray(snapshot.cell_data["velocity"][:, 0], float) for snapshot in found]
    assert all(np.abs(a - b).max() > 1e-4 for i, a in enumerate(upwards) for b in upwards[:i]), (
        "two phases are alike"
    )
    if COMM.size > 1:
        Reactor(case, MPI.COMM_SELF).run(output=tmp_path / "one")
        assert_same_phases(tmp_path / "one", tmp_path / "all", 1e-6)


def test_velocities_of_gas_and_bed_in_a_phase() -> None:
    """Fails when gas at rest in the pores is not carried with the reactor, gas at rest in the lab has a velocity there, or the bed's own
    velocity shows up elsewhere than in the moving layer."""
    case = resolved()
    grid, motion = Grid.from_case(case), BedMotion(case.motion)
    step = Schedule.from_case(case).step(12)
    x, y = motion.vibration.velocity(step.t1 - case.motion.start)
    layer = np.repeat(grid.row_layer, grid.columns)
    porosity = np.array([1.0 if x.material is None else x.material.porosity for x in case.geometry.layers])
    still = phase_fields({"velocity": np.zeros((grid.cells, 2))}, case, grid, motion, step)
    np.testing.assert_allclose(
        still["velocity_lab"] / porosity[layer, None], np.tile([x, y], (grid.cells, 1))
    )
    against = {"velocity": -porosity[layer, None] * np.array([x, y])}
    at_rest = phase_fields(against, case, grid, motion, step)
    np.testing.assert_allclose(at_rest["velocity_lab"], 0.0, atol=1e-15)
    bed = layer == grid.layer_names.index("bed")
    slid = motion.at(step.t1 - case.motion.start) - motion.at(step.t0 - case.motion.start)
    np.testing.assert_allclose(still["bed_velocity"][bed], np.tile([slid / step.dt, 0.0], (bed.sum(), 1)))
    assert slid != 0.0 and not still["bed_velocity"][~bed].any()


@pytest.mark.parametrize("change", [{}, {"motion__startup": "impulsive"}], ids=["developed", "impulsive"])
def test_phases_of_a_resumed_run(change: dict[str, Any], tmp_path: Path) -> None:
    """Fails when a run that was stopped within its last cycle, or prolonged by half a cycle, has other phases than one in a single go, or
    leaves a file that is not one of them."""
    case = resolved(**change)
    last = LastCycle.of(case, Schedule.from_case(case))
    whole = case.with_({"time.end": "0.283 s"})  # ends within a step

    def stop(reactor: Reactor) -> None:
        if reactor.time > last.since + 0.3 * PERIOD:
            reactor.stop()

    halting = case.with_({"output.every": "7 ms"})
    Reactor(case, MPI.COMM_SELF).run(output=tmp_path / "once")
    with pytest.raises(Interrupted):
        Reactor(halting, MPI.COMM_SELF).run(output=tmp_path / "cut", callback=stop)
    assert 0 < len(phases(tmp_path / "cut")) < 8
    (tmp_path / "cut" / "phases" / "phases_000099.vtu").write_text("written, but not listed")
    Reactor(halting, MPI.COMM_SELF).run(output=tmp_path / "cut", resume=True)
    assert_same_phases(tmp_path / "once", tmp_path / "cut", 1e-12)

    Reactor(whole, MPI.COMM_SELF).run(output=tmp_path / "whole")
    Reactor(whole, MPI.COMM_SELF).run(output=tmp_path / "once", resume=True)
    assert_same_phases(tmp_path / "whole", tmp_path / "once", 1e-12)
    assert len(list((tmp_path / "once" / "phases").iterdir())) == 8
    Reactor(case, MPI.COMM_SELF).run(output=tmp_path / "whole", overwrite=True)
    assert len(phases(tmp_path / "whole")) == 8
    RunDirectory(tmp_path / "whole").cut_back(0, 0.0)
    assert not (tmp_path / "whole" / "phases.pvd").exists()
    assert not list((tmp_path / "whole" / "phases").iterdir())


def test_phases_before_a_state_that_was_not_in_the_last_cycle(tmp_path: Path) -> None:
    """Fails when an end drawn near enough that the restart state lies within the last cycle gives fewer phases without a word."""
    case = resolved(time__end="1 s")

    def stop(reactor: Reactor) -> None:
        if reactor.time > 0.2:
            reactor.stop()

    with pytest.raises(Interrupted):
        Reactor(case, MPI.COMM_SELF).run(output=tmp_path, callback=stop)
    state = RunDirectory(tmp_path).read_checkpoint()
    assert state is not None
    end = state[1]["time"] + 0.5 * PERIOD
    Reactor(case.with_({"time.end": f"{end!r} s"}), MPI.COMM_SELF).run(output=tmp_path, resume=True)
    assert len(phases(tmp_path)) == 4
    assert "4 of the 8 phases of the last cycle" in (tmp_path / "run.log").read_text()


def test_directory_from_before_the_key_goes_on(tmp_path: Path) -> None:
    """Fails when a run whose case.toml was written before output.phases existed cannot be prolonged."""
    case = resolved(output__phases=0)
    Reactor(case, MPI.COMM_SELF).run(output=tmp_path)
    file = tmp_path / "case.toml"
    file.write_text("".join(line for line in file.read_text().splitlines(True) if "phases = 0" not in line))
    Reactor(case.with_({"time.end": "0.3 s"}), MPI.COMM_SELF).run(output=tmp_path, resume=True)
    assert json.loads((tmp_path / "summary.json").read_text())["simulated_seconds"] == 0.3
    with pytest.raises(InputError, match=r"changed in output\.phases"):
        Reactor(case.with_({"output.phases": 8}), MPI.COMM_SELF).run(output=tmp_path, resume=True)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"output.phases": 12}, "one of 1, 2, 4, 8, 16, which divide time.steps_per_cycle = 16"),
        ({"output.phases": 32}, "one of 1, 2, 4, 8, 16"),
        ({"output.phases": -1}, "output.phases"),
        ({"output.phases": "16"}, "output.phases"),
        (
            {"fidelity": "averaged"},
            'output.phases: found 8 in a run with fidelity averaged.*fidelity = "resolved"',
        ),
        ({"fidelity": "steady"}, "found 8 in a run with fidelity steady"),
    ],
)
def test_phases_that_cannot_be_written_are_refused(changes: dict[str, Any], said: str) -> None:
    """Fails when phases between steps, or of a run that knows none, are accepted or ignored."""
    with pytest.raises(InputError, match=said) as error:
        resolved().with_(changes)
    assert error.value.exit_status == 2 and len(str(error.value).splitlines()) == 1


def test_what_check_says_of_phases() -> None:
    """Fails when nobody is told that all outputs meet the same phase, that a run ends before its first cycle, or that nothing vibrates; or
    when outputs that do meet other phases are blamed."""

    def said(**changes: Any) -> list[str]:
        return [text for text in check_case(resolved(**changes))["warnings"] if "phase" in text]

    in_step = {"output__every": "0.25 s", "output__phases": 0, "time__end": "2 s"}
    (warning,) = said(**in_step)
    assert "output.phases = 16" in warning and "62.5 ms" in warning
    assert said(**{**in_step, "output__every": "0.27 s"}) == said(**{**in_step, "output__phases": 8}) == []
    assert said(**{**in_step, "fidelity": "averaged"}) == []
    (warning,) = said(time__end="80 ms")
    assert "no phases are written" in warning
    assert said(time__end="82.5 ms") == []
    assert any("output.phases: nothing vibrates" in text for text in idle_keys(resolved(motion__gamma=0.0)))
