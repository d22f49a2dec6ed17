"""Does the steady solver converge from a cold start, untuned? A grid of doses, bed speeds and meshes.

    python scripts/steady_grid.py                                  # what has not been run yet, then the table in docs/steady.md
    python scripts/steady_grid.py --mesh thesis --kind cycle --dose 1e-3 --speed 1.3
    mpirun -n 2 python scripts/steady_grid.py --mesh four-cycles

Each case is kept under results/steady_grid and not run again. A failure is kept too, and counts.
"""

from __future__ import annotations

import argparse
import json
import time
import tomllib
from pathlib import Path
from typing import Any

from document import write_between

from meshes import COARSE, FINE_ROWS, rows
from mpm import Case, Reactor, load_case
from mpm.errors import ConvergenceError
from mpm.parallel import is_root
from mpm.reactor.flow import Flow

from mpi4py import MPI  # isort: skip  (after mpm.numerics.fem)

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "results" / "steady_grid"
DOCUMENT = ROOT / "docs" / "steady.md"
BEGIN, END = "<!-- table: written by scripts/steady_grid.py -->", "<!-- end of table -->"
SPEEDS = (0.1, 0.5, 1.3, 5.0)  # cm/s
FIVE, FOUR = (1e-5, 1e-4, 2e-4, 1e-3, 1e-2), (1e-5, 1e-4, 1e-3, 1e-2)  # mass fraction of TMA
DOSES = {"coarse": FIVE, "mid": FIVE, "thesis": FOUR, "four-cycles": (2e-4,)}
WATER = 0.375  # mass of water per mass of TMA: molar 1.5 : 1
USED_UP = 1e-9  # share of the precursor that may leave where all of it counts as taken up


MESHES: dict[tuple[str, str], dict[str, Any]] = {
    ("coarse", "zone"): COARSE,
    ("coarse", "cycle"): COARSE,
    ("mid", "zone"): {"geometry.cell_width": "0.9 mm", **rows(8, 4, 8, 20)},
    ("mid", "cycle"): {"geometry.cell_width": "0.9 mm", **rows(8, 4, 8, 20)},
    ("thesis", "zone"): FINE_ROWS,
    ("thesis", "cycle"): {},
    ("four-cycles", "cycle"): {},
}


def grid_case(mesh: str, kind: str, dose: float, speed: float) -> Case:
    """One zone of TMA, or cycles with the stoichiometric amount of water; `speed` in cm/s."""
    changes = {**MESHES[mesh, kind], "fidelity": "steady", "motion.bed_velocity": f"{speed} cm/s"}
    if mesh == "four-cycles":
        return load_case(four_cycles(dose), changes)
    changes["geometry.inlet.tma.mass_fractions.TMA"] = dose
    if kind == "cycle":
        changes["geometry.inlet.water.mass_fractions.H2O"] = WATER * dose
    return load_case(ROOT / "cases" / f"single_{kind}.toml", changes)


def four_cycles(dose: float) -> dict[str, Any]:
    """The single cycle on the mesh of four cycles, dosed alike in each."""
    data = tomllib.loads((ROOT / "cases" / "single_cycle.toml").read_text(encoding="utf-8"))
    base = ROOT / "meshes" / "four_cycles.toml"
    inlets = tomllib.loads(base.read_text(encoding="utf-8"))["geometry"]["inlet"]
    feeds = {"tma": {"TMA": dose}, "water": {"H2O": WATER * dose}, "purge": {}}
    data["geometry"] = {
        "base": str(base),
        "inlet": [
            {
                "name": i["name"],
                "velocity": "3.5 cm/s",
                "mass_fractions": feeds[i["name"].rstrip("0123456789")],
            }
            for i in inlets
        ],
    }
    return data


def measure(
    mesh: str, kind: str, dose: float, speed: float, flow: Flow | None
) -> tuple[dict[str, Any], Flow]:
    """What one steady state takes and gives, and the flow it used: that does not depend on the dose."""
    reactor = Reactor(grid_case(mesh, kind, dose, speed), flow=flow)
    begun, clock = time.process_time(), time.monotonic()
    flow = reactor.flow
    numbers: dict[str, Any] = {"cells": reactor.grid.cells, "ranks": reactor.comm.size}
    numbers |= {"flow_seconds": time.process_time() - begun, "flow_wall": time.monotonic() - clock}
    begun, clock = time.process_time(), time.monotonic()
    try:
        summary = reactor.run().summary
    except ConvergenceError as error:
        return {**numbers, "failure": str(error)}, flow
    numbers |= {"seconds": time.process_time() - begun, "wall": time.monotonic() - clock}
    species, titration = summary["species"], summary["titration"]
    numbers["newton_steps"] = reactor.steps
    numbers["balance"] = max(entry["balance_error"] for entry in species.values())
    numbers["exits"] = {name: entry["exit_mean"] for name, entry in titration.items()}
    numbers["left"] = species["TMA"]["left"] / species["TMA"]["fed"]
    if kind == "zone" and numbers["left"] < USED_UP:
        numbers["gap"] = abs(titration["tma"]["exit_mean"] - summary["dose_ratio"]["tma"])
    return numbers, flow


def table() -> str:
    """Markdown of everything measured so far, and the count."""
    lines = [
        "| mesh | case | Y TMA | bed, cm/s | cells | Newton steps | processor time, s | balance | exit | exit - dose ratio |"
    ]
    lines.append("|" + " --- |" * 10)
    count = found = 0
    for mesh, kind in MESHES:
        for speed in SPEEDS:
            for dose in DOSES[mesh]:
                path = KEPT / f"{mesh}-{kind}-{dose:g}-{speed:g}.json"
                if not path.exists():
                    continue
                n = json.loads(path.read_text(encoding="utf-8"))
                count += 1
                start = f"| {mesh} | {kind} | {dose:g} | {speed:g} | {n['cells']:,} |"
                if "failure" in n:
                    lines.append(f"{start} failed | | | | |")
                    continue
                found += 1
                exits = ", ".join(f"{value:.4f}" for value in n["exits"].values())
                gap = f"{n['gap']:.1e}" if "gap" in n else ""
                lines.append(
                    f"{start} {n['newton_steps']} | {n['seconds']:.1f} | {n['balance']:.0e} | {exits} | {gap} |"
                )
    return "\n".join([f"{found} of {count} cases converged.", "", *lines])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mesh", nargs="*", default=["coarse", "mid", "thesis"], choices=list(DOSES))
    parser.add_argument("--kind", nargs="*", default=["zone", "cycle"], choices=["zone", "cycle"])
    parser.add_argument("--speed", type=float, nargs="*", default=SPEEDS, choices=SPEEDS, help="cm/s")
    parser.add_argument(
        "--dose", type=float, nargs="*", default=FIVE, choices=FIVE, help="mass fraction of TMA"
    )
    chosen = parser.parse_args()
    root = is_root(MPI.COMM_WORLD)
    KEPT.mkdir(parents=True, exist_ok=True)
    for mesh, kind in MESHES:
        if mesh not in chosen.mesh or kind not in chosen.kind:
            continue
        for speed in chosen.speed:
            flow: Flow | None = None
            for dose in (d for d in DOSES[mesh] if d in chosen.dose):
                path = KEPT / f"{mesh}-{kind}-{dose:g}-{speed:g}.json"
                if path.exists():
                    continue
                numbers, flow = measure(mesh, kind, dose, speed, flow)
                if root:
                    path.write_text(json.dumps(numbers), encoding="utf-8")
                    print(f"{path.stem}: {numbers}", flush=True)
    if root:
        write_between(DOCUMENT, BEGIN, END, table())


if __name__ == "__main__":
    main()
