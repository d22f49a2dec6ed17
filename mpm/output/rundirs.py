"""Directories of runs before a run takes them: which name is next, and whether what one holds can go on."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from mpm.case.kinds import RUN, kind_of_directory, what_it_is
from mpm.errors import InputError
from mpm.output.directory import RunDirectory

if TYPE_CHECKING:
    from mpm.case.case import Case

RESULTS = Path("results")
AUTO = "auto"
"""The name that numbers the directories of a case."""


def directory_named(name: str) -> Path:
    """`results/NAME`. Raises InputError for a name that leads somewhere else."""
    if not name.strip() or Path(name).name != name or name in (".", ".."):
        raise InputError.at(
            None,
            "--name",
            repr(name),
            f"{AUTO}, or a name in {RESULTS}/; for another place: -o DIR",
            given="",
        )
    return RESULTS / name


def make_numbered(stem: str) -> Path:
    """Make `results/STEM-001`, or with the number after the last one there; two programs at once get two directories.

    Raises InputError when nothing can be made there.
    """
    numbered = re.compile(re.escape(stem) + r"-(\d{3,})")
    try:
        RESULTS.mkdir(parents=True, exist_ok=True)
        while True:
            taken = [int(found[1]) for p in RESULTS.iterdir() if (found := numbered.fullmatch(p.name))]
            path = RESULTS / f"{stem}-{max(taken, default=0) + 1:03d}"
            try:
                path.mkdir()
            except FileExistsError:  # another program has just taken it
                continue
            return path
    except OSError as error:
        raise InputError(f"{RESULTS}: cannot be used for results ({error.strerror})") from error


def require_run(path: Path, complaint: str = "nothing to resume") -> None:
    """Raise InputError, with the `complaint`, where there is no run."""
    if kind_of_directory(path) is not RUN:
        raise InputError.at(path, "", f"{complaint}: {what_it_is(path)}", RUN.words)


def can_resume(path: Path, case: Case) -> bool:
    """Whether the run in `path` has a restart state; False: it was ended before its first one, and begins anew.

    Raises InputError where there is no run, or one that has already reached the end of `case`.
    """
    require_run(path)
    directory = RunDirectory(path)
    summary = directory.read_summary() or {}
    reached = summary.get("simulated_seconds", 0.0)
    steady = case.fidelity == "steady"
    if summary.get("status") == "done" and (steady or case.time.end <= reached):
        further = "" if steady else f" to a later end: mpm resume {path} --end '{2.0 * reached:g} s';"
        raise InputError(
            f"{path}: nothing to resume: the run is done{'' if steady else f', t = {reached:g} s'};{further} "
            f"anew: mpm run {path}/case.toml -o {path} --overwrite"
        )
    return (path / "checkpoint.npz").exists()
