"""What a notebook shows of a case."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm.markup import paragraph, table
from mpm.screen import number

if TYPE_CHECKING:
    from mpm.case.tables import CaseTables


def case_html(case: CaseTables) -> str:
    """Title and key numbers of a case."""
    return paragraph(case.title or "case", bold=True) + table(case_rows(case))


def case_rows(case: CaseTables) -> list[tuple[str, str]]:
    """What one asks first of a case, each value with its unit."""
    geometry, motion = case.geometry, case.motion
    ends = "periodic ends" if geometry.periodic else "walls at its ends"
    until = "" if case.fidelity == "steady" else f", 0 s to {number(case.time.end, 's')}"
    rows = [
        ("fidelity", case.fidelity + until),
        (
            "strip",
            f"{number(geometry.length * 1e3, 'mm')} long, {number(geometry.height * 1e3, 'mm')} high, {ends}",
        ),
    ]
    for layer in reversed(geometry.layers):
        moves = f", moves at {number(case.conveying_velocity * 1e2, 'cm/s')}" if layer.moving else ""
        rows.append(
            (
                f"layer {layer.name}",
                f"{number(layer.height * 1e3, 'mm')}, {layer.material_name or 'gas'}{moves}",
            )
        )
    for inlet in geometry.inlets:
        fed = ", ".join(f"mass fraction {number(x)} of {name}" for name, x in inlet.feed.items())
        rows.append(
            (
                f"inlet {inlet.name}",
                f"{number(inlet.velocity * 1e2, 'cm/s')} over {number(inlet.width * 1e3, 'mm')}, {fed or case.gas.carrier}",
            )
        )
    rows += [
        (f"outlet {outlet.name}", f"{number(outlet.width * 1e3, 'mm')} wide") for outlet in geometry.outlets
    ]
    vibration = (
        f"gamma {number(motion.gamma)} at {number(motion.frequency, 'Hz')}" if motion.gamma else "none"
    )
    gas = (
        f"{case.gas.carrier} at {number(case.gas.temperature, 'K')} and {number(case.gas.pressure, 'Pa', 6)}"
    )
    return [*rows, ("vibration", vibration), ("gas", gas)]
