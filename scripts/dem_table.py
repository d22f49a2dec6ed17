"""Measure the table of docs/dem.md: mean bed velocity against the seed's, by row, stiffness and seed.

    python scripts/dem_table.py -o DIR [--rows sine_105 ...] [--stiffness 3 30 300] [--seeds 1 2 3]
    python scripts/dem_table.py -o DIR --markdown
    python scripts/dem_table.py -o DIR --write docs/dem.md

Each run leaves DIR/<row>_k<stiffness>_s<seed>.json and is not repeated; a killed run continues from its last
whole cycle. Runs go one after the other, cheapest stiffness first.
"""

import argparse
import json
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np
from document import write_between

from mpm.dem.case import load_case
from mpm.dem.simulate import Simulation
from mpm.errors import ConvergenceError
from mpm.files import write_atomically

SMALL = {"length": 8.0, "depth": 4.0, "height": 15.0, "size_classes": 1}
LARGE = {"length": 20.0, "depth": 5.0, "height": 15.0, "size_classes": 1}
COARSE = {
    "length": 8.0,
    "depth": 4.0,
    "height": 15.0,
    "size_classes": 5,
    "base": "frit",
    "frit_diameter": "125 um",
}
FINE = {
    "length": 8.0,
    "depth": 4.0,
    "height": 15.0,
    "size_classes": 1,
    "base": "frit",
    "frit_diameter": "25 um",
}
SIXTEEN = {"kind": "sine", "frequency": "16 Hz", "angle": "60 deg", "angle_from": "vertical"}
SAWTOOTH = {"kind": "sawtooth", "gamma": 10.273 / 9.81, "frequency": "48 Hz", "angle": "45 deg"}
AIR = {"velocity": "0 cm/s"}

MARKS = ("<!-- table of scripts/dem_table.py -->", "<!-- end of the table -->")
TOLERANCE = 0.15  # of the seed's value
Row = tuple[str, str, dict[str, Any]]  # what it is, the seed's value in cm/s, the powder file


def glass(waveform: dict[str, Any], box: dict[str, Any] = SMALL) -> dict[str, Any]:
    """GL50 without gas on a flat base, chapter 2."""
    return {"powder": "GL50", "waveform": waveform, "box": box}


def sixteen(powder: str, gamma: float, box: dict[str, Any], **change: Any) -> dict[str, Any]:
    """Chapters 4 and 5: 16 Hz (chapter 3 vibrates at 18.5 Hz), frit monolayer, air in the bed."""
    return {"powder": powder, "waveform": {**SIXTEEN, "gamma": gamma, **change}, "box": box, "gas": AIR}


ROWS: dict[str, Row] = {
    "sine_105": ("GL50, sine 1.05 g", "1.08-3.51", glass({"kind": "seed", "harmonics": 1})),
    "sine_070": ("GL50, sine 0.7 g", "0.33", glass({"kind": "seed", "harmonics": 1, "gamma": 0.7})),
    "three_070": ("GL50, 0.7 g, three harmonics", "0.58", glass({"kind": "seed", "harmonics": 3, "gamma": 0.7})),
    "sawtooth_105": ("GL50, pseudo-sawtooth 1.05 g equivalent", "1.57", glass(SAWTOOTH)),
    "gl223_030": ("GL223, Gamma 0.30, air", "0.58", sixteen("GL223", 0.30, COARSE)),
    # 2.03: 22.5 mm in 1.11 s (section 4.4.2), derived; the others are printed
    "gl223_050": ("GL223, Gamma 0.50, air", "2.03", sixteen("GL223", 0.50, COARSE)),
    "gl56_030": ("GL56 (one size), Gamma 0.30, air", "1.3", sixteen("GL56", 0.30, FINE)),
    "gl223_030_h": (
        "GL223, Gamma 0.30, air, angle from the horizontal", "0.58",
        sixteen("GL223", 0.30, COARSE, angle_from="horizontal"),
    ),
    "gl223_050_h": (
        "GL223, Gamma 0.50, air, angle from the horizontal", "2.03",
        sixteen("GL223", 0.50, COARSE, angle_from="horizontal"),
    ),
    "gl56_030_h": (
        "GL56 (one size), Gamma 0.30, air, angle from the horizontal", "1.3",
        sixteen("GL56", 0.30, FINE, angle_from="horizontal"),
    ),
    "gl223_030_45": (
        "GL223, Gamma 0.30, air, 45 deg", "0.58", sixteen("GL223", 0.30, COARSE, angle="45 deg"),
    ),
    "gl223_050_45": (
        "GL223, Gamma 0.50, air, 45 deg", "2.03", sixteen("GL223", 0.50, COARSE, angle="45 deg"),
    ),
    "gl56_030_45": (
        "GL56 (one size), Gamma 0.30, air, 45 deg", "1.3", sixteen("GL56", 0.30, FINE, angle="45 deg"),
    ),
    "sine_105_full": (
        "GL50, sine 1.05 g, cohesion not reduced", "1.08-3.51",
        glass({"kind": "seed", "harmonics": 1}, {**SMALL, "reduced_cohesion": False}),
    ),
    "sine_070_full": (
        "GL50, sine 0.7 g, cohesion not reduced", "0.33",
        glass({"kind": "seed", "harmonics": 1, "gamma": 0.7}, {**SMALL, "reduced_cohesion": False}),
    ),
    "sine_105_large": ("GL50, sine 1.05 g, box 20x5x15 d", "1.08-3.51", glass({"kind": "seed", "harmonics": 1}, LARGE)),
    "sawtooth_105_large": ("GL50, pseudo-sawtooth, box 20x5x15 d", "1.57", glass(SAWTOOTH, LARGE)),
}  # fmt: skip


def measure(name: str, stiffness: float, seed: int, cycles: int, out: Path) -> None:
    """Run one seed of one row unless its result is there."""
    result = out / f"{name}_k{stiffness:g}_s{seed}.json"
    if result.exists():
        return
    change = {"box.stiffness": f"{stiffness!r} N/m", "run.dump_per_cycle": 0, "run.cycles": cycles}
    case = load_case(ROWS[name][2], change)
    simulation = Simulation(case, seed, out / "states" / result.stem)
    before = 0
    if simulation.state_file.exists():
        with np.load(simulation.state_file) as archive:
            before = int(archive["cycles"])
    began = time.process_time()
    arrays = simulation.run(resume=True)
    assert arrays is not None
    mass = simulation.spec.diameters[simulation.filling.classes] ** 3
    centre = arrays["cycle_end"][:, :, 0] @ (mass / mass.sum())
    speeds: np.ndarray = np.diff(centre) / simulation.period
    kept = speeds[case.run.discard :]
    record = {
        "row": name,
        "stiffness": stiffness,
        "seed": seed,
        "particles": len(mass),
        "steps_per_cycle": simulation.steps * case.run.updates_per_cycle,
        "cpu_seconds_per_cycle": (time.process_time() - began) / max(case.run.cycles - before, 1),
        "cycle_velocities": speeds.tolist(),
        "mean_velocity": float(kept.mean()),
        "coordination": float(2.0 * arrays["pairs"][case.run.discard * case.run.samples_per_cycle :].mean()),
    }
    write_atomically(result, json.dumps(record, indent=1))
    print(f"{result.stem}: {100 * kept.mean():.3f} cm/s", flush=True)


def verdict(expected: str, speeds: list[float]) -> str:
    """Where the seed's value `expected` [cm/s], one number or a range, lies from the mean of `speeds` [cm/s] of all seeds.

    "reproduced" in the range or within TOLERANCE of the number; "within the spread" within two standard deviations between seeds, if
    these are below half of the value (else it cannot be told); otherwise the ratio to the nearest of the seed's values.
    """
    mean = statistics.mean(speeds)
    low, high = (float(part) for part in (expected.split("-") * 2)[:2])
    nearest = min(max(mean, low), high)
    off = abs(mean - nearest)
    if off <= (TOLERANCE * nearest if low == high else 0.0):
        return "reproduced"
    spread = 2.0 * statistics.stdev(speeds) if len(speeds) > 2 else 0.0
    if off <= spread:
        return "within the spread" if spread <= 0.5 * nearest else "spread too large to tell"
    return f"{mean / nearest:.2f} of it"


def markdown(out: Path) -> str:
    """The table of docs/dem.md from the results found."""
    lines = [
        "| case | seed [cm/s] | k [N/m] | seeds | mean ± spread [cm/s] | contacts | CPU s per cycle | verdict |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, (what, expected, _) in ROWS.items():
        found = [json.loads(p.read_text(encoding="utf-8")) for p in sorted(out.glob(f"{name}_k*_s*.json"))]
        for stiffness in sorted({r["stiffness"] for r in found}):
            runs = [r for r in found if r["stiffness"] == stiffness]
            speeds = [100.0 * r["mean_velocity"] for r in runs]
            spread = f" ± {statistics.stdev(speeds):.2f}" if len(speeds) > 1 else ""
            contacts = statistics.mean(r["coordination"] for r in runs)
            cost = statistics.median(r["cpu_seconds_per_cycle"] for r in runs)
            lines.append(
                f"| {what} | {expected} | {stiffness:g} | {len(runs)} | {statistics.mean(speeds):.2f}{spread} "
                f"| {contacts:.1f} | {cost:.0f} | {verdict(expected, speeds)} |"
            )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("results/dem_table"))
    parser.add_argument("--rows", nargs="*", choices=list(ROWS), default=list(ROWS))
    parser.add_argument("--stiffness", nargs="*", type=float, default=[3.0, 30.0, 300.0])
    parser.add_argument("--seeds", nargs="*", type=int, default=[1, 2, 3])
    parser.add_argument("--cycles", type=int, default=8, help="per run, the first three are not averaged")
    parser.add_argument("--markdown", action="store_true", help="print the table of what is there")
    parser.add_argument(
        "--write", type=Path, metavar="DOC", help="put the table between the marks of this document"
    )
    options = parser.parse_args()
    if options.markdown:
        print(markdown(options.output))
        return
    if options.write:
        write_between(options.write, *MARKS, markdown(options.output))
        return
    options.output.mkdir(parents=True, exist_ok=True)
    for stiffness in options.stiffness:
        for seed in options.seeds:
            for name in options.rows:
                try:
                    measure(name, stiffness, seed, options.cycles, options.output)
                except ConvergenceError as error:
                    print(f"{name}, {stiffness:g} N/m, seed {seed}: {error}", flush=True)


if __name__ == "__main__":
    main()
