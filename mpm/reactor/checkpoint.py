"""Restart states: everything a run needs to go on, independent of the number of ranks.

Arrays are stored in the grid's order. The velocity fields are stored too: a resumed run must not depend on how the flow solver rounds.
A state knows its case by content, so that no other case, mesh or motion can go on from it.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.case.options import Output
from mpm.case.profile import PRESETS
from mpm.case.sources import merge, read_toml
from mpm.errors import InputError
from mpm.output.directory import RunDirectory
from mpm.parallel import on_root
from mpm.reactor.records import totals

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.reactor.course import Course

Arrays = dict[str, NDArray[Any]]
State = tuple[Arrays, dict[str, Any]]
Identity = dict[str, Any]
BEFORE = (
    "out",
    "out_volume",
    "back_volume",
    "surface",
    "slid",
)  # of the latest output, for what is reported since then
FORMAT = 5  # of the states that this version writes and reads; another number for every change of what an entry means


def identity(case: Case) -> Identity:
    """By what a state knows its case: digests of all that determines the results but for the time at which they end and are looked at.

    The mesh follows from the case; files count with their content (a mechanism's tables and a shared geometry are in the case).
    """
    content = case.to_dict()
    profile = case.motion.profile_content
    if case.motion.profile not in PRESETS:
        profile = _digest(profile)
    content["motion"]["profile"] = profile
    for table, key in (("time", "end"), ("chemistry", "mechanism"), ("chemistry", "name")):
        content[table].pop(key, None)
    for name in ("title", "output"):
        content.pop(name, None)
    return {"format": FORMAT, "profile": profile, "case": _digest(json.dumps(content, sort_keys=True))}


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def write(course: Course, known: Identity, directory: RunDirectory) -> None:
    """Write the state of a run, which is `known` by its case's identity; collective."""
    arrays, meta = pack(course)
    on_root(course.comm, lambda: directory.write_checkpoint(arrays, {**known, **meta}))


def pack(course: Course) -> State:
    """Arrays (those that are gathered on rank 0 alone) and plain numbers of the state; collective."""
    parts = course.system.stored()
    if course.before is not None:
        parts |= {f"before.{name}": getattr(course.before, name) for name in BEFORE}
    arrays = {name: np.asarray(value) for name, value in parts.items() if value is not None}
    clock = course.clock
    return arrays, {"time": clock.time, "steps": clock.steps, "wall": clock.wall, "rows": len(course.rows)}


def restore(course: Course, arrays: Arrays, meta: dict[str, Any]) -> None:
    """Put a fresh `course` of the same case into the stored state, but for its rows; collective."""
    clock = course.clock
    clock.time, clock.steps, clock.wall_before = meta["time"], meta["steps"], meta["wall"]
    course.system.restore({k: v for k, v in arrays.items() if not k.startswith("before.")}, clock.steps)
    if "before.out" in arrays:
        then: dict[str, Any] = {name: arrays[f"before.{name}"] for name in BEFORE}
        course.before = replace(totals(course.system), **{**then, "slid": float(then["slid"])})


def check_same_case(directory: RunDirectory, case: Case, state: State | None) -> None:
    """Raise InputError unless the directory's case and its `state` differ from `case` in nothing but an earlier end."""
    mine, meta = identity(case), state[1] if state is not None else {}
    path, where = directory.path / "case.toml", directory.path / "checkpoint.npz"
    if state is not None and meta.get("format") != FORMAT:
        raise InputError(
            f"{where}: written by another version of mpm (format {meta.get('format', 1)}; this one goes on from {FORMAT}); "
            "accepted: a run begun anew (--overwrite)"
        )
    same_profile = meta.get("profile") == mine["profile"]
    # a directory from before a key of [output] existed has its default
    old = merge({"output": Output().model_dump(mode="json")}, read_toml(path)) if path.exists() else {}
    allowed = {"time.end", "motion.profile"} if same_profile else {"time.end"}
    changed = (
        [key for key in _differences(old, tomllib.loads(case.to_toml())) if key not in allowed] if old else []
    )
    if changed:
        raise InputError(
            f"{directory.path}: the case has changed in {changed[0]} since this run began; accepted with --resume: a later time.end"
        )
    if state is None:
        return
    if not same_profile:
        raise InputError(
            f"{case.motion.profile}: the motion profile has changed since the run in {directory.path} began; accepted with "
            "--resume: a later time.end"
        )
    if meta["case"] != mine["case"]:
        raise InputError(f"{where}: the state of another case; accepted: that of the case to be resumed")
    if case.time.end < meta["time"]:
        raise InputError(
            f"{directory.path}: time.end: found {case.time.end:g} s; accepted: not before the restart state at {meta['time']:g} s"
        )


def _differences(old: Any, new: Any, key: str = "") -> list[str]:
    """Dotted keys in which two tables differ."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [*old, *(k for k in new if k not in old)]
        return [d for k in keys for d in _differences(old.get(k), new.get(k), f"{key}.{k}".lstrip("."))]
    return [] if old == new else [key]
