"""What is said of conventions: by `mpm check` and its JSON, on the page of a run, by `mpm compare`, of switches that nothing reads."""

import json
from pathlib import Path
from typing import Any

import pytest

from mpm.advice.checks import check_case
from mpm.advice.conventions import WORDS
from mpm.advice.idle import idle_keys
from mpm.case.case import load_case
from mpm.case.conventions import CLOSED_CODE, SWITCHES, conventions_of
from mpm.case.keys import find_key
from mpm.cli import main
from mpm.output.compare import changed_keys
from mpm.page.run_page import run_html, run_page
from mpm.reactor.reactor import Reactor
from mpm.report.trees import flatten

from .cases import MPI, zone
from .test_check_screen import words
from .test_convention_runs import MICRO, OPTIONS, TIMES


def test_every_value_has_its_words() -> None:
    """Fails when a value of a switch that is not this model's own has none, or one that is, has."""
    usual = conventions_of(zone({}, MICRO))
    values = {(key, value) for key, options in OPTIONS.items() for value in options}
    assert set(WORDS) == {(key, value) for key, value in values if usual[key] != value}


def test_check_tells_the_conventions(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a case as it comes takes more than a line, when a switch that differs is not told with its equation and origin, or the
    JSON has other switches than summary.json."""
    plain = words(zone({}, MICRO))
    assert "Conventions preset mpm (default): all switches are this model's own" in plain
    assert all(text not in plain for text in WORDS.values())
    one = words(zone({"transport.scheme": "upwind"}, MICRO))
    assert (
        "transport.scheme species and heat by first-order upwinding, which adds |u| h/2 to diffusion " in one
    )
    assert "model's own" not in one and one.count("(built-in)") == plain.count("(built-in)")
    closed = words(zone({"conventions": "closed-code", "porous.diffusion": "printed"}, MICRO))
    assert "Conventions preset closed-code transport.scheme" in closed
    assert "diffusion in pores eps D/tau, not eps D/tau^2 porous.inertia" in closed
    assert WORDS["porous.inertia", "superficial"] + " (built-in)" in closed
    assert main(["check", "single_zone", "--json", "--set", "conventions=closed-code"]) == 0
    found = json.loads(capsys.readouterr().out)["conventions"]
    assert list(found.pop("differing")) == list(SWITCHES)
    assert found == {"preset": "closed-code", **CLOSED_CODE}


def test_the_page_of_a_run_and_two_runs_beside_each_other(tmp_path: Path) -> None:
    """Fails when a reader of a run's page, or of two runs that are compared, is not told that they were computed otherwise."""
    one, other = (zone({**TIMES["averaged"], "conventions": name}, MICRO) for name in ("mpm", "closed-code"))
    changed = {found.key: (found.first, found.second) for found in changed_keys(one, other)}
    assert changed.keys() == {"conventions", *SWITCHES}
    assert changed["transport.scheme"] == ("fitted", "upwind")
    Reactor(other, MPI.COMM_SELF).run(tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["conventions"] == {"preset": "closed-code", **CLOSED_CODE}
    assert not [
        name for name in flatten(summary) if "conventions" in name
    ]  # no result, though one of them is a number
    html = run_html(run_page(tmp_path / "run", budget=0))
    for key, value in CLOSED_CODE.items():
        assert WORDS[key, value].replace("'", "&#39;") in html, key


BED = {"name": "bed", "height": "1 mm", "cells": 1, "material": "glass_beads", "moving": True}
GAS = {"name": "gas", "height": "1 mm", "cells": 1}
PORT = {"center": "1.5 mm", "width": "1 mm"}
OTHER = {key: options[-1] for key, options in OPTIONS.items()}


@pytest.mark.parametrize(
    ("layers", "more", "idle"),
    [
        ([GAS], {}, {"porous.diffusion", "porous.inertia", "porous.reaction_volume", "motion.drag_reference", "transport.backflow_rows",
                     "geometry.inlet_diffusion"}),
        ([BED], {}, {"transport.backflow_rows", "geometry.inlet_diffusion"}),
        ([BED], {"geometry.outlet": [{"name": "out", **PORT}]}, {"geometry.inlet_diffusion"}),
        ([{**BED, "moving": False}], {}, {"motion.drag_reference", "transport.backflow_rows", "geometry.inlet_diffusion"}),
        ([BED], {"motion.bed_velocity": "0 m/s"}, {"motion.drag_reference", "transport.backflow_rows", "geometry.inlet_diffusion"}),
        ([BED], {"motion.bed_velocity": "0 m/s", "motion.gamma": 0.3, "motion.profile": "thesis", "fidelity": "resolved"},
         {"transport.backflow_rows", "geometry.inlet_diffusion"}),
        ([BED], {"chemistry.mechanism": "titania"}, {"transport.backflow_rows", "geometry.inlet_diffusion"}),
    ],
)  # fmt: skip
def test_a_switch_that_nothing_reads_is_named(
    layers: list[dict[str, Any]], more: dict[str, Any], idle: set[str]
) -> None:
    """Fails when a switch that somebody typed has no effect and is not named, or is named where it has one; the scheme always has one."""
    tables = {"geometry": {"length": "9 mm", "cell_width": "1 mm", "layer": layers}}
    found = idle_keys(load_case(tables, {**OTHER, **more}))
    named = {key for sentence in found for key in sentence.partition(":")[0].split(", ")}
    if not load_case(tables, more).mechanism.gas_reactions:
        idle = idle | {"porous.reaction_volume"}
    assert named & set(SWITCHES) == idle


def test_nobody_typed_what_a_preset_brings(tmp_path: Path) -> None:
    """Fails when switches of the preset, which nobody asked for one by one, are said to have no effect, in the case of a run either."""
    tables = {"geometry": {"length": "9 mm", "cell_width": "1 mm", "layer": [GAS]}, "conventions": "closed-code"}  # fmt: skip
    case = load_case(tables)
    assert idle_keys(case) == []
    (tmp_path / "case.toml").write_text(case.to_toml(), encoding="utf-8")
    assert idle_keys(load_case(tmp_path / "case.toml")) == []
    typed = load_case(tables, {"porous.diffusion": "effective"})
    assert idle_keys(typed) == ["porous.diffusion: no layer is porous"]


def test_a_preset_that_comes_too_late_is_named(tmp_path: Path) -> None:
    """Fails when the preset, set over the case.toml of a run, in which every switch is typed, is silently without effect."""
    for name, other in (("mpm", "closed-code"), ("closed-code", "mpm")):
        path = tmp_path / f"{name}.toml"
        path.write_text(zone({"conventions": name}, MICRO).to_toml(), encoding="utf-8")
        assert not any(said.startswith("conventions") for said in idle_keys(load_case(path)))
        told = idle_keys(load_case(path, {"conventions": other}))
        assert "conventions: every switch is typed, and otherwise" in told


@pytest.mark.parametrize(
    ("drag", "inertia", "share"),
    [
        ("pore", "interstitial", ""),
        ("superficial", "superficial", ""),
        ("pore", "superficial", "0.46 times"),
        ("superficial", "interstitial", "2.17 times"),
    ],
)
def test_drag_and_inertia_that_do_not_go_together(drag: str, inertia: str, share: str) -> None:
    """Fails when check does not warn of a flow that depends on the frame of its observer, or warns of one that does not, or of a bed at
    rest."""
    changes = {"motion.drag_reference": drag, "porous.inertia": inertia}
    found = [w for w in check_case(zone(changes, MICRO))["warnings"] if "frame of the observer" in w]
    assert len(found) == bool(share) and all(f"brings {share} the bed's velocity" in w for w in found)
    still = {"motion.bed_velocity": "0 m/s", "motion.gamma": 0.0}
    rest = check_case(zone({**changes, **still}, MICRO))["warnings"]
    assert not any("frame of the observer" in w for w in rest)


def test_switches_are_explained_beside_the_preset() -> None:
    """Fails when `mpm explain` of a switch does not lead to the preset, or of the preset not to each switch."""
    assert set(find_key("conventions").related) >= set(SWITCHES)
    assert all("conventions" in find_key(key).related for key in SWITCHES)
