"""What the tests of sweeps at work share: a bench with stand-ins for `mpm run` that only wait.

Every test runs the driver as a process of its own, as a person would. A stand-in takes the arguments of `mpm run`,
notes in a shared file when it starts and stops, keeps a restart state, and fails on demand by the value of gamma.
"""

import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import pytest

POINT = """
import json, os, signal, sys, time, tomllib
from pathlib import Path

case, out, resume = tomllib.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[3]), "--resume" in sys.argv
gamma, speed = case["motion"]["gamma"], float(case["motion"].get("bed_velocity", "1").split()[0])
out.mkdir(parents=True, exist_ok=True)
stop = []
signal.signal(signal.SIGINT, lambda *_: stop.append(True))

def note(what):
    with open(os.environ["EVENTS"], "a") as stream:
        stream.write(f"{what} {out.name} {os.getpid()} {time.time()} {'resume' if resume else 'new'}\\n")

note("start")
if gamma == 0.77:
    print("error: step 3: the coverage's Newton iteration stalls at residual 1e-2", file=sys.stderr)
    sys.exit(3)
if gamma == 0.44:
    print(f"{out}/history.csv: No space left on device", file=sys.stderr)
    sys.exit(3)
if gamma == 0.66:
    print("error: this input only the solver can refuse", file=sys.stderr)
    sys.exit(2)
if gamma == 0.88:
    os.kill(os.getpid(), signal.SIGKILL)
if gamma == 0.55:
    raise ValueError("a defect of the program")
state, steps = out / "checkpoint.json", 20
step = json.loads(state.read_text()) if resume else 0
while step < steps:
    time.sleep(float(os.environ["DELAY"]) / steps)
    step += 1
    (out / "checkpoint.tmp").write_text(json.dumps(step))
    (out / "checkpoint.tmp").replace(state)
    note("step")
    if stop:
        note("interrupted")
        sys.exit(130)
names = ("PMI_RANK", "PMI_SIZE", "PMIX_RANK", "SLURM_JOB_ID", "OMP_NUM_THREADS", "MY_OWN")
(out / "environment.json").write_text(json.dumps({name: os.environ.get(name) for name in names}))
summary = {"status": "done", "simulated_seconds": 1.0, "cvd": {"rate_mean": gamma / 3}}
summary["titration"] = {"tma": {"exit_mean": gamma * speed, "exit_profile": [0.5, 1.0]}}
(out / "summary.json").write_text(json.dumps(summary))
note("stop")
"""
DRIVER = """
import sys
from mpm.errors import MpmError
from mpm.sweep import cluster, run_sweep

cluster.QUEUE_SECONDS = 1.0
path, output, jobs, ranks, scheduler, *command = sys.argv[1:]
try:
    sys.exit(run_sweep(path, output, int(jobs), int(ranks), scheduler or None, command=command))
except MpmError as error:
    print(f"error: {error}", file=sys.stderr)
    sys.exit(error.exit_status)
"""


@dataclass
class Bench:
    """A directory with the stand-ins, the sweep file and what the points noted."""

    path: Path
    delay: float = 0.1
    environment: dict[str, str] = field(default_factory=dict)
    started: list[subprocess.Popen[str]] = field(default_factory=list)

    def sweep(
        self,
        gammas: str,
        speeds: tuple[str, ...] = ("0.5 cm/s",),
        more: str = "",
        tail: str = "",
        pictures: str = "",
    ) -> None:
        more += f"\npictures = {json.dumps([pictures] if pictures else [])}"
        (self.path / "sweep.toml").write_text(
            f'[sweep]\ncase = "single_zone"\n{more}\n'
            f'[[sweep.axis]]\nkey = "motion.gamma"\nname = "gamma"\nvalues = {gammas}\n'
            f'[[sweep.axis]]\nkey = "motion.bed_velocity"\nname = "speed"\nvalues = {json.dumps(speeds)}\n{tail}'
        )

    def start(
        self,
        out: str = "out",
        jobs: int = 2,
        ranks: int = 1,
        scheduler: str = "",
        command: list[str] | None = None,
    ) -> subprocess.Popen[str]:
        """A driver at work."""
        (self.path / "driver.py").write_text(DRIVER)
        (self.path / "point.py").write_text(POINT)
        where = [str(self.path / "sweep.toml"), str(self.path / out), str(jobs), str(ranks), scheduler]
        process = subprocess.Popen(
            [sys.executable, str(self.path / "driver.py"), *where, *(command or self.command)],
            env=self.variables,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.started.append(process)
        return process

    @property
    def command(self) -> list[str]:
        return [sys.executable, str(self.path / "point.py")]

    @property
    def variables(self) -> dict[str, str]:
        ours = {"EVENTS": str(self.path / "events"), "DELAY": str(self.delay)}
        return os.environ | ours | self.environment

    def run(self, *args: object, **options: object) -> tuple[int, str]:
        """Exit status and messages of a driver."""
        process = self.start(*args, **options)  # type: ignore[arg-type]
        _, messages = process.communicate(timeout=120)
        return process.returncode, messages

    def events(self, what: str) -> list[list[str]]:
        """Name, pid, time and new/resume of every such event."""
        file = self.path / "events"
        lines = file.read_text().splitlines() if file.exists() else []
        return [line.split()[1:] for line in lines if line.split()[0] == what]

    def names(self, what: str) -> Counter[str]:
        return Counter(event[0] for event in self.events(what))

    @staticmethod
    def alive(pid: int) -> bool:
        """Whether a process is computing (a zombie is not)."""
        try:
            return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
        except OSError:
            return False

    @staticmethod
    def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> None:
        """Until the condition holds; fails after `seconds`."""
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, "waited in vain"
            time.sleep(0.02)

    def table(self, out: str = "out") -> pd.DataFrame:
        return pd.read_csv(self.path / out / "results.csv")

    def text(self, out: str = "out") -> str:
        return (self.path / out / "results.csv").read_text()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path)
    yield bench
    for process in bench.started:
        if process.poll() is None:
            process.kill()
            process.wait()
