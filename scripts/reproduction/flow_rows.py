"""Rows R1 to R5: the flow in a vibrating reactor (figure 5.8)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.case.case import Case
from mpm.mesh.grid import Grid
from mpm.motion.kinematics import Vibration
from reproduction.row import Checks, Finding, row
from reproduction.store import Arrays, Lab

Floats = NDArray[np.float64]
GAMMAS = (0.30, 0.60)
CM = 1e2
EARLY = 1
"""Cycle of the start-up transient that is looked at: the second after the vibration starts."""


def resolved(lab: Lab, base: str = "zone", mesh: str = "light", **motion: Any) -> Case:
    """A resolved case, with keys of `[motion]`."""
    changes = {"fidelity": "resolved", "time.steps_per_cycle": 16 if lab.coarse else 32}
    return lab.case(base, mesh, {**changes, **{f"motion.{key}": value for key, value in motion.items()}})


def below_frit(grid: Grid) -> int:
    """Row that holds y = -5 mm, right below the frit in the thesis' geometry."""
    return int(np.searchsorted(grid.y, -0.005, side="right")) - 1


def reverse_share(velocity: Floats) -> float:
    """Downward over upward flux through a horizontal line of equal facets."""
    return float(abs(np.minimum(velocity, 0.0).sum()) / np.maximum(velocity, 0.0).sum())


@row(
    "R1",
    "5.8a",
    "Before vibration streamlines run from inlet to outlet",
    "no reverse flux below the frit, in frit and bed, or at the outlet",
)
def before_vibration(lab: Lab) -> Finding:
    from reproduction.flows import BOTTOM, TOP, at_rest

    case = resolved(lab, mesh="thesis")
    grid = Grid.from_case(case)
    flows = at_rest(lab, case)
    checks, numbers = Checks(), dict[str, Any]()
    opening = grid.opening(case.geometry.outlets[0])
    for name, text in (("steady", "steady"), ("after_50ms", "50 ms after the inlets open")):
        field = flows[name]
        rows = [grid.layer_rows("frit"), grid.layer_rows("bed")]
        porous = max(reverse_share(field[BOTTOM, r]) for part in rows for r in range(part.start, part.stop))
        values = {
            "below_frit": reverse_share(field[TOP, below_frit(grid)]),
            "porous": porous,
            "outlet": reverse_share(field[TOP, -1, opening]),
        }
        numbers[name] = values
        checks.add(text, max(values.values()) < 1e-6)
    worst = max(v for values in numbers.values() for v in values.values())
    return Finding(checks.verdict, f"largest reverse share {worst:.1e} (steady and at 50 ms)", numbers)


@row(
    "R2",
    "5.8",
    "The frame moves faster than the inlet gas for Gamma 0.3 to 0.6",
    "3.38 to 6.76 cm/s against 3 to 4 cm/s",
)
def frame_speed(lab: Lab) -> Finding:
    checks, numbers = Checks(), dict[str, Any]()
    for gamma in GAMMAS:
        v = Vibration.from_motion(resolved(lab, mesh="coarse", gamma=gamma).motion)
        vx, vy = v.velocity(0.0)
        numbers[f"gamma {gamma}"] = {"x": vx, "y": vy, "speed": float(np.hypot(vx, vy))}
    for inlet in (0.03, 0.035, 0.04):
        for part, text in (("speed", "|V|"), ("y", "V_y")):
            everywhere = all(entry[part] > inlet for entry in numbers.values())
            checks.add(f"{text} against {inlet * CM:g} cm/s", everywhere)
    low, high = numbers["gamma 0.3"], numbers["gamma 0.6"]
    measured = "peak " + ", ".join(f"{t} {low[p] * CM:.2f} to {high[p] * CM:.2f}" for p, t in
                                   (("speed", "|V|"), ("y", "V_y"), ("x", "V_x"))) + " cm/s"  # fmt: skip
    least = {inlet: 0.3 * inlet / low["speed"] for inlet in (0.03, 0.035, 0.04)}
    why = (
        "At Gamma = 0.30 only the length of the velocity vector passes 3 cm/s; it stays below the 3.5 and "
        "4 cm/s that the same thesis allows "
        "for its inlets, and each component stays below 3 cm/s. |V| passes 3.5 cm/s from Gamma = "
        f"{least[0.035]:.2f} and 4 cm/s from "
        f"{least[0.04]:.2f}. At Gamma = 0.60 the statement holds for all three inlet velocities, for |V| "
        "and for V_y."
    )
    return Finding(checks.verdict, measured, numbers, why)


def following(ux: Floats, frame: Floats) -> float:
    """Share of the steps with an appreciable frame velocity (a tenth of its peak) in which `ux` has its sign."""
    counted = np.abs(frame) > 0.1 * np.abs(frame).max()
    return float(np.mean(np.sign(ux[counted]) == np.sign(frame[counted])))


@row(
    "R3",
    "5.8b",
    "Extension: flow from left to right; retraction: from right to left (lab frame)",
    "the sign of mean u_x follows the frame's in at least 90 % of a cycle",
)
def left_and_right(lab: Lab) -> Finding:
    from reproduction.flows import cycle

    checks, numbers = Checks(), dict[str, Any]()
    configurations = [(g, first, True) for g in GAMMAS for first in (None, EARLY)] + [(0.30, None, False)]
    for gamma, first, periodic in configurations:
        case = resolved(lab, gamma=gamma, startup="developed" if first is None else "impulsive")
        case = case if periodic else case.with_({"geometry.periodic": False})
        state = ("developed" if first is None else "start-up") + ("" if periodic else ", closed ends")
        arrays = cycle(lab, case, first)
        frame = arrays["frame"][:, 0]
        for layer in ("frit", "bed", "headspace"):
            ux = arrays[f"ux_{layer}"]
            numbers[f"{layer}, Gamma {gamma:.2f}, {state}"] = {
                "share": following(ux, frame),
                "amplitude": float(0.5 * np.ptp(ux)),
                "mean": float(ux.mean()),
                "frame": float(0.5 * np.ptp(frame)),
            }
    for ends in ("periodic", "closed"):
        for layer in ("frit", "bed", "headspace"):
            shares = [
                n["share"]
                for name, n in numbers.items()
                if name.startswith(layer) and ("closed" in name) == (ends == "closed")
            ]
            checks.add(f"{layer}, {ends} ends", min(shares) >= 0.9)
    parts = []
    for layer in ("frit", "bed", "headspace"):
        shares = [
            n["share"] for name, n in numbers.items() if name.startswith(layer) and "closed" not in name
        ]
        parts.append(f"{layer} {min(shares):.0%} to {max(shares):.0%}")
    head = numbers["headspace, Gamma 0.30, developed"]
    closed = numbers["headspace, Gamma 0.30, developed, closed ends"]
    parts.append(f"headspace between closed ends {closed['share']:.0%}")
    bed = numbers["bed, Gamma 0.30, developed"]
    why = (
        "The gas in the frit moves with the frit. In the bed it moves with the particles, which fly to "
        "the right at constant velocity while the "
        f"reactor retracts: at Gamma 0.30 its mean is {bed['mean'] * CM:.2f} cm/s with an amplitude of "
        f"{bed['amplitude'] * CM:.2f} cm/s. "
        "The headspace gas is dragged by the walls through a Stokes layer of 0.7 mm only; in the "
        "developed state, at Gamma 0.30, its height mean "
        f"swings by {head['amplitude'] * CM:.2f} cm/s around {head['mean'] * CM:.2f} cm/s while the frame "
        "swings by "
        f"{head['frame'] * CM:.2f} cm/s. In the periodic strip nothing else pushes it; between closed "
        "ends (not the thesis' boundary condition) the "
        f"walls do, and the sign follows the frame in {closed['share']:.0%} of the cycle. Relative to the "
        "reactor the streamlines in the periodic "
        "headspace reverse with every stroke, against the frame."
    )
    return Finding(checks.verdict, "sign follows in: " + ", ".join(parts), numbers, why)


def outlet_numbers(case: Case, arrays: Arrays) -> dict[str, float]:
    """Exchange through the outlets in a cycle.

    `back`: volume drawn in over volume let out; `net_error`: |out - back - in| / in over the cycle; `depth` [m]: largest volume
    drawn in by any outlet in a cycle over its open width; `on_retraction`: share of the drawn volume taken while the frame
    moves down; `apparent`: share of the cycle in which the gas at the outlet moves down in the lab's frame, V_y + u_out < 0.
    """
    grid = Grid.from_case(case)
    v_y = arrays["frame"][:, 1]
    dt = 1.0 / (case.motion.frequency * case.time.steps_per_cycle)
    out = back = retraction = 0.0
    depth, apparent = 0.0, 0.0
    for outlet in case.geometry.outlets:
        u = arrays[f"out_{outlet.name}"]
        drawn = -np.minimum(u, 0.0).sum(axis=1) * grid.dx * dt
        out += float(np.maximum(u, 0.0).sum() * grid.dx * dt)
        back += float(drawn.sum())
        retraction += float(drawn[v_y < 0.0].sum())
        depth = max(depth, float(drawn.sum() / (u.shape[1] * grid.dx)))
        apparent = max(apparent, float(np.mean(u.mean(axis=1) + v_y < 0.0)))
    fed = float(arrays["inflow"].sum() * dt)
    numbers = {
        "back": back / out,
        "net_error": abs(out - back - fed) / fed,
        "depth": depth,
        "apparent": apparent,
    }
    if back > 0.0:
        numbers["on_retraction"] = retraction / back
    return numbers


@row(
    "R4",
    "5.8",
    "Outlet gas is drawn in on retraction and as much expelled; the headspace is not invaded",
    "backflow above 1 %, net over a cycle equal to the feed, depth below a tenth of the headspace",
)
def backflow(lab: Lab) -> Finding:
    from reproduction.flows import cycle

    numbers, checks = {}, Checks()
    for base, count in (("zone", "one outlet"), ("cycle", "two outlets")):
        for frame in ("reactor", "lab"):
            for gamma in GAMMAS:
                case = resolved(lab, base, gamma=gamma, inlet_frame=frame)
                numbers[f"{count}, inlets in the {frame}'s frame, Gamma {gamma:.2f}"] = outlet_numbers(
                    case, cycle(lab, case)
                )
    for gamma in GAMMAS:
        case = resolved(lab, "cycle", gamma=gamma, startup="impulsive")
        numbers[f"two outlets, inlets in the reactor's frame, Gamma {gamma:.2f}, start-up"] = outlet_numbers(
            case, cycle(lab, case, EARLY)
        )
    height = next(l.height for l in case.geometry.layers if l.name == "headspace")
    fixed = [n for name, n in numbers.items() if "reactor's" in name]
    low, high = (numbers[f"one outlet, inlets in the lab's frame, Gamma {g:.2f}"] for g in GAMMAS)
    swung = [n for name, n in numbers.items() if "lab's" in name]
    seen = [numbers[f"one outlet, inlets in the reactor's frame, Gamma {g:.2f}"]["apparent"] for g in GAMMAS]
    checks.add("drawn in with inlets fixed to the reactor", all(n["back"] > 0.01 for n in fixed))
    checks.add("drawn in with inlets at rest in the lab", all(n["back"] > 0.01 for n in swung))
    checks.add("drawn in on retraction", all(n.get("on_retraction", 0.0) > 0.5 for n in swung))
    checks.add("as much expelled", all(n["net_error"] < 0.01 for n in numbers.values()))
    checks.add("headspace not invaded", all(n["depth"] < 0.1 * height for n in numbers.values()))
    measured = (
        f"inlets fixed to the reactor: drawn in {max(n['back'] for n in fixed):.1%}; fixed in the lab: "
        f"{low['back']:.0%} at Gamma 0.30, "
        f"{high['back']:.0%} at 0.60 ({high.get('on_retraction', 0.0):.0%} of it on retraction, depth "
        f"{high['depth'] * 1e3:.2f} mm); net equals the feed to "
        f"{max(n['net_error'] for n in numbers.values()):.0e}"
    )
    why = (
        "The gas is incompressible. With inlets that ride on the reactor what goes out at every instant "
        "is what comes in, so no outlet can draw in, "
        "whether there is one or two, in the start-up or developed. Seen from the lab the gas at the "
        "outlet does move down on retraction, for "
        f"{seen[0]:.0%} of the cycle at Gamma 0.30 and {seen[1]:.0%} at 0.60: it is carried down with the "
        "reactor, which is what lab-frame "
        "streamlines show and nothing that passes the outlet. With inlets at rest in the lab the port "
        "flow relative to the reactor is v - V_y: "
        "it is least on the upward stroke (extension) and reverses there where V_y > v, and then the "
        "outlet does draw in. What is drawn in is expelled "
        f"again (the net over a cycle is the feed) and reaches {high['depth'] * 1e3:.2f} mm into a "
        f"headspace of {height * 1e3:.1f} mm, so that part of the statement "
        "holds; the stroke is the opposite one."
    )
    return Finding(checks.verdict, measured, numbers, why)


@row("R5", "5.8c", "Gamma 0.60 does the same with larger fluctuation", "ratio of rms u' about 2 (1.8 to 2.2)")
def fluctuation(lab: Lab) -> Finding:
    from reproduction.flows import cycle

    checks, numbers = Checks(), dict[str, Any]()
    for first, state in ((None, "developed"), (EARLY, "start-up")):
        startup = "developed" if first is None else "impulsive"
        low, high = (cycle(lab, resolved(lab, gamma=g, startup=startup), first)["rms"] for g in GAMMAS)
        names = Grid.from_case(resolved(lab)).layer_names
        ratio = {name: float(h / l) for name, h, l in zip(names, high, low, strict=True) if l > 0.0}
        numbers[state] = {"ratio": ratio, "rms": {name: float(l) for name, l in zip(names, low, strict=True)}}
        for layer in ("bed", "headspace"):
            checks.add(f"{layer}, {state}", 1.8 <= ratio[layer] <= 2.2)
    measured = "; ".join(
        f"{state}: "
        + ", ".join(f"{layer} {numbers[state]['ratio'][layer]:.2f}" for layer in ("bed", "headspace"))
        for state in numbers
    )
    why = (
        "Relative to the reactor the bed's gas follows the particles. Their velocity in flight is chosen "
        "so that the mean stays at the prescribed value, "
        "and with it the fluctuation in the bed need not grow in proportion to Gamma. The headspace does "
        "follow the frame's acceleration."
    )
    return Finding(checks.verdict, measured, numbers, why)
