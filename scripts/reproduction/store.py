"""Runs of the rows, kept by content: a run that several rows need is made once, and one that was stopped goes on.

results/reproduce/<coarse|full>/runs/<hash of the case>/    the directory of an ordinary run
                                flows/<hash>.npz            what the flow rows measure of a cycle
                                rows/<setting>/<id>.json    what a row measured under a setting (`reproduction.settings`)
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
from mpm.revision import revision
from reproduction.settings import MPM, Setting

ROOT = Path(__file__).parents[2]
BASES = {name: ROOT / "cases" / "thesis" / f"single_{name}.toml" for name in ("zone", "cycle")}
Arrays = dict[str, NDArray[Any]]
PROGRAM = "made by"
"""Name beside the arrays of a flow that holds the revision which made them."""


@dataclass
class Lab:
    """Where a row gets its runs from. `coarse` puts every case on the coarsest mesh, for tests; `mesh` puts it on one by its name.

    With `only_stored` nothing is run: what is missing raises FileNotFoundError. `finest` asks for the thesis' own mesh where a
    row offers it. `setting` is what every case has under the changes of its row. `used` collects mesh and fidelity of the row's
    cases, for the table, `programs` the revisions that made its runs.
    """

    folder: Path
    coarse: bool = False
    say: Callable[[str], None] = print
    finest: bool = False
    only_stored: bool = False
    setting: Setting = MPM
    mesh: str | None = None
    used: dict[str, set[str]] = field(default_factory=dict)
    programs: set[str] = field(default_factory=set)

    def begin(self) -> None:
        """Forget which meshes and programs the row before used."""
        self.used.clear()
        self.programs.clear()

    def case(self, base: str, mesh: str = "medium", changes: Mapping[str, Any] | None = None) -> Case:
        """A case of `base` (zone or cycle) on a mesh, with changes by dotted key."""
        mesh = "coarse" if self.coarse else self.mesh or mesh
        case = self._case(base, mesh, changes or {})
        fidelity: str = case.fidelity
        if fidelity == "resolved" and case.motion.startup == "impulsive":
            fidelity = "start-up"
        self.used.setdefault(f"{mesh}, {case.geometry.cells:,} cells", set()).add(fidelity)
        return case

    def best(self, base: str, changes: Mapping[str, Any]) -> Case:
        """The case on the thesis' mesh where that is asked for or has been run, else on the medium one."""
        fine = self._case(base, "thesis", changes)
        return self.case(base, "thesis" if self.finest or self.has(fine) else "medium", changes)

    def _case(self, base: str, mesh: str, changes: Mapping[str, Any]) -> Case:
        return load_case(BASES[base], {**MESHES[mesh], **self.setting.changes(base), **changes})

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
        run = load_run(directory)
        self.programs.add(str(run.summary.get("revision", "unknown")))
        return run

    def so_far(self, case: Case) -> Run | None:
        """The run of `case` as far as it has come, None when it has not begun; nothing is run."""
        directory = self.folder / "runs" / case.content_hash()[:16]
        if not (directory / "history.csv").exists():
            return None
        run = load_run(directory)
        self.programs.add(str(run.summary.get("revision", "unknown")))
        return run

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
            np.savez_compressed(part, **{**arrays, PROGRAM: np.array(revision())})  # type: ignore[arg-type]
            part.replace(path)
            self.say(f"  {kind} {key} ({case.title}) in {time.monotonic() - started:.0f} s")
        with np.load(path) as stored:
            found = {name: stored[name] for name in stored.files}
        self.programs.add(str(found.pop(PROGRAM, "unknown")))
        return found

    def keep(self, name: str, content: Mapping[str, Any]) -> None:
        """Write what a row measured under the setting, with the revision that measured it and those that made its runs."""
        path = self._finding(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        content = {
            **content,
            "setting": self.setting.name,
            "revision": revision(),
            "runs by": sorted(self.programs),
        }
        write_atomically(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")

    def kept(self, name: str) -> dict[str, Any]:
        """What `keep` has written under the setting. Raises FileNotFoundError when there is nothing."""
        content: dict[str, Any] = json.loads(self._finding(name).read_text(encoding="utf-8"))
        return content

    def _finding(self, name: str) -> Path:
        return self.folder / "rows" / self.setting.name / f"{name}.json"
