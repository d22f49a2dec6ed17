"""What heat costs: processor time of runs with a table [energy] over that of the same runs without, one after the other."""

from __future__ import annotations

import time
from typing import Any

from heat_sections.store import COARSE, HOT, Numbers, case_of, kept, markdown
from mpm import Case, Reactor

PAIRS = 2
SECONDS = {"averaged": 4.0, "resolved": 0.25, "steady": 0.0}
ENERGIES: dict[str, dict[str, Any] | None] = {
    "none": None,
    "`[energy]`, nothing changes": {},
    "cold powder": {"cold": True},
}


def case_with(energy: str, fidelity: str, mesh: str) -> Case:
    """The zone without heat, with a table [energy] at one temperature, and with cold powder between hot walls."""
    end = SECONDS[fidelity] if mesh != COARSE else 0.3
    march: dict[str, Any] = {"fidelity": fidelity}
    if end:
        march |= {"time.end": f"{end} s", "output.every": f"{end / 2} s"}
    if energy == "cold powder":
        return case_of("heating", mesh, march)
    same = {"gas.temperature": f"{HOT} K", "energy": {}}
    if energy == "none":
        del same["energy"]
    return case_of("single_zone", mesh, march, same)


def seconds(fidelity: str, mesh: str) -> Numbers:
    """Processor time of each, the least of some rounds in turn [s]."""

    def measure() -> Numbers:
        found: Numbers = {}
        for _ in range(PAIRS):
            for energy in ENERGIES:
                begun = time.process_time()
                reactor = Reactor(case_with(energy, fidelity, mesh))
                reactor.run(progress=False)
                used = time.process_time() - begun
                found[energy] = min(used, found.get(energy, used))
                found[f"{energy}, steps"] = float(reactor.steps)
        return found

    return kept(f"cost-{fidelity}-{mesh}", case_with("cold powder", fidelity, mesh), measure)


def table(meshes: tuple[str, ...]) -> str:
    """By fidelity: seconds without heat, and how many times as long with it."""
    lines = []
    for fidelity, end in SECONDS.items():
        found = seconds(fidelity, meshes[0])
        plain, still, cold = (found[energy] for energy in ENERGIES)
        what = f"{end:g} s" if end else "the whole"
        lines.append([fidelity, what, f"{plain:.1f}", f"{still / plain:.2f}", f"{cold / plain:.2f}"])
    head = [
        "fidelity",
        "simulated",
        "without heat, s",
        "`[energy]`, nothing changes, times",
        "cold powder, times",
    ]
    return markdown(head, lines)
