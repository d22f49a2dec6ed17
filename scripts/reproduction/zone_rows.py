"""Rows R6 to R15 and R23: one precursor zone (figures 5.5 and 5.9 to 5.12)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.case import Case
from mpm.chemistry import inlet_concentrations
from mpm.engineering import inlet_excess
from mpm.fronts import coverage_front, front, layer_mean
from mpm.results import Run, made_site
from reproduction.row import Checks, Finding, row
from reproduction.store import Lab

Floats = NDArray[np.float64]
DOSE = "geometry.inlet.tma.mass_fractions.TMA"
DOSES = (1e-4, 2e-4, 1e-3, 1e-2)
GAMMAS = (0.3, 0.4, 0.5, 0.6)
SPEEDS = ("0.5 cm/s", "1.3 cm/s", "2.0 cm/s", "3.0 cm/s")
EARLY = {"time.end": "1.925 s", "output.every": "0.275 s"}
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
    return inlet_concentrations(case.mechanism, case.gas, inlet.mass_fractions)["TMA"]


def increasing(values: list[float], margin: float = 0.0) -> bool:
    """True when each value exceeds the one before by more than `margin`."""
    return all(b - a > margin for a, b in pairwise(values))


# --- R6 to R8: vibration and conveying ---


ORDERS = ("height", "spill into the headspace", "bed front", "width in the bed")


def spread(run: Run) -> dict[str, float]:
    """Where TMA stands at the end of a run [m]: the quantities of ORDERS.

    Height of the contour C0/10 above the underside of the frit; distance upstream of the inlet at which the headspace's mean falls
    below C0/100 and the bed's below C0/10 (0 where they do not reach it); 10-90 width upstream in the bed.
    """
    c, grid = run.field(run.snapshot(), "C_TMA"), run.grid
    center = next(i.center for i in run.case.geometry.inlets if i.name == "tma")
    y = 0.5 * (grid.y[1:] + grid.y[:-1])
    frit = grid.y[grid.layer_rows("frit").start]

    def upstream(layer: str, share: float) -> float:
        return front(grid, layer_mean(grid, c, layer), 2.0 * share * feed(run.case), center).get(
            "upstream", 0.0
        )

    values = (
        _highest(y, c.max(axis=1), 0.1 * feed(run.case)) - frit,
        upstream("headspace", 0.01),
        upstream("bed", 0.1),
        front(grid, layer_mean(grid, c, "bed"), feed(run.case), center).get("upstream_width", 0.0),
    )
    return dict(zip(ORDERS, values, strict=True))


def _highest(y: Floats, values: Floats, level: float) -> float:
    """Largest y at which `values` pass `level` downwards (linear between rows)."""
    i = int(np.flatnonzero(values >= level)[-1])
    if i == len(y) - 1:
        return float(y[-1])
    return float(y[i] + (values[i] - level) / (values[i] - values[i + 1]) * (y[i + 1] - y[i]))


@row(
    "R6",
    "5.9a,b",
    "t = 1.925 s: with Gamma 0.60 the front is farther into the headspace, nearer the bed inlet, and "
    "shallower than with 0.30",
    "four orderings, each by more than 1 %",
)
def vibration_spreads(lab: Lab) -> Finding:
    checks, numbers = Checks(), {}
    for startup, state in (("impulsive", "start-up"), ("developed", "developed")):
        for frame in ("reactor", "lab"):
            runs = [
                lab.run(
                    lab.case(
                        "zone",
                        "medium",
                        {
                            "fidelity": "resolved",
                            "time.steps_per_cycle": 16,
                            "motion.startup": startup,
                            "motion.inlet_frame": frame,
                            "motion.gamma": gamma,
                            **EARLY,
                        },
                    )
                )
                for gamma in (0.3, 0.6)
            ]
            name = f"{state}, inlets in the {frame}'s frame"
            low, high = (spread(run) for run in runs)
            holds = [text for text in ORDERS if high[text] > 1.01 * low[text]]
            numbers[name] = {"gamma 0.3": low, "gamma 0.6": high, "holds": holds}
            checks.add(name, len(holds) == len(ORDERS))
    measured = "; ".join(
        f"{name}: {len(n['holds'])} of {len(ORDERS)} ("
        + ", ".join(
            f"{text} {n['gamma 0.3'][text] * MM:.2f} to {n['gamma 0.6'][text] * MM:.2f} mm" for text in ORDERS
        )
        + ")"
        for name, n in numbers.items()
    )
    found = [f"{', '.join(n['holds'])} ({name})" for name, n in numbers.items() if n["holds"]]
    why = (
        "Measured are the height of the contour C0/10 above the frit's underside, how far upstream of the inlet the "
        "mean of the headspace reaches C0/100 and that of the bed C0/10, and the 10-90 width in the bed. Ordered as stated "
        f"by more than 1 % are: {'; '.join(found) or 'none'}. In all other cases the larger vibration leaves the precursor as far or less "
        "far spread. At 1.925 s the start-up drift of the headspace has had three of its decay times of 0.7 s."
    )
    return Finding(checks.verdict, measured, numbers, why)


def centroid(run: Run, layer: str) -> float:
    """Position [m] of the centroid of TMA in a layer relative to its inlet: angle of its first moment around the periodic strip."""
    c, grid = run.field(run.snapshot(), "C_TMA"), run.grid
    center = next(i.center for i in run.case.geometry.inlets if i.name == "tma")
    x = 0.5 * (grid.x[1:] + grid.x[:-1])
    moment = layer_mean(grid, c, layer) @ np.exp(2j * np.pi * (x - center) / grid.length)
    return float(np.angle(moment) / (2.0 * np.pi) * grid.length)


@row(
    "R7",
    "5.9c,d",
    "A bed speed of 3.0 instead of 0.5 cm/s drags TMA to the bed's outlet",
    "centroid moves to +x in bed and headspace",
)
def dragging(lab: Lab) -> Finding:
    checks, numbers = Checks(), {}
    layers = ("frit", "bed", "headspace")
    for state, changes in (
        ("cycle mean", {}),
        ("start-up", {"fidelity": "resolved", "motion.startup": "impulsive", "time.steps_per_cycle": 16}),
    ):
        for speed in ("0.5 cm/s", "3.0 cm/s"):
            run = lab.run(lab.case("zone", "light", {**EARLY, **changes, "motion.bed_velocity": speed}))
            numbers[f"{state}, {speed}"] = {layer: centroid(run, layer) for layer in layers}
        slow, fast = numbers[f"{state}, 0.5 cm/s"], numbers[f"{state}, 3.0 cm/s"]
        for layer in ("bed", "headspace"):
            checks.add(f"{layer} ({state})", fast[layer] - slow[layer] > 0.1e-3)
    slow, fast = numbers["start-up, 0.5 cm/s"], numbers["start-up, 3.0 cm/s"]
    measured = "start-up: centroid from the inlet " + ", ".join(
        f"{layer} {slow[layer] * MM:+.1f} -> {fast[layer] * MM:+.1f} mm" for layer in layers
    )
    why = "A centroid that moves by less than 0.1 mm counts as unmoved."
    return Finding(checks.verdict, measured, numbers, why)


def late(run: Run, since: float = 5.0) -> Floats:
    """Box mean of the coverage at output times from `since` [s] on."""
    return run.history["titration.tma.box_mean"][run.history["time"] >= since - 1e-9]


def pulse_case(lab: Lab, mesh: str, startup: str, frame: str, gamma: float) -> Case:
    """6.5 s of the zone with its vibration resolved."""
    changes = {
        "fidelity": "resolved",
        "time.steps_per_cycle": 16,
        "time.end": "6.5 s",
        "output.every": "0.5 s",
        "motion.startup": startup,
        "motion.inlet_frame": frame,
        "motion.gamma": gamma,
    }
    return lab.case("zone", mesh, changes)


@row(
    "R8",
    "5.10b",
    "The box mean of the coverage grows with Gamma and falls with the bed speed, for t >= 5 s",
    "ordering at every output time, by more than the mesh error",
)
def box_mean(lab: Lab) -> Finding:
    checks, numbers = Checks(), {}

    def pulse(mesh: str, startup: str, frame: str, gamma: float) -> Floats:
        return late(lab.run(pulse_case(lab, mesh, startup, frame, gamma)))

    parts = []
    gains = {
        mesh: pulse(mesh, "developed", "reactor", 0.6) - pulse(mesh, "developed", "reactor", 0.3)
        for mesh in ("coarse", "medium")
    }
    error = float(np.abs(gains["medium"] - gains["coarse"]).max())
    for startup, state in (("impulsive", "start-up"), ("developed", "developed")):
        for frame in ("reactor", "lab"):
            gammas = GAMMAS if frame == "reactor" and startup == "impulsive" else (0.3, 0.6)
            curves = {gamma: pulse("coarse", startup, frame, gamma) for gamma in gammas}
            gain = curves[0.6] - curves[0.3]
            name = f"Gamma, {state}, inlets in the {frame}'s frame"
            numbers[name] = {
                "box_mean at 6.5 s": {f"{g}": float(c[-1]) for g, c in curves.items()},
                "gain 0.3 to 0.6 (5 to 6.5 s)": [float(gain.min()), float(gain.max())],
                "mesh error of the gain": error,
            }
            steps = [
                float((b - a).min())
                for a, b in zip(list(curves.values())[:-1], list(curves.values())[1:], strict=True)
            ]
            checks.add(name, all(step > 0.0 for step in steps) and gain.min() > error)
            parts.append(
                f"{state}/{frame} {gain[0]:+.4f} at 5 s, {gain[-1]:+.4f} at 6.5 s (mesh {error:.4f})"
            )
    speeds = {s: late(lab.run(lab.case("zone", "light", {"motion.bed_velocity": s}))) for s in SPEEDS}
    coarser = {s: late(lab.run(lab.case("zone", "coarse", {"motion.bed_velocity": s}))) for s in SPEEDS}
    error = max(float(np.abs(speeds[s] - coarser[s]).max()) for s in SPEEDS)
    falls = min(float((speeds[a] - speeds[b]).min()) for a, b in pairwise(SPEEDS))
    numbers["bed speed"] = {
        "box_mean at 20 s": {s: float(v[-1]) for s, v in speeds.items()},
        "smallest fall": falls,
        "mesh error": error,
    }
    checks.add("falls with the bed speed, t >= 5 s", falls > error)
    soon = {s: lab.run(lab.case("zone", "light", {"motion.bed_velocity": s})).history for s in SPEEDS}
    at = {s: float(np.interp(2.5, h["time"], h["titration.tma.box_mean"])) for s, h in soon.items()}
    numbers["bed speed"]["box_mean at 2.5 s"] = at
    checks.add("falls with the bed speed, t = 2.5 s", increasing([-v for v in at.values()]))
    measured = (
        "Gamma 0.3 -> 0.6: "
        + "; ".join(parts)
        + "; at 20 s by bed speed "
        + ", ".join(f"{v[-1]:.3f}" for v in speeds.values())
        + f" (mesh {error:.3f})"
    )
    why = (
        "Gains are those of the coarse mesh, their mesh error the difference to the medium mesh in the developed state with "
        "inlets fixed to the reactor, where the gain at 6.5 s is "
        f"{gains['coarse'][-1]:+.4f} on the coarse and {gains['medium'][-1]:+.4f} on the medium mesh. Coverage rides in columns "
        "that slide as a whole; on columns wider than the swing of the bed (0.34 to 0.67 mm) the swing can spread the coverage "
        "by up to a column, so a gain that shrinks with the column is the mesh's. A bed that moves faster brings more fresh sites into the "
        "box, but TMA gas that it drags around the periodic strip reaches the box from the other side: at Y 1e-3 the box fills "
        f"up within 20 s at every speed, and the largest reversal of the order is {-falls:.2f}."
    )
    return Finding(checks.verdict, measured, numbers, why)


# --- R9 to R12, R23: dose ---


def bed_front(run: Run, inlet: str, index: int = -1) -> float | None:
    """Where the coverage that an inlet makes passes 1/2 in the bed at a stored time (`mpm.fronts.coverage_front`)."""
    port = next(i for i in run.case.geometry.inlets if i.name == inlet)
    site = made_site(run.case, port)
    profile = layer_mean(run.grid, run.field(run.snapshot(index), f"theta_{site}"), "bed")
    bed = run.case.geometry.moving_layer
    assert bed is not None and bed.material is not None
    return coverage_front(run.grid, profile, port.center, bed.material.initial_coverage.get(str(site), 0.0))


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
    checks, numbers = Checks(), {}
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
    checks, numbers = Checks(), {}
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
    checks, numbers = Checks(), {}
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
