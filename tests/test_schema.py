"""JSON Schemas of all files: every property described, every shipped file valid, what is wrong found."""

import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from mpm.case.case import case_schema, load_case
from mpm.case.chemistry import mechanism_schema
from mpm.cli import main
from mpm.dem.case import DemCase, powder_schema
from mpm.dem.powder import POWDERS
from mpm.sweep.cluster import SLURM_OWN
from mpm.sweep.schema import sweep_schema
from mpm.sweep.sweepfile import AXIS_KEYS, RANGE_KEYS, SWEEP_KEYS

ROOT = Path(__file__).parent.parent
SCHEMAS = {"case": case_schema, "sweep": sweep_schema, "powder": powder_schema, "mechanism": mechanism_schema}
FILES = {
    "case": ["cases/*.toml", "cases/thesis/*.toml", "cases/dem_to_reactor/reactor.toml", "meshes/*.toml"],
    "sweep": ["cases/sweeps/*.toml"],
    "powder": ["cases/dem/*.toml", "cases/dem_to_reactor/powder.toml"],
    "mechanism": ["mpm/mechanisms/*.toml"],
}


def properties(schema: Any, place: str = "") -> list[tuple[str, dict[str, Any]]]:
    """Every property of a schema, with its address."""
    found = []
    if isinstance(schema, dict):
        for name, entry in schema.get("properties", {}).items():
            found.append((f"{place}.{name}", entry))
        for key, value in schema.items():
            found += properties(value, f"{place}.{key}")
    return found


@pytest.mark.parametrize("kind", SCHEMAS)
def test_every_property_says_what_it_means(kind: str) -> None:
    """Fails when a key is added to a kind of file without a description."""
    found = properties(SCHEMAS[kind]())
    assert len(found) >= 20
    assert [name for name, entry in found if len(entry.get("description", "")) < 10] == []
    assert "null" not in str(SCHEMAS[kind]()), "TOML has no null"


@pytest.mark.parametrize("kind", SCHEMAS)
def test_shipped_files_are_valid(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the schema that `mpm schema KIND` prints would mark a good file in an editor."""
    assert main(["schema", kind]) == 0
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema)
    files = [path for pattern in FILES[kind] for path in ROOT.glob(pattern)]
    assert files
    for path in files:
        jsonschema.validate(tomllib.loads(path.read_text(encoding="utf-8")), schema)


@pytest.mark.parametrize(
    ("kind", "old", "new"),
    [
        ("sweep", "[sweep]", "[sweep]\nmod = 'grid'"),
        ("sweep", "[sweep]", "[sweep]\nmode = 'grids'"),
        ("sweep", "[[sweep.axis]]", "[[sweep.axes]]"),
        ("sweep", "num = 7", "nums = 7"),
        ("powder", '"GL50"', '"GL51"'),
        ("powder", '"30 N/m"', "30"),
        ("powder", 'kind = "seed"', 'kind = "seeds"'),
        ("mechanism", 'equation = "TMA', 'equations = "TMA'),
        ("mechanism", '"72.09 g/mol"', "72.09"),
    ],
)
def test_what_an_editor_should_mark(kind: str, old: str, new: str) -> None:
    file = {
        "sweep": "cases/sweeps/dose.toml",
        "powder": "cases/dem/demo.toml",
        "mechanism": "mpm/mechanisms/alumina.toml",
    }[kind]
    text = (ROOT / file).read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(text.replace(old, new)), SCHEMAS[kind]())


def test_a_case_may_override_one_key_of_its_mechanism() -> None:
    """Fails when the schema of a case marks an entry as incomplete that the mechanism's file completes."""
    path = ROOT / "cases" / "single_zone.toml"
    changes = {
        "chemistry": {"reaction": {"tma": {"A": "0.8 m/s"}}, "species": {"TMA": {"molar_mass": "72 g/mol"}}}
    }
    jsonschema.validate(tomllib.loads(path.read_text(encoding="utf-8")) | changes, SCHEMAS["case"]())
    keys = {"chemistry.reaction.tma.A": "0.8 m/s", "chemistry.species.TMA.molar_mass": "72 g/mol"}
    assert load_case(path, keys).mechanism.get("TMA").molar_mass == pytest.approx(0.072)


def test_schemas_know_the_keys_that_are_read() -> None:
    """Fails when a reader takes a key that its schema, which is written by hand, does not have."""
    sweep = sweep_schema()["properties"]["sweep"]["properties"]
    axis = sweep["axis"]["items"]["properties"]
    assert (sorted(sweep), sorted(axis)) == (sorted(SWEEP_KEYS), sorted(AXIS_KEYS))
    assert (
        sorted(axis["linspace"]["properties"]) == sorted(axis["logspace"]["properties"]) == sorted(RANGE_KEYS)
    )
    assert sorted(sweep["slurm"]["properties"]) == sorted(SLURM_OWN)
    powder = powder_schema()["properties"]
    assert {*powder} == {*DemCase.model_fields} - {"directory"}
    assert powder["powder"]["anyOf"][0]["enum"] == [*POWDERS]


def test_an_unknown_kind_of_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "swep"]) == 2
    assert "case, sweep, powder, mechanism (did you mean sweep?)" in capsys.readouterr().err


def test_the_schema_of_mechanisms_knows_rate_laws() -> None:
    """Fails when an editor would mark what is right (one equilibrium constant or a table of it) or pass what is wrong."""
    check = jsonschema.Draft202012Validator(mechanism_schema()).is_valid

    def with_keys(**keys: Any) -> dict[str, Any]:
        return {"reaction": {"r": {"equation": "A + * <=> A*", "A": "1 m/s", **keys}}}

    for right in (
        {"equilibrium_constant": "2 m^3/mol"},
        {"equilibrium_constant": 2},
        {"equilibrium_constant": {"A": "2 m^3/mol", "Ea": "-40 kJ/mol"}},
        {"reverse": {"A": "1e13 1/s", "orders": {"A*": 1}, "coverage": {"A*": {"E": "5 kJ/mol"}}}},
        {"orders": {"A": 0.5}, "motz_wise": False},
    ):
        assert check(with_keys(**right)), right
    for wrong in (
        {"equilibrium_constant": True},
        {"reverse": "1e13 1/s"},
        {"reverse": {"sticking": 0.1}},
        {"orders": {"A": 5}},
        {"coverage": {"A*": 3}},
    ):
        assert not check(with_keys(**wrong)), wrong
    polynomials = {"temperatures": [200, 1000, 3500], "low": [0.0] * 7, "high": [0.0] * 7}
    assert check({"site": {"A*": {"nasa": polynomials, "sites": 2}}})
    assert not check({"site": {"A*": {"nasa": {**polynomials, "low": [0.0] * 6}}}})
    assert not check({"phase": "gas"})  # which a case says of a file of Cantera
