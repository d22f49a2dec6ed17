"""Rows R6 and R8 at the thesis' columns of 0.34 mm, where upwinding adds least: beside the rows, which stay as they are.

Each yields its finding anew after every configuration, so that one that is stopped leaves what it has. Inlets ride on the reactor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.output.results import Run
from reproduction.row import Checks, Finding
from reproduction.store import Lab
from reproduction.vibration_rows import ORDERS, pulse_case, spreads, spreads_text

Floats = NDArray[np.float64]
STATES = (("developed", "developed"), ("impulsive", "start-up"))
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


def gain(weak: Run, strong: Run) -> tuple[Floats, Floats]:
    """Output times [s] from SINCE on that both runs have come to, and what the box mean gains there from weak to strong vibration."""
    times, boxes = [], []
    for run in (weak, strong):
        kept = run.history["time"] >= SINCE - 1e-9
        times.append(run.history["time"][kept])
        boxes.append(run.history["titration.tma.box_mean"][kept])
    count = min(map(len, times))
    apart = np.abs(times[0][:count] - times[1][:count]) > 1e-2
    if apart.any():  # where a run was stopped between output times
        count = int(np.argmax(apart))
    return times[0][:count], boxes[1][:count] - boxes[0][:count]


def gains(lab: Lab, mesh: str, startup: str) -> tuple[Floats, Floats] | None:
    """`gain` from Gamma 0.3 to 0.6 on a mesh; None where only stored runs are asked for and they have not come to SINCE."""
    cases = [pulse_case(lab, mesh, startup, "reactor", gamma, END) for gamma in (0.3, 0.6)]
    weak, strong = (lab.so_far(case) if lab.only_stored else lab.run(case) for case in cases)
    if weak is None or strong is None:
        return None
    found = gain(weak, strong)
    return found if len(found[0]) else None


def growth(lab: Lab) -> Iterator[Finding]:
    """R8, its part about Gamma: a gain at every output time from 5 s on, by more than the mesh error (the change from 1 mm columns)."""
    checks, numbers = Checks(), dict[str, Any]()
    parts = []
    for startup, state in STATES:
        wide, fine = gains(lab, COARSER, startup), gains(lab, MESH, startup)
        if fine is None or wide is None:
            return
        times, found = fine
        common = min(len(found), len(wide[1]))
        error = float(np.abs(found[:common] - wide[1][:common]).max())
        numbers[state] = {"time": times.tolist(), "gain": found.tolist(), "mesh error": error}
        checks.add(state, found.min() > error)
        parts.append(
            f"{state} {found[0]:+.4f} at {times[0]:.1f} s, {found[-1]:+.4f} at {times[-1]:.1f} s, "
            f"least {found.min():+.4f} (mesh {error:.4f})"
        )
        yield Finding(checks.verdict, "Gamma 0.3 to 0.6: " + "; ".join(parts), dict(numbers))


AT_THESIS_COLUMNS: dict[str, Callable[[Lab], Iterator[Finding]]] = {"R6": spreading, "R8": growth}
