"""The picture of docs/vibration.md: gain by Gamma over the width of the columns, and what adds to diffusion in the bed."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mpm.pictures.outline import OKABE_ITO
from mpm.pictures.standard import STYLE
from vibration_sections import dispersion, readings, theory
from vibration_sections.extrapolation import to_zero
from vibration_sections.store import GAMMAS, WIDTHS, Lab

NAMES = {
    readings.OURS: "exponential fitting (mpm)",
    "upwinding": "first-order upwinding",
    '`conventions = "closed-code"`': "closed-code conventions",
}
THESIS = 0.34  # mm


def draw(lab: Lab) -> Figure:
    """Both panels, of what is measured."""
    with style.context(STYLE):
        figure = Figure(figsize=(10.5, 4.2), layout="constrained")
        left, right = figure.subplots(1, 2)
        gains(left, lab)
        diffusion(right, lab)
        for panel in (left, right):
            panel.axvline(THESIS, color="0.6", linewidth=0.9, linestyle=(0, (4, 3)), zorder=0)
            panel.set_xlabel("width of the columns [mm]")
            panel.grid(alpha=0.25)
    return figure


def gains(panel: Axes, lab: Lab) -> None:
    """What Gamma 0.6 instead of 0.3 adds to the box mean; open symbols: extrapolated to no width."""
    for colour, (reading, name) in zip(OKABE_ITO, NAMES.items(), strict=False):
        values = readings.gains(lab, reading)
        known = [(h, v) for h, v in zip(WIDTHS, values, strict=True) if v is not None]
        if not known:
            continue
        panel.plot(*zip(*known, strict=True), "o-", color=colour, label=name)
        found = to_zero(WIDTHS, values)
        if found is not None:
            (limit, order), (h, v) = found, known[-1]
            between = np.linspace(0.0, h, 30)
            panel.plot(between, limit + (v - limit) * (between / h) ** order, ":", color=colour)
            panel.plot([0.0], [limit], "o", color=colour, markerfacecolor="white", clip_on=False, zorder=3)
    panel.axhline(0.0, color="0.3", linewidth=0.9)
    panel.set_xlim(left=0.0)
    panel.annotate(
        "mesh of the thesis",
        (THESIS + 0.03, 0.97),
        xycoords=("data", "axes fraction"),
        fontsize=8,
        va="top",
        color="0.4",
    )
    panel.set_title("coverage gained by shaking twice as hard (Γ 0.3 to 0.6)", fontsize=10)
    panel.set_ylabel("gain of the box mean, 5.5 to 6.5 s")
    # above the curves and below the name of the mesh
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.14, 0.92)}
    panel.legend(fontsize=8, title="open: extrapolated to no width", title_fontsize=8, **place)


def diffusion(panel: Axes, lab: Lab) -> None:
    """What is added to diffusion along the bed, over what there is."""
    widths = np.geomspace(0.1, 3.0, 40)
    schemes = {"upwind": "first-order upwinding", "fitted": "exponential fitting (mpm)"}
    for gamma, dashes in zip(GAMMAS, ("-", "--"), strict=True):
        case = lab.case(dispersion.BASE, {}, width=dispersion.CELL_WIDTH, gamma=gamma)
        bed = next(layer for layer in theory.layers(case) if layer.name == "bed")
        for colour, (scheme, name) in zip((OKABE_ITO[1], OKABE_ITO[0]), schemes.items(), strict=True):
            share = [dispersion.PERCENT * theory.added_by_scheme(bed, 1e-3 * h, scheme) for h in widths]
            panel.plot(widths, share, dashes, color=colour, label=f"{name}, Γ {gamma:g}")
        real = dispersion.PERCENT * dispersion.in_layers(lab, gamma)["bed"]
        panel.plot(
            widths, np.full_like(widths, real), dashes, color="black", label=f"vibration itself, Γ {gamma:g}"
        )
    panel.set(xscale="log", yscale="log", xlim=(0.1, 3.0), ylim=(0.008, 300.0))
    panel.set_xticks([0.1, *sorted(WIDTHS)], labels=["0.1", *(f"{h:g}" for h in sorted(WIDTHS))])
    panel.minorticks_off()
    panel.set_title("what adds to diffusion along the bed", fontsize=10)
    panel.set_ylabel("added [% of the bed's own]")
    panel.legend(fontsize=8, loc="lower right")
