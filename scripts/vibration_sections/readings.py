"""The zone of the source's figure 5.10 under its code's conventions and numerics: box mean of the coverage at 6.5 s by Gamma."""

from __future__ import annotations

from typing import Any

from meshes import rows
from vibration_sections.extrapolation import to_zero
from vibration_sections.store import GAMMAS, WIDTHS, Lab, box, less, markdown, shown

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
    "output.every": "0.5 s",
}
"""Y_TMA = 1e-3, 1.3 cm/s, developed, 32 steps per cycle, 36 rows."""


def measured(lab: Lab, reading: str, width: float, gamma: float) -> float | None:
    """Box mean at the end; `width` in mm."""
    case = lab.case("thesis/single_zone", {**ZONE, **READINGS[reading]}, width=width, gamma=gamma)
    return box(lab.run(f"zone at 6.5 s, {reading}, {width:g} mm, Gamma {gamma:g}", case))


def gains(lab: Lab, reading: str) -> list[float | None]:
    """Gain of the box mean from Gamma 0.3 to 0.6 by width of the columns."""
    return [
        less(measured(lab, reading, width, GAMMAS[1]), measured(lab, reading, width, GAMMAS[0]))
        for width in WIDTHS
    ]


def table(lab: Lab) -> str:
    """Box means in the thesis' columns, gains in all, and what the gain tends to."""
    lines = []
    for reading in READINGS:
        low, high = (measured(lab, reading, 0.34, gamma) for gamma in GAMMAS)
        by_width = gains(lab, reading)
        limit = to_zero(WIDTHS, by_width)
        lines.append(
            [
                reading,
                shown(low, ".4f"),
                shown(high, ".4f"),
                f"**{shown(less(high, low), '+.4f')}**",
                *(shown(gain, "+.4f") for gain in by_width if gain is not by_width[2]),
                "–" if limit is None else f"{limit[0]:+.4f} ({limit[1]:.1f})",
            ]
        )
    head = ["", "Gamma 0.3, 0.34 mm", "Gamma 0.6, 0.34 mm", "gain, 0.34 mm"]
    head += [f"gain, {width:g} mm" for width in WIDTHS if width != WIDTHS[2]]
    return markdown([*head, "gain at no width (order)"], lines)
