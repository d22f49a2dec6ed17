"""Can vibration become an effective diffusivity in a steady model? (thesis, section 6.3): measure it.

    python scripts/open_question.py                        # all points, then docs/open_question.md is given its tables
    python scripts/open_question.py --columns 0.34 --gamma 0.3 --speed 1.3

Every point compares, on one mesh and at the same instant, the resolved model with `averaged`, `averaged` with dispersion, and the
steady state; narrower columns tell the model's difference from the mesh's. Numbers are kept under results/open_question; what has been
measured is not measured again.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from document import write_between

from meshes import rows
from mpm import Reactor, load_case
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion
from mpm.transport.dispersion import vibrational_dispersion

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "results" / "open_question"
DOCUMENT = ROOT / "docs" / "open_question.md"
BEGIN, END = "<!-- tables: written by scripts/open_question.py -->", "<!-- end of tables -->"
COLUMNS = (2.33, 1.0, 0.34)  # mm
GAMMAS, SPEEDS = (0.3, 0.4, 0.5, 0.6), (0.5, 1.3, 3.0)
# residence times of the bed in the zone, and seconds to renew the headspace, until the comparison
PASSES, FLUSH = 2.0, 15.0
LAYERS = ("plenum", "frit", "bed", "headspace")
SITE = "OAl(CH3)2"
FRONT = "front.tma.bed.coverage"  # m upstream of the inlet, where the mean coverage of the bed is 1/2
MESH: dict[str, Any] = {
    **rows(4, 3, 4, 8),
    # the frit, which saturates over hours, starts saturated: then the steady state is near when the runs end
    "material.sintered_powder.initial_coverage": {"OH": 0.0, SITE: 1.0},
}
MODELS: dict[str, dict[str, Any]] = {
    "resolved": {"fidelity": "resolved"},
    "averaged": {"fidelity": "averaged"},
    "averaged + dispersion": {"fidelity": "averaged", "transport.vibrational_dispersion": True},
    "steady": {"fidelity": "steady"},
    "steady + dispersion": {"fidelity": "steady", "transport.vibrational_dispersion": True},
    "resolved, impulsive start": {"fidelity": "resolved", "motion.startup": "impulsive"},
}


def record(model: str, columns: float, gamma: float, speed: float) -> Path:
    return KEPT / f"{model.replace(' ', '_')}-{columns:g}mm-{gamma:g}-{speed:g}.json"


def measure(model: str, columns: float, gamma: float, speed: float) -> dict[str, float]:
    """Coverage of the box and at the exit, methane at the outlet, processor time [s] of one model; `columns` in mm, `speed` in cm/s.

    Columns slide as a whole: transients are averaged over several slides, the steady coverage over what enters and leaves a cell.
    """
    path = record(model, columns, gamma, speed)
    if path.exists():
        known: dict[str, float] = json.loads(path.read_text(encoding="utf-8"))
        return known
    end = PASSES * 0.1397 / (0.01 * speed) + FLUSH
    case = load_case(
        ROOT / "cases" / "single_zone.toml",
        {
            **MESH,
            **MODELS[model],
            "geometry.cell_width": f"{columns} mm",
            "motion.gamma": gamma,
            "motion.bed_velocity": f"{speed} cm/s",
            "time.end": f"{end} s",
            "time.step": "10 ms",
            "output.every": "62.5 ms",
        },
    )
    reactor = Reactor(case)
    middle = 0.5 * (reactor.grid.x[1:] + reactor.grid.x[:-1])
    box = middle < next(i.center for i in case.geometry.inlets if i.name == "tma")
    # several slides and some cycles
    slides = max(4.0 * reactor.grid.dx / (0.01 * speed), 1.0)
    seen: list[tuple[float, float]] = []

    def look(r: Reactor) -> None:
        coverage = r.coverage("bed", SITE)
        if case.fidelity == "steady":
            before = np.concatenate([np.zeros((len(coverage), 1)), coverage[:, :-1]], axis=1)
            coverage = 0.5 * (coverage + before)
        if r.time >= end - slides or case.fidelity == "steady":
            seen.append((float(coverage[:, box].mean()), float(coverage[:, -1].mean())))

    begun = time.process_time()
    result = reactor.run(callback=look)
    numbers = {
        "box_mean": float(np.mean([s[0] for s in seen])),
        "exit_mean": float(np.mean([s[1] for s in seen])),
        "x_CH4": float(np.mean(result.history["outlets.zone1.x.CH4"][-len(seen) :])),
        "processor_seconds": time.process_time() - begun,
    }
    fronts = result.history.get(FRONT, np.array([]))[-len(seen) :]
    if np.isfinite(fronts).any():
        numbers["front"] = float(np.nanmean(fronts))
    KEPT.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(numbers), encoding="utf-8")
    return numbers


def dispersion(gamma: float) -> dict[str, list[float]]:
    """Mean of K_xx and K_yy over the effective diffusivity of each layer, at 1.3 cm/s in the widest columns."""
    path = KEPT / f"dispersion-{gamma:g}.json"
    if path.exists():
        known: dict[str, list[float]] = json.loads(path.read_text(encoding="utf-8"))
        return known
    wide = {**MESH, "geometry.cell_width": f"{COLUMNS[0]} mm"}
    case = load_case(ROOT / "cases" / "single_zone.toml", {**wide, "motion.gamma": gamma})
    strip = Strip(case, Reactor(case).comm)
    d = case.gas.diffusivity["TMA"]
    k = vibrational_dispersion(case, strip, BedMotion(case.motion), [d])[0]
    found = {}
    for index, layer in enumerate(case.geometry.layers):
        inside = strip.grid.row_layer[strip.row] == index
        m = layer.material
        free = [m.porosity * d / t for t in m.tortuosity_factor] if m else [d, d]
        weight = strip.volume[inside] / strip.volume[inside].sum()
        found[layer.name] = [float(k[i][inside] @ weight / free[i]) for i in range(2)]
    KEPT.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found), encoding="utf-8")
    return found


def tables() -> str:
    """Markdown of everything measured so far."""
    lines = [
        "| Gamma | bed, cm/s | columns, mm | model | box mean | exit mean | front, mm | outlet CH4, 1e-6 | processor time, s |"
    ]
    lines.append("|" + " --- |" * 9)
    for gamma, speed, columns, model in itertools.product(GAMMAS, SPEEDS, COLUMNS, MODELS):
        path = record(model, columns, gamma, speed)
        if path.exists():
            n = json.loads(path.read_text(encoding="utf-8"))
            front = f"{1e3 * n['front']:.2f}" if "front" in n else ""
            values = f"{n['box_mean']:.4f} | {n['exit_mean']:.4f} | {front} | {1e6 * n['x_CH4']:.2f} | {n['processor_seconds']:.1f}"
            lines.append(f"| {gamma:g} | {speed:g} | {columns:g} | {model} | {values} |")
    lines += ["", *differences()]
    lines += [
        "",
        "| Gamma | " + " | ".join(f"{name}, K_xx/D, K_yy/D" for name in LAYERS) + " |",
        "|" + " --- |" * 5,
    ]
    for gamma in GAMMAS:
        path = KEPT / f"dispersion-{gamma:g}.json"
        if path.exists():
            k = json.loads(path.read_text(encoding="utf-8"))
            lines.append(
                f"| {gamma:g} | " + " | ".join(f"{k[n][0]:.4f}, {k[n][1]:.4f}" for n in LAYERS) + " |"
            )
    return "\n".join(lines)


def differences() -> list[str]:
    """Markdown lines: box mean of the resolved run less that of the averaged one, by mesh."""
    lines = [
        "| Gamma | bed, cm/s | "
        + " | ".join(f"resolved - averaged, columns of {columns:g} mm" for columns in COLUMNS)
        + " |",
        "|" + " --- |" * (2 + len(COLUMNS)),
    ]
    for gamma, speed in itertools.product(GAMMAS, SPEEDS):
        cells = []
        for columns in COLUMNS:
            paths = [record(model, columns, gamma, speed) for model in ("resolved", "averaged")]
            found = [json.loads(p.read_text(encoding="utf-8"))["box_mean"] for p in paths if p.exists()]
            cells.append(f"{found[0] - found[1]:+.4f}" if len(found) == len(paths) else "")
        lines.append(f"| {gamma:g} | {speed:g} | " + " | ".join(cells) + " |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--columns", type=float, nargs="*", default=COLUMNS, choices=COLUMNS, help="mm")
    parser.add_argument("--gamma", type=float, nargs="*", default=GAMMAS, choices=GAMMAS)
    parser.add_argument("--speed", type=float, nargs="*", default=SPEEDS, choices=SPEEDS, help="cm/s")
    parser.add_argument("--model", nargs="*", default=list(MODELS), choices=MODELS)
    chosen = parser.parse_args()
    for gamma in chosen.gamma:
        print(f"Gamma {gamma:g}: K/D {dispersion(gamma)}", flush=True)
    for columns, gamma, speed, model in itertools.product(
        chosen.columns, chosen.gamma, chosen.speed, chosen.model
    ):
        numbers = measure(model, columns, gamma, speed)
        print(f"{columns:g} mm, Gamma {gamma:g}, {speed:g} cm/s, {model}: {numbers}", flush=True)
    write_between(DOCUMENT, BEGIN, END, tables())


if __name__ == "__main__":
    main()
