"""Every combination of the switches of docs/conventions.md, all 288, in every fidelity: do balances close and bounds hold?

    python scripts/conventions.py                     # 3,456 runs of some hundred cells, then the table of docs/conventions.md
    python scripts/conventions.py --fidelity steady   # one fidelity, printed alone
    python scripts/conventions.py --some 5            # five combinations drawn by chance, printed alone

Ends with status 1 when a run fails or leaves its bounds. Tests run a set in which every pair of values occurs
(`tests/test_convention_runs.py`); this has them all.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from document import write_between

from meshes import rows
from mpm import Case, Reactor, load_case
from mpm.errors import MpmError
from mpm.report.balances import worst_balance
from mpm.revision import revision

ROOT = Path(__file__).parents[1]
DOCUMENT = ROOT / "docs" / "conventions.md"
MARKS = ("<!-- combinations: written by scripts/conventions.py -->", "<!-- end of combinations -->")
VALUES: dict[str, tuple[Any, ...]] = {
    "transport.scheme": ("fitted", "upwind", "central"),
    "transport.backflow_rows": (1, 2),
    "porous.diffusion": ("effective", "free", "printed"),
    "porous.inertia": ("interstitial", "superficial"),
    "porous.reaction_volume": ("gas", "total"),
    "motion.drag_reference": ("pore", "superficial"),
    "geometry.inlet_diffusion": (False, True),
}
MESH = {"geometry.cell_width": "10 mm", **rows(2, 1, 2, 2)}
TIMES: dict[str, dict[str, Any]] = {
    "steady": {"fidelity": "steady"},
    "averaged": {"fidelity": "averaged", "time.end": "0.3 s", "time.step": "30 ms", "output.every": "0.15 s"},
    "resolved": {
        "fidelity": "resolved",
        "time.end": "0.2 s",
        "time.steps_per_cycle": 8,
        "output.every": "0.1 s",
    },
}
DRAWING: dict[str, Any] = {
    "geometry.periodic": False,
    "geometry.outlet": [
        {"name": "upstream", "center": "30 mm", "width": "20 mm"},
        {"name": "downstream", "center": "119 mm", "width": "20 mm"},
    ],
    "geometry.inlet.purge.velocity": "1 mm/s",
    "geometry.inlet.tma.velocity": "1 mm/s",
    "motion.bed_velocity": "3 cm/s",
}
"""Between closed ends the bed drags gas out at the right and so in at the left, in every fidelity."""
HEATED: dict[str, Any] = {
    "energy.initial_temperature": "473 K",
    "geometry.bed_temperature": "298 K",
    "geometry.wall": [
        {"name": "bottom_wall", "side": "bottom", "temperature": "450 K", "end": "30 mm"},
        {"name": "top_wall", "side": "top", "temperature": "473 K", "end": "95 mm"},
    ],
    "geometry.inlet.tma.temperature": "400 K",
}
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "zone": ("single_zone", {}),
    "both precursors": ("single_cycle", {}),
    "an outlet that draws back": ("single_zone", DRAWING),
    "heated": ("single_zone", HEATED),
}
"""What is run: base case and changes."""
BALANCE, BELOW_ZERO, ABOVE_FEED, COVERAGE = 1e-9, 1e-14, 1e-9, 1e-11
"""Bounds of the fields of `Worst`."""


@dataclass
class Worst:
    """The worst of runs: balance over its largest term, concentration below 0 over the largest feed, precursor above its own feed, how far
    coverages leave 0 to 1 or sum up to something else than 1. A number that is not finite counts as infinite."""

    balance: float = 0.0
    below_zero: float = 0.0
    above_feed: float = 0.0
    coverage: float = 0.0

    def join(self, other: Worst) -> None:
        for one in fields(self):
            setattr(self, one.name, max(getattr(self, one.name), getattr(other, one.name)))

    @property
    def holds(self) -> bool:
        bounds = (BALANCE, BELOW_ZERO, ABOVE_FEED, COVERAGE)
        return all(getattr(self, one.name) <= most for one, most in zip(fields(self), bounds, strict=True))


def combinations() -> list[dict[str, Any]]:
    """All of them."""
    return [dict(zip(VALUES, chosen, strict=True)) for chosen in product(*VALUES.values())]


def case_of(kind: str, fidelity: str, chosen: Mapping[str, Any]) -> Case:
    """A case of some hundred cells."""
    base, changes = KINDS[kind]
    return load_case(ROOT / "cases" / f"{base}.toml", {**MESH, **TIMES[fidelity], **changes, **chosen})


def state(reactor: Reactor) -> Worst:
    """How a run stands at this moment."""
    transport, theta = reactor.system.transport, reactor.system.coverage.theta
    c, feed = transport.concentration, transport.ports.largest_feed
    _, balance = worst_balance(reactor.case, reactor.totals())
    found = Worst(
        balance=balance,
        below_zero=max(0.0, -float(c.min()) / feed),
        above_feed=above_feed(reactor),
        coverage=max(
            -float(theta.min()), float(theta.max()) - 1.0, float(np.abs(theta.sum(axis=0) - 1.0).max())
        ),
    )
    if not (np.isfinite(c).all() and np.isfinite(theta).all() and np.isfinite(balance)):
        return Worst(*[float("inf")] * len(fields(Worst)))
    return found


def above_feed(reactor: Reactor) -> float:
    """How far a gas that is fed and used up, never made, is above its feed, relative to it; in gas that is heated as mole fractions."""
    transport, gas = reactor.system.transport, reactor.system.gas
    most = [0.0]
    for name, c, feed in zip(
        transport.names, transport.concentration, transport.ports.feed.max(axis=0), strict=True
    ):
        if name in reactor.case.fed_species:
            limit = feed * (1.0 if gas is None else float(np.max(gas.relative[: c.size])))
            most.append(float(c.max()) / limit - 1.0)
    return max(most)


def run(case: Case) -> Worst:
    """The worst of a run at every output time and its end. Raises what the run raises."""
    worst = Worst()
    reactor = Reactor(case)
    reactor.run(callback=lambda r: worst.join(state(r)), progress=False)
    worst.join(state(reactor))
    return worst


def runs(kind: str, fidelity: str, chosen: Sequence[Mapping[str, Any]]) -> tuple[Worst, list[str]]:
    """The worst of these combinations, and one line for every run that fails or leaves its bounds."""
    worst, failures = Worst(), []
    for one in chosen:
        try:
            found = run(case_of(kind, fidelity, one))
        except (MpmError, ArithmeticError, ValueError) as error:
            failures.append(f"{fidelity}, {kind}, {one}: {error}")
            continue
        if not found.holds:
            failures.append(f"{fidelity}, {kind}, {one}: {found}")
        worst.join(found)
    return worst, failures


def main(arguments: list[str] | None = None) -> int:
    """Run what is asked for; returns the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--fidelity", choices=tuple(TIMES), help="this one alone")
    parser.add_argument("--some", type=int, metavar="N", help="N combinations by chance")
    options = parser.parse_args(arguments)
    chosen = combinations()
    if options.some:
        chosen = random.Random(options.some).sample(chosen, options.some)
    lines, failures = [], []
    for fidelity in [options.fidelity] if options.fidelity else TIMES:
        for kind in KINDS:
            begun = time.process_time()
            worst, failed = runs(kind, fidelity, chosen)
            failures += failed
            lines.append(
                f"| {fidelity} | {kind} | {len(chosen)} | {len(failed)} | {worst.balance:.1e} | {worst.below_zero:.1e} "
                f"| {worst.above_feed:.1e} | {worst.coverage:.1e} |"
            )
            print(f"{lines[-1]}  {time.process_time() - begun:.0f} s", flush=True)
    print("\n".join(failures))
    if not (options.fidelity or options.some or failures):
        head = (
            "| fidelity | case | runs | failed | worst balance | gas below 0, of the feed | above the feed, of it "
            "| coverage beyond 0 to 1 |"
        )
        table = "\n".join([head, "|---" * 8 + "|", *lines])
        write_between(DOCUMENT, *MARKS, f"{table}\n\nMeasured with mpm {revision()}.")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
