"""Whole runs under other conventions: the preset, laws and bounds under combinations of all switches, ranks, restart."""

import random
import sys
from collections.abc import Iterator, Mapping
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case, load_case
from mpm.case.conventions import CLOSED_CODE, SWITCHES, conventions_of, switches
from mpm.case.keys import values
from mpm.cli import main
from mpm.errors import InputError
from mpm.flow.sequence import CyclicFlow
from mpm.reactor.reactor import Reactor
from mpm.sweep.plan import plan
from mpm.sweep.sweepfile import read_sweep

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from conventions import DRAWING

from .cases import HEATED, MPI, TINY, assert_same_numbers, cycle, run, zone
from .general import SIX_GASES
from .test_restart import assert_same_state, interrupted

COMM = MPI.COMM_WORLD

OPTIONS: dict[str, tuple[Any, ...]] = {
    "transport.scheme": ("fitted", "upwind", "central"),
    "transport.backflow_rows": (1, 2),
    "porous.diffusion": ("effective", "free", "printed"),
    "porous.inertia": ("interstitial", "superficial"),
    "porous.reaction_volume": ("gas", "total"),
    "motion.drag_reference": ("pore", "superficial"),
    "geometry.inlet_diffusion": (False, True),
}
MICRO = {
    "geometry.cell_width": "10 mm",
    "geometry.layer.plenum.cells": 2,
    "geometry.layer.frit.cells": 1,
    "geometry.layer.bed.cells": 2,
    "geometry.layer.headspace.cells": 2,
}
TIMES: dict[str, dict[str, Any]] = {
    "steady": {"fidelity": "steady"},
    "averaged": {"fidelity": "averaged", "time.end": "0.3 s", "time.step": "30 ms", "output.every": "0.15 s"},
    "resolved": {
        "fidelity": "resolved", "time.end": "0.2 s", "time.steps_per_cycle": 8, "output.every": "0.2 s",
    },
}  # fmt: skip


def draws_in(reactor: Reactor) -> bool:
    """Whether gas comes back through an outlet at some phase; collective."""
    sequence = reactor.flow.sequence
    fields = sequence.phases if isinstance(sequence, CyclicFlow) else [reactor.system.velocity]
    return any(op.drawn_in for field in fields for op in reactor.system.transport.operators(field)[:1])


def covering(seed: int = 17) -> list[dict[str, Any]]:
    """Combinations of all switches in which every pair of values of every two of them occurs; a few instead of all 288."""
    names, rng = list(OPTIONS), random.Random(seed)
    missing = {(a, x, b, y) for a, b in combinations(names, 2) for x, y in product(OPTIONS[a], OPTIONS[b])}
    every = [dict(zip(names, chosen, strict=True)) for chosen in product(*OPTIONS.values())]
    rng.shuffle(every)
    found = []
    while missing:
        best = max(every, key=lambda one: sum(one[a] == x and one[b] == y for a, x, b, y in missing))
        missing = {(a, x, b, y) for a, x, b, y in missing if not (best[a] == x and best[b] == y)}
        found.append(best)
    return found


def test_the_combinations_cover_every_pair() -> None:
    """Fails when a switch is left out of the tests below, or a value of it."""
    assert set(OPTIONS) == set(SWITCHES)
    assert all(CLOSED_CODE[name] in OPTIONS[name] for name in SWITCHES)
    assert 9 <= len(covering()) <= 16


KINDS: dict[str, Mapping[str, Any]] = {
    "zone": {},
    "an outlet that draws back": DRAWING,
    "heated": HEATED,
    "heated, an outlet that draws back": {
        **{key: value for key, value in HEATED.items() if key != "geometry.wall"},
        **DRAWING,
    },
    "six gases": SIX_GASES,
}


def combined() -> Iterator[Any]:
    for fidelity in TIMES:
        for number, chosen in enumerate(covering()):
            label = "-".join(str(value)[:4] for value in chosen.values())
            kinds = ["zone", "cycle", *(list(KINDS)[1:])]
            for kind in ("zone", kinds[1 + number % (len(kinds) - 1)]):
                yield pytest.param(fidelity, kind, chosen, id=f"{fidelity}-{kind}-{label}")


@pytest.mark.parametrize(("fidelity", "kind", "chosen"), list(combined()))
def test_laws_hold_with_any_combination(fidelity: str, kind: str, chosen: dict[str, Any]) -> None:
    """Fails when balances do not close, concentrations or coverages leave their bounds, or a number is not finite, whatever switches are
    put together: the zone in all, beside it in turn both precursors, outlets that draw back in, temperature, six gases."""
    changes = {**TIMES[fidelity], **chosen}
    case = cycle(changes, MICRO) if kind == "cycle" else zone({**changes, **KINDS[kind]}, MICRO)
    reactor, result = run(case)
    assert "draws back" not in kind or draws_in(reactor)
    assert result.summary["conventions"] == {"preset": "mpm", **chosen}
    feed = reactor.system.transport.ports.feed.max(axis=0)
    transport = reactor.system.transport
    for name, most in zip(transport.names, feed, strict=True):
        if (
            name in case.fed_species and kind != "six gases"
        ):  # what is only fed and taken up is never more than the feed
            c = transport.concentration[transport.names.index(name)]
            relative = 1.0 if reactor.system.gas is None else reactor.system.gas.relative[: c.size]
            assert c.max() <= most * (1.0 + 1e-9) * np.max(relative), name


# --- the preset ---


def test_the_preset_is_all_its_switches() -> None:
    """Fails when `closed-code` is another case than all of its switches typed, or gives other numbers, or mpm's own preset is not all of
    the defaults."""
    preset = zone({**TIMES["averaged"], "conventions": "closed-code"}, MICRO)
    typed = zone({**TIMES["averaged"], **CLOSED_CODE}, MICRO)
    assert switches(preset) == switches(typed) == dict(CLOSED_CODE)
    assert preset.with_({"conventions": "mpm"}) != preset
    plain = zone(TIMES["averaged"], MICRO)
    assert all(plain.to_dict()[k.split(".")[0]][k.split(".")[1]] != v for k, v in CLOSED_CODE.items())
    assert zone({**TIMES["averaged"], "conventions": "mpm"}, MICRO) == plain
    one, other = (run(case)[1].summary for case in (preset, typed))
    assert_same_numbers(one, other, 0.0)
    assert one["conventions"]["preset"] == "closed-code" and other["conventions"]["preset"] == "mpm"


def test_a_typed_switch_wins_over_the_preset(tmp_path: Path) -> None:
    """Fails when the preset overrules a switch in the file, by --set, or in a resolved case that is loaded again and set once more."""
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    tables = {"geometry": {"length": "100 mm", "layer": layer}, "conventions": "closed-code"}
    case = load_case({**tables, "transport": {"scheme": "central"}}, {"porous.diffusion": "printed"})
    assert switches(case) == {
        **CLOSED_CODE,
        "transport.scheme": "central",
        "porous.diffusion": "printed",
    }
    (tmp_path / "case.toml").write_text(case.to_toml(), encoding="utf-8")
    again = load_case(tmp_path / "case.toml")
    assert again == case and conventions_of(again) == conventions_of(case)
    assert switches(load_case(tmp_path / "case.toml", {"conventions": "mpm"})) == switches(case)
    assert switches(case.with_({"transport.scheme": "upwind"}))["transport.scheme"] == "upwind"
    default = load_case(
        {**tables, "transport": {"scheme": "fitted"}}
    )  # which is what is there without the preset, but is typed
    assert switches(default)["transport.scheme"] == "fitted"


def test_where_a_switch_comes_from() -> None:
    """Fails when a value of the preset is said to be typed or a default, or a typed one to be built in."""
    found = {
        v.name: v.origin
        for v in values(zone({"conventions": "closed-code", "transport.scheme": "central"}, MICRO))
    }
    assert found["conventions"] == found["transport.scheme"] == "typed"
    assert found["porous.diffusion"] == found["geometry.inlet_diffusion"] == "built-in"
    assert {v.name: v.origin for v in values(zone({}, MICRO))}["porous.diffusion"] == "default"


@pytest.mark.parametrize(
    ("setting", "key"),
    [
        ("conventions=fluent", "conventions"),
        ("conventions=3", "conventions"),
        ("conventions=[]", "conventions"),
        ("transport.scheme=quick", "transport.scheme"),
        ("transport.backflow_rows=3", "transport.backflow_rows"),
        ("transport.backflow_rows=0", "transport.backflow_rows"),
        ("transport.backflow_rows=1.5", "transport.backflow_rows"),
        ("transport.backflow_rows=true", "transport.backflow_rows"),
        ("porous.diffusion=1", "porous.diffusion"),
        ("porous.inertia=", "porous.inertia"),
        ("porous.difusion=free", "porous.difusion"),
        ("porous=closed-code", "porous"),
        ("motion.drag_reference=true", "motion.drag_reference"),
    ],
)
def test_nonsense_is_one_line(setting: str, key: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a slip in a switch is a traceback, more than one line, or silently the default."""
    assert main(["check", "single_zone", "--set", setting]) == 2
    said = capsys.readouterr().err.strip()
    assert key in said and len(said.splitlines()) == 1


def test_switches_as_axes_of_a_sweep(tmp_path: Path) -> None:
    """Fails when a sweep cannot vary the preset, or a switch beside it, or the switch does not win."""
    (tmp_path / "sweep.toml").write_text("""
[sweep]
case = "single_zone"
[[sweep.axis]]
key = "conventions"
values = ["mpm", "closed-code"]
[[sweep.axis]]
key = "transport.scheme"
values = ["fitted", "central"]
""")
    cases = [point.case for point in plan(read_sweep(tmp_path / "sweep.toml"))]
    found = [conventions_of(case) for case in cases if case is not None]
    assert [(one["preset"], one["transport.scheme"], one["porous.diffusion"]) for one in found] == [
        ("mpm", "fitted", "effective"),
        ("mpm", "central", "effective"),
        ("closed-code", "fitted", "free"),
        ("closed-code", "central", "free"),
    ]


# --- ranks and restart ---

CLOSED = {"conventions": "closed-code"}
PARALLEL: dict[str, Case] = {
    "averaged": zone({"time.end": "0.3 s", "output.every": "0.15 s", **CLOSED}, TINY),
    "drawing, resolved": zone(
        {
            "fidelity": "resolved", "time.end": "0.2 s", "time.steps_per_cycle": 16, "output.every": "0.1 s", **DRAWING, **CLOSED,
        },
        TINY,
    ),
    "drawing, steady": zone({"fidelity": "steady", **DRAWING, **CLOSED}, TINY),
    "heated, steady": zone({"fidelity": "steady", **HEATED, **CLOSED}, TINY),
}  # fmt: skip


@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize("name", PARALLEL)
def test_ranks_agree_on_the_closed_code(name: str) -> None:
    """Fails when a number depends on the ranks, among them those that hold one of the two rows that an outlet draws from and not the
    other; or when no outlet of the case that is meant to does draw in."""
    case = PARALLEL[name]
    _, alone = run(case, MPI.COMM_SELF)
    reactor, together = run(case, COMM)
    assert draws_in(reactor) == ("drawing" in name)
    assert_same_numbers(alone.summary, together.summary, 1e-8)
    for field in ("C_TMA", "C_CH4", "velocity"):
        a, b = alone.field(field), together.field(field)
        np.testing.assert_allclose(b, a, rtol=0.0, atol=1e-8 * np.abs(a).max(), err_msg=field)


@pytest.mark.parallel
@pytest.mark.parametrize("name", ["averaged", "drawing, resolved"])
def test_a_restart_equals_an_undisturbed_run(name: str, tmp_path: Path) -> None:
    """Fails when a run under the closed code's conventions that is interrupted goes on under others, or otherwise."""
    case = PARALLEL[name]
    undisturbed = Reactor(case).run()
    interrupted(case, tmp_path / "run", 0.09)
    resumed = Reactor(case).run(tmp_path / "run", resume=True)
    assert resumed.summary["conventions"] == {"preset": "closed-code", **CLOSED_CODE}
    assert_same_numbers(undisturbed.summary, resumed.summary, 1e-9)
    assert_same_state(undisturbed, resumed, 1e-9)


def test_a_run_does_not_go_on_under_other_conventions(tmp_path: Path) -> None:
    """Fails when a restart state of one convention is taken over by a case with another."""
    interrupted(PARALLEL["averaged"], tmp_path / "run", 0.09, MPI.COMM_SELF)
    other = PARALLEL["averaged"].with_({"transport.scheme": "fitted"})
    with pytest.raises(InputError, match=r"transport\.scheme"):
        Reactor(other, MPI.COMM_SELF).run(tmp_path / "run", resume=True)


@pytest.mark.parametrize("switch", ["porous.inertia", "motion.drag_reference"])
def test_a_flow_is_not_handed_to_other_conventions(switch: str) -> None:
    """Fails when a search or sweep takes over the flow of a case whose gas is moved otherwise."""
    one = zone(TIMES["averaged"], MICRO)
    with pytest.raises(InputError):
        Reactor(one.with_({switch: "superficial"}), MPI.COMM_SELF, flow=Reactor(one, MPI.COMM_SELF).flow)
