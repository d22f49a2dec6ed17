"""The run directory: what is written can be read by others, survives a kill, and can be cut back."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mpm.errors import ConvergenceError, InputError, MpmError
from mpm.files import write_atomically
from mpm.mesh.grid import Grid
from mpm.output.directory import RunDirectory
from mpm.output.vtu import Packer, encode_vtu, grid_quads, read_pvd, read_vtu

COLUMNS, ROWS = 12, 5


@pytest.fixture
def grid() -> Grid:
    """Two layers with unequal rows and three zones: any mix-up of rows, columns or zones changes a value."""
    return Grid(
        x=np.linspace(0.0, 0.12, COLUMNS + 1),
        y=np.array([-0.003, -0.001, 0.0, 0.004, 0.007, 0.012]),
        row_layer=np.array([0, 0, 1, 1, 1]),
        zone_of_column=np.repeat([1, 2, 3], 4),
        layer_names=("bed", "headspace"),
        materials=(None, None),
        moving=np.array([True, True, False, False, False]),
        periodic=True,
    )


def centres(grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    x, y = 0.5 * (grid.x[1:] + grid.x[:-1]), 0.5 * (grid.y[1:] + grid.y[:-1])
    return np.tile(x, grid.rows), np.repeat(y, grid.columns)


def fields(grid: Grid, t: float) -> dict[str, np.ndarray]:
    """Affine in x, y and t, so that a wrong cell order, mesh or time shows as a wrong value."""
    x, y = centres(grid)
    return {"C_TMA": 1 + 10 * x + 100 * y + 7 * t, "velocity": np.column_stack([x - t, y + t])}


def write_run(directory: RunDirectory, grid: Grid, times: list[float]) -> None:
    for t in times:
        directory.fields.write(t, grid, fields(grid, t), displacement=(1e-3 * t, -2e-3 * t))
        directory.append_history({"time": t, "balance.TMA": 1e-12 * t})


TIMES = [0.0, 0.1, 0.30000000000000004, 2 / 3]


@pytest.fixture
def run(tmp_path: Path, grid: Grid) -> RunDirectory:
    directory = RunDirectory(tmp_path / "run", precision="Float64")
    directory.prepare()
    write_run(directory, grid, TIMES)
    directory.release()
    return directory


def test_pyvista_reads_all_steps(run: RunDirectory, grid: Grid) -> None:
    """Fails when a value, a vector component, a cell's place, a zone or a time differs from what was written."""
    pyvista = pytest.importorskip("pyvista")
    reader = pyvista.get_reader(run.pvd)
    assert list(reader.time_values) == TIMES
    for index, t in enumerate(TIMES):
        reader.set_active_time_point(index)
        mesh = reader.read()[0]
        x, y = centres(grid)
        assert np.allclose(
            mesh.cell_centers().points[:, :2], np.column_stack([x + 1e-3 * t, y - 2e-3 * t]), atol=1e-15
        )
        assert np.array_equal(mesh["C_TMA"], fields(grid, t)["C_TMA"])
        assert (
            np.array_equal(mesh["velocity"][:, :2], fields(grid, t)["velocity"])
            and not mesh["velocity"][:, 2].any()
        )
        assert mesh.field_data["TimeValue"][0] == t
        assert mesh.compute_cell_sizes()["Area"].sum() == pytest.approx(
            0.12 * 0.015, rel=1e-12
        )  # quads are not folded
        for zone in (1, 2, 3):
            assert mesh.threshold([zone, zone], scalars="zone").n_cells == 4 * ROWS
        assert np.array_equal(mesh["layer"], np.repeat([0, 0, 1, 1, 1], COLUMNS))
        assert mesh["zone"].dtype == np.int32


def test_meshio_reads_a_step(run: RunDirectory, grid: Grid) -> None:
    """Fails when meshio sees other cells, values or another time."""
    meshio = pytest.importorskip("meshio")
    mesh = meshio.read(run.path / run.steps[3][1])
    assert mesh.cells[0].type == "quad" and len(mesh.cells[0].data) == grid.cells
    middle = mesh.points[mesh.cells[0].data].mean(axis=1)
    assert np.allclose(middle[:, 0], centres(grid)[0] + 1e-3 * TIMES[3], atol=1e-15)
    assert np.array_equal(mesh.cell_data["C_TMA"][0], fields(grid, TIMES[3])["C_TMA"])
    assert float(mesh.field_data["TimeValue"][0]) == TIMES[3]


def test_a_few_lines_of_numpy_read_a_field(run: RunDirectory, grid: Grid) -> None:
    """The lines printed in docs/output.md; fails when the block layout is not the one described there."""
    content = (run.path / run.steps[1][1]).read_bytes()
    head, data = content.split(b'<AppendedData encoding="raw">\n_')
    offset = int(head.split(b'Name="C_TMA"')[1].split(b'offset="')[1].split(b'"')[0])
    size = int(np.frombuffer(data, "<u8", 4, offset)[3])
    values = np.frombuffer(zlib.decompress(data[offset + 32 : offset + 32 + size]), "<f8")
    assert np.array_equal(values, fields(grid, TIMES[1])["C_TMA"])


def test_own_reader_returns_what_was_written(run: RunDirectory, grid: Grid) -> None:
    """Fails when read_vtu and encode_vtu disagree, or when single precision loses more than it must."""
    snapshot = run.read_fields()
    assert snapshot.time == TIMES[-1]
    assert np.allclose(snapshot.centres[:, 1], centres(grid)[1] - 2e-3 * TIMES[-1], atol=1e-15)
    assert set(snapshot.cell_data) == {"zone", "layer", "C_TMA", "velocity"}
    single = RunDirectory(run.path)
    single.write_fields(1.0, grid, fields(grid, 1.0))
    stored = single.read_fields().cell_data["C_TMA"]
    assert stored.dtype == np.float32
    assert np.allclose(stored, fields(grid, 1.0)["C_TMA"], rtol=6e-8, atol=0)


def test_what_changes_under_a_known_name_is_written_anew() -> None:
    """Fails when one packer for many times writes an old array of the same name, or compresses again what has stayed the same."""
    packer, values = Packer(), np.ones(100)
    first = packer.block("C_TMA", values)
    assert packer.block("C_TMA", np.ones(100)) is first
    values[3] = 2.0  # in the array that it has seen
    assert packer.block("C_TMA", values) != first
    assert packer.block("C_TMA", np.ones(100)) == first
    view = values[:]
    view.flags.writeable = False
    seen = packer.block("C_TMA", view)
    values[3] = 3.0  # below a view that cannot be written
    assert packer.block("C_TMA", view) != seen
    values.flags.writeable = False
    fixed = packer.block("C_TMA", values)
    assert packer.block("C_TMA", values.ravel()) is fixed
    assert packer.block("C_TMA", values[:50]) != fixed


def test_what_is_not_wanted_is_not_unpacked(run: RunDirectory) -> None:
    """Fails when a reader that wants some fields gets others or none, or when a name that no file has is an error."""
    whole, some = run.read_fields(1), run.read_fields(1, ["C_TMA", "nothing"])
    assert list(some.cell_data) == ["C_TMA"]
    assert np.array_equal(some.cell_data["C_TMA"], whole.cell_data["C_TMA"])
    assert np.array_equal(some.quads, whole.quads) and some.time == whole.time


@pytest.mark.parametrize("kind", ["nothing", "zeros", "noise", "ramp", "field"])
@pytest.mark.parametrize("lasting", [False, True])
def test_any_reader_of_zlib_finds_what_was_packed(kind: str, lasting: bool) -> None:
    """Fails when a block, written by whatever is fastest here, is no zlib stream of the raw bytes, or other bytes the second time."""
    rng = np.random.default_rng(7)
    wave = np.sin(np.linspace(0.0, 30.0, 50_000)) * np.exp(-np.linspace(0.0, 200.0, 50_000))
    values = {
        "nothing": np.zeros(0, np.float32),
        "zeros": np.zeros(300_000, np.float32),
        "noise": np.frombuffer(rng.bytes(1_200_000), np.int32),
        "ramp": np.arange(300_000, dtype=np.int32),
        "field": wave.astype(np.float32),
    }[kind]
    block = Packer().block("C_TMA", values, lasting)
    raw = values.tobytes()
    assert list(np.frombuffer(block, "<u8", 4)) == [1, len(raw), 0, len(block) - 32]
    assert zlib.decompress(block[32:]) == raw
    assert Packer().block("C_TMA", values, lasting) == block


def test_numbers_of_a_grid_do_not_swell_the_files() -> None:
    """Fails when what the fast compressor writes of corners and offsets, half as much again as zlib, goes into every file."""
    quads = grid_quads(411, 121)
    content = encode_vtu(np.zeros((412 * 122, 3)), quads, {}, 0.0)
    assert len(content) < 1.05 * (len(zlib.compress(quads.tobytes(), 1)) + 60_000)


def test_wrong_shape_is_refused(run: RunDirectory, grid: Grid) -> None:
    """Fails when an array of another length is written as if it were a field."""
    with pytest.raises(MpmError, match="C_TMA: shape"):
        run.write_fields(1.0, grid, {"C_TMA": np.zeros(grid.cells - 1)})
    assert len(read_pvd(run.pvd)) == len(TIMES)


def test_cut_back_then_continue(run: RunDirectory, grid: Grid) -> None:
    """A resumed run ends with the same files as one that was never stopped; fails when a step is lost, doubled or stale."""
    (run.path / "fields" / "fields_000007.vtu.tmp").write_text("half a file")
    (run.path / "fields" / "fields_000009.vtu").write_text("written, but not listed yet")
    again = RunDirectory(run.path, precision="Float64")
    again.prepare(resume=True)
    again.cut_back(2, TIMES[1])
    assert [t for t, _ in read_pvd(run.pvd)] == TIMES[:2]
    assert list(again.history()["time"]) == TIMES[:2]
    write_run(again, grid, TIMES[2:])
    assert [t for t, _ in read_pvd(run.pvd)] == TIMES
    assert sorted(p.name for p in (run.path / "fields").iterdir()) == [
        f"fields_{i:06d}.vtu" for i in range(4)
    ]
    for t, path in read_pvd(run.pvd):
        assert np.array_equal(read_vtu(path).cell_data["C_TMA"], fields(grid, t)["C_TMA"])
    assert list(RunDirectory(run.path).history()["time"]) == TIMES


def test_history_keeps_every_digit_and_grows_columns(tmp_path: Path) -> None:
    """Fails when a number changes on the way to disk, a late column loses its place, or an absent number becomes 0."""
    directory = RunDirectory(tmp_path)
    directory.append_history({"balance.TMA": 0.1 + 0.2, "time": 0.0, "cvd.rate_mean": None})
    directory.append_history({"time": 1 / 3, "balance.TMA": 1e-300, "titration.tma.exit_mean": 0.5})
    lines = (tmp_path / "history.csv").read_text().splitlines()
    assert lines == [
        "time,balance.TMA,titration.tma.exit_mean",
        "0.0,0.30000000000000004,",
        "0.3333333333333333,1e-300,0.5",
    ]
    history = RunDirectory(tmp_path).history()
    assert history["time"][1] == 1 / 3 and np.isnan(history["titration.tma.exit_mean"][0])
    directory.append_history({"time": 1.0, "balance.TMA": float("nan"), "titration.tma.exit_mean": np.inf})
    assert (tmp_path / "history.csv").read_text().splitlines() == [*lines, "1.0,,"]


def test_summary_holds_finite_numbers_only(tmp_path: Path) -> None:
    """Fails when NaN or infinity reaches the file or takes other numbers along, None is kept, or a numpy number is not written as one."""
    directory = RunDirectory(tmp_path)
    summary = {
        "cells": np.int64(5),
        "a": {"x": np.float64(0.1), "gone": None},
        "profile": np.array([0.5, 1.0]),
        "ok": True,
    }
    directory.write_summary(summary)
    expected = {"cells": 5, "a": {"x": 0.1}, "profile": [0.5, 1.0], "ok": True}
    assert json.loads((tmp_path / "summary.json").read_text()) == expected == directory.read_summary()
    for bad in (float("nan"), np.float64("inf"), np.array([1.0, -np.inf])):
        directory.write_summary({**summary, "a": {"x": 0.1, "TMA": bad}})
        assert directory.read_summary() == expected
    with pytest.raises(MpmError, match="set is not"):
        directory.write_summary({"a": {1, 2}})
    assert directory.read_summary() == expected


def test_checkpoint_round_trip_is_exact(tmp_path: Path) -> None:
    """Fails when a bit of an array or of the time is lost, or when a damaged file is taken for a state."""
    directory = RunDirectory(tmp_path)
    assert directory.read_checkpoint() is None
    theta = np.random.default_rng(1).random((3, 7))
    directory.write_checkpoint({"theta": theta, "phase": np.int64(3)}, {"time": 0.1 + 0.2, "case": "abc"})
    stored = RunDirectory(tmp_path).read_checkpoint()
    assert stored is not None
    arrays, meta = stored
    assert (
        np.array_equal(arrays["theta"], theta) and arrays["phase"] == 3 and set(arrays) == {"theta", "phase"}
    )
    assert meta == {"time": 0.1 + 0.2, "case": "abc"}
    (tmp_path / "checkpoint.npz").write_bytes(b"not a zip file")
    with pytest.raises(InputError, match="not a checkpoint"):
        directory.read_checkpoint()


def test_what_is_not_finite_is_kept_from_states_and_fields(run: RunDirectory, grid: Grid) -> None:
    """Fails when not-a-number replaces a good state or a field is written with it."""
    run.write_checkpoint({"theta": np.ones(3)}, {"time": 1.0})
    with pytest.raises(ConvergenceError, match=r"checkpoint\.npz: theta is not finite"):
        run.write_checkpoint({"theta": np.array([1.0, np.nan])}, {"time": 2.0})
    state = run.read_checkpoint()
    assert state is not None and state[1] == {"time": 1.0}
    with pytest.raises(MpmError, match="is nan"):
        run.write_checkpoint({"theta": np.ones(3)}, {"time": float("nan")})
    with pytest.raises(ConvergenceError, match="C_TMA is not finite"):
        run.write_fields(1.0, grid, {"C_TMA": np.full(grid.cells, np.inf)})
    assert len(read_pvd(run.pvd)) == len(TIMES)


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "cut": lambda content: content[: len(content) // 2],
    "a line more": lambda content: content + b"x\n",
    "other bytes within": lambda content: content[:300] + b"\0\xff\0\0" + content[304:],
}


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        (name, damage)
        for name in ("checkpoint.npz", "history.csv", "fields.pvd", "summary.json")
        for damage in DAMAGE
        if (name, damage) != ("checkpoint.npz", "a line more")  # an archive is whole without what follows it
    ],
)
def test_damaged_files_are_said_in_one_line(name: str, damage: str, run: RunDirectory) -> None:
    """Fails when a file that a disk, an editor or a copy has damaged ends a reader otherwise than in a line that names it, or is taken for
    whole where it is not."""
    run.write_checkpoint({"theta": np.ones(300)}, {"time": TIMES[1], "rows": 2})
    run.write_summary({"status": "done", "title": "x" * 400})
    file = run.path / name
    file.write_bytes(DAMAGE[damage](file.read_bytes()))
    again = RunDirectory(run.path)
    reads = {
        "checkpoint.npz": again.read_checkpoint,
        "history.csv": lambda: again.cut_back(4, TIMES[-1]),
        "fields.pvd": lambda: again.steps,
        "summary.json": again.read_summary,
    }
    with pytest.raises(InputError, match=re.escape(str(file))) as error:
        reads[name]()
    assert error.value.exit_status == 2 and len(str(error.value).splitlines()) == 1


def test_damaged_fields_are_said_in_one_line(run: RunDirectory) -> None:
    """Fails when a .vtu that is cut or overwritten is read as if it were whole, or with a traceback."""
    file = run.path / run.steps[-1][1]
    content = file.read_bytes()
    for damage in ("empty", "cut", "a line more"):
        file.write_bytes(DAMAGE[damage](content))
        with pytest.raises(InputError, match="not a whole"):
            run.read_fields()
    start = content.index(b"_", content.index(b"<AppendedData")) + 1
    file.write_bytes(content[: start + 40] + b"\xff" * 8 + content[start + 48 :])
    with pytest.raises(InputError, match="not a whole"):
        run.read_fields()


def test_unfinished_row_is_not_read(run: RunDirectory) -> None:
    """Fails when the row that a kill has left unfinished is taken for a row, or stays when the run goes on."""
    file = run.path / "history.csv"
    file.write_bytes(file.read_bytes() + b"0.7,1e-1")
    again = RunDirectory(run.path)
    assert list(again.history()["time"]) == TIMES
    again.cut_back(3, TIMES[2])
    again.append_history({"time": 0.7, "balance.TMA": 0.5})
    assert list(RunDirectory(run.path).history()["time"]) == [*TIMES[:3], 0.7]


def test_rows_that_the_state_counts_must_be_there(run: RunDirectory) -> None:
    """Fails when a run goes on from a state although rows before it are missing or belong to a later time."""
    with pytest.raises(InputError, match=r"found 4 rows; accepted: the 5 up to t = 0\.8 s"):
        RunDirectory(run.path).cut_back(5, 0.8)
    with pytest.raises(InputError, match="found 4 rows"):
        RunDirectory(run.path).cut_back(3, TIMES[1])
    assert [t for t, _ in read_pvd(run.pvd)] == TIMES


def test_an_output_costs_the_same_however_many_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when tables are written anew at every row: what an output time writes besides its fields must not grow, and the .pvd must list
    every step after each write."""
    grid = Grid(
        np.linspace(0, 1, 3),
        np.linspace(0, 1, 2),
        np.zeros(1, int),
        np.ones(2, int),
        ("bed",),
        (None,),
        np.ones(1, bool),
        True,
    )
    directory, written = RunDirectory(tmp_path), 0
    directory.prepare()
    pwrite, replace = os.pwrite, write_atomically

    def counted(handle: int, content: bytes, start: int) -> int:
        nonlocal written
        written += len(content)
        return pwrite(handle, content, start)

    def counted_whole(path: Path, content: str) -> None:
        nonlocal written
        written += len(content)
        replace(path, content)

    monkeypatch.setattr("os.pwrite", counted)
    monkeypatch.setattr("mpm.output.history.write_atomically", counted_whole)
    monkeypatch.setattr("mpm.output.vtu.write_atomically", counted_whole)
    costs = []
    for step in range(600):
        written = 0
        directory.write_fields(step / 7, grid, {"C_TMA": np.zeros(2)})
        directory.append_history({"time": step / 7, **{f"balance.{k}": step / 3 for k in range(20)}})
        costs.append(written)
        if step % 10 == 0:
            assert [t for t, _ in read_pvd(directory.pvd)] == [k / 7 for k in range(step + 1)]
    assert np.median(costs[-100:]) < 1.2 * np.median(costs[50:150])
    size = directory.pvd.stat().st_size + (tmp_path / "history.csv").stat().st_size
    assert np.mean(costs[-100:]) < 0.01 * size
    again = RunDirectory(tmp_path)
    assert again.steps == directory.steps and len(again.history()["balance.7"]) == 600


def test_one_run_at_a_time(run: RunDirectory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a second run is let into a live directory, one whose run has ended or was killed stays closed, or a refusal leaves a
    file."""
    monkeypatch.setattr("mpm.output.directory.PATIENCE", 0.1)
    run.prepare(resume=True)
    for way in ({"resume": True}, {"overwrite": True}):
        with pytest.raises(InputError, match="another run is at work"):
            RunDirectory(run.path).prepare(**way)
    assert len(run.history()["time"]) == len(TIMES)
    code = f"""
import time
from mpm.output.directory import RunDirectory
directory = RunDirectory({str(run.path)!r})
directory.prepare(resume=True)
print("in", flush=True)
time.sleep(60)
"""
    run.release()
    assert not run.log.exists(), "nothing was logged"
    other = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert other.stdout is not None and other.stdout.readline()
    with pytest.raises(InputError, match="another run is at work"):
        run.prepare(resume=True)
    other.kill()
    other.communicate()
    run.prepare(resume=True)
    run.release()


def test_directory_in_use_is_refused_or_emptied(run: RunDirectory, tmp_path: Path) -> None:
    """Fails when an earlier run is overwritten without being asked to, or a file that is not ours is deleted."""
    (run.path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="--resume"):
        RunDirectory(run.path).prepare()
    assert len(run.steps) == len(TIMES)
    emptied = RunDirectory(run.path)
    emptied.prepare(overwrite=True)
    emptied.release()
    assert [p for p in run.path.rglob("*") if p.is_file()] == [run.path / "notes.txt"]
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be used"):
        RunDirectory(tmp_path / "file").prepare()


WRITER = """
import sys
import numpy as np
from mpm.mesh.grid import Grid
from mpm.output.directory import RunDirectory
grid = Grid(np.linspace(0, 1, 101), np.linspace(0, 1, 51), np.zeros(50, int), np.ones(100, int), ("bed",), (None,), np.ones(50, bool), True)
directory = RunDirectory(sys.argv[1])
directory.prepare()
print("writing", flush=True)
for step in range(100000):
    value = np.full(grid.cells, float(step))
    directory.write_fields(float(step), grid, {"C_TMA": value + np.arange(grid.cells) % 7})
    directory.append_history({"time": float(step), "balance.TMA": float(step)})
    directory.write_checkpoint({"theta": value}, {"time": float(step)})
"""


@pytest.mark.parametrize("attempt", range(6))
def test_killed_writer_leaves_readable_files(tmp_path: Path, attempt: int) -> None:
    """SIGKILL at a random moment: fails when a listed step, the history or the checkpoint is damaged or out of step."""
    target = tmp_path / "run"
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(target)], stdout=subprocess.PIPE)
    assert process.stdout is not None and process.stdout.readline()
    while not (target / "checkpoint.npz").exists():
        time.sleep(1e-3)
    time.sleep(random.Random(attempt).uniform(0.0, 0.3))
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    directory = RunDirectory(target)
    steps = read_pvd(directory.pvd)
    assert steps
    for index, (t, path) in enumerate(steps):
        assert t == index and read_vtu(path).cell_data["C_TMA"].min() == index
    assert abs(len(directory.history()["time"]) - len(steps)) <= 1
    stored = directory.read_checkpoint()
    assert stored is not None
    restart = stored[1]["time"]
    assert np.all(stored[0]["theta"] == restart)
    directory.cut_back(int(restart) + 1, restart)
    assert (
        list(directory.history()["time"]) == [t for t, _ in directory.steps] == list(np.arange(restart + 1))
    )
    assert not list(target.rglob("*.tmp"))


def test_write_atomically_leaves_the_old_file_when_it_fails(tmp_path: Path) -> None:
    """Fails when a write that breaks off half way has already touched the file."""
    path = tmp_path / "a.txt"
    write_atomically(path, "old")
    with pytest.raises(UnicodeEncodeError):
        write_atomically(path, "new \ud800")
    assert path.read_text() == "old"


def test_what_did_not_change_is_unpacked_once(run: RunDirectory) -> None:
    """Fails when reading many times unpacks the mesh again each time, hands out arrays that can be changed, or an old array."""
    first, second = run.read_fields(0), run.read_fields(1)
    assert second.cell_data["zone"] is first.cell_data["zone"]
    assert not first.cell_data["zone"].flags.writeable
    assert not np.array_equal(second.cell_data["C_TMA"], first.cell_data["C_TMA"])
    assert np.array_equal(run.read_fields(0).cell_data["C_TMA"], first.cell_data["C_TMA"])
