"""Rows R6 and R8 at the thesis' columns of 0.34 mm, where upwinding adds least: beside the rows, which stay as they are.

Each yields its finding anew after every configuration, so that one that is stopped leaves what it has. In R6 inlets ride on the reactor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.output.results import Run
from reproduction.row import Checks, Finding
from reproduction.store import Lab
from reproduction.vibration_rows import ORDERS, pulse_case, spreads, spreads_text

Floats = NDArray[np.float64]
STATES = (("developed", "developed"), ("impulsive", "start-up"))
R8_STATES = {
    f"{state}{suffix}": (startup, frame)
    for frame, suffix in (("reactor", ""), ("lab", ", inlets in the lab's frame"))
    for startup, state in STATES
}
"""Start-up and inlets' frame of what R8 is followed in, by name."""
MESH, COARSER = "thesis", "medium"
END, SINCE = "20 s", 5.0
"""Until when R8 is followed, and from when it is judged [s]."""


def spreading(lab: Lab) -> Iterator[Finding]:
    """R6: the four orderings at 1.925 s, each by more than 1 %."""
    checks, numbers = Checks(), dict[str, Any]()
    for startup, state in STATES:
        numbers[state] = spreads(lab, MESH, startup, "reactor")
        checks.add(state, len(numbers[state]["holds"]) == len(ORDERS))
        yield Finding(checks.verdict, spreads_text(numbers), dict(numbers))


def common(runs: Sequence[Run]) -> tuple[Floats, list[Floats]]:
    """Output times [s] that all runs have come to, and the box mean of each there."""
    times = [run.history["time"] for run in runs]
    count = min(map(len, times))
    apart = np.any([np.abs(times[0][:count] - other[:count]) > 1e-2 for other in times[1:]], axis=0)
    if apart.any():  # where a run was stopped between output times
        count = int(np.argmax(apart))
    return times[0][:count], [run.history["titration.tma.box_mean"][:count] for run in runs]


def gains(lab: Lab, startup: str, frame: str) -> dict[str, list[float]] | None:
    """What the box mean gains from Gamma 0.3 to 0.6 at every output time, by how much that differs from columns of 1 mm (its mesh error
    then), and the box mean at 0.3; None where only stored runs are asked for and they have not come to SINCE."""
    cases = [
        pulse_case(lab, mesh, startup, frame, gamma, END) for mesh in (MESH, COARSER) for gamma in (0.3, 0.6)
    ]
    runs = [lab.so_far(case) if lab.only_stored else lab.run(case) for case in cases]
    there = [run for run in runs if run is not None]
    if len(there) < len(runs):
        return None
    times, (weak, strong, weak_wide, strong_wide) = common(there)
    if times[-1] < SINCE:
        return None
    found, wide = strong - weak, strong_wide - weak_wide
    series = {"time": times, "gain": found, "mesh error": np.abs(found - wide), "box mean": weak}
    return {name: values.tolist() for name, values in series.items()}


def growth(lab: Lab) -> Iterator[Finding]:
    """R8, its part about Gamma: a gain at every output time from 5 s on, by more than the mesh error (the change from 1 mm columns)."""
    checks, numbers = Checks(), dict[str, Any]()
    parts = []
    for state, (startup, frame) in R8_STATES.items():
        found = gains(lab, startup, frame)
        if found is None:
            continue
        judged = np.asarray(found["time"]) >= SINCE - 1e-9
        times, gain, errors = (np.asarray(found[name])[judged] for name in ("time", "gain", "mesh error"))
        error = float(errors.max())
        numbers[state] = {
            **found,
            "least gain from 5 s": float(gain.min()),
            "largest mesh error from 5 s": error,
        }
        checks.add(state, gain.min() > error)
        parts.append(
            f"{state} {gain[0]:+.4f} at {times[0]:.1f} s, {gain[-1]:+.4f} at {times[-1]:.1f} s, "
            f"least {np.round(gain.min(), 4) + 0.0:+.4f} (mesh {error:.4f})"
        )
        yield Finding(checks.verdict, "Gamma 0.3 to 0.6: " + "; ".join(parts), dict(numbers))


AT_THESIS_COLUMNS: dict[str, Callable[[Lab], Iterator[Finding]]] = {"R6": spreading, "R8": growth}
WANTED = {"R6": [state for _, state in STATES], "R8": list(R8_STATES)}
"""States that a row is to be measured in there."""
