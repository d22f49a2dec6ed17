"""What gas would have to do to a bed that flies as prescribed (`motion.profile = "thesis"`): lift-off, then constant velocity.

In a closed strip gas rides with the reactor but for the through-flow U, so a bed that moves up at w relative to the reactor is pushed with
R (U - w) per area, R = mu h/K: it sucks gas under itself or presses it out. Ports are narrow; the flow is spread over the strip here.
"""

from __future__ import annotations

import numpy as np

from mpm.constants import GRAVITY, TURN
from mpm.motion.kinematics import BedMotion, Flight
from vibration_sections.dispersion import ALL_GAMMAS, BASE, CELL_WIDTH
from vibration_sections.store import Lab, markdown

PHASES = 2000


def pressures(lab: Lab, gamma: float) -> dict[str, float]:
    """Weight, what the through-flow carries, and the least and largest force of the gas in flight [Pa]."""
    case = lab.case(BASE, {}, width=CELL_WIDTH, gamma=gamma)
    bed = next(layer for layer in case.geometry.layers if layer.moving)
    material = bed.material
    course = BedMotion(case.motion).course
    assert material is not None and material.density is not None and isinstance(course, Flight)
    resistance = case.gas.viscosity * bed.height / material.permeability[1]
    through = sum(i.velocity * i.width for i in case.geometry.inlets) / case.geometry.length
    phase = course.liftoff + np.linspace(0.0, (course.contact - course.liftoff) % TURN, PHASES)
    reactor = course.vibration.ay * course.vibration.omega * np.cos(phase)
    force = resistance * (through - (case.motion.liftoff_velocity - reactor))
    return {
        "weight": (1.0 - material.porosity) * material.density * GRAVITY * bed.height,
        "carried": resistance * through,
        "least": float(force.min()),
        "largest": float(force.max()),
    }


def table(lab: Lab) -> str:
    """Pa by Gamma."""
    lines = []
    for gamma in ALL_GAMMAS:
        found = pressures(lab, gamma)
        lines.append(
            [
                f"{gamma:g}",
                f"{found['weight']:.1f}",
                f"{found['carried']:.1f} ({100.0 * found['carried'] / found['weight']:.0f} %)",
                f"{found['least']:+.0f} to {found['largest']:+.0f}",
            ]
        )
    return markdown(
        ["Gamma", "weight, Pa", "carried by the through-flow, Pa", "gas force in flight, Pa"], lines
    )
