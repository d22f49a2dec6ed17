"""Which process speaks: a number that a batch system gave to a serial program says nothing about MPI."""

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from mpm.cli import main
from mpm.launcher import launched_rank, share_cores

TASK_FARMS = (
    {"SLURM_PROCID": "1", "SLURM_NTASKS": "8", "SLURM_STEP_NUM_TASKS": "8"},
    {"PMI_RANK": "1"},
    {"PMI_RANK": "1", "PMI_SIZE": "8"},
    {
        "PMI_RANK": "1",
        "PMI_SIZE": "8",
        "PMI_FD": "987",
    },  # started by a rank, which keeps its connection to itself
    {"PMI_RANK": "one", "PMI_SIZE": "8", "PMI_PORT": "node:1234"},
    {"PMIX_RANK": "1", "SLURM_PROCID": "1"},
    {"OMPI_COMM_WORLD_RANK": "1", "OMPI_COMM_WORLD_SIZE": "1", "PMIX_NAMESPACE": "job"},
)


@pytest.mark.parametrize("environment", TASK_FARMS)
@pytest.mark.parametrize(
    "arguments", [["check", "single_zone"], ["schema"], ["--help"], ["mesh", "single_zone"]]
)
def test_every_task_of_a_farm_speaks_and_writes(
    environment: dict[str, str], arguments: list[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Fails when a serial program with a number from its batch system prints or writes nothing."""
    monkeypatch.chdir(tmp_path)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert launched_rank(os.environ) == 0
    if arguments[0] == "mesh":
        arguments = [*arguments, "--set", "geometry.cell_width=5 mm"]
    assert main(arguments) == 0
    assert len(capsys.readouterr().out.splitlines()) > 5
    assert (tmp_path / "single_zone.msh").exists() == (arguments[0] == "mesh")


def test_bad_input_of_a_later_task_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SLURM_PROCID", "3")
    assert main(["run", "single_zone", "--set", "motion.gama=1"]) == 2
    assert "did you mean gamma?" in capsys.readouterr().err


def test_ranks_of_an_mpi_launcher_are_counted() -> None:
    """srun --mpi=pmi2 and mpirun leave an open descriptor; Open MPI and srun --mpi=pmix a name of the job."""
    reading, writing = os.pipe()
    try:
        assert (
            launched_rank({"PMI_RANK": "3", "PMI_SIZE": "8", "PMI_FD": str(reading), "SLURM_PROCID": "3"})
            == 3
        )
    finally:
        os.close(reading)
        os.close(writing)
    assert (
        launched_rank({"OMPI_COMM_WORLD_RANK": "2", "OMPI_COMM_WORLD_SIZE": "4", "PMIX_NAMESPACE": "j"}) == 2
    )
    assert launched_rank({"PMIX_RANK": "5", "SLURM_STEP_NUM_TASKS": "8", "PMIX_NAMESPACE": "j"}) == 5


JOB = {"PMIX_RANK": "0", "SLURM_STEP_NUM_TASKS": "2", "PMIX_NAMESPACE": "j"}
SLEEP = "MPIR_CVAR_ENABLE_HEAVY_YIELD"


def test_ranks_sleep_where_cores_are_short(tmp_path: Path) -> None:
    """Fails when ranks poll for each other on a crowded machine, sleep on a free one, or each start a thread per core."""
    crowded, free, strange = tmp_path / "crowded", tmp_path / "free", tmp_path / "strange"
    crowded.write_text("400000000 890000000 170\n")
    free.write_text("400000000 8000000 31\n")
    strange.write_text("none\n")
    for statistics, expected in ((crowded, "1"), (free, None), (strange, None), (tmp_path / "none", None)):
        environment = dict(JOB)
        share_cores(environment, statistics)
        assert environment.get(SLEEP) == expected and environment["OMP_NUM_THREADS"] == "1"
    chosen = JOB | {SLEEP: "0", "OMP_NUM_THREADS": "4"}
    share_cores(environment := dict(chosen), crowded)
    assert environment == chosen
    share_cores(alone := {"PMI_RANK": "0"}, crowded)
    assert alone == {"PMI_RANK": "0"}


def test_versions_are_printed_once_by_two_ranks(mpirun: Any) -> None:
    """Fails (it waited for ever) when only one rank starts MPI."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "MPI", "HYDRA"))}
    done = subprocess.run(
        [*mpirun(2), "-m", "mpm", "--version"],
        capture_output=True, text=True, timeout=300, env=environment,
    )  # fmt: skip
    assert done.returncode == 0 and done.stdout.count("python ") == 1, done.stderr
