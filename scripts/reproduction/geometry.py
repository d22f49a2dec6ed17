"""Rows R13, R16 to R18, R20 and R21 over what the thesis does not print of its domain: headspace, pressure and width of the ports.

The machine has a channel of 0.5 in (headspace 9.7 mm over 3 mm of bed) in a laboratory at 626 Torr. At that pressure the excess number of
0.895 that gives 4.0 mm (equation 5-20, figure 5.11) gives ports of 4.86 mm.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reproduction.row import HOLDS
from reproduction.settings import REFERENCE, Setting

ROW_NAMES = ("R13", "R16", "R17", "R18", "R20", "R21")
MESH = "coarse"
POINTS: dict[str, dict[str, str]] = {
    "base": {},
    "headspace 9.7 mm": {"headspace": "9.7 mm"},
    "626 Torr": {"pressure": "626 Torr"},
    "ports 2.2 mm": {"width": "2.2 mm"},
    "ports 4.8 mm": {"width": "4.8 mm"},
    "as printed, ports 4.0 mm": {"headspace": "9.7 mm", "pressure": "626 Torr"},
    "as printed, ports 4.8 mm": {"headspace": "9.7 mm", "pressure": "626 Torr", "width": "4.8 mm"},
    "as printed, ports 2.2 mm": {"headspace": "9.7 mm", "pressure": "626 Torr", "width": "2.2 mm"},
    "ports 3.0 mm": {"width": "3.0 mm"},
}
"""What each point changes of REFERENCE: one at a time, then all that is printed at three widths, which are not, and a width between."""
MM = 1e3


def settings() -> dict[str, Setting]:
    """The points as settings of a lab."""
    return {
        name: Setting(f"geometry/{name}", geometry={**REFERENCE, **changed})
        for name, changed in POINTS.items()
    }


def _only(found: dict[str, Any]) -> Any:
    """Numbers at the one width of a point."""
    (numbers,) = found["numbers"].values()
    return numbers


def _knees(found: dict[str, Any]) -> str:
    pairs = (f"{n['knees'][0]:.1f}/{n['knees'][1]:.1f}" for n in found["numbers"].values())
    return "knees " + ", ".join(pairs) + " s"


def _boxes(found: dict[str, Any]) -> str:
    n = _only(found)
    since = n["within 5 % since"]
    return f"differ by {n['difference']:.0%}, " + (
        f"alike since {since:.0f} s" if since is not None else "never alike"
    )


def _fronts(found: dict[str, Any]) -> str:
    n = _only(found)
    return "a front is missing" if n["shift"] is None else f"shift {n['shift'] * MM:.1f} mm"


def _rates(found: dict[str, Any]) -> str:
    n = _only(found)
    peak = n["peak over final"]
    return f"ratio {n['ratio']:.0f}, peak {peak['stoichiometric']:.2f} and {peak['delayed']:.2f}"


SHORT: dict[str, Callable[[dict[str, Any]], str]] = {
    "R13": _knees,
    "R16": _boxes,
    "R17": lambda found: f"{_only(found)['zone1']:.3f} and {_only(found)['zone2']:.3f}",
    "R18": _fronts,
    "R20": _rates,
    "R21": lambda found: f"{_only(found)['largest from 30 s']:.3f}",
}
"""The measured numbers of a row in a few words."""
HEADINGS = {
    "R13": "R13: knees by dose, Y 1e-4, 2e-4, 1e-3, 1e-2",
    "R16": "R16: box means from 30 s",
    "R17": "R17: CH4, largest over final, zones 1 and 2",
    "R18": "R18: fronts at 60.4 s",
    "R20": "R20: CVD, rich over lean; peak over final without and with delay",
    "R21": "R21: box means, largest difference",
}


def mark(verdict: str) -> str:
    """A verdict in a word or two."""
    if verdict == HOLDS:
        return "**holds**"
    return "**no**" if verdict.startswith("not") else "**in part**"


def bare(found: dict[str, Any]) -> str:
    """The verdict without the port width in the names of its conditions, so that points can be compared."""
    verdict: str = found["verdict"]
    for width in {changed.get("width", REFERENCE["width"]) for changed in POINTS.values()}:
        verdict = verdict.replace(f", ports {width}", "").replace(f"ports {width}", "shift")
    return verdict


Measured = dict[str, dict[str, dict[str, Any]]]
"""Findings by point and row."""


def depends(measured: Measured) -> str:
    """Which of the three turns which row: points that differ from the base in one thing, and those as printed."""
    lines = []
    for row in ROW_NAMES:
        base = measured.get("base", {}).get(row)
        if base is None:
            continue
        others = {name: rows[row] for name, rows in measured.items() if name != "base" and row in rows}
        turned = [name for name, found in others.items() if bare(found) != bare(base)]
        lines.append(f"* **{row}**: {'; '.join(turned) or 'none of the points'}.")
    return "\n".join(lines)


def section(measured: Measured) -> str:
    """The table of the sweep, and what the rows depend on."""
    text = (
        "## Geometry as printed\n\n"
        "The thesis prints no geometry of its domain. Its machine has a channel of 0.5 in, which 3 mm of bed leave a headspace of "
        "9.7 mm, in a laboratory at 626 Torr; for the ports it prints velocities alone. The rows above stand on a headspace of 12.7 mm, "
        "101325 Pa and ports of 4.0 and 2.2 mm. The width of 4.0 mm is what equation 5-20 with figure 5.11 gives at 101325 Pa; at "
        f"626 Torr it gives 4.9 mm. Here each is changed alone, then all together; mesh *{MESH}*, the model's own conventions, criteria "
        "as above (`scripts/reproduce.py --geometry`).\n\n"
    )
    if not measured:
        return text + "Not measured.\n\n"
    text += "| point | " + " | ".join(HEADINGS.values()) + " |\n" + "|---" * (len(ROW_NAMES) + 1) + "|\n"
    for name in POINTS:
        cells = [
            f"{mark(found['verdict'])}: {SHORT[row](found)}"
            if (found := measured.get(name, {}).get(row))
            else "not measured"
            for row in ROW_NAMES
        ]
        text += f"| {name} | " + " | ".join(cells) + " |\n"
    return (
        text
        + "\nPoints at which a row has another verdict than at the base of this table:\n\n"
        + depends(measured)
        + "\n\n"
    )
