"""How the command line ends: the exit status of each kind of error, one line for it, and no rank left waiting."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mpm.cli import program
from mpm.errors import ConvergenceError, InputError, Interrupted, MpmError

MPIRUN = Path(sys.executable).with_name("mpirun")

PROGRAM = """
import sys
from mpm.cli import base, program
from mpm.errors import ConvergenceError

program._PATIENCE = 1.0

@base.app.command()
def fail(who: str) -> None:
    from mpi4py import MPI

    rank = str(MPI.COMM_WORLD.rank)
    if who in ("all", rank):
        raise ConvergenceError("flow, step 3: residual 1e+03")
    if who == "interrupt":
        raise KeyboardInterrupt
    if who == "defect" and rank == "1":
        raise ZeroDivisionError("a defect")
    MPI.COMM_WORLD.Barrier()

sys.exit(program.main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (InputError("case.toml: wrong"), 2),
        (ConvergenceError("transport: step 5:\n residual 1e3"), 3),
        (Interrupted("interrupted at t = 3 s"), 130),
        (KeyboardInterrupt(), 130),
        (MpmError("the solver needs dolfinx"), 1),
    ],
)
def test_each_error_has_its_status_and_one_line(
    error: BaseException, status: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def schema() -> None:
        raise error

    monkeypatch.setattr("mpm.case.case.case_schema", schema)
    assert program.main(["schema"]) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in err


def test_a_defect_shows_where_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def schema() -> None:
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr("mpm.case.case.case_schema", schema)
    with pytest.raises(SystemExit, match="1"):
        program.main(["schema"])
    assert "Traceback" in capsys.readouterr().err


def test_sigterm_ends_like_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr("mpm.case.case.case_schema", lambda: os.kill(os.getpid(), signal.SIGTERM))
    assert program.main(["schema"]) == 130
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.skipif(not MPIRUN.exists(), reason="no mpirun beside this Python")
@pytest.mark.parametrize(
    ("who", "status", "lines"),
    [
        ("all", 3, ["flow, step 3: residual 1e+03"]),
        ("nobody", 0, []),
        ("interrupt", 130, ["interrupted"]),
        ("1", 3, ["[rank 1] flow, step 3: residual 1e+03"]),
        ("0", 3, ["flow, step 3: residual 1e+03"]),
        ("defect", 1, ["ZeroDivisionError: a defect"]),
    ],
)
def test_no_rank_is_left_waiting(who: str, status: int, lines: list[str], tmp_path: Path) -> None:
    """An error on all ranks ends them together; one on a single rank takes the others down. Fails by timeout if not."""
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "MPI", "HYDRA"))}
    done = subprocess.run(
        [MPIRUN, "-n", "2", sys.executable, program, "fail", who],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment,
    )
    assert done.returncode == status
    said = [line for line in done.stderr.splitlines() if line in lines]
    if who == "1":  # the launcher has been seen to pass on twice what a rank says just before it ends the job
        said = said[:1]
    assert said == lines
    if status != 1:
        assert "Traceback" not in done.stderr
