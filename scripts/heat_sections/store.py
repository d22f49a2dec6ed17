"""Runs of the sections, kept by name under results/temperature, and how a table shows two meshes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from meshes import rows
from mpm import Case, Reactor, load_case
from mpm.arrays import Floats
from mpm.files import write_atomically
from mpm.report.trees import flatten

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "results" / "temperature"
COARSE = "coarse"
MESHES = ("full", "half")
MARCHED = ("half", "quarter")
"""Of what is followed in time."""
MESH: dict[str, dict[str, Any]] = {
    "full": {"geometry.cell_width": "0.34 mm", **rows(15, 6, 10, 38)},
    "half": {"geometry.cell_width": "0.68 mm", **rows(8, 3, 5, 19)},
    "quarter": {"geometry.cell_width": "1.36 mm", **rows(4, 2, 3, 10)},
    COARSE: {"geometry.cell_width": "5 mm", **rows(3, 2, 3, 4)},
}
HOT, COLD = 473.15, 298.15  # K
STEADY = {"fidelity": "steady"}
SATURATED = {"material.sintered_powder.initial_coverage": {"OH": 0.0, "OAl(CH3)2": 1.0}}
"""The frit, which takes hours to saturate, as it is then."""
LATE = 1.0 / 3.0  # of a run, at its end, over which means are taken
Numbers = dict[str, float]


def case_of(name: str, mesh: str, *changes: Mapping[str, Any]) -> Case:
    """A shipped case on a mesh, with changes by dotted key."""
    merged = {key: value for change in (MESH[mesh], *changes) for key, value in change.items()}
    return load_case(ROOT / "cases" / f"{name}.toml", merged)


def kept(label: str, case: Case, measure: Callable[[], Numbers]) -> Numbers:
    """What `measure` has found of a case, from the store where it is known."""
    path = KEPT / f"{label}.json"
    if path.exists():
        known: Numbers = json.loads(path.read_text(encoding="utf-8"))
        return known
    found = measure()
    KEPT.mkdir(parents=True, exist_ok=True)
    write_atomically(path, json.dumps(found))
    print(f"{label}: {case.geometry.cells:,} cells", flush=True)
    return found


def run(label: str, case: Case, look: Callable[[Reactor], Numbers] | None = None) -> Numbers:
    """All numbers of the summary by dotted name, `late.` those of the history over its last third, and what `look` sees at the end.

    Amounts of heat in `late.` are their growth [W/m].
    """

    def measure() -> Numbers:
        reactor = Reactor(case)
        result = reactor.run(progress=False)
        found = flatten(result.summary)
        found["cells"] = float(reactor.grid.cells)
        return found | late(result.history) | ({} if look is None else look(reactor))

    return kept(label, case, measure)


def late(history: Mapping[str, Floats]) -> Numbers:
    """Means over the last third of the rows; of `energy.` the growth by time."""
    time = history["time"]
    if len(time) < 3:
        return {}
    window = time >= time[-1] - LATE * (time[-1] - time[0])
    found = {}
    for name, values in history.items():
        inside = values[window]
        if name.startswith("energy.") and not name.endswith("error"):
            found[f"late.{name}"] = float((inside[-1] - inside[0]) / (time[window][-1] - time[window][0]))
        elif np.isfinite(inside).any():
            found[f"late.{name}"] = float(np.nanmean(inside))
    return found


def fastest(reactor: Reactor, layer: str = "headspace") -> Numbers:
    """Largest vertical speed of the gas in a layer now [m/s]."""
    inside = reactor.field("velocity")[reactor.grid.layer_rows(layer)]
    return {f"rising.{layer}": float(np.abs(inside[..., 1]).max())}


def markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table."""
    return "\n".join(["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *lines)])


def both(values: Sequence[float], digits: str) -> str:
    """A number of the first mesh and, in brackets, of the others."""
    first, *others = (format(value, digits) for value in values)
    return f"{first} ({', '.join(others)})" if others else first


def in_time(meshes: tuple[str, ...]) -> tuple[str, ...]:
    """The meshes of what is followed in time."""
    return MARCHED if meshes == MESHES else meshes


def measured_on(meshes: tuple[str, ...]) -> str:
    """A sentence on where the numbers of a table are from."""
    first, *others = (f"{case_of('single_zone', mesh).geometry.cells:,}" for mesh in meshes)
    return f"On {first} cells a zone" + (f"; in brackets on {', '.join(others)}." if others else ".")
