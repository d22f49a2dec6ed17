"""The zone of the source's figure 5.10 under its code's conventions and numerics: box mean of the coverage by Gamma."""

from __future__ import annotations

from typing import Any

from meshes import rows
from vibration_sections.extrapolation import tends
from vibration_sections.store import GAMMAS, WIDTHS, Lab, Numbers, box, less, markdown, shown

UPWIND: dict[str, Any] = {"transport.scheme": "upwind"}
FREE: dict[str, Any] = {"porous.diffusion": "free"}
SUPERFICIAL: dict[str, Any] = {"motion.drag_reference": "superficial"}
OURS = "ours"
READINGS: dict[str, dict[str, Any]] = {
    OURS: {},
    "upwinding": UPWIND,
    "free diffusivity": FREE,
    "both": {**UPWIND, **FREE},
    "both, drag relative to v_s": {**UPWIND, **FREE, **SUPERFICIAL},
    '`conventions = "closed-code"`': {"conventions": "closed-code"},
    "the same, but fitted": {"conventions": "closed-code", "transport.scheme": "fitted"},
}
"""Rows of the table: what each changes."""
ZONE: dict[str, Any] = {
    **rows(6, 4, 12, 14),
    "fidelity": "resolved",
    "time.end": "6.5 s",
    "output.every": "62.5 ms",
}
"""Y_TMA = 1e-3, 1.3 cm/s, developed, 32 steps per cycle, 36 rows."""
WINDOW = 1.0
"""Last second of a run. The bed slides by whole columns, so that at one instant the box mean is wrong by up to half a column over the
box, 0.0016 in columns of 0.34 mm; in the mean over many slides that is gone."""
THESIS = 0.34  # mm
STEPS = (32, 64, 128)
STEPS_WIDTH = 1.0  # mm


def found(lab: Lab, reading: str, width: float, gamma: float) -> Numbers | None:
    """Numbers of a run; `width` in mm."""
    case = lab.case("thesis/single_zone", {**ZONE, **READINGS[reading]}, width=width, gamma=gamma)
    return lab.run(f"zone, {reading}, {width:g} mm, Gamma {gamma:g}", case, window=WINDOW)


def gain(lab: Lab, reading: str, width: float, name: str = "box_mean") -> float | None:
    """What the larger vibration adds to the box mean of the last second, or to another number."""
    low, high = (box(found(lab, reading, width, gamma), name) for gamma in GAMMAS)
    return less(high, low)


def gains(lab: Lab, reading: str) -> list[float | None]:
    """Gain by width of the columns."""
    return [gain(lab, reading, width) for width in WIDTHS]


def table(lab: Lab) -> str:
    """Box means at 6.5 s in the thesis' columns, then the gain of the last second in all, and what it tends to."""
    end = "box_mean_at_end"
    lines, by_width = [], []
    for reading in READINGS:
        low, high = (box(found(lab, reading, THESIS, gamma), end) for gamma in GAMMAS)
        lines.append([reading, shown(low, ".4f"), shown(high, ".4f"), shown(less(high, low), "+.4f")])
        values = gains(lab, reading)
        by_width.append([reading, *(shown(value, "+.4f") for value in values), tends(WIDTHS, values)])
    head = ["columns of 0.34 mm, at 6.5 s", *(f"Gamma {gamma:g}" for gamma in GAMMAS), "gain"]
    widths = [f"{width:g} mm" for width in WIDTHS]
    return "\n\n".join(
        [
            markdown(head, lines),
            markdown(
                ["gain of the mean over 5.5 to 6.5 s, columns of", *widths, "no width (order)"], by_width
            ),
        ]
    )


def steps(lab: Lab) -> str:
    """What steps per cycle do to ours: backward Euler adds u^2 dt/2 to diffusion."""
    lines, values = [], []
    for number in STEPS:
        # the first is the default, as in the other tables
        changes = {**ZONE, **({"time.steps_per_cycle": number} if number != STEPS[0] else {})}
        means = []
        for gamma in GAMMAS:
            case = lab.case("thesis/single_zone", changes, width=STEPS_WIDTH, gamma=gamma)
            means.append(box(lab.run(f"zone, {number} steps, Gamma {gamma:g}", case, window=WINDOW)))
        values.append(less(means[1], means[0]))
        lines.append([f"{number}", *(shown(mean, ".4f") for mean in means), shown(values[-1], "+.4f")])
    lines.append(["no step (order)", "", "", tends([1.0 / number for number in STEPS], values)])
    return markdown(["steps per cycle", *(f"Gamma {gamma:g}" for gamma in GAMMAS), "gain"], lines)
