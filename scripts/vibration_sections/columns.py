"""What resolving the vibration adds to its average, by width of the columns: frit saturated, Y_TMA = 2e-4, two passes of the bed."""

from __future__ import annotations

from typing import Any

from meshes import rows
from vibration_sections.extrapolation import tends
from vibration_sections.store import GAMMAS, SITE, WIDTHS, Lab, box, less, markdown, shown

SPEED = 0.013  # m/s
LENGTH = 0.1397  # m
PASSES, FLUSH = 2.0, 15.0
"""Residence times of the bed in the zone, and seconds to renew the headspace, until the end."""
BASE: dict[str, Any] = {
    **rows(4, 3, 4, 8),
    # the frit, which saturates over hours, starts saturated: then the steady state is near when the runs end
    "material.sintered_powder.initial_coverage": {"OH": 0.0, SITE: 1.0},
    "time.end": f"{PASSES * LENGTH / SPEED + FLUSH:.4f} s",
    "time.step": "5 ms",
    "output.every": "62.5 ms",
}
NUMERICS: dict[str, dict[str, Any]] = {
    "ours": {},
    "upwinding": {"transport.scheme": "upwind"},
    "closed-code": {"conventions": "closed-code"},
}
RESOLVED, AVERAGED = {"fidelity": "resolved"}, {"fidelity": "averaged"}
DISPERSED: dict[str, Any] = {"transport.vibrational_dispersion": True}
MODELS: dict[str, dict[str, Any]] = {
    "resolved, 32 steps per cycle": RESOLVED,
    "averaged, 5 ms": AVERAGED,
    "averaged, 2.5 ms": {**AVERAGED, "time.step": "2.5 ms"},
    "averaged + K": {**AVERAGED, **DISPERSED},
    "steady": {"fidelity": "steady"},
    "steady + K": {"fidelity": "steady", **DISPERSED},
}
"""Ours in columns of 1 mm: what K changes, and how near the models are."""
MODELS_WIDTH = 1.0


def measured(lab: Lab, label: str, changes: dict[str, Any], width: float, gamma: float) -> float | None:
    """Box mean over several slides of the bed; `width` in mm."""
    case = lab.case("single_zone", {**BASE, **changes}, width=width, gamma=gamma)
    window = max(4.0 * case.geometry.length / case.geometry.columns / SPEED, 1.0)
    return box(lab.run(f"{label}, {width:g} mm, Gamma {gamma:g}", case, window=window))


def averaged(lab: Lab, numerics: str, width: float) -> float | None:
    """The averaged run sees the vibration's mean alone, which is none: one serves for every Gamma (`tests/test_vibration_page.py`)."""
    return measured(lab, f"averaged, {numerics}", {**AVERAGED, **NUMERICS[numerics]}, width, GAMMAS[0])


def resolved(lab: Lab, numerics: str, width: float, gamma: float) -> float | None:
    """The run that follows every phase."""
    return measured(lab, f"resolved, {numerics}", {**RESOLVED, **NUMERICS[numerics]}, width, gamma)


def differences(lab: Lab, numerics: str) -> dict[str, list[float | None]]:
    """By width of the columns: resolved less averaged at both Gammas, and the gain between them."""
    found = {}
    for gamma in GAMMAS:
        found[f"resolved − averaged, Gamma {gamma:g}"] = [
            less(resolved(lab, numerics, width, gamma), averaged(lab, numerics, width)) for width in WIDTHS
        ]
    low, high = found.values()
    return {**found, "gain from 0.3 to 0.6": [less(b, a) for a, b in zip(low, high, strict=True)]}


def table(lab: Lab) -> str:
    """Differences by numerics and width, then the box means themselves."""
    lines, means = [], []
    for numerics in NUMERICS:
        for name, values in differences(lab, numerics).items():
            changed = (shown(value, "+.4f") for value in values)
            lines.append([numerics, name, *changed, tends(WIDTHS, values)])
        runs: dict[str, list[float | None]] = {
            "averaged": [averaged(lab, numerics, width) for width in WIDTHS],
            **{
                f"resolved, Gamma {gamma:g}": [resolved(lab, numerics, width, gamma) for width in WIDTHS]
                for gamma in GAMMAS
            },
        }
        means += [[numerics, name, *(shown(v, ".4f") for v in values)] for name, values in runs.items()]
    widths = [f"{width:g} mm" for width in WIDTHS]
    return "\n\n".join(
        [
            markdown(["numerics", "box mean", *widths, "no width (order)"], lines),
            markdown(["numerics", "box mean of", *widths], means),
        ]
    )


def models(lab: Lab) -> str:
    """Box means of the models in columns of 1 mm; those that do not see the vibration are run at one Gamma."""
    lines = []
    for name, changes in MODELS.items():
        sees = changes == RESOLVED or "transport.vibrational_dispersion" in changes
        means = (measured(lab, name, changes, MODELS_WIDTH, gamma if sees else GAMMAS[0]) for gamma in GAMMAS)
        lines.append([name, *(shown(mean, ".5f") for mean in means)])
    return markdown(["model", *(f"Gamma {gamma:g}" for gamma in GAMMAS)], lines)
