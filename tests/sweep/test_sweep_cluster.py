"""Sweeps beyond one machine: a real Dask scheduler and workers on loopback, and Slurm's commands played by scripts."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mpm.errors import InputError
from mpm.sweep import cluster
from mpm.sweep.cluster import PoolLost, Waiting, look_at_queue, slurm_options
from mpm.sweep.lease import Lease, Watch

from .conftest import Bench

pytest.importorskip("distributed", reason="needs the extra sweep")

SPEEDS = ("0.5 cm/s", "1.3 cm/s", "2 cm/s")


@pytest.fixture
def dask(bench: Bench) -> Iterator[Any]:
    """`dask(2)`: address of a scheduler on loopback and the processes of that many workers, one point at a time each."""
    processes = []

    def start(*command: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, "-m", *command],
            env=bench.variables,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        processes.append(process)
        return process

    def cluster(workers: int) -> tuple[str, list[subprocess.Popen[bytes]]]:
        import distributed

        file = bench.path / "scheduler.json"
        where = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
        start("distributed.cli.dask_scheduler", *where)
        bench.wait_for(lambda: file.exists() and file.stat().st_size > 0)
        how = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"]
        how += ["--local-directory", str(bench.path), "--scheduler-file", str(file)]
        started = [start("distributed.cli.dask_worker", *how) for _ in range(workers)]
        with distributed.Client(scheduler_file=str(file), set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
            return client.scheduler.address, started

    setattr(cluster, "processes", processes)  # noqa: B010
    yield cluster
    for process in reversed(processes):
        process.kill()
        process.wait()


def test_dask_with_a_killed_worker_gives_the_local_table(bench: Bench, dask: Any) -> None:
    """Fails when a point of the killed worker is lost, a finished one repeated, or the tables differ in a byte."""
    bench.delay = 1.0
    bench.sweep("[0.1, 0.2, 0.3, 0.77]", SPEEDS)
    address, workers = dask(2)
    driver = bench.start(scheduler=address)

    def in_the_middle() -> bool:
        steps = bench.names("step")
        return len(bench.events("stop")) >= 3 and sum(2 <= count <= 16 for count in steps.values()) == 2

    bench.wait_for(in_the_middle)
    workers[0].send_signal(signal.SIGKILL)
    workers[0].wait()
    finished = set(bench.names("stop"))
    _, messages = driver.communicate(timeout=120)
    assert driver.returncode == 0, messages
    starts = bench.names("start")
    assert max(starts.values()) == 2, "the worker was not in the middle of a point"
    assert all(starts[name] == 1 for name in finished)
    assert set(bench.names("step").values()) == {20}, (
        "the interrupted point did not go on from its restart state"
    )
    (bench.path / "events").unlink()
    assert bench.run("local")[0] == 0
    assert Counter(bench.table("local").status) == {"done": 9, "failed": 3}
    assert bench.text() == bench.text("local")


def test_an_interrupted_dask_sweep_stops_its_points_on_the_workers(bench: Bench, dask: Any) -> None:
    """Fails when workers go on computing for a driver that was stopped, or the next call does not go on."""
    bench.delay = 2.0
    bench.sweep("[0.1, 0.2, 0.3]")
    address, _ = dask(2)
    driver = bench.start(scheduler=address)
    bench.wait_for(lambda: len(bench.events("step")) > 10)
    driver.send_signal(signal.SIGINT)
    _, messages = driver.communicate(timeout=30)
    assert driver.returncode == 130, messages
    assert not any(bench.alive(int(event[1])) for event in bench.events("start"))
    assert Counter(bench.table().status) == {"interrupted": 2, "pending": 1}
    assert bench.run(scheduler=address)[0] == 0
    assert set(bench.names("step").values()) == {20}


def test_a_lost_scheduler_ends_the_sweep_with_what_is_finished(bench: Bench, dask: Any) -> None:
    """Fails when the driver waits for ever, shows tracebacks, or the next call starts over."""
    bench.delay = 1.0
    bench.sweep("[0.1, 0.2, 0.3, 0.4]")
    address, _ = dask(1)
    driver = bench.start(scheduler=address)
    bench.wait_for(lambda: len(bench.events("stop")) == 1 and len(bench.events("start")) == 2)
    dask.processes[0].kill()
    _, messages = driver.communicate(timeout=90)
    assert driver.returncode == 3, messages
    lines = messages.splitlines()
    last = max(place for place, line in enumerate(lines) if f"the Dask cluster at {address}" in line)
    assert "table in" in lines[last + 1] and "Traceback" not in messages
    bench.wait_for(lambda: not any(bench.alive(int(event[1])) for event in bench.events("start")))
    assert bench.run()[0] == 0
    assert set(bench.names("step").values()) == {20}


def test_an_address_without_a_scheduler_is_one_line(bench: Bench) -> None:
    """Fails when a wrong address ends in a traceback."""
    bench.sweep("[0.1]")
    status, messages = bench.run(scheduler="tcp://127.0.0.1:1")
    assert status == 2
    assert "--scheduler: found 'tcp://127.0.0.1:1'" in messages.splitlines()[-1]
    assert "Traceback" not in messages


def test_a_port_that_says_nothing_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a listener that accepts and never answers, or an address of TLS without keys, holds the driver up."""
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        for address in (f"tcp://127.0.0.1:{silent.getsockname()[1]}", "tls://127.0.0.1:1", "127.0.0.1", ""):
            with pytest.raises(InputError, match="--scheduler: found"), cluster.dask_pool(address, "none"):
                pass


def test_a_driver_that_fell_silent_has_left(tmp_path: Path) -> None:
    """Fails when a point on another machine would outlive its driver, or one with a living driver be stopped."""
    with Lease(tmp_path / "lease") as lease:
        watch = Watch(lease.path, lease.token, expiry=3.0)
        assert not watch.ended()
        looks = [watch.ended() for _ in range(8)]  # 3 s are 6 looks without news
        assert looks == [False] * 6 + [True] * 2
        assert Watch(lease.path, "another driver's").ended()
        watch = Watch(lease.path, lease.token)
    assert watch.ended(), "a driver that has ended says so"


SBATCH = """#!{python}
import os, subprocess, sys
job = subprocess.Popen(["bash", sys.argv[-1]], start_new_session=True, stdin=subprocess.DEVNULL,
                       stdout=open(os.environ["JOBS"] + "/output", "a"), stderr=subprocess.STDOUT)
open(os.environ["JOBS"] + "/" + str(job.pid), "w").write(open(sys.argv[-1]).read())
print("Submitted batch job", job.pid)
"""
SCANCEL = """#!{python}
import os, signal, sys
for job in sys.argv[1:]:
    try:
        os.killpg(int(job), signal.SIGTERM)
    except ProcessLookupError:
        pass
"""


def slurm(bench: Bench, **scripts: str) -> None:
    """Puts commands of these texts first on the PATH of the bench's drivers."""
    commands, jobs = bench.path / "bin", bench.path / "jobs"
    commands.mkdir()
    jobs.mkdir()
    for name, text in scripts.items():
        (commands / name).write_text(text)
        (commands / name).chmod(0o755)
    bench.environment = {"PATH": f"{commands}:{os.environ['PATH']}", "JOBS": str(jobs)}


@pytest.mark.parametrize(
    ("refusing", "said"),
    [
        (
            "#!/bin/sh\necho 'sbatch: error: invalid partition: short' >&2\nexit 1\n",
            "invalid partition: short",
        ),
        ("#!/bin/sh\nexit 3\n", "sbatch ended with status 3 and without a word"),
        ("#!/bin/sh\necho welcome\n", "Could not parse job id"),
        ("#!/nowhere/sh\n", "sbatch cannot be started"),
    ],
)
def test_jobs_that_slurm_refuses_end_the_sweep(bench: Bench, refusing: Any, said: str) -> None:
    """Fails when the driver waits for jobs that were never taken, shows a traceback, or ends as if all were well."""
    slurm(bench, sbatch=refusing)
    bench.sweep("[0.1]", tail='[sweep.slurm]\nworkers = 2\ninterface = "lo"\n')
    status, messages = bench.run(scheduler="slurm")
    assert status == 3, messages
    assert "no job could be submitted" in messages.splitlines()[-1] and said in messages.splitlines()[-1]
    assert "Traceback" not in messages and not bench.events("start")


QUEUE = """#!{python}
import os, sys
for job in sys.argv[2].partition("=")[2].split(","):
    if os.path.exists(f"/proc/{{job}}") and open(f"/proc/{{job}}/stat").read().split()[2] != "Z":
        print(f"{{job}}|RUNNING (None)")
"""


def test_jobs_that_end_before_a_worker_connects_end_the_sweep(bench: Bench) -> None:
    """The jobs find no Python. Fails when the driver waits for workers that no job will start, or does not say where to look."""
    python = sys.executable
    broken = SBATCH.format(python=python).replace(
        '["bash"', '["bash", "-c", "echo no module dask >&2", "job"'
    )
    slurm(bench, sbatch=broken, scancel=SCANCEL.format(python=python), squeue=QUEUE.format(python=python))
    bench.sweep("[0.1]", tail='[sweep.slurm]\nworkers = 2\ninterface = "lo"\n')
    status, messages = bench.run(scheduler="slurm")
    assert status == 3, messages
    assert "have ended" in messages and "Traceback" not in messages
    assert Counter(bench.table().status) == {"pending": 1}


def test_what_a_waiting_sweep_waits_for_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a pending job is not named with Slurm's reason, is named at every look, or a lost queue counts as empty."""
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")

    def answer(text: str) -> None:
        (tmp_path / "squeue").write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / "squeue").chmod(0o755)

    answer("echo '7|PENDING (QOSMaxJobsPerUserLimit)'")
    monkeypatch.setattr(cluster, "QUEUE_SECONDS", 0.0)
    waiting = Waiting(lambda: look_at_queue(["7"], tmp_path))
    for _ in range(3):
        waiting.update(0)
    waiting.update(1)
    assert capsys.readouterr().err.count("job 7 is PENDING (QOSMaxJobsPerUserLimit)") == 1
    monkeypatch.setattr(cluster, "QUEUE_SECONDS", 60.0)
    waiting.update(1)
    waiting.update(0)  # a worker was there a moment ago
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(cluster, "QUEUE_SECONDS", 0.0)
    waiting.update(1)
    answer("echo 'slurm_load_jobs error: Unable to contact slurm controller' >&2; exit 1")
    waiting.update(0)
    assert "squeue does not tell" in capsys.readouterr().err
    (tmp_path / "dask-worker-7.err").write_text("ModuleNotFoundError: No module named 'distributed'\n")
    answer("echo 'slurm_load_jobs error: Invalid job id specified' >&2; exit 1")
    with pytest.raises(PoolLost, match=r"\(7\) have ended.*No module named 'distributed'"):
        waiting.update(0)


def test_slurm_runs_the_sweep_in_its_jobs(bench: Bench) -> None:
    """sbatch and scancel are scripts that start and end processes here. Fails when job scripts do not run points."""
    slurm(bench, sbatch=SBATCH.format(python=sys.executable), scancel=SCANCEL.format(python=sys.executable))
    jobs = bench.path / "jobs"
    bench.sweep(
        "[0.1, 0.2, 0.3, 0.4]", tail='[sweep.slurm]\nworkers = 2\nqueue = "short"\ninterface = "lo"\n'
    )
    status, messages = bench.run(scheduler="slurm")
    assert status == 0, messages
    assert set(bench.table().status) == {"done"} and "2 Slurm jobs" in messages
    scripts = [file for file in jobs.iterdir() if file.name != "output"]
    assert len(scripts) == 2
    assert (
        "#SBATCH -p short" in scripts[0].read_text() and "#SBATCH --cpus-per-task=1" in scripts[0].read_text()
    )
    bench.wait_for(lambda: not any(bench.alive(int(file.name)) for file in scripts), 10.0)


def test_slurm_options_ask_for_points_times_ranks() -> None:
    """Fails when a job gets fewer processors than its points have ranks, or our own keys reach dask-jobqueue."""
    options = slurm_options({"workers": 3, "points_per_job": 4, "walltime": "01:00:00"}, 2, Path("log"))
    assert (options["cores"], options["job_cpu"], options["processes"]) == (4, 8, 1)
    assert options["walltime"] == "01:00:00" and options["memory"] == "32 GB"
    assert not {"workers", "points_per_job"} & set(options)


def test_wrong_slurm_options_are_one_line(bench: Bench) -> None:
    """Fails when an option that dask-jobqueue does not know ends in a traceback."""
    bench.sweep("[0.1]", tail='[sweep.slurm]\nqueu = "short"\n')
    started = time.monotonic()
    status, messages = bench.run(scheduler="slurm")
    assert status == 2 and time.monotonic() - started < 30
    assert "sweep.slurm" in messages.splitlines()[-1] and "queu" in messages.splitlines()[-1]
