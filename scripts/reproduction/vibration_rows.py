"""Rows R6 to R8: what vibration and conveying do to the precursor's front (figures 5.9 and 5.10)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.case.case import Case
from mpm.output.results import Run
from mpm.report.fronts import front, layer_mean
from reproduction.row import Checks, Finding, row
from reproduction.store import Lab
from reproduction.zone_rows import feed, increasing

Floats = NDArray[np.float64]
GAMMAS = (0.3, 0.4, 0.5, 0.6)
SPEEDS = ("0.5 cm/s", "1.3 cm/s", "2.0 cm/s", "3.0 cm/s")
EARLY = {"time.end": "1.925 s", "output.every": "0.275 s"}
MM = 1e3


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
        return front(grid, layer_mean(grid, c, layer), feed=2.0 * share * feed(run.case), center=center).get(
            "upstream", 0.0
        )

    values = (
        _highest(y, c.max(axis=1), 0.1 * feed(run.case)) - frit,
        upstream("headspace", 0.01),
        upstream("bed", 0.1),
        front(grid, layer_mean(grid, c, "bed"), feed=feed(run.case), center=center).get(
            "upstream_width", 0.0
        ),
    )
    return dict(zip(ORDERS, values, strict=True))


def _highest(y: Floats, values: Floats, level: float) -> float:
    """Largest y at which `values` pass `level` downwards (linear between rows)."""
    i = int(np.flatnonzero(values >= level)[-1])
    if i == len(y) - 1:
        return float(y[-1])
    return float(y[i] + (values[i] - level) / (values[i] - values[i + 1]) * (y[i + 1] - y[i]))


def early_case(lab: Lab, mesh: str, startup: str, frame: str, gamma: float) -> Case:
    """The zone until 1.925 s with its vibration resolved."""
    changes = {
        "fidelity": "resolved",
        "time.steps_per_cycle": 16,
        "motion.startup": startup,
        "motion.inlet_frame": frame,
        "motion.gamma": gamma,
        **EARLY,
    }
    return lab.case("zone", mesh, changes)


def spreads(lab: Lab, mesh: str, startup: str, frame: str) -> dict[str, Any]:
    """Where TMA stands at 1.925 s at both Gamma, and which of the four orderings hold."""
    low, high = (spread(lab.run(early_case(lab, mesh, startup, frame, gamma))) for gamma in (0.3, 0.6))
    holds = [text for text in ORDERS if high[text] > 1.01 * low[text]]
    return {"gamma 0.3": low, "gamma 0.6": high, "holds": holds}


def spreads_text(numbers: dict[str, Any]) -> str:
    """One line of what `spreads` has measured, by the name of the configuration."""
    return "; ".join(
        f"{name}: {len(n['holds'])} of {len(ORDERS)} ("
        + ", ".join(
            f"{text} {n['gamma 0.3'][text] * MM:.2f} to {n['gamma 0.6'][text] * MM:.2f} mm" for text in ORDERS
        )
        + ")"
        for name, n in numbers.items()
    )


@row(
    "R6",
    "5.9a,b",
    "t = 1.925 s: with Gamma 0.60 the front is farther into the headspace, nearer the bed inlet, and "
    "shallower than with 0.30",
    "four orderings, each by more than 1 %",
)
def vibration_spreads(lab: Lab) -> Finding:
    checks, numbers = Checks(), dict[str, Any]()
    for startup, state in (("impulsive", "start-up"), ("developed", "developed")):
        for frame in ("reactor", "lab"):
            name = f"{state}, inlets in the {frame}'s frame"
            numbers[name] = spreads(lab, "medium", startup, frame)
            checks.add(name, len(numbers[name]["holds"]) == len(ORDERS))
    measured = spreads_text(numbers)
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
    checks, numbers = Checks(), dict[str, Any]()
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


def pulse_case(lab: Lab, mesh: str, startup: str, frame: str, gamma: float, end: str = "6.5 s") -> Case:
    """The zone until `end` with its vibration resolved."""
    changes = {
        "fidelity": "resolved",
        "time.steps_per_cycle": 16,
        "time.end": end,
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
    checks, numbers = Checks(), dict[str, Any]()

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
        f"{gains['coarse'][-1]:+.4f} on the coarse and {gains['medium'][-1]:+.4f} on the medium mesh. Upwinding of "
        "the gas that swings adds to diffusion along wide columns, the more so the larger Gamma (docs/vibration.md), "
        "so a gain that shrinks with the column is the mesh's. A bed that moves faster brings more fresh sites into the "
        "box, but TMA gas that it drags around the periodic strip reaches the box from the other side: at Y 1e-3 the box fills "
        f"up within 20 s at every speed, and the largest reversal of the order is {-falls:.2f}."
    )
    return Finding(checks.verdict, measured, numbers, why)
