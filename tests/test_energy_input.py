"""The table [energy] and what belongs to it: what is read, what is filled in, what is refused, and isothermal cases as they were."""

import re
from pathlib import Path
from typing import Any

import pytest

from mpm.advice.checks import check_case
from mpm.advice.idle import idle_keys
from mpm.advice.screen import print_report
from mpm.advice.sketch import ASCII, BOXES, sketch
from mpm.case.case import Case, build_case, load_case
from mpm.case.keys import values
from mpm.case.sources import built_in_files, parse_toml
from mpm.errors import InputError
from mpm.guide.newcase import new_case

from .test_screen import text_of

HOT = {"temperature": "200 degC"}
ENERGY: dict[str, Any] = {"energy": {}}


def zone(*walls: dict[str, Any], **changes: Any) -> Case:
    """The single zone with temperature and these walls."""
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    return load_case("single_zone", {**ENERGY, "geometry.wall": list(walls), **keys})


# Isothermal cases


@pytest.mark.parametrize("name", sorted(built_in_files("cases")))
def test_a_case_without_energy_says_nothing_of_heat(name: str) -> None:
    """Fails when a key of temperature gets into the resolved case, and so into the content hash, of a case that has none."""
    case = load_case(name)
    if case.energy is not None:
        return
    text = case.to_toml()
    for word in (
        "energy",
        "wall",
        "bed_temperature",
        "heating",
        "enthalpy",
        "heat_of_reaction",
        "pore_diameter",
    ):
        assert word not in text, word
    assert {"heat_capacity", "conductivity"}.isdisjoint(case.to_dict()["gas"])
    assert all("temperature" not in inlet for inlet in case.to_dict()["geometry"]["inlet"])
    assert case.temperatures == (case.gas.temperature,)
    assert "energy" not in check_case(case)


def test_content_hashes_of_isothermal_cases_are_those_of_before() -> None:
    """Fails when results of before [energy] are no longer taken for those of the same case."""
    assert load_case("single_zone").content_hash()[:12] == "aad2aa7df8fe"
    assert load_case("first_case").content_hash()[:12] == "b100d86589ba"


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"geometry.wall": [{"side": "top", "end": "20 mm", **HOT}]}, "geometry.wall.top"),
        ({"geometry.inlet.tma.temperature": "300 K"}, "geometry.inlet.tma.temperature"),
        ({"geometry.bed_temperature": "300 K"}, "geometry.bed_temperature"),
        ({"geometry.layer.bed.heating": "1 W/m^3"}, "geometry.layer.bed.heating"),
    ],
)
def test_keys_of_temperature_ask_for_energy(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError) as caught:
        load_case("single_zone", changes)
    assert str(caught.value).startswith(f"single_zone: {key}: found a ") and "[energy]" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_properties_without_energy_are_named_as_idle() -> None:
    typed = {
        "gas.conductivity": "0.0454 W/m/K",
        "material.glass_beads.effective_conductivity": "0.2 W/m/K",
        "chemistry.species.TMA.enthalpy": "-80 kJ/mol",
        "chemistry.reaction.tma.heat_of_reaction": "-100 kJ/mol",
    }
    (sentence,) = idle_keys(load_case("single_zone", typed))
    assert set(sentence.partition(": ")[0].split(", ")) == set(typed)
    assert idle_keys(load_case("single_zone", {**ENERGY, **typed})) == []


# What is read and filled in


def test_an_empty_table_switches_temperature_on() -> None:
    """Fails when a default is missing in the resolved case, or reading that gives another case."""
    case = load_case("single_zone", ENERGY)
    assert case.energy is not None
    assert (case.energy.initial_temperature, case.energy.conductivity_model) == (473.0, "parallel")
    assert (case.energy.flow_update, case.energy.buoyancy, case.energy.soret) == (0.01, True, False)
    assert case.bed_temperature == 473.0 == case.inlet_temperature(case.geometry.inlets[0])
    again = load_case(case.to_dict())
    assert again == case and again.content_hash() == case.content_hash()
    tables = case.to_dict()
    assert tables["geometry"]["bed_temperature"] == "473.0 K" == tables["geometry"]["inlet"][0]["temperature"]
    assert (
        tables["gas"]["conductivity"].startswith("0.0374")
        and "enthalpy" in tables["chemistry"]["species"]["TMA"]
    )
    assert case.content_hash() != load_case("single_zone").content_hash()


def test_temperatures_with_their_units() -> None:
    case = zone(
        {"side": "top", "end": "20 mm", "temperature": "392 degF"}, geometry__bed_temperature="-10 °C"
    )
    assert case.geometry.walls[0].temperature == pytest.approx(473.15, abs=1e-12)
    assert case.bed_temperature == 263.15
    assert case.temperatures[0] == 263.15 and case.temperatures[-1] == case.geometry.walls[0].temperature


def test_names_and_ends_of_walls_are_filled_in() -> None:
    """Fails when a wall that nobody named cannot be addressed by key, or does not reach to the end of its side."""
    case = zone(
        {"side": "top", "end": "20 mm", **HOT},
        {"side": "top", "start": "20 mm", "end": "90 mm", "heat_flux": "1 kW/m^2"},
        {"side": "top", "start": "120 mm", "heat_transfer_coefficient": "10 W/m^2/K", "ambient": "300 K"},
        {"side": "bottom", "name": "plate", "end": "30 mm", **HOT},
    )
    assert [wall.name for wall in case.geometry.walls] == ["top", "top2", "top3", "plate"]
    assert [wall.start for wall in case.geometry.walls] == [0.0, 0.02, 0.12, 0.0]
    assert case.geometry.walls[2].end == case.geometry.length
    changed = case.with_({"geometry.wall.top2.temperature": "300 K"}).geometry.walls[1]
    assert (changed.temperature, changed.heat_flux) == (300.0, None)
    origin = {value.name: value.origin for value in values(case)}
    assert (
        origin["geometry.wall.top2.heat_flux"] == "typed" and origin["geometry.wall.top3.end"] == "worked out"
    )


def test_end_walls_of_a_closed_strip() -> None:
    case = zone({"side": "left", **HOT}, geometry__periodic=False)
    (wall,) = case.geometry.walls
    assert (wall.name, wall.start) == ("left", 0.0) and wall.end == pytest.approx(case.geometry.height)


def test_a_shared_geometry_brings_its_walls(tmp_path: Any) -> None:
    (tmp_path / "hot.toml").write_text(
        '[geometry]\nbase = "single_zone"\n[[geometry.wall]]\nside = "top"\nend = "20 mm"\ntemperature = "200 degC"\n'
    )
    mine = '[geometry]\nbase = "hot.toml"\n[[geometry.wall]]\nname = "top"\nheat_flux = "5 W/m^2"\n[energy]\n'
    (tmp_path / "case.toml").write_text(mine)
    (wall,) = load_case(tmp_path / "case.toml").geometry.walls
    assert (wall.end, wall.temperature, wall.heat_flux) == (0.02, None, 5.0)


def test_a_new_case_from_one_with_heat_is_that_one(tmp_path: Any) -> None:
    case = zone({"side": "top", "end": "20 mm", **HOT}, geometry__layer__bed__heating="1 W/cm^3")
    text = new_case(case, tmp_path)
    assert build_case(parse_toml(text, "new"), {}, tmp_path, "new") == case


# What is refused

TOP = {"side": "top", "end": "20 mm"}
REFUSED: dict[str, tuple[dict[str, Any], str, str]] = {
    "over a port": (
        {"geometry.wall": [{"side": "bottom", **HOT}]},
        "geometry.wall.bottom",
        "overlaps port purge at 32.925 mm to 36.925 mm; accepted: walls between the ports of this side: 0 mm to 32.925 mm, 36.925",
    ),
    "over a wall": (
        {"geometry.wall": [{**TOP, **HOT}, {**TOP, "start": "19 mm", "end": "30 mm", **HOT}]},
        "geometry.wall.top2",
        "overlaps wall top at 0 mm to 20 mm: two conditions at one place",
    ),
    "two conditions": (
        {"geometry.wall": [{**TOP, **HOT, "heat_flux": "1 W/m^2"}]},
        "geometry.wall.top.heat_flux",
        "temperature and heat_flux, 2 conditions at one place",
    ),
    "no condition": ({"geometry.wall": [TOP]}, "geometry.wall.top", "a wall without a condition"),
    "no surroundings": (
        {"geometry.wall": [{**TOP, "heat_transfer_coefficient": "1 W/m^2/K"}]},
        "geometry.wall.top.heat_transfer_coefficient",
        "without ambient",
    ),
    "surroundings alone": (
        {"geometry.wall": [{**TOP, "ambient": "300 K"}]},
        "geometry.wall.top.ambient",
        "without heat_transfer_coefficient",
    ),
    "beyond its side": (
        {"geometry.wall": [{"side": "top", "start": "120 mm", "end": "150 mm", **HOT}]},
        "geometry.wall.top.end",
        "a stretch of the top, 0 mm to 139.7 mm",
    ),
    "ends before it begins": (
        {"geometry.wall": [{"side": "top", "start": "60 mm", "end": "50 mm", **HOT}]},
        "geometry.wall.top.start",
        "a stretch of the top",
    ),
    "at an open end": (
        {"geometry.wall": [{"side": "left", **HOT}]},
        "geometry.wall.left.side",
        "geometry.periodic = false",
    ),
    "no such side": (
        {"geometry.wall": [{"side": "botom", **HOT}]},
        "geometry.wall.wall.side",
        "did you mean bottom?",
    ),
    "no side": ({"geometry.wall": [HOT]}, "geometry.wall.wall.side", "nothing"),
    "one name twice": (
        {"geometry.wall": [{**TOP, **HOT, "name": "a"}, {"side": "bottom", "end": "9 mm", **HOT, "name": "a"}]},
        "geometry.wall.a.name",
        "a different name for every wall",
    ),
    "misspelt key": (
        {"geometry.wall": [{**TOP, "temprature": "300 K"}]},
        "geometry.wall.top.temprature",
        "did you mean temperature?",
    ),
    "temperature without a unit": (
        {"geometry.wall": [{**TOP, "temperature": 473}]},
        "geometry.wall.top.temperature",
        "473 without a unit",
    ),
    "temperature below zero": (
        {"energy.initial_temperature": "-300 degC"},
        "energy.initial_temperature",
        "above 0 K",
    ),
    "number in quotes": (
        {"geometry.inlet.tma.temperature": "473"},
        "geometry.inlet.tma.temperature",
        "no unit",
    ),
    "no such model": (
        {"energy.conductivity_model": "paralel"},
        "energy.conductivity_model",
        "did you mean parallel?",
    ),
    "an update of two": ({"energy.flow_update": 2}, "energy.flow_update", "above 0 and below 1"),
    "a misspelt key of energy": ({"energy.bouyancy": True}, "energy.bouyancy", "did you mean buoyancy?"),
    "heating by area": ({"geometry.layer.bed.heating": "1 W/m^2"}, "geometry.layer.bed.heating", "1e5 W/m^3"),
    "powder without heat capacity": (
        {"material.p": {"porosity": 0.4, "particle_diameter": "30 um"}, "geometry.layer.bed.material": "p"},
        "material.p.heat_capacity",
        "layer bed has a temperature",
    ),
    "powder without conductivity": (
        {
            "material.p": {"porosity": 0.4, "particle_diameter": "30 um", "heat_capacity": "9e2 J/kg/K", "density": "2 g/cm^3"},
            "geometry.layer.bed.material": "p",
        },
        "material.p.conductivity",
        "or an effective_conductivity",
    ),
    "carrier of which nothing is known": (
        {"gas.carrier": "Kr", "gas.molar_mass": "83.8 g/mol", "gas.viscosity": "3e-5 Pa s"},
        "gas.heat_capacity",
        "one of the carriers N2, Ar, He",
    ),
    "enthalpies of a part": (
        {
            "chemistry.species.X": {"molar_mass": "72.09 g/mol", "formula": "Al(CH3)3"},
            "chemistry.reaction.cvd.equation": "X + 3 H2O -> 3 CH4 + Al(OH)3",
        },
        "chemistry.species.X.enthalpy",
        "no enthalpy of X, and one of others in reaction cvd",
    ),
    "sticking above one at a wall": (
        {
            "geometry.wall": [{**TOP, "temperature": "900 K"}],
            "chemistry.reaction.tma.sticking": 0.9,
            "chemistry.reaction.tma.b": 1,
            "chemistry.reaction.tma.reference_temperature": "473 K",
        },
        "chemistry.reaction.tma.sticking",
        "at 900 K",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_bad_input_is_one_line_that_says_where(name: str) -> None:
    changes, key, said = REFUSED[name]
    with pytest.raises(InputError) as caught:
        load_case("single_zone", {**ENERGY, **changes})
    line = str(caught.value)
    assert line.startswith(f"single_zone: {key}: found ") and said in line and "\n" not in line, line


def test_walls_may_touch_each_other_and_ports() -> None:
    """Fails when walls from port to port, which cover a whole side, are taken for overlapping."""
    spans = [("0 mm", "32.925 mm"), ("36.925 mm", "102.775 mm"), ("102.775 mm", "102.775001 mm")]
    walls = [{"side": "bottom", "start": a, "end": b, **HOT} for a, b in spans[:2]]
    assert [wall.name for wall in zone(*walls).geometry.walls] == ["bottom", "bottom2"]


def test_an_effective_conductivity_stands_in_for_the_model() -> None:
    case = zone(material__glass_beads__effective_conductivity="0.2 W/m/K")
    assert case.energy is not None
    beads, frit = case.materials["glass_beads"], case.materials["sintered_powder"]
    assert case.energy.conductivity_of(beads, 0.04) == pytest.approx(0.2)
    assert case.energy.conductivity_of(frit, 0.04) == pytest.approx(0.37 * 0.04 + 0.63 * 16.3)
    assert (case.energy.model_of(beads), case.energy.model_of(frit)) == ("given", "parallel")


# What check says


def test_check_gives_the_numbers_of_heat() -> None:
    """Glass beads, 3 mm, parallel: C_h 1.176e6 J/m3/K, 0.719 W/m/K, 14.7 s; the numbers of the design (5 to 15 s, some 10 ms)."""
    case = zone({"side": "bottom", "end": "20 mm", **HOT}, geometry__bed_temperature="25 degC")
    energy = check_case(case)["energy"]
    bed, layers = energy["bed"], energy["layers"]
    assert layers["bed"]["heat_capacity"] == pytest.approx(0.54 * 2500.0 * 871.0 + 0.46 * 759.17, rel=1e-5)
    assert layers["bed"]["conductivity"] == pytest.approx(0.46 * 0.0374727 + 0.54 * 1.3, rel=1e-6)
    assert layers["bed"]["model"] == "parallel" and layers["headspace"]["model"] == "gas"
    assert bed["diffusion_time"] == pytest.approx(
        9e-6 * layers["bed"]["heat_capacity"] / layers["bed"]["conductivity"]
    )
    assert bed["residence_over_diffusion_time"] == pytest.approx(0.1397 / 0.013 / bed["diffusion_time"])
    assert 5e-3 < bed["exchange_time"] < 30e-3
    assert bed["adiabatic_rise"] == pytest.approx(
        {"tma": 144730.0 * 58000.0 * 6.92e-8 / layers["bed"]["heat_capacity"]}
    )
    assert (
        layers["headspace"]["Rayleigh"]
        > layers["headspace"]["critical_Rayleigh"]
        == pytest.approx(1707.8, rel=1e-4)
    )
    assert layers["plenum"]["Rayleigh"] < 1707.8
    assert layers["bed"]["Darcy_Rayleigh"] < 1e-3 < layers["bed"]["critical_Darcy_Rayleigh"]
    assert (energy["lowest_temperature"], energy["highest_temperature"]) == (298.15, 473.15)


def test_check_warns_of_what_turns_over_and_of_heats_that_nobody_knows() -> None:
    cold = {"geometry.bed_temperature": "25 degC"}
    (warning,) = check_case(load_case("single_zone", {**ENERGY, **cold}))["warnings"]
    assert "headspace" in warning and "without the gas's own inertia" in warning
    heavy = load_case("single_zone", {**ENERGY, **cold, "energy.buoyancy": False})
    assert check_case(heavy)["warnings"] == []
    steady = load_case("single_zone", {**ENERGY, **cold, "fidelity": "steady"})
    assert "without the gas's own inertia" not in check_case(steady)["warnings"][0]
    ours = load_case("single_zone")
    tables = ours.to_dict()  # of an isothermal case: no enthalpies
    tables["chemistry"]["mechanism"] = "inline"
    unknown = check_case(load_case({**tables, **ENERGY}))
    assert unknown["energy"]["without_heat"] == ["tma", "water", "cvd"]
    assert any("no heat of reaction is known of tma, water, cvd" in line for line in unknown["warnings"])


@pytest.mark.parametrize(
    ("changes", "idle"),
    [
        ({"fidelity": "steady", "energy.initial_temperature": "300 K", "energy.flow_update": 0.02},
         {"energy.initial_temperature", "energy.flow_update"}),
        ({"geometry.bed_temperature": "300 K", "geometry.bed_inflow": "periodic"}, {"geometry.bed_temperature"}),
        ({"geometry.bed_temperature": "300 K", "motion.bed_velocity": "0 m/s"}, {"geometry.bed_temperature"}),
        ({"geometry.inlet.purge.temperature": "300 K", "geometry.inlet.purge.velocity": "0 m/s"}, {"geometry.inlet.purge.temperature"}),
        ({"material.glass_beads.effective_conductivity": "0.2 W/m/K", "material.glass_beads.conductivity": "1 W/m/K"},
         {"material.glass_beads.conductivity"}),
        ({"geometry.bed_temperature": "300 K", "energy.flow_update": 0.02}, set()),
    ],
)  # fmt: skip
def test_keys_of_temperature_without_effect_are_named(changes: dict[str, Any], idle: set[str]) -> None:
    case = load_case("single_zone", {**ENERGY, **changes})
    named = {key for sentence in idle_keys(case) for key in sentence.partition(": ")[0].split(", ")}
    assert {key for key in named if not key.startswith(("time.", "motion.", "output."))} == idle
    assert idle_keys(load_case(case.to_dict())) == idle_keys(case)


def test_the_screen_says_which_conductivity_it_is() -> None:
    """Fails when a line is wider than 80 columns, or a temperature of the case is not on the screen."""
    case = zone(
        {**TOP, "heat_transfer_coefficient": "10 W/m^2/K", "ambient": "30 degC"},
        {"side": "bottom", "end": "20 mm", **HOT},
        material__glass_beads__pore_diameter="23 um",
        geometry__layer__bed__heating="1 W/cm^3",
    )
    text = text_of(80, print_report, case, check_case(case))
    assert max(len(line) for line in text.splitlines()) <= 80
    words = " ".join(text.split())
    for part in (
        "wall bottom (bottom, 0 to 20 mm) held at 473.15 K",
        "10 W/m^2/K from surroundings at 303.15 K",
        "bed conducts 0.7192 W/m/K, parallel (default)",
        "heated by 1e6 W/m^3",
        "heat of reaction tma -144.7 kJ/mol",
        "Rayleigh number of headspace",
        "pores 23 um wide",
        "slip multiplies permeability by 1.028",
        "tma on all sites warms the bed by 0.4939 mK",
    ):
        assert part in words, part


def test_the_example_of_the_documents_is_a_case() -> None:
    """Fails when what docs/case_file.md shows of temperature is refused."""
    text = (Path(__file__).parents[1] / "docs" / "case_file.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```toml\n([^`]*\[energy\][^`]*)^```", text, re.MULTILINE)
    case = build_case(parse_toml(example, "document"), {}, Path(), "document")
    assert [wall.name for wall in case.geometry.walls] == ["bottom", "roof"]
    assert case.energy is not None and case.temperatures == (298.15, 300.0, 473.0, 473.15)


def test_the_sketch_shows_walls_that_give_or_take_heat() -> None:
    """Fails when such a wall is drawn as any other, in either set of characters, or one at an end is not named."""
    case = zone(
        {"side": "bottom", "end": "32.925 mm", **HOT}, {"side": "right", **HOT}, geometry__periodic=False
    )
    for pen, line in ((BOXES, "━"), (ASCII, "=")):
        lines = sketch(case, 80, pen)
        (floor,) = (text for text in lines if text.count(line) > 3)
        assert floor[1:19] == line * 18 and floor.count(line) == 18
        assert f"{line * 3}: walls that give or take heat; heat passes the right" in lines[-1]
    assert not any("heat" in text for text in sketch(load_case("single_zone"), 80))


def test_time_in_which_walls_warm_the_bed() -> None:
    """Fails when the way of heat from the walls is off: C h/(sum of 1/R), R of the layers between and half of the bed, by covered
    length."""
    case = load_case("heating")
    report = check_case(case)["energy"]
    layers, geometry = report["layers"], case.geometry
    k = {name: numbers["conductivity"] for name, numbers in layers.items()}
    half = 1.5e-3 / k["bed"]
    below = 5e-3 / k["plenum"] + 1.59e-3 / k["frit"] + half
    above = 12.7e-3 / k["headspace"] + half
    passed = (geometry.length - 8e-3) / geometry.length / below
    passed += (geometry.length - 10e-3) / geometry.length / above
    assert report["bed"]["wall_time"] == pytest.approx(layers["bed"]["heat_capacity"] * 3e-3 / passed)


def test_steady_heat_of_solids_that_come_back_through_walls_is_refused() -> None:
    """Fails when the bed's heat would leave at one end of a closed strip and not come in at the other."""
    changes = {"fidelity": "steady", "geometry.bed_inflow": "periodic", "geometry.periodic": False}
    with pytest.raises(InputError, match=r"geometry\.bed_inflow: found periodic solids between walls"):
        load_case("single_zone", {**changes, "energy": {}})
    for way in ({"geometry.periodic": True}, {"fidelity": "averaged"}, {"geometry.bed_inflow": "fresh"}):
        load_case("single_zone", {**changes, "energy": {}, **way})
