"""R8 at the thesis' columns as a function of time: the criterion asks for every time until 20 s, and the box is full before."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reproduction.columns import NAMES, Columns
from reproduction.thesis_mesh import R8_STATES, SINCE

ROW = "R8"
SHOWN = (1.925, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 20.0)
"""Times of the table [s], between output times by interpolation."""
FULL = 0.999
"""Box mean from which a box counts as full."""
NOTHING = 1e-4
"""Gain up to which there is none: what rounding and the last columns that fill make of it."""
INTRODUCTION = f"""## {ROW} at the thesis' columns, over time

The thesis has the box mean grow with Gamma at every time from 5 s on. Here is what Gamma 0.6 instead of 0.3 adds to it, in brackets its
mesh error at that time (the change from columns of 1 mm; 16 steps per cycle; between outputs by interpolation). *Full*: when the box mean
at Gamma 0.3 reaches {FULL}. From then on no vibration can add anything, so that a gain of nothing at 20 s says that the box is full and not
that there was no gain; and the criterion of the verdict, the least gain above the largest mesh error from 5 to 20 s, can no longer be met.
It is left as it was; the last two columns have what is true before. *Gains*: from 5 s on without a break, at every output, by more than
{NOTHING:g}. *Above its mesh error*: the longest time from 5 s on in which the gain is at every output above the mesh error of that output,
and by how much at least and at most. A single box mean may besides be off by half a column over the box, 0.0016.

"""


def at(one: dict[str, Any], time: float) -> str:
    """Gain and its mesh error at a time, or a dash after the end of the run."""
    if time > one["time"][-1] + 1e-2:
        return "–"
    gain, error = (float(np.interp(time, one["time"], one[name])) for name in ("gain", "mesh error"))
    return f"{gain + 0.0:+.4f} ({error:.4f})"


def full(one: dict[str, Any]) -> float | None:
    """Output time [s] at which the box is full at the weaker vibration; None where it never is."""
    return next((t for t, box in zip(one["time"], one["box mean"], strict=True) if box >= FULL), None)


def above(one: dict[str, Any]) -> tuple[float, float, float, float] | None:
    """First and last output time [s] of the longest stretch from SINCE on in which the gain is above its own mesh error, and its least
    and largest margin there; None where it is so at no time."""
    time, margin = np.asarray(one["time"]), np.asarray(one["gain"]) - np.asarray(one["mesh error"])
    stretches = _stretches((margin > 0.0) & (time >= SINCE - 1e-9))
    if not stretches:
        return None
    first, last = max(stretches, key=lambda pair: pair[1] - pair[0])
    inside = margin[first : last + 1]
    return float(time[first]), float(time[last]), float(inside.min()), float(inside.max())


def gains_until(one: dict[str, Any]) -> float | None:
    """Last output time [s] until which the box mean gains at every output from SINCE on; None where it does not at SINCE."""
    time = np.asarray(one["time"])
    judged = time >= SINCE - 1e-9
    stretches = _stretches(np.asarray(one["gain"])[judged] > NOTHING)
    return float(time[judged][stretches[0][1]]) if stretches and stretches[0][0] == 0 else None


def _stretches(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def section(columns: Columns) -> str:
    """The table of gains over time under both conventions; empty where nothing was measured."""
    head = [
        "conventions",
        "state",
        *(f"{time:g} s" for time in SHOWN),
        "full",
        "gains",
        "above its mesh error",
    ]
    lines = []
    for key, found in columns.fine.items():
        numbers = found.get(ROW, {}).get("numbers", {})
        for state in R8_STATES:
            if state in numbers and "box mean" in numbers[state]:
                lines.append([NAMES[key], state, *_cells(numbers[state])])
    if not lines:
        return ""
    ruled = [head, ["---"] * len(head), *lines]
    return INTRODUCTION + "\n".join("| " + " | ".join(line) + " |" for line in ruled) + "\n\n"


def _cells(one: dict[str, Any]) -> list[str]:
    when, until, stretch = full(one), gains_until(one), above(one)
    return [
        *(at(one, time) for time in SHOWN),
        "–" if when is None else f"{when:.1f} s",
        "never" if until is None else f"until {until:.1f} s",
        "never" if stretch is None else _said(*stretch),
    ]


def _said(first: float, last: float, least: float, most: float) -> str:
    """A stretch of time and the margins in it."""
    if first == last:
        return f"at {first:.1f} s alone, by {least:.4f}"
    return f"{first:.1f} to {last:.1f} s, by {least:.4f} to {most:.4f}"
