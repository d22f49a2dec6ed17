"""Parasitic CVD and exit coverage of one cycle over the doses of both precursors, in the steady state.

    python scripts/cvd_map.py            # what has not been run yet, then docs/figures/cvd_map_steady.png

Doses are given as dose ratios (excess numbers): precursor fed over what saturates the fresh solids once.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from meshes import COARSE
from mpm import Reactor, load_case
from mpm.reactor.flow import Flow
from mpm.report.dosing import inlet_excess

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "results" / "cvd_map.json"
PICTURE = ROOT / "docs" / "figures" / "cvd_map_steady.png"
RATIOS = tuple(round(float(r), 3) for r in np.geomspace(0.25, 4.0, 7))  # 1 is among them
TICKS = (0.25, 0.5, 1.0, 2.0, 4.0)
INLETS = {"tma": "TMA", "water": "H2O"}
MESH: dict[str, Any] = {"fidelity": "steady", **COARSE}


def measure() -> dict[str, dict[str, float]]:
    """Mean CVD rate [mol/m3/s], CVD events over all fed TMA, and exit coverages, by "TMA ratio,water ratio"."""
    found: dict[str, dict[str, float]] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    base = load_case(ROOT / "cases" / "single_cycle.toml", MESH)
    saturating = {}  # mass fractions at which the dose ratio is 1; the ratio is proportional to them
    for inlet in base.geometry.inlets:
        excess = inlet_excess(base, inlet)
        if excess is not None and excess[2] is not None:
            saturating[inlet.name] = inlet.mass_fractions[excess[0]] / excess[2]
    flow: Flow | None = None
    for tma in RATIOS:
        for water in RATIOS:
            key = f"{tma:g},{water:g}"
            if key in found:
                continue
            doses = {"tma": tma * saturating["tma"], "water": water * saturating["water"]}
            case = base.with_({f"geometry.inlet.{i}.mass_fractions.{s}": doses[i] for i, s in INLETS.items()})
            reactor = Reactor(case, flow=flow)
            summary, flow = reactor.run().summary, reactor.flow
            found[key] = {
                "rate": summary["cvd"]["rate_mean"],
                "share": summary["cvd"]["total"] / summary["species"]["TMA"]["fed"],
                **{name: summary["titration"][name]["exit_mean"] for name in INLETS},
            }
            KEPT.parent.mkdir(parents=True, exist_ok=True)
            KEPT.write_text(json.dumps(found), encoding="utf-8")
            print(key, found[key], flush=True)
    return found


def draw(found: dict[str, dict[str, float]]) -> Figure:
    """Mean CVD rate, and what leaves either zone, over both dose ratios."""
    figure = Figure(figsize=(11.0, 3.4), layout="constrained")
    panels = (
        ("rate", "mean CVD rate [mol m$^{-3}$ s$^{-1}$]"),
        ("tma", "coverage leaving the TMA zone"),
        ("water", "coverage leaving the water zone"),
    )
    for axis, (name, label) in zip(figure.subplots(1, len(panels)), panels, strict=True):
        values = np.array([[found[f"{t:g},{w:g}"][name] for t in RATIOS] for w in RATIOS])
        image = axis.pcolormesh(
            RATIOS, RATIOS, values, norm=LogNorm() if name == "rate" else None, shading="nearest"
        )
        axis.plot([1.0], [1.0], "r+", ms=10)
        axis.set(xscale="log", yscale="log", xlabel="dose ratio of TMA", ylabel="dose ratio of water")
        for coordinate in (axis.xaxis, axis.yaxis):
            coordinate.set_major_locator(FixedLocator(TICKS))
            coordinate.set_major_formatter("{x:g}")
            coordinate.set_minor_locator(NullLocator())
        figure.colorbar(image, ax=axis, label=label)
    return figure


if __name__ == "__main__":
    draw(measure()).savefig(PICTURE, dpi=110)
