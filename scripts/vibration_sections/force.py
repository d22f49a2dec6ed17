"""What gas would have to do to a bed that flies as prescribed (`motion.profile = "thesis"`): lift-off, then constant velocity.

In a closed strip gas rides with the reactor but for the through-flow U, so a bed that moves up at w relative to the reactor is pushed with
R (U - w) per area, R = mu h/K: it sucks gas under itself or presses it out. Ports are narrow; the flow is spread over the strip here.
The program works it out (`mpm.advice.motion.flight_force`), and `mpm check` warns of it.
"""

from __future__ import annotations

from mpm.advice.motion import flight_force
from mpm.case.balance import forces_on_bed
from vibration_sections.dispersion import ALL_GAMMAS, BASE, CELL_WIDTH
from vibration_sections.store import Lab, markdown


def pressures(lab: Lab, gamma: float) -> dict[str, float]:
    """Weight, what the through-flow carries, and the least and largest force of the gas in flight [Pa]."""
    case = lab.case(BASE, {}, width=CELL_WIDTH, gamma=gamma)
    forces, pull = forces_on_bed(case.motion, case.geometry, case.gas), flight_force(case)
    assert forces is not None and pull is not None
    carried = forces.resistance * forces.through_flow
    return {"weight": forces.weight, "carried": carried, "least": pull[0], "largest": pull[1]}


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
