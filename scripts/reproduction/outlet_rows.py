"""Rows R13 to R15: what leaves the outlet of one precursor zone (figure 5.12)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.constants import GAS_CONSTANT
from mpm.output.results import Run
from reproduction.row import Checks, Finding, row
from reproduction.store import Lab
from reproduction.zone_rows import DOSE, DOSES, dose_case, excess, feed, increasing

Floats = NDArray[np.float64]
METHANE, LEFT_OVER = "outlets.zone1.x.CH4", "outlets.zone1.x.TMA"
KNEES = (2.5, 7.5)
HEIGHTS = ("6.35 mm", "12.7 mm", "25.4 mm")


def signal(run: Run, name: str) -> tuple[Floats, Floats]:
    """Times [s] and values of an outlet's mole fraction; a row tells the mean since the row before, so it counts at the middle."""
    time, values = run.history["time"], run.history[name]
    return 0.5 * (time[1:] + time[:-1]), values[1:]


def knees(time: Floats, values: Floats) -> tuple[float, float]:
    """Times at which a signal first passes 10 and 90 % of its largest value: the ends of its low and of its rising segment."""
    top = float(values.max())
    return tuple(float(time[np.flatnonzero(values >= share * top)[0]]) for share in (0.1, 0.9))  # type: ignore[return-value]


@row(
    "R13",
    "5.12b",
    "Outlet CH4: low until 2.5 s, rising to 7.5 s, then moderate",
    "three segments, knees at 2.5 and 7.5 s within 20 %",
)
def three_segments(lab: Lab) -> Finding:
    checks, numbers = Checks(), dict[str, Any]()
    heights = () if lab.setting.geometry else (HEIGHTS[0], HEIGHTS[2])
    runs = {f"Y {dose:g}": lab.run(dose_case(lab, dose)) for dose in DOSES}
    runs |= {
        f"headspace {height}": lab.run(
            lab.case("zone", "medium", {"geometry.layer.headspace.height": height})
        )
        for height in heights
    }
    for name, run in runs.items():
        time, values = signal(run, METHANE)
        low, high = knees(time, values)
        rise = 0.8 * values.max() / max(high - low, time[1] - time[0])
        after = time > high
        fall = abs(np.polyfit(time[after], values[after], 1)[0]) if after.sum() > 1 else np.inf
        numbers[name] = {"knees": (low, high), "slope after over slope of the rise": float(fall / rise)}
    doses = {name: n for name, n in numbers.items() if name.startswith("Y")}
    checks.add(
        "low, rising, moderate", all(n["slope after over slope of the rise"] < 0.5 for n in doses.values())
    )
    for name, n in doses.items():
        checks.add(
            f"knees, {name}", all(abs(k / e - 1.0) < 0.2 for k, e in zip(n["knees"], KNEES, strict=True))
        )
    measured = "knees " + ", ".join(
        f"{n['knees'][0]:.1f} and {n['knees'][1]:.1f} s ({name})" for name, n in numbers.items()
    )
    why = (
        "Knees are where the signal passes 10 and 90 % of its largest value. They move with the dose and "
        "with the headspace, which the thesis prints for the machine alone"
    )
    if heights:
        low, high = (numbers[f"headspace {h}"]["knees"] for h in heights)
        why += f": with Y 1e-3 {low[0]:.1f} and {low[1]:.1f} s at {heights[0]}, {high[0]:.1f} and {high[1]:.1f} s at {heights[1]}"
    why += "."
    return Finding(checks.verdict, measured, numbers, why)


@row(
    "R14",
    "5.12",
    "Y 1e-2 gives a larger, earlier CH4 spike than low Y",
    "peak over final value grows with Y, its time falls",
)
def spike(lab: Lab) -> Finding:
    numbers = {}
    for dose in DOSES:
        time, values = signal(lab.run(dose_case(lab, dose)), METHANE)
        top = int(np.argmax(values))
        numbers[f"{dose:g}"] = {
            "ratio": float(values[top] / values[time > time[-1] - 1.0].mean()),
            "peak": float(values[top]),
            "time": float(time[top]),
        }
    checks = Checks()
    checks.add("peak over final value grows with Y", increasing([n["ratio"] for n in numbers.values()]))
    checks.add(
        "largest with Y 1e-2",
        numbers["0.01"]["peak"] > max(n["peak"] for y, n in numbers.items() if y != "0.01"),
    )
    checks.add(
        "earliest with Y 1e-2",
        numbers["0.01"]["time"] < min(n["time"] for y, n in numbers.items() if y != "0.01"),
    )
    measured = "peak over final value " + ", ".join(
        f"{n['ratio']:.2f} at {n['time']:.1f} s (Y {y})" for y, n in numbers.items()
    )
    why = "At a low dose the methane still rises at 20 s or has no peak worth the name: its largest value is then its last."
    return Finding(checks.verdict, measured, numbers, why)


@row(
    "R15",
    "5.12",
    "With a high excess number unreacted precursor leaves",
    "unreacted share tends to 1 - 1/gamma, within 0.02 in the steady state",
)
def unreacted(lab: Lab) -> Finding:
    checks, numbers = Checks(), dict[str, Any]()
    for dose in DOSES[1:]:
        run = lab.run(dose_case(lab, dose))
        _, x = signal(run, LEFT_OVER)
        gas, inlet = run.case.gas, next(i for i in run.case.geometry.inlets if i.name == "tma")
        out = float(x[-1]) * gas.pressure / (GAS_CONSTANT * gas.temperature) * run.summary["flow"]["outflow"]
        steady = lab.run(lab.case("zone", "medium", {DOSE: dose, **lab.settled}))
        case, tma = steady.case, steady.summary["species"]["TMA"]
        shares = {
            "20 s": out / (inlet.velocity * inlet.width * feed(run.case)),
            "steady": tma["left"] / tma["fed"],
        }
        expected = 1.0 - 1.0 / excess(case)
        numbers[f"{dose:g}"] = {**shares, "expected": expected}
        checks.add(f"Y {dose:g}", abs(shares["steady"] - expected) < 0.02)
    measured = "unreacted " + ", ".join(
        f"{n['20 s']:.3f} at 20 s, {n['steady']:.3f} in the steady state (expected {n['expected']:.3f}, Y {y})"
        for y, n in numbers.items()
    )
    why = (
        "At 20 s gas and frit still store precursor, which is then missing in the outlet; the gas in the bed's pores "
        "circulates in a periodic strip."
    )
    return Finding(checks.verdict, measured, numbers, why)
