"""Keys of a case file: each has a meaning, a legal default and example; of a case, where each value comes from."""

import tomllib
from pathlib import Path

import pytest

from mpm.advice.idle import idle_keys
from mpm.case.case import Case, case_schema, load_case
from mpm.case.keys import READ_BY, Key, Value, all_keys, find_key, find_keys, keys_of, values
from mpm.case.schema import for_people, number_text
from mpm.errors import InputError
from mpm.units import parse

ROOT = Path(__file__).parent.parent
SILICA = {"porosity": 0.4, "particle_diameter": "30 um", "density": "2200 kg/m^3"}


def test_descriptions_keep_what_is_accepted_and_what_stands_in() -> None:
    table = case_schema()["$defs"]["Material"]["properties"]
    assert (
        'Accepted: a diameter above 0 m with its unit, e.g. "56 um"'
        in table["particle_diameter"]["description"]
    )
    assert "Left out: Bruggeman" in table["tortuosity_factor"]["description"]


@pytest.mark.parametrize("key", [key for key in all_keys() if not key.is_table], ids=lambda key: key.name)
def test_defaults_and_examples_are_toml(key: Key) -> None:
    """Fails when what `mpm explain` shows cannot be written into a file, is of another dimension, or a key has no example."""
    for text in (key.default, key.example):
        value = tomllib.loads(f"x = {text}")["x"] if text else None
        if key.unit and isinstance(value, str):
            parse(value, key.unit)
    assert key.description and key.kind
    assert key.default_text and key.example
    assert all(find_key(other) for other in key.related)


def test_defaults_are_those_of_the_classes() -> None:
    """Fails when a default that is shown is not the one that an empty case gets."""
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    bare = load_case({"geometry": {"length": "100 mm", "layer": layer}, "energy": {}})
    shown = {key.name: key.default for key in all_keys() if key.default}
    assert len(shown) > 30
    written = {key: tomllib.loads(f"x = {text}")["x"] for key, text in shown.items() if "<" not in key}
    assert bare.with_(written) == bare


def test_a_key_is_found_by_its_name_its_last_part_or_the_name_of_an_entry() -> None:
    assert find_key("geometry.inlet.tma.velocity").name == "geometry.inlet.<name>.velocity"
    assert find_key("velocity").name == "geometry.inlet.<name>.velocity"
    assert find_key("geometry.inlet.tma.mass_fractions.TMA").name.endswith("mass_fractions.<species>")
    assert find_key('chemistry.site."OAl(CH3)2".molar_mass').name == "chemistry.site.<name>.molar_mass"
    assert find_key("[[geometry.inlet]]") == find_key("geometry.inlet.tma") == find_key("geometry.inlet")
    assert {key.name for key in find_keys("density")} == {
        "gas.density", "material.<name>.density", "chemistry.film.<name>.density",
    }  # fmt: skip
    assert [key.last for key in keys_of("transport")] == [
        "scheme",
        "backflow_rows",
        "vibrational_dispersion",
    ]
    assert "velocity" in [key.last for key in keys_of("geometry.inlet")]


@pytest.mark.parametrize(
    ("name", "guess"),
    [
        ("motion.gama", "did you mean motion.gamma?"),
        ("velocty", "did you mean geometry.inlet.<name>.velocity?"),
        ("geometry.inlet.tma.velocty", "did you mean geometry.inlet.<name>.velocity?"),
        ("qqqq", "or a table: geometry, material, gas"),
        ("density", "one of material.<name>.density, gas.density"),
    ],
)
def test_an_unknown_key_gives_the_nearest(name: str, guess: str) -> None:
    with pytest.raises(InputError) as caught:
        find_key(name)
    assert guess in str(caught.value)


def origins(case: Case) -> dict[str, Value]:
    return {value.name: value for value in values(case)}


def test_where_the_values_of_a_case_come_from() -> None:
    found = origins(
        load_case("single_zone", {"material.silica": SILICA, "geometry.layer.bed.material": "silica"})
    )
    for name, text, origin in (
        ("title", "Single TMA zone", "typed"),
        ("geometry.layer.bed.material", "silica", "typed"),
        ("geometry.inlet.tma.velocity", "3.5 cm/s", "typed"),
        ("geometry.inlet.tma.center", "104.775 mm", "base"),
        ("geometry.bed_inflow", "fresh", "default"),
        ("material.silica.porosity", "0.4", "typed"),
        ("material.silica.kozeny_constant", "5", "worked out"),
        ("material.silica.site_density", "6.92e-8 mol/m^2", "default"),
        ("material.sintered_powder.tortuosity_factor", "2.85 / 2.68", "built-in"),
        ("chemistry.reaction.tma.A", "0.9 m/s", "built-in"),
        ("gas.density", "0.721663 kg/m^3", "worked out"),
        ("gas.diffusivity.TMA", "2.88e-5 m^2/s", "worked out"),
        ("motion.angle", "60 deg", "typed"),
        ("motion.startup", "developed", "default"),
    ):
        assert (found[name].text, found[name].origin) == (text, origin), name
        assert found[name].key == find_key(name)


def test_origins_of_what_is_said_once_for_all(tmp_path: Path) -> None:
    """One diffusivity for all species is typed for each; zones and windows that nobody typed are not."""
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    port = {"center": "50 mm", "width": "10 mm"}
    dose = {
        "name": "in",
        **port,
        "mass_fractions": {"TMA": 1e-4},
        "windows": [["1 s", "2 s"], ["3 s", "4 s"]],
    }
    tables = {"length": "100 mm", "layer": layer, "inlet": [dose], "outlet": [{"name": "out", **port}]}
    found = origins(load_case({"geometry": tables, "gas": {"diffusivity": "1e-5 m^2/s"}}))
    assert found["gas.diffusivity.H2O"].origin == "typed"
    assert found["geometry.inlet.in.windows"].text == "1 s to 2 s, 3 s to 4 s"
    assert found["geometry.zone.zone1.end"].origin == "worked out"
    own = ROOT / "mpm" / "mechanisms" / "alumina.toml"
    (tmp_path / "own.toml").write_text(own.read_text())
    (tmp_path / "case.toml").write_text(
        '[geometry]\nbase = "single_zone"\n[chemistry]\nmechanism = "own.toml"\n'
    )
    found = origins(load_case(tmp_path / "case.toml"))
    assert found["chemistry.reaction.cvd.A"].origin == "built-in"
    assert found["geometry.inlet.purge.velocity"].origin == "default"


OTHER = {
    "motion.gamma": 0.4, "motion.frequency": "20 Hz", "motion.angle": "50 deg", "motion.angle_from": "vertical",
    "motion.liftoff_velocity": "-0.5 cm/s", "motion.inlet_frame": "lab", "motion.startup": "impulsive", "motion.start": "70 ms",
    "time.end": "21 s", "time.step": "11 ms", "time.steps_per_cycle": 64, "output.every": "0.5 s", "output.checkpoint": "30 s",
    "energy.initial_temperature": "300 K", "energy.flow_update": 0.02,
}  # fmt: skip
"""A value that is not the default, of each key that not all fidelities read (but those that need others, or are refused)."""


@pytest.mark.parametrize("fidelity", ["resolved", "averaged", "steady"])
def test_fidelities_of_the_keys_are_those_of_a_case(fidelity: str) -> None:
    """Fails when `mpm explain` names a fidelity that `mpm check` says has no use for the key, or the other way round."""
    needs_others = {"motion.profile", "motion.liftoff_phase", "motion.contact_phase"}
    assert (
        OTHER.keys() | needs_others | {"transport.vibrational_dispersion", "output.phases"} == READ_BY.keys()
    )
    for name, value in OTHER.items():
        idle = idle_keys(load_case("first_case", {"fidelity": fidelity, name: value}))
        named = [key for sentence in idle for key in sentence.partition(":")[0].split(", ")]
        read = fidelity in READ_BY[name].partition(";")[0]
        assert read != (name in named), f"{name} in a {fidelity} run: {idle}"


def test_a_powder_of_ones_own_needs_particles_alone() -> None:
    """Kozeny-Carman with 5, the constant of packed spheres; the resolved case, which says so, is the same case."""
    case = load_case("single_zone", {"material.silica": SILICA, "geometry.layer.bed.material": "silica"})
    material = case.materials["silica"]
    assert material.kozeny_constant == 5.0
    assert material.permeability == pytest.approx((0.4**3 * 30e-6**2 / (180.0 * 0.6**2),) * 2, rel=1e-12)
    again = load_case(case.to_dict())
    assert again == case
    assert (
        again.with_({"material.silica.permeability": "1 um^2"}).materials["silica"].permeability[0] == 1e-12
    )


@pytest.mark.parametrize(
    ("number", "unit", "text"),
    [
        (0.00034, "m", "0.34 mm"), (56e-6, "m", "56 um"), (0.1397, "m", "139.7 mm"), (0.0, "m", "0 mm"), (0.035, "m/s", "3.5 cm/s"),
        (0.027, "s", "27 ms"), (0.25, "s", "0.25 s"), (0.0, "s", "0 s"),
        (4.25e-12, "m^2", "4.25 um^2"), (6.92e-8, "mol/m^2", "6.92e-8 mol/m^2"),
        (1.72e-5, "Pa*s", "1.72e-5 Pa s"), (-0.004, "m/s", "-0.4 cm/s"), (0.02801, "kg/mol", "28.01 g/mol"),
    ],
)  # fmt: skip
def test_quantities_as_people_write_them(number: float, unit: str, text: str) -> None:
    assert for_people(number, unit) == text
    assert parse(for_people(number, unit, exact=True), unit) == number
    third = number / 3.0
    assert parse(for_people(third, unit, exact=True), unit) == third


def test_numbers_as_people_write_them() -> None:
    assert [number_text(x) for x in (2e-4, 101325.0, 0.46, 1e9, -5e-5, 0.0)] == [
        "2e-4", "101325", "0.46", "1e9", "-5e-5", "0",
    ]  # fmt: skip
