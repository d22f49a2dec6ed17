"""What each convention does alone: box mean of the zone in its last second in columns of 1 mm. For docs/conventions.md."""

from __future__ import annotations

from typing import Any

from vibration_sections.readings import WINDOW, ZONE
from vibration_sections.store import GAMMAS, Lab, box, less, markdown, shown

WIDTH = 1.0  # mm
SWITCHES: dict[str, dict[str, Any]] = {
    "nothing": {},
    'transport.scheme = "upwind"': {"transport.scheme": "upwind"},
    'transport.scheme = "central"': {"transport.scheme": "central"},
    "transport.backflow_rows = 2": {"transport.backflow_rows": 2},
    'porous.diffusion = "free"': {"porous.diffusion": "free"},
    'porous.diffusion = "printed"': {"porous.diffusion": "printed"},
    'porous.inertia = "superficial"': {"porous.inertia": "superficial"},
    'porous.reaction_volume = "total"': {"porous.reaction_volume": "total"},
    'motion.drag_reference = "superficial"': {"motion.drag_reference": "superficial"},
    "geometry.inlet_diffusion = true": {"geometry.inlet_diffusion": True},
    'conventions = "closed-code"': {"conventions": "closed-code"},
}


def table(lab: Lab) -> str:
    """Box mean at both Gammas and what the switch changes."""
    found = {
        name: [
            box(
                lab.run(
                    f"{name}, Gamma {gamma:g}",
                    lab.case("thesis/single_zone", {**ZONE, **changes}, width=WIDTH, gamma=gamma),
                    window=WINDOW,
                )
            )
            for gamma in GAMMAS
        ]
        for name, changes in SWITCHES.items()
    }
    lines = []
    for name, (low, high) in found.items():
        change = less(low, found["nothing"][0])
        values = [
            shown(low, ".4f"),
            shown(high, ".4f"),
            shown(change, "+.4f"),
            shown(less(high, low), "+.4f"),
        ]
        lines.append([name if name == "nothing" else f"`{name}`", *values])
    return markdown(["typed", "Gamma 0.3", "Gamma 0.6", "change at 0.3", "gain from 0.3 to 0.6"], lines)
