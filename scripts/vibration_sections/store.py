"""Runs of the sections, kept by what was typed of their case, and how tables show what is not measured.

results/vibration/<digest>.json    label, changes, the program that measured it, numbers

The digest is of the case file and the changes as they are typed: a key that comes later and that nobody types makes no new case.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from meshes import rows
from mpm import Case, Reactor, load_case
from mpm.files import write_atomically
from mpm.revision import revision

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "results" / "vibration"
Numbers = dict[str, float]
GAMMAS = (0.3, 0.6)
WIDTHS = (2.33, 1.0, 0.34, 0.17)  # mm
SITE = "OAl(CH3)2"
COARSE: dict[str, Any] = {"geometry.cell_width": "10 mm", **rows(2, 2, 2, 3), "time.steps_per_cycle": 8}
"""What a trial in seconds changes of every case, with its end at 3 s."""


@dataclass
class Lab:
    """Where sections get their numbers from. `coarse` makes every case a trial; with `only_stored` nothing is run.

    `widths` [mm] are those that are to be run; `revisions` collects which program has measured what was asked for.
    """

    folder: Path = KEPT
    coarse: bool = False
    only_stored: bool = False
    widths: Sequence[float] = WIDTHS
    say: Callable[[str], None] = print
    revisions: set[str] = field(default_factory=set)

    def case(self, base: str, changes: Mapping[str, Any], *, width: float, gamma: float) -> Case:
        """A case of the repository with columns of `width` [mm] and a vibration, with changes by dotted key."""
        trial = {**COARSE, "time.end": "3 s"} if self.coarse else {}
        given = {"geometry.cell_width": f"{width:g} mm", "motion.gamma": gamma, **changes, **trial}
        return load_case(ROOT / "cases" / f"{base}.toml", given)

    def run(self, label: str, case: Case, *, window: float = 0.0) -> Numbers | None:
        """Numbers of a run, made where it is not stored and its columns are to be run; None where it is missing.

        `box_mean`, `exit_mean`: coverage before the precursor and of what leaves, means over the last `window` [s] and at least the
        last output; `box_mean_at_end` at that alone.
        """
        wanted = any(np.isclose(1e3 * case.geometry.cell_width, width, rtol=0.05) for width in self.widths)
        return self.kept(label, case, lambda: _measure(case, window), run=self.coarse or wanted)

    def kept(
        self, label: str, case: Case, make: Callable[[], Numbers], *, run: bool = True, kind: str = "run"
    ) -> Numbers | None:
        """What `make` finds of a case, from the store where it is there; None where it is not and nothing is to be run."""
        path = self.folder / f"{_digest(case, kind)}.json"
        if not path.exists():
            if self.only_stored or not run:
                return None
            begun = time.process_time()
            numbers = make() | {"processor_seconds": time.process_time() - begun}
            record = {
                "label": label,
                "changes": {key: str(value) for key, value in case.origin.overrides.items()},
                "program": revision(),
                "numbers": numbers,
            }
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, json.dumps(record, indent=2, ensure_ascii=False) + "\n")
            self.say(f"  {label}: {numbers}")
        record = json.loads(path.read_text(encoding="utf-8"))
        self.revisions.add(record["program"])
        found: Numbers = record["numbers"]
        return found

    def footer(self) -> str:
        """Which program has measured what was asked for since the last footer."""
        said = "; ".join(sorted(self.revisions))
        self.revisions.clear()
        return f"\n\nMeasured with mpm {said}." if said else ""


def _digest(case: Case, kind: str) -> str:
    typed = {"data": case.origin.data, "overrides": case.origin.overrides, "kind": kind}
    return hashlib.sha256(json.dumps(typed, sort_keys=True, default=str).encode()).hexdigest()[:16]


def _measure(case: Case, window: float) -> Numbers:
    """Run the case without files. Columns of the bed slide as a whole; of a steady state, what enters and leaves each counts alike."""
    reactor = Reactor(case)
    middle = 0.5 * (reactor.grid.x[1:] + reactor.grid.x[:-1])
    box = middle < next(i.center for i in case.geometry.inlets if i.name == "tma")
    steady = case.fidelity == "steady"
    seen: list[tuple[float, float]] = []

    def look(r: Reactor) -> None:
        coverage = r.coverage("bed", SITE)
        if steady:
            before = np.concatenate([np.zeros((len(coverage), 1)), coverage[:, :-1]], axis=1)
            coverage = 0.5 * (coverage + before)
        if steady or r.time >= case.time.end - window - 1e-9:
            seen.append((float(coverage[:, box].mean()), float(coverage[:, -1].mean())))

    result = reactor.run(callback=look, progress=False)
    means = np.mean(seen, axis=0)
    return {
        "box_mean": float(means[0]),
        "box_mean_at_end": seen[-1][0],
        "exit_mean": float(means[1]),
        "x_CH4": float(np.mean(result.history["outlets.zone1.x.CH4"][-len(seen) :])),
        "cells": float(reactor.grid.cells),
        "steps": float(reactor.steps),
    }


def markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    ruled = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(line) + " |" for line in ruled)


def shown(value: float | None, form: str) -> str:
    """A number, or a dash where it has not been measured."""
    return "–" if value is None else format(value, form)


def box(found: Numbers | None, name: str = "box_mean") -> float | None:
    """The box mean of a run that may be missing."""
    return None if found is None else found[name]


def less(a: float | None, b: float | None) -> float | None:
    """a - b where both are there."""
    return None if a is None or b is None else a - b
