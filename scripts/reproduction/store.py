"""Runs of the rows, kept by content: a run that several rows need is made once, and one that was stopped goes on.

results/reproduce/<coarse|full>/runs/<hash of the case>/    the directory of an ordinary run
                                flows/<hash>.npz            what the flow rows measure of a cycle
                                rows/<id>.json              what a row measured
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes import MESHES
from mpm.case.case import Case, load_case
from mpm.files import write_atomically
from mpm.output.results import Run, load_run

ROOT = Path(__file__).parents[2]
BASES = {name: ROOT / "cases" / "thesis" / f"single_{name}.toml" for name in ("zone", "cycle")}
Arrays = dict[str, NDArray[Any]]


@dataclass
class Lab:
    """Where a row gets its runs from. `coarse` puts every case on the coarsest mesh, for tests.

    With `only_stored` nothing is run: what is missing raises FileNotFoundError. `finest` asks for the thesis' own mesh where a
    row offers it. `used` collects mesh and fidelity of the row's cases, for the table.
    """

    folder: Path
    coarse: bool = False
    say: Callable[[str], None] = print
    finest: bool = False
    only_stored: bool = False
    used: dict[str, set[str]] = field(default_factory=dict)

    def case(self, base: str, mesh: str = "medium", changes: Mapping[str, Any] | None = None) -> Case:
        """A case of `base` (zone or cycle) on a mesh, with changes by dotted key."""
        mesh = "coarse" if self.coarse else mesh
        case = load_case(BASES[base], {**MESHES[mesh], **(changes or {})})
        fidelity: str = case.fidelity
        if fidelity == "resolved" and case.motion.startup == "impulsive":
            fidelity = "start-up"
        self.used.setdefault(f"{mesh}, {case.geometry.cells:,} cells", set()).add(fidelity)
        return case

    def best(self, base: str, changes: Mapping[str, Any]) -> Case:
        """The case on the thesis' mesh where that is asked for or has been run, else on the medium one."""
        fine = load_case(BASES[base], {**MESHES["thesis"], **changes})
        return self.case(base, "thesis" if self.finest or self.has(fine) else "medium", changes)

    @property
    def settled(self) -> dict[str, Any]:
        """Changes that bring a case to its final state."""
        return {"fidelity": "steady"}

    def meshes(self) -> str:
        """Meshes and fidelities of the cases asked for since `used` was cleared."""
        return "; ".join(f"{mesh}: {', '.join(sorted(kinds))}" for mesh, kinds in self.used.items())

    def run(self, case: Case) -> Run:
        """The finished run of `case`, made or continued when it is not there yet. Raises what the run raises."""
        directory = self.folder / "runs" / case.content_hash()[:16]
        if not self._done(directory):
            self._may_run(case)
            from mpm.reactor.reactor import Reactor

            started = time.monotonic()
            resume = (directory / "checkpoint.npz").exists()
            Reactor(case).run(directory, resume=resume, overwrite=not resume)
            self.say(f"  run {directory.name} ({case.title}) in {time.monotonic() - started:.0f} s")
        return load_run(directory)

    def _may_run(self, case: Case) -> None:
        if self.only_stored:
            raise FileNotFoundError(f"no stored run of {case.title}")

    def has(self, case: Case) -> bool:
        """Whether the finished run of `case` is in the store."""
        return self._done(self.folder / "runs" / case.content_hash()[:16])

    def _done(self, directory: Path) -> bool:
        summary = directory / "summary.json"
        return summary.exists() and json.loads(summary.read_text(encoding="utf-8"))["status"] == "done"

    def arrays(self, case: Case, kind: str, make: Callable[[], Arrays]) -> Arrays:
        """Arrays that depend on `case` and `kind` alone, kept in one file."""
        key = hashlib.sha256(f"{case.content_hash()} {kind}".encode()).hexdigest()[:16]
        path = self.folder / "flows" / f"{key}.npz"
        if not path.exists():
            self._may_run(case)
            started = time.monotonic()
            arrays = make()
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_suffix(".part.npz")
            np.savez_compressed(part, **arrays)  # type: ignore[arg-type]
            part.replace(path)
            self.say(f"  {kind} {key} ({case.title}) in {time.monotonic() - started:.0f} s")
        with np.load(path) as stored:
            return {name: stored[name] for name in stored.files}

    def keep(self, name: str, content: Mapping[str, Any]) -> None:
        """Write what a row measured."""
        path = self.folder / "rows" / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")

    def kept(self, name: str) -> dict[str, Any]:
        """What `keep` has written. Raises FileNotFoundError when there is nothing."""
        content: dict[str, Any] = json.loads(
            (self.folder / "rows" / f"{name}.json").read_text(encoding="utf-8")
        )
        return content
