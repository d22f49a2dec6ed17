"""Restart states: everything a run needs to go on, independent of the number of ranks.

Arrays are stored in the grid's order. The velocity fields are stored too: a resumed run must not depend on how the flow solver rounds.
A state knows its case by content, so that no other case, mesh or motion can go on from it.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.case.case import Output
from mpm.case.profile import PRESETS
from mpm.case.sources import merge, read_toml
from mpm.errors import InputError
from mpm.files import read_text
from mpm.output.directory import RunDirectory
from mpm.parallel import is_root, on_root, total
from mpm.reactor.sequence import March, Replay, unpack
from mpm.report.records import Totals

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.reactor.reactor import Reactor

Arrays = dict[str, NDArray[Any]]
State = tuple[Arrays, dict[str, Any]]
FORMAT = 2  # of the states that this version writes and reads; another number for every change of what an entry means


def identity(case: Case) -> dict[str, Any]:
    """By what a state knows its case: digests of all that determines the results but for the time at which they end and are looked at.

    The mesh follows from the case; files count with their content (a mechanism's tables and a shared geometry are in the case).
    """
    content = case.to_dict()
    motion = content["motion"]
    motion["profile"] = profile = _profile(motion["profile"])
    for table, key in (("time", "end"), ("chemistry", "mechanism"), ("chemistry", "name")):
        content[table].pop(key, None)
    for name in ("title", "output"):
        content.pop(name, None)
    return {"format": FORMAT, "profile": profile, "case": _digest(json.dumps(content, sort_keys=True))}


def _profile(name: str) -> str:
    return name if name in PRESETS else _digest(read_text(name))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def write(reactor: Reactor, directory: RunDirectory) -> None:
    """Write the state of `reactor`; collective."""
    arrays, meta = pack(reactor)
    on_root(reactor.comm, lambda: directory.write_checkpoint(arrays, meta))


def pack(reactor: Reactor) -> tuple[Arrays, dict[str, Any]]:
    """Arrays (on rank 0) and plain numbers of the state."""
    transport, bed, flows = reactor.transport, reactor.bed, reactor.flows
    assert flows is not None
    ledger, scatter = transport.ledger, reactor.strip.scatter
    gathered = {
        "concentration": scatter.to_root(transport.concentration),
        "gas_events": scatter.to_root(ledger.gas_events),
        "flow": scatter.to_root(flows.stored()),
        "theta": bed.scatter.to_root(bed.theta),
        "surface_events": bed.scatter.to_root(ledger.surface_events),
    }
    arrays = {
        **{name: values for name, values in gathered.items() if values is not None},
        **{f"ledger_{name}": total(reactor.comm, getattr(ledger, name)) for name in SUMMED},
        "passed": bed.passed,
        "left": np.asarray(bed.left),
        "right": np.asarray(bed.right),
        "sites_initially": reactor.sites_initially,
    }
    if isinstance(flows, Replay) and flows.dispersion is not None:
        dispersion = scatter.to_root(flows.dispersion[:, :, : reactor.strip.owned])
        arrays |= {"dispersion": dispersion} if dispersion is not None else {}
    if reactor.before is not None:
        arrays |= {f"before_{name}": np.asarray(getattr(reactor.before, name)) for name in BEFORE}
    meta = {
        **reactor.identity,
        "time": reactor.time,
        "steps": reactor.steps,
        "rows": len(reactor.rows),
        "wall": reactor.wall,
        "distance": bed.distance,
        "shifted": bed.shifted,
        "marched": flows.done if isinstance(flows, March) else -1,
    }
    return arrays, meta


SUMMED = ("fed", "out", "back", "out_volume", "back_volume")
BEFORE = (
    "out",
    "out_volume",
    "back_volume",
    "surface",
    "slid",
)  # of the latest output, for what is reported since then


def restore(reactor: Reactor, arrays: Arrays, meta: dict[str, Any]) -> None:
    """Put `reactor`, freshly built for the same case, into the stored state; collective."""
    transport, bed, strip = reactor.transport, reactor.bed, reactor.strip
    ledger = transport.ledger
    transport.concentration = strip.scatter.to_local(arrays["concentration"])
    ledger.gas_events = strip.scatter.to_local(arrays["gas_events"])
    ledger.surface_events = bed.scatter.to_local(arrays["surface_events"])
    bed.theta = bed.scatter.to_local(arrays["theta"])
    for name in SUMMED:  # sums over ranks: rank 0 carries them on
        values = arrays[f"ledger_{name}"]
        setattr(ledger, name, values if is_root(reactor.comm) else np.zeros_like(values))
    bed.passed = arrays["passed"]
    bed.left, bed.right = list(arrays["left"]), list(arrays["right"])
    bed.distance, bed.shifted = meta["distance"], meta["shifted"]
    reactor.sites_initially = arrays["sites_initially"]
    reactor.time, reactor.steps, reactor.wall_before = meta["time"], meta["steps"], meta["wall"]
    fields = unpack(strip, arrays["flow"])
    if meta["marched"] >= 0:
        march = March(reactor.case, strip, reactor.motion, reactor.schedule)
        march.restore(fields, meta["marched"])
        reactor.flows = march
    else:
        dispersion = arrays["dispersion"][:, :, strip.cell] if "dispersion" in arrays else None
        reactor.flows = Replay(strip, fields, reactor.schedule.resting_steps > 0, dispersion)
    reactor.flows.register(transport)
    if "before_out" in arrays:
        now = reactor.totals()
        then = {name: arrays[f"before_{name}"] for name in BEFORE}
        reactor.before = Totals(**{**vars(now), **then, "slid": float(then["slid"])})


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
