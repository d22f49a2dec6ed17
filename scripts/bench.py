"""`make bench`: cells, steps, seconds per step of the flow and of the species, memory, on 1 and 2 ranks.

A report, not a test. Every row is a run of its own in processes of its own; `--full` simulates everything instead of extrapolating
from the first part; `--case cycle` takes the full cycle instead of the zone. Times are wall clock, so an otherwise idle machine matters.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from meshes import FINE_ROWS

ROOT = Path(__file__).resolve().parent.parent
SECONDS = {"zone": 20.0, "cycle": 60.0}  # simulated by the whole run of each case


def worker(name: str, fidelity: str, seconds: float) -> None:
    """Run one row under MPI and print its numbers as JSON on rank 0."""
    import resource
    import time

    from mpm import Reactor, load_case
    from mpm.flow.cycle import mean_motion
    from mpm.flow.problem import FlowProblem
    from mpm.motion.kinematics import REST
    from mpm.parallel import largest, total

    changes: dict[str, object] = {}
    if name == "zone":  # the cycle's file has the thesis' rows
        changes = {**FINE_ROWS}
    changes |= {
        "fidelity": fidelity,
        "time.end": f"{seconds} s",
        "output.every": f"{max(seconds / 20, 0.25)} s",
    }
    case = load_case(ROOT / "cases" / f"single_{name}.toml", changes)
    reactor = Reactor(case)
    begun = time.perf_counter()
    system, flow = reactor.system, reactor.flow
    found = time.perf_counter() - begun
    with tempfile.TemporaryDirectory() as directory:
        result = reactor.run(reactor.comm.bcast(directory, root=0))
    wall = time.perf_counter() - begun
    peak = total(reactor.comm, [resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0])[0]
    problem = FlowProblem(case, system.strip, system.schedule.dt)
    problem.solve_steady(mean_motion(system.bed_motion), problem.convective_force())
    problem.step(REST)  # makes the factor
    flow_step = _seconds(lambda: problem.step(REST))
    transport, operators = system.transport, system.operators(flow.sequence.mean())
    step = system.schedule.step(0)
    transport.advance(operators, reactor.time, step.dt)
    species_step = _seconds(lambda: transport.advance(operators, reactor.time, step.dt))
    wall = float(largest(reactor.comm, [wall])[0])
    if reactor.comm.rank == 0:
        numbers = {
            "cells": reactor.grid.cells,
            "steps": reactor.steps,
            "wall": wall,
            "flow": found,
            "flow_step": flow_step,
            "species_step": species_step,
            "memory": peak,
            "balance": max(entry["balance_error"] for entry in result.summary["species"].values()),
        }
        print("BENCH " + json.dumps(numbers), flush=True)


def _seconds(step: Callable[[], object], repetitions: int = 5) -> float:
    """Mean duration of one of some steps [s]."""
    import time

    begun = time.perf_counter()
    for _ in range(repetitions):
        step()
    return (time.perf_counter() - begun) / repetitions


def measure(name: str, fidelity: str, ranks: int, seconds: float) -> dict[str, float]:
    """One row in processes of its own."""
    launcher = [str(Path(sys.executable).parent / "mpirun"), "-n", str(ranks)] if ranks > 1 else []
    if launcher and not Path(launcher[0]).exists():
        launcher[0] = shutil.which("mpirun") or "mpirun"
    command = [*launcher, sys.executable, __file__, "--case", name, "--worker", fidelity]
    command += ["--seconds", str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line.startswith("BENCH ")]
    if done.returncode or not lines:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
    row: dict[str, float] = json.loads(lines[0].removeprefix("BENCH "))
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", choices=list(SECONDS), default="zone")
    parser.add_argument("--full", action="store_true", help="simulate everything instead of extrapolating")
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--fidelity", nargs="+", default=["averaged", "resolved", "steady"])
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    parser.add_argument("--seconds", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        worker(options.case, options.worker, options.seconds)
        return
    from rich.console import Console  # here, because what the workers import counts as their memory
    from rich.table import Table

    whole_run = SECONDS[options.case]
    table = Table(title=f"Single {options.case} at the thesis mesh, all species, {whole_run:g} s")
    for column in (
        "fidelity",
        "ranks",
        "cells",
        "steps",
        "flow s",
        "s/step flow",
        "s/step species",
        "wall s",
        "for all",
        "MB in all",
        "worst balance",
    ):
        table.add_column(column, justify="left" if column == "fidelity" else "right")
    for fidelity in options.fidelity:
        for ranks in options.ranks:
            seconds = (
                whole_run
                if options.full or fidelity == "steady"
                else whole_run
                * {"averaged": 0.2, "resolved": 0.05 if options.case == "zone" else 0.01}[fidelity]
            )
            row = measure(options.case, fidelity, ranks, seconds)
            whole = row["flow"] + (row["wall"] - row["flow"]) * whole_run / seconds
            table.add_row(
                fidelity,
                str(ranks),
                f"{row['cells']:,.0f}",
                f"{row['steps']:,.0f}",
                f"{row['flow']:.1f}",
                f"{row['flow_step']:.3f}",
                f"{row['species_step']:.4f}",
                f"{row['wall']:.1f}",
                f"{whole:.0f}",
                f"{row['memory'] / 1e6:.0f}",
                f"{row['balance']:.1e}",
            )
    Console(width=160).print(table)


if __name__ == "__main__":
    main()
