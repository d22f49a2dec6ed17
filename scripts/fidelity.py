"""Does a cheaper fidelity, or a longer step, give the same coverage? Zone at the thesis mesh, 20 s, three doses.

    python scripts/fidelity.py       # what has not been run yet, then the table in docs/fidelity.md
    python scripts/fidelity.py --dose 2e-4

Each run is kept under results/fidelity and not run again. Runs with the same flow share it, so times are without it; they are processor
seconds of the first rank, which other programs on the machine disturb least.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from document import write_between

from meshes import FINE_ROWS
from mpm import Reactor, load_case
from mpm.parallel import is_root
from mpm.reactor.flow import Flow

from mpi4py import MPI  # isort: skip  (after mpm.numerics.fem)

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "results" / "fidelity"
DOCUMENT = ROOT / "docs" / "fidelity.md"
BEGIN, END = "<!-- table: written by scripts/fidelity.py -->", "<!-- end of table -->"
DOSES = (1e-4, 2e-4, 1e-3)  # mass fraction of TMA
SITE = "OAl(CH3)2"
# averaged with a quarter of a column per step, half, one and two; resolved with 32 steps per cycle
MODELS: dict[str, dict[str, Any]] = {
    "resolved": {"fidelity": "resolved"},
    "averaged, 6.5 ms": {"fidelity": "averaged", "time.step": "6.6 ms"},
    "averaged, 13 ms": {"fidelity": "averaged", "time.step": "14 ms"},
    "averaged, 26 ms": {"fidelity": "averaged", "time.step": "27 ms"},
    "averaged, 52 ms": {"fidelity": "averaged", "time.step": "53 ms"},
}


def record(model: str, dose: float) -> Path:
    return KEPT / f"{model.replace(', ', '-').replace(' ', '')}-{dose:g}.npz"


def measure(model: str, dose: float, flow: Flow | None) -> Flow:
    """Run one model and keep its coverage of the bed (rows, columns) with its numbers; returns the flow it used."""
    changes = {
        **FINE_ROWS,
        **MODELS[model],
        "geometry.inlet.tma.mass_fractions.TMA": dose,
        "output.every": "1 s",
    }
    reactor = Reactor(load_case(ROOT / "cases" / "single_zone.toml", changes), flow=flow)
    flow = reactor.flow
    begun = time.process_time()
    summary = reactor.run().summary
    seconds = time.process_time() - begun
    coverage = reactor.coverage("bed", SITE)
    if is_root(reactor.comm):
        balance = max(entry["balance_error"] for entry in summary["species"].values())
        numbers = {
            "cells": reactor.grid.cells,
            "steps": reactor.steps,
            "time": reactor.time,
            "seconds": seconds,
            "balance": balance,
        }
        KEPT.mkdir(parents=True, exist_ok=True)
        np.savez(KEPT / "aside.npz", coverage=coverage, numbers=json.dumps(numbers))
        (KEPT / "aside.npz").rename(record(model, dose))
        print(f"{model}, Y = {dose:g}: mean coverage {coverage.mean():.5f}, {numbers}", flush=True)
    return flow


def table() -> str:
    """Markdown of everything measured so far; the last two columns compare with the resolved run, cell by cell."""
    lines = [
        "| Y TMA | model | steps | seconds | balance | mean | exit mean | exit, top row | mean - resolved | mean of abs. | largest |"
    ]
    lines.append("|" + " --- |" * 11)
    for dose in DOSES:
        reference = None
        for model in MODELS:
            path = record(model, dose)
            if not path.exists():
                continue
            with np.load(path) as kept:
                theta, n = kept["coverage"], json.loads(str(kept["numbers"]))
            if model == "resolved":
                reference = theta
            start = f"| {dose:g} | {model} | {n['steps']:,} | {n['seconds']:.0f} | {n['balance']:.0e} | {theta.mean():.4f}"
            exits = f"{theta[:, -1].mean():.4f} | {theta[-1, -1]:.4f}"
            differences = " | | "
            if reference is not None and model != "resolved":
                d = theta - reference
                differences = f"{d.mean():+.4f} | {np.abs(d).mean():.4f} | {np.abs(d).max():.3f}"
            lines.append(f"{start} | {exits} | {differences} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--dose", type=float, nargs="*", default=DOSES, choices=DOSES)
    parser.add_argument("--model", nargs="*", default=list(MODELS), choices=MODELS)
    chosen = parser.parse_args()
    flows: dict[str, Flow | None] = {"resolved": None, "averaged": None}
    for model in chosen.model:
        kind = model.split(",")[0]
        for dose in chosen.dose:
            if not record(model, dose).exists():
                flows[kind] = measure(model, dose, flows[kind])
        if kind == "resolved":
            flows[kind] = None  # its 32 fields are no longer needed
    if is_root(MPI.COMM_WORLD):
        write_between(DOCUMENT, BEGIN, END, table())


if __name__ == "__main__":
    main()
