"""Disks that are full, places that may not be written, and compiled equations that a killed run left half done."""

import ctypes
import errno
import logging
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mpm.dem.case import load_case as load_powder
from mpm.dem.run import prepare
from mpm.errors import InputError, StorageError, storage_error
from mpm.files import lock, replacing, write_atomically, write_in_place
from mpm.mesh.msh import write_msh
from mpm.output.directory import RunDirectory
from mpm.reactor.progress import log_file
from mpm.reactor.reactor import Reactor

from .cases import MPI, SHORT, TINY, run, zone

CASE = zone({**SHORT, "output.every": "14 ms", "output.checkpoint": "1 ms"}, TINY)
FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    """Fails when a write that breaks off touches the file, leaves its beginnings, or does not say which file it was."""
    path = tmp_path / "table.csv"
    write_atomically(path, "old\n")

    def fill(path: Path) -> None:
        with replacing(path) as aside:
            aside.write_text("half")
            raise FULL

    with pytest.raises(OSError, match="No space left") as error:
        fill(path)
    assert error.value.filename == str(path)
    handle = os.open(path, os.O_RDONLY)
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("os.open", lambda *_: os.dup(handle))  # cannot be written
            with pytest.raises(OSError, match=r"Bad file descriptor") as error:
                write_in_place(path, b"new\n", 4)
    finally:
        os.close(handle)
    assert error.value.filename == str(path)
    assert path.read_text() == "old\n" and list(tmp_path.iterdir()) == [path]


def test_a_write_in_place_that_does_not_fit_is_taken_back(tmp_path: Path) -> None:
    """Fails when a disk that fills up within a row leaves the row's beginning, or a .pvd without its closing tags."""
    path = tmp_path / "table.csv"
    path.write_bytes(b"0123456789")
    pwrite = os.pwrite

    def filling(handle: int, content: bytes, start: int) -> int:
        if start >= 12:
            raise FULL
        return pwrite(handle, content[: 12 - start], start)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.pwrite", filling)
        with pytest.raises(OSError, match="No space left"):
            write_in_place(path, b"abcdefgh", 6)
    assert path.read_bytes() == b"0123456789"
    write_in_place(path, b"abcdefgh", 6)
    assert path.read_bytes() == b"012345abcdefgh"


def test_what_a_user_is_told_of_a_disk() -> None:
    """Fails when a full disk is bad input, a closed one a numerical failure, or a defect is hidden."""
    assert storage_error(OSError(errno.ENOSPC, "full", "a.csv")).exit_status == 3  # type: ignore[union-attr]
    said = storage_error(OSError(errno.EACCES, "Permission denied", "a.csv"))
    assert isinstance(said, InputError) and str(said) == "a.csv: Permission denied"
    assert storage_error(OSError(errno.ECHILD, "no child")) is None


@pytest.mark.parametrize("calls", [3, 9])
def test_a_full_disk_keeps_the_last_state(
    calls: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when a run that finds no room for its state ends otherwise than with one line and status 3, or cannot go on when there is
    room again."""
    _, whole = run(CASE, output=tmp_path / "whole")
    write, count = RunDirectory.write_checkpoint, 0

    def filling(self: RunDirectory, *state: object) -> None:
        nonlocal count
        count += 1
        if count > calls:
            with replacing(self.path / "checkpoint.npz"):
                raise FULL
        write(self, *state)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(RunDirectory, "write_checkpoint", filling)
        with pytest.raises(
            StorageError, match=r"checkpoint\.npz: No space left .* state at t = .* go on with --resume"
        ):
            Reactor(CASE, MPI.COMM_SELF).run(output=tmp_path / "run")
    assert not (tmp_path / "run" / "summary.json").exists()
    _, resumed = run(CASE, output=tmp_path / "run", resume=True)
    for name, values in whole.history.items():
        np.testing.assert_array_equal(resumed.history[name], values)


def test_a_log_on_a_full_disk_is_silent(capfd: pytest.CaptureFixture[str]) -> None:
    """Fails when each message that the log has no room for prints a traceback of logging, or closing it ends the run."""
    log = logging.getLogger("mpm.test")
    with log_file(log, Path("/dev/full")):
        log.info("nothing of this fits")
    assert capfd.readouterr() == ("", "")


def test_standard_output_on_a_full_disk() -> None:
    """Fails when a table that is cut in a pipe or file counts as printed."""
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run(
            [sys.executable, "-m", "mpm", "schema"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (3, "mpm: No space left on device\n")


def test_one_powder_run_at_a_time(tmp_path: Path) -> None:
    """Fails when two `mpm dem` share a directory, or one that is over keeps it closed."""
    case = load_powder(Path(__file__).parents[1] / "cases" / "dem" / "demo.toml")
    held = prepare(case, tmp_path, resume=False, overwrite=False)
    for way in ((True, False), (False, True)):
        with pytest.raises(InputError, match="another mpm dem is at work"):
            prepare(case, tmp_path, *way)
    held.close()
    prepare(case, tmp_path, resume=True, overwrite=False).close()


LIMITED = """
import resource, sys
import mpm.numerics.fem
from mpi4py import MPI  # which needs files of its own, in memory
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
from mpm.cli import main
sys.exit(main(sys.argv[2:]))
"""


def limited(size: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`mpm` with files of at most `size` bytes, which is how a full disk shows from inside."""
    return subprocess.run(
        [sys.executable, "-c", LIMITED, str(size), *arguments], capture_output=True, text=True, check=False
    )


def test_runs_and_meshes_on_a_full_disk(tmp_path: Path) -> None:
    """Fails when `mpm mesh` reports a mesh that is cut, which gmsh does not notice, or `mpm run` ends with a traceback."""
    file = tmp_path / "case.toml"
    file.write_text(CASE.to_toml())
    run(CASE.with_({"time.end": "14 ms"}), output=tmp_path / "compiled")  # no compiler under the limit
    done = limited(4000, "mesh", str(file), "-o", str(tmp_path / "m.msh"))
    assert done.returncode == 3 and "m.msh: No space left" in done.stderr and "Mesh:" not in done.stdout
    done = limited(30_000, "run", str(file), "-o", str(tmp_path / "run"), "--quiet")
    assert done.returncode == 3 and "Traceback" not in done.stderr
    assert done.stderr.count("\n") == 1 and "File too large" in done.stderr
    assert sorted(tmp_path.glob("**/*.tmp*")) == [] and not (tmp_path / "m.msh").exists()


def test_a_mesh_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when an old mesh is lost to one that could not be written."""
    path = tmp_path / "m.msh"
    write_msh(CASE, path)
    whole = path.read_bytes()
    monkeypatch.setattr("mpm.mesh.msh.END", b"$EndOfSomethingElse\n")
    with pytest.raises(OSError, match="No space left"):
        write_msh(CASE.with_({"geometry.cell_width": "4 mm"}), path)
    assert path.read_bytes() == whole and list(tmp_path.iterdir()) == [path]


def obey() -> None:
    """Let root be refused like everybody (CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH leave with the next program)."""
    for capability in (1, 2):
        ctypes.CDLL(None).prctl(
            24, capability, 0, 0, 0
        )  # PR_CAPBSET_DROP; refused to others, who obey anyway


def as_user(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "mpm", *arguments],
        preexec_fn=obey, capture_output=True, text=True, check=False, env={**os.environ, **environment},
    )  # fmt: skip


def test_places_that_may_not_be_written(tmp_path: Path) -> None:
    """Fails when a read-only home, output directory or finished run ends in a traceback, or the remedy that is named does not help."""
    file, home = tmp_path / "case.toml", tmp_path / "home"
    file.write_text(CASE.with_({"time.end": "14 ms"}).to_toml())
    home.mkdir(mode=0o555)
    (tmp_path / "closed").mkdir(mode=0o555)
    no_home = {"HOME": str(home), "XDG_CACHE_HOME": "", "MPLCONFIGDIR": str(tmp_path)}
    del no_home["XDG_CACHE_HOME"]
    out = str(tmp_path / "run")

    def refused(message: str, *arguments: str, **environment: str) -> None:
        done = as_user(*arguments, **environment)
        assert done.returncode == 2, done.stderr
        assert message in done.stderr and done.stderr.count("\n") == 1, done.stderr

    refused("set XDG_CACHE_HOME", "run", str(file), "-o", out, "-q", **no_home)
    cache = {
        **no_home,
        "XDG_CACHE_HOME": str(Path(os.environ.get("XDG_CACHE_HOME", "~/.cache")).expanduser()),
    }
    assert as_user("run", str(file), "-o", out, "-q", **cache).returncode == 0
    refused(
        "closed: cannot be used as output directory",
        "run",
        str(file),
        "-o",
        str(tmp_path / "closed"),
        "-q",
        **cache,
    )
    refused(
        "m.msh: cannot write the mesh", "mesh", str(file), "-o", str(tmp_path / "closed" / "m.msh"), **cache
    )
    for path in (Path(out), *Path(out).rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    refused("nothing to resume", "run", str(file), "-o", out, "-q", "--resume", **cache)  # needs no writing
    refused("cannot be used as output directory", "resume", out, "--end", "28 ms", "-q", **cache)
    refused("Permission denied", "plot", out, **{**cache, "MPLCONFIGDIR": ""})


# --- compiled equations ---


COMPILE = """
import sys
from pathlib import Path
import mpm.numerics.fem, ufl
from mpi4py import MPI
from mpm.numerics.fem import dolfinx
mpm.numerics.fem.cache_directory = lambda: Path(sys.argv[1])
mpm.numerics.fem.check_cache()
mesh = dolfinx.mesh.create_unit_square(MPI.COMM_WORLD, 2, 2)
one = dolfinx.fem.form(dolfinx.fem.Constant(mesh, 1.0) * ufl.dx)
print(dolfinx.fem.assemble_scalar(one))
"""


def test_a_form_left_by_a_killed_run_is_compiled_again(tmp_path: Path) -> None:
    """Fails when a run waits for what a run killed while it compiled has begun (ffcx: for 10 s, then for ever an error)."""

    def compiled() -> None:
        done = subprocess.run(
            [sys.executable, "-c", COMPILE, str(tmp_path / "cache")],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0 and float(done.stdout) == pytest.approx(1.0), done.stderr

    compiled()
    (ready,) = (tmp_path / "cache").glob("*.c.cached")
    ready.unlink()
    ready.with_suffix("").write_text("int half = ")
    compiled()
    assert ready.exists()
    ready.with_suffix("").write_text("int never_looked_at_again = ")
    compiled()


def test_a_form_that_is_ready_does_not_wait_for_one_that_is_compiled(tmp_path: Path) -> None:
    """Fails (by its time limit) when a run whose forms are there waits for another process that holds the compiler."""
    command = [sys.executable, "-c", COMPILE, str(tmp_path / "cache")]
    subprocess.run(command, check=True, capture_output=True)
    with lock(tmp_path / "cache" / "lock", 0.0):
        subprocess.run(command, check=True, capture_output=True, timeout=60)


def test_equations_that_cannot_be_compiled_are_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when an absent compiler ends in a traceback of cffi."""
    monkeypatch.setattr("mpm.numerics.fem.cache_directory", lambda: tmp_path / "cache")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(InputError, match=r"the equations cannot be compiled .* a C compiler and room"):
        Reactor(CASE, MPI.COMM_SELF).run()


def test_a_compiler_that_does_not_end_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a run that has waited in vain for another that compiles ends in a traceback."""
    monkeypatch.setattr("mpm.numerics.fem.cache_directory", lambda: tmp_path)
    monkeypatch.setattr("mpm.numerics.fem.COMPILING", 0.1)
    with (
        lock(tmp_path / "lock"),
        pytest.raises(InputError, match=r"another process has been compiling for 0\.1 s"),
    ):
        Reactor(CASE, MPI.COMM_SELF).run()


def test_one_process_at_a_time(tmp_path: Path) -> None:
    """Fails when a lock lets two in, outlives its file, or is taken on a file that its last owner has removed."""
    path = tmp_path / "lock"
    first = lock(path)
    with pytest.raises(BlockingIOError):
        lock(path, 0.1)
    first.close()
    with lock(path):
        path.unlink()
        with lock(path):  # another file: the old one is nobody's any more
            assert path.exists()
