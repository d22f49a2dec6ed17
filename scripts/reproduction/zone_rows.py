"""Rows R9 to R12 and R23: one precursor zone by dose (figures 5.5 and 5.11)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.case.case import Case
from mpm.output.results import Run
from mpm.report.dosing import inlet_excess
from mpm.report.fronts import coverage_front, layer_mean
from reproduction.row import Checks, Finding, row
from reproduction.store import Lab

Floats = NDArray[np.float64]
DOSE = "geometry.inlet.tma.mass_fractions.TMA"
DOSES = (1e-4, 2e-4, 1e-3, 1e-2)
MM = 1e3


def dose_case(lab: Lab, dose: float) -> Case:
    """The zone at a dose, on the finest mesh there is."""
    return lab.best("zone", {DOSE: dose})


def excess(case: Case) -> float:
    """Excess number of the TMA inlet (5-20)."""
    found = inlet_excess(case, next(i for i in case.geometry.inlets if i.name == "tma"))
    assert found is not None
    return found[1]


def feed(case: Case) -> float:
    """Concentration of TMA in its inlet [mol/m3]."""
    inlet = next(i for i in case.geometry.inlets if i.name == "tma")
    return case.feed_concentrations(inlet.mass_fractions)["TMA"]


def increasing(values: list[float], margin: float = 0.0) -> bool:
    """True when each value exceeds the one before by more than `margin`."""
    return all(b - a > margin for a, b in pairwise(values))


# --- R9 to R12, R23: dose ---


def bed_front(run: Run, inlet: str, index: int = -1) -> float | None:
    """Where the coverage that an inlet makes passes 1/2 in the bed at a stored time (`mpm.report.fronts.coverage_front`)."""
    port = next(i for i in run.case.geometry.inlets if i.name == inlet)
    (site,) = run.case.sites_made_by(port)
    profile = layer_mean(run.grid, run.field(run.snapshot(index), f"theta_{site}"), "bed")
    bed = run.case.geometry.moving_layer
    assert bed is not None and bed.material is not None
    return coverage_front(
        run.grid, profile, center=port.center, incoming=bed.material.initial_coverage.get(site, 0.0)
    )


@row(
    "R9",
    "5.11",
    "t = 20 s, Y 1e-4: all but a thin top layer is titrated at the exit",
    "untitrated share 5 to 25 %, at the top",
)
def lean_dose(lab: Lab) -> Finding:
    run = lab.run(dose_case(lab, 1e-4))
    entry = run.summary["titration"]["tma"]
    profile = np.array(entry["exit_profile"])
    heights = run.grid.dy[run.grid.layer_rows("bed")]
    untitrated = 1.0 - entry["exit_mean"]
    reached = profile >= 0.9
    top = float(heights[~reached].sum() / heights.sum())
    checks = Checks()
    checks.add("untitrated share 5 to 25 %", 0.05 <= untitrated <= 0.25)
    checks.add(
        "untitrated sites lie on top",
        not reached.all() and bool(np.all(np.diff(reached.astype(int)) <= 0)) and bool(reached[0]),
    )
    at = {
        t: float(np.interp(t, run.history["time"], run.history["titration.tma.exit_mean"]))
        for t in (15.0, 17.5, 20.0)
    }
    steady = lab.run(lab.case("zone", "medium", {DOSE: 1e-4, **lab.settled})).summary["titration"]["tma"][
        "exit_mean"
    ]
    measured = (
        f"untitrated {untitrated:.1%} at 20 s; coverage below 0.9 in the top {top:.0%} of the bed, top row {profile[-1]:.3f}; "
        f"in the steady state untitrated {1.0 - steady:.1%}"
    )
    numbers = {
        "exit_profile": profile.tolist(),
        "exit_mean": entry["exit_mean"],
        "exit_mean at": at,
        "steady exit_mean": steady,
        "excess": excess(run.case),
    }
    why = (
        f"The excess number is {excess(run.case):.3f}, so a bed that consumes everything leaves with that "
        "coverage once the start is forgotten; at 20 s the exit "
        f"mean has been {at[15.0]:.3f} (15 s), {at[17.5]:.3f} (17.5 s), {at[20.0]:.3f}."
    )
    return Finding(checks.verdict, measured, numbers, why)


@row("R10", "5.11", "Y 2e-4, 1e-3, 1e-2: full titration at the exit", "exit mean >= 0.99 at 20 s")
def rich_doses(lab: Lab) -> Finding:
    checks, numbers = Checks(), dict[str, Any]()
    for dose in DOSES[1:]:
        run = lab.run(dose_case(lab, dose))
        entry = run.summary["titration"]["tma"]
        numbers[f"{dose:g}"] = {
            "exit_mean": entry["exit_mean"],
            "exit_min": entry["exit_min"],
            "excess": excess(run.case),
        }
        checks.add(f"Y {dose:g}", entry["exit_mean"] >= 0.99)
    measured = "exit mean " + ", ".join(
        f"{n['exit_mean']:.4f} (Y {y}, excess {n['excess']:.2f})" for y, n in numbers.items()
    )
    why = "An excess number above 1 allows full titration; what is missing at 20 s is the time that the plenum and the frit take before."
    return Finding(checks.verdict, measured, numbers, why)


@row(
    "R11",
    "5.11",
    "Titration is limited by supply, not by rate",
    "sticking x 0.1 and x 10 change the exit mean by less than 1 %",
)
def supply_limited(lab: Lab) -> Finding:
    checks, numbers = Checks(), dict[str, Any]()
    for dose in (1e-4, 1e-3):
        exits = {}
        for factor in (0.1, 1.0, 10.0):
            changes = {DOSE: dose} | (
                {} if factor == 1.0 else {"chemistry.reaction.tma.A": f"{0.9 * factor:g} m/s"}
            )
            exits[factor] = lab.run(lab.case("zone", "light", changes)).summary["titration"]["tma"][
                "exit_mean"
            ]
        change = max(abs(exits[f] / exits[1.0] - 1.0) for f in (0.1, 10.0))
        numbers[f"{dose:g}"] = {"exit_mean": {f"{f:g}": e for f, e in exits.items()}, "change": change}
        checks.add(f"Y {dose:g}", change < 0.01)
    measured = "largest change " + ", ".join(f"{n['change']:.2%} (Y {y})" for y, n in numbers.items())
    why = "Rate matters where the bed's top row, next to the outlet, is reached by what is left of the precursor."
    return Finding(checks.verdict, measured, numbers, why)


VARIATIONS: dict[str, dict[str, Any]] = {
    "gas velocity x 2": {"geometry.inlet.tma.velocity": "7 cm/s", DOSE: 0.5e-4},
    "port width x 2": {"geometry.inlet.tma.width": "8 mm", DOSE: 0.5e-4},
    "port width x 1/2": {"geometry.inlet.tma.width": "2 mm", DOSE: 2e-4},
    "bed speed x 2": {"motion.bed_velocity": "2.6 cm/s", DOSE: 2e-4},
    "bed height x 2": {"geometry.layer.bed.height": "6 mm", DOSE: 2e-4},
    "surface x 2": {"material.glass_beads.surface_to_volume": "116000 1/m", DOSE: 2e-4},
}
"""Each factor of the excess number changed, and the feed with it, so that the excess number stays."""


@row(
    "R12",
    "5-20",
    "v, port width and feed raise gamma; bed speed, height and S lower it",
    "at fixed gamma the exit mean of the steady state stays within 5 %",
)
def excess_alone(lab: Lab) -> Finding:
    checks, numbers = Checks(), dict[str, Any]()
    base = lab.case("zone", "medium", {DOSE: 1e-4, **lab.settled})
    exit_base = lab.run(base).summary["titration"]["tma"]["exit_mean"]
    numbers["base"] = {"exit_mean": exit_base, "excess": excess(base)}
    for name, changes in VARIATIONS.items():
        case = lab.case("zone", "medium", {DOSE: 1e-4, **lab.settled, **changes})
        alone = lab.case("zone", "medium", {**{k: v for k, v in changes.items() if k != DOSE}, DOSE: 1e-4})
        up = excess(alone) > excess(base)
        exit_mean = lab.run(case).summary["titration"]["tma"]["exit_mean"]
        numbers[name] = {"exit_mean": exit_mean, "excess": excess(case), "raises gamma alone": up}
        expected_up = name.startswith("gas velocity") or name == "port width x 2"
        checks.add(name, abs(exit_mean / exit_base - 1.0) < 0.05 and up == expected_up)
    measured = f"base {exit_base:.3f} at gamma {excess(base):.3f}; " + ", ".join(
        f"{name} {n['exit_mean']:.3f}" for name, n in numbers.items() if name != "base"
    )
    why = (
        "The excess number fixes the exit coverage only where no precursor leaves unused. At gamma near 1 "
        "part of it does, and how much depends on where the "
        "precursor enters the bed: gas from the plenum rises evenly, so a larger share of TMA gas in the "
        "feed meets more of the bed."
    )
    return Finding(checks.verdict, measured, numbers, why)


@row(
    "R23",
    "5.5 (text)",
    "The front advances to the bed inlet as Y grows",
    "coverage front and box mean monotone in Y at 20 s",
)
def front_by_dose(lab: Lab) -> Finding:
    numbers = {}
    for dose in DOSES:
        run = lab.run(dose_case(lab, dose))
        numbers[f"{dose:g}"] = {
            "box_mean": run.summary["titration"]["tma"]["box_mean"],
            "front": bed_front(run, "tma"),
        }
    boxes = [n["box_mean"] for n in numbers.values()]
    fronts = [n["front"] for n in numbers.values() if n["front"] is not None]
    checks = Checks()
    checks.add("box mean", increasing(boxes))
    checks.add("front", len(fronts) >= 2 and increasing(fronts))
    measured = "front upstream of the inlet " + ", ".join(
        (f"{n['front'] * MM:.1f} mm" if n["front"] is not None else "no front") + f" (Y {y})"
        for y, n in numbers.items()
    )
    why = "A negative distance is downstream of the inlet's centreline, which lies 104.8 mm from where the bed comes in."
    return Finding(checks.verdict, measured, numbers, why)
