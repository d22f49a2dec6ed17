"""Does a run that is killed again and again end with the numbers of one that is not?

    python scripts/kill_test.py                        # 50 kills on one process, 50 on two
    python scripts/kill_test.py --kills 12 --ranks 2 --seed 7

Small runs (averaged; resolved with an impulsive start) are ended by SIGKILL at random moments, most of them while steps are taken, some
while the program starts, reads its state or finds the flow. Each is resumed until it is done, and compared with the undisturbed run: on
one process history.csv byte for byte and all numbers of summary.json to the last digit, on several to TOLERANCE. Ends with status 1 when
a run differs or cannot be resumed.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from meshes import rows
from mpm.case.case import Case, load_case
from mpm.output.history import History
from mpm.report.trees import flatten

ROOT = Path(__file__).parents[1]
TOLERANCE = 1e-10  # of the largest value of a column; balances, which are rounding, absolute
MESH = {"geometry.cell_width": "5 mm", **rows(3, 2, 3, 4)}
MODES: dict[str, dict[str, Any]] = {
    "averaged": {"time.end": "5.003 s", "time.step": "14 ms", "output.every": "0.1 s"},
    "impulsive": {
        "fidelity": "resolved",
        "motion.startup": "impulsive",
        "time.end": "1.003 s",
        "time.steps_per_cycle": 16,
        "output.every": "20 ms",
    },
}
BOOKKEEPING = ("wall_seconds", "versions", "ranks", "revision")
PATIENCE = 300.0  # seconds for a run that is not killed


def start(case: Path, directory: Path, ranks: int) -> subprocess.Popen[bytes]:
    """`mpm run`, resumed where a run has begun, in a session of its own."""
    launcher = [str(Path(sys.executable).with_name("mpirun")), "-n", str(ranks)] if ranks > 1 else []
    way = "--resume" if (directory / "case.toml").exists() else "--overwrite"
    command = [
        *launcher, sys.executable, "-m", "mpm", "run", str(case), "-o", str(directory), way, "--quiet", "--no-report",
    ]  # fmt: skip
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with open(directory.with_suffix(".err"), "wb") as errors:
        return subprocess.Popen(command, start_new_session=True, env=environment, stderr=errors)


def kill(process: subprocess.Popen[bytes]) -> None:
    """SIGKILL to a run and all its ranks at once."""
    family = [process.pid, *(child.pid for child in psutil.Process(process.pid).children(recursive=True))]
    for number in family:
        try:
            os.kill(number, signal.SIGKILL)
        except ProcessLookupError:
            continue
    process.wait()


def done(directory: Path) -> bool:
    """Whether the run has reached its end: one killed while it leaves has nothing to resume."""
    summary = directory / "summary.json"
    return summary.exists() and json.loads(summary.read_text(encoding="utf-8"))["status"] == "done"


def lines(directory: Path) -> int:
    """Lines of the run's log: one more says that it has begun, or has begun to march."""
    log = directory / "run.log"
    return len(log.read_bytes().splitlines()) if log.exists() else 0


def wait(process: subprocess.Popen[bytes], seconds: float, directory: Path, until: int = 0) -> bool:
    """For `seconds` once the log has `until` lines; False when the run ended before."""
    deadline = time.monotonic() + PATIENCE
    while lines(directory) < until and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    end = time.monotonic() + seconds
    while process.poll() is None and time.monotonic() < end:
        time.sleep(0.002)
    return process.poll() is None


def numbers(summary: dict[str, Any]) -> str:
    return json.dumps({key: value for key, value in summary.items() if key not in BOOKKEEPING})


def difference(one: Path, other: Path) -> float:
    """Largest difference of two runs' histories and summaries, see TOLERANCE; infinite when they differ in kind."""
    a, b = (History(folder / "history.csv").by_column() for folder in (one, other))
    if a.keys() != b.keys() or any(a[name].shape != b[name].shape for name in a):
        return float("inf")
    worst = 0.0
    for name, values in a.items():
        if not np.array_equal(np.isnan(values), np.isnan(b[name])):
            return float("inf")
        scale = 1.0 if name.startswith("balance.") else max(float(np.nanmax(np.abs(values))), 1e-300)
        worst = max(worst, float(np.nanmax(np.abs(values - b[name]))) / scale)
    x, y = (json.loads((folder / "summary.json").read_text(encoding="utf-8")) for folder in (one, other))
    p, q = (flatten({k: v for k, v in s.items() if k not in BOOKKEEPING}) for s in (x, y))
    if p.keys() != q.keys():
        return float("inf")
    feed = max(entry["fed"] for entry in x["species"].values())
    for name, value in p.items():
        error = name.endswith("error")
        scale = 1.0 if error else max(abs(value), 1e-6 * feed if name.startswith("species.") else 1e-9)
        worst = max(worst, abs(value - q[name]) / scale)
    return worst


class Bench:
    """Undisturbed runs and killed ones of one mode on `ranks` processes."""

    def __init__(self, mode: str, ranks: int, folder: Path, moments: random.Random) -> None:
        self.mode, self.ranks, self.folder, self.moments = mode, ranks, folder, moments
        case: Case = load_case(
            ROOT / "cases" / "single_zone.toml", {**MESH, **MODES[mode], "output.checkpoint": "50 ms"}
        )
        folder.mkdir(parents=True)
        self.case, self.whole = folder / "case.toml", folder / "whole"
        self.case.write_text(case.to_toml(), encoding="utf-8")
        self.march = 0.0
        self.march = self.finish(self.whole)

    def finish(self, directory: Path) -> float:
        """Run, or go on, to the end; returns the seconds that its steps took."""
        process = start(self.case, directory, self.ranks)
        wait(process, 0.0, directory, lines(directory) + 2)
        begun = time.monotonic()
        if process.wait(timeout=PATIENCE) != 0:
            raise RuntimeError(directory.with_suffix(".err").read_text(encoding="utf-8", errors="replace"))
        return time.monotonic() - begun

    def killed(self, name: str, most: int) -> tuple[int, float | None]:
        """Kill a run at random moments until it is done, or `most` times; how often, and how it differs (None: identical bytes)."""
        directory, kills = self.folder / name, 0
        while kills < most and not done(directory):
            process = start(self.case, directory, self.ranks)
            anywhere = self.moments.random() < 0.2
            until = 0 if anywhere else lines(directory) + 2
            if not wait(process, self.moments.uniform(0.0, 0.6 * self.march), directory, until):
                if process.returncode != 0:
                    raise RuntimeError(
                        directory.with_suffix(".err").read_text(encoding="utf-8", errors="replace")
                    )
                break
            kill(process)
            kills += 1
        if not done(directory):
            self.finish(directory)
        same = (directory / "history.csv").read_bytes() == (self.whole / "history.csv").read_bytes()
        one, other = (
            json.loads((d / "summary.json").read_text(encoding="utf-8")) for d in (self.whole, directory)
        )
        return kills, None if same and numbers(one) == numbers(other) else difference(self.whole, directory)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=50, help="on each number of processes")
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as scratch:
        for ranks in options.ranks:
            moments, kills, runs, identical, worst = random.Random(options.seed), 0, 0, 0, 0.0
            benches = [Bench(m, ranks, Path(scratch) / f"{m}-{ranks}", moments) for m in MODES]
            while kills < options.kills:
                bench = benches[runs % len(benches)]
                count, differs = bench.killed(f"run-{runs}", min(6, options.kills - kills))
                kills, runs, identical = kills + count, runs + 1, identical + (differs is None)
                worst = max(worst, differs or 0.0)
                bad += differs is not None and (ranks == 1 or differs > TOLERANCE)
                print(
                    f"{ranks} processes, {bench.mode}: {count} kills, "
                    + ("identical bytes" if differs is None else f"differs by {differs:.2g}"),
                    flush=True,
                )
            print(
                f"{ranks} processes, seed {options.seed}: {kills} kills in {runs} runs, {identical} identical to the last byte, "
                f"others by at most {worst:.2g}",
                flush=True,
            )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
