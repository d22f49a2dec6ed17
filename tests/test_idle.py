"""Keys without effect are named to whoever typed them, and only those."""

from typing import Any

import pytest

from mpm.advice.checks import check_case
from mpm.advice.idle import idle_keys
from mpm.case.case import load_case
from mpm.dem.case import load_case as load_powder
from mpm.dem.idle import idle_keys as idle_in_powder
from mpm.sweep.sweepfile import read_sweep

from .cases import SHORT, TINY, physical_numbers, run, zone

BED = {"name": "bed", "height": "1 mm", "cells": 1, "material": "glass_beads", "moving": True}


def named(tables: dict[str, Any], changes: dict[str, Any] | None = None) -> set[str]:
    """Keys that are said to have no effect."""
    bed = {"length": "9 mm", "cell_width": "1 mm", "layer": [BED], **tables.pop("geometry", {})}
    case = load_case({**tables, "geometry": bed}, changes)
    sentences = check_case(case)["without_effect"]
    assert sentences == idle_keys(case)
    return {key for sentence in sentences for key in sentence.partition(": ")[0].split(", ")}


def test_defaults_are_not_spoken_of() -> None:
    assert named({"motion": {"gamma": 0.3, "angle": "60 deg", "startup": "developed"}}) == set()
    assert named({}) == set()
    assert named({"fidelity": "steady"}) == set()


@pytest.mark.parametrize(
    ("tables", "idle"),
    [
        ({"fidelity": "steady", "motion": {"gamma": 0.5, "start": "1 s"}}, {"motion.gamma", "motion.start"}),
        ({"fidelity": "steady", "time": {"end": "9 s", "step": "1 s"}}, {"time.end", "time.step"}),
        ({"fidelity": "steady", "output": {"every": "1 s", "checkpoint": "1 s"}}, {"output.every", "output.checkpoint"}),
        ({"motion": {"frequency": "20 Hz", "bed_velocity": "1 cm/s", "start": "1 s"}}, {"motion.frequency"}),
        ({"motion": {"gamma": 0.4}, "transport": {"vibrational_dispersion": True}}, set()),
        ({"fidelity": "resolved", "motion": {"gamma": 0.4, "startup": "impulsive"}, "time": {"step": "1 ms"}}, {"time.step"}),
        ({"fidelity": "resolved", "motion": {"liftoff_phase": "9 deg"}}, {"motion.liftoff_phase"}),
        ({"fidelity": "resolved", "motion": {"gamma": 0.0, "angle": "30 deg"}}, {"motion.angle"}),
        ({"fidelity": "resolved", "motion": {"gamma": 0.0, "frequency": "20 Hz"}}, set()),
        ({"motion": {"gamma": 0.0, "frequency": "20 Hz"}}, {"motion.frequency"}),
        ({"material": {"glass_beads": {"heat_capacity": "1 J/kg/K", "conductivity": "1 W/m/K", "density": "2 g/cm^3"}}},
         {"material.glass_beads.heat_capacity", "material.glass_beads.conductivity"}),
        ({"material": {"frit_felt": {"porosity": 0.6}}}, {"material.frit_felt"}),
        ({"geometry": {"layer": [{**BED, "grading": 0.5}]}}, {"geometry.layer.bed.grading"}),
        ({"geometry": {"bed_inflow": "periodic", "layer": [{**BED, "moving": False}]}}, {"geometry.bed_inflow"}),
        ({"chemistry": {"reaction": {"cvd": {"reference_temperature": "400 K"}}}}, {"chemistry.reaction.cvd.reference_temperature"}),
        ({"chemistry": {"species": {"TMA": {"elements": {"Al": 1, "C": 3, "H": 9}}}}}, {"chemistry.species.TMA.formula"}),
    ],
)  # fmt: skip
def test_a_typed_key_without_effect_is_named(tables: dict[str, Any], idle: set[str]) -> None:
    assert named(tables) == idle


@pytest.mark.parametrize("name", ["single_zone", "single_cycle"])
@pytest.mark.parametrize("fidelity", ["averaged", "resolved", "steady"])
def test_a_resolved_case_names_what_its_own_case_did(name: str, fidelity: str, tmp_path: Any) -> None:
    """Fails when the case that a run writes, with every key in it, is told that most of them have no effect."""
    case = load_case(
        name, {"fidelity": fidelity, "motion.gamma": 0.4, "material.glass_beads.conductivity": "2 W/m/K"}
    )
    (tmp_path / "case.toml").write_text(case.to_toml(), encoding="utf-8")
    again = load_case(tmp_path / "case.toml")
    assert idle_keys(again) == idle_keys(case) != []
    assert "material.glass_beads.conductivity: " in " ".join(idle_keys(case))


def test_overrides_count_as_typed() -> None:
    assert named({}, {"motion.gamma": 0.4, "material.glass_beads.conductivity": "2 W/m/K"}) == {
        "motion.gamma",
        "material.glass_beads.conductivity",
    }


@pytest.mark.parametrize("fidelity", ["averaged", "steady"])
def test_what_is_called_idle_changes_no_number(fidelity: str) -> None:
    """Fails when a run reads a key that check says it does not."""
    base = {**SHORT, "fidelity": fidelity}
    changes = {
        "motion.gamma": 0.45, "motion.frequency": "23 Hz", "motion.angle": "40 deg", "motion.liftoff_velocity": "-0.3 cm/s",
        "motion.startup": "impulsive", "time.steps_per_cycle": 8, "material.glass_beads.heat_capacity": "1 J/kg/K",
    }  # fmt: skip
    if fidelity == "steady":
        changes |= {"motion.start": "0.3 s", "time.end": "3 s", "time.step": "1 ms", "output.every": "1 s"}
    other = zone({**base, **changes}, TINY)
    said = " ".join(idle_keys(other))
    assert [key for key in changes if key not in said] == []
    one, two = (physical_numbers(run(case)[1].summary) for case in (zone(base, TINY), other))
    for numbers in (one, two):
        numbers.pop("simulated_seconds", None)
    assert one == two


def test_powder_and_sweep_files(tmp_path: Any) -> None:
    powder = {
        "powder": {"base": "GL50", "ergun": [150, 1.75], "stiffness": "100 N/m"},
        "waveform": {"kind": "sine", "gamma": 0.3, "frequency": "16 Hz"},
        "box": {"baffle_width": "1 mm", "cohesion": False, "frit_diameter": "25 um"},
    }
    assert list(idle_in_powder(load_powder(powder))) == [
        "box.frit_diameter, box.baffle_width: box.base is flat",
        "powder.stiffness: the contacts have box.stiffness",
        "powder.ergun: there is no [gas]",
    ]
    axis = '[[sweep.axis]]\nkey = "motion.gamma"\nlinspace = { start = 0.2, stop = 0.4, num = 2 }\n'
    for mode, idle in (
        ("grid", ("sweep.samples", "sweep.seed")),
        ("sample", ("sweep.axis (motion.gamma).num",)),
    ):
        text = f'[sweep]\ncase = "single_zone"\nmode = "{mode}"\nsamples = 4\nseed = 2\n{axis}'
        (tmp_path / "sweep.toml").write_text(text, encoding="utf-8")
        assert read_sweep(tmp_path / "sweep.toml").idle == idle


def test_entropies_are_idle_without_an_equilibrium() -> None:
    """Fails when an entropy or a reference pressure that nothing reads passes in silence, or one that an equilibrium reads is named."""
    nothing = {"elements": {}, "enthalpy": "0 J/mol", "entropy": "0 J/mol/K"}
    site = {"*": nothing, "A*": {**nothing, "enthalpy": "-90 kJ/mol"}}
    species = {
        "A": {"molar_mass": "20 g/mol", "elements": {}, "enthalpy": "0 J/mol", "entropy": "150 J/mol/K"}
    }
    reaction = {"on": {"equation": "A + * -> A*", "A": "1 m/s"}}
    chemistry = {
        "mechanism": "inline",
        "species": species,
        "site": site,
        "reaction": reaction,
        "reference_pressure": "1 atm",
    }
    tables = {"geometry": {"base": "single_zone"}, "chemistry": chemistry}
    one_way = idle_keys(load_case(tables))
    assert any(
        "chemistry.species.A.enthalpy" in line and "chemistry.site.A*.entropy" in line for line in one_way
    )
    assert any(line.startswith("chemistry.reference_pressure: no way back") for line in one_way)
    both_ways = idle_keys(load_case(tables, {"chemistry.reaction.on.equation": "A + * <=> A*"}))
    assert not any("chemistry.s" in line or "reference_pressure" in line for line in both_ways)
