"""Reading and writing of case files as plain tables, before and after they are validated.

A case is put together from several sources: the file, the shared geometry that it names as `geometry.base`, the
built-in materials and the reaction mechanism it refers to, and overrides by dotted key (`--set`, sweeps). They are
merged here, later ones over earlier ones; entries of lists are matched by their `name`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import tomli_w

from mpm.case.cantera_file import cantera_tables, is_cantera
from mpm.case.conventions import preset_tables
from mpm.case.materials import BUILT_IN
from mpm.case.merging import Table, replaced
from mpm.case.merging import merge as merge  # offered here too
from mpm.case.profile import PRESETS
from mpm.case.ratetables import as_equilibrium_table
from mpm.case.walls import name_walls
from mpm.errors import InputError
from mpm.files import is_file, read_text
from mpm.spelling import quotes_advice

_OF_MECHANISM = ("chemistry.mechanism", "chemistry.phase", "chemistry.gas_reactions")
_KEYS = ("mechanism", "phase", "gas_reactions")
_SOURCES = ("conventions", "geometry.base", *_OF_MECHANISM)
"""Keys that name what the other tables lie over."""
DEEPEST = 30
"""Levels of tables and lists in a file; a case needs five."""


def read_toml(path: Path) -> Table:
    """Parse a TOML file; InputError when it is missing, unreadable or no TOML."""
    return parse_toml(read_source(path), path)


def read_source(path: Path) -> str:
    """The text of an input file; InputError when it is missing or unreadable."""
    try:
        return read_text(path)
    except FileNotFoundError:
        raise InputError.at(path, "", "no such file", "the path of a TOML file") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError.at(path, "", f"an unreadable file ({reason})", "a TOML file") from None


def parse_toml(text: str, source: str | Path) -> Table:
    """Parse the text of a TOML file; InputError for what is none."""
    try:
        table = tomllib.loads(text)
        if _deeper_than(DEEPEST, table):
            raise ValueError(f"tables or lists nested more than {DEEPEST} deep")
        return table
    except tomllib.TOMLDecodeError as error:
        found = f"a TOML syntax error ({error})"
        raise InputError.at(source, "", found, f"valid TOML{quotes_advice(text, str(error))}") from None
    except (
        ValueError,
        RecursionError,
    ) as error:  # an integer of 5,000 digits, a list in a list in a list ...
        raise InputError.at(source, "", f"more than can be read ({error})", "valid TOML") from None


def _deeper_than(levels: int, value: Any) -> bool:
    """Whether tables and lists are nested in more than so many levels."""
    if not isinstance(value, dict | list):
        return False
    inner = value.values() if isinstance(value, dict) else value
    return levels == 0 or any(_deeper_than(levels - 1, entry) for entry in inner)


def built_in_files(folder: str) -> dict[str, Path]:
    """Names and paths of the files that come with mpm in `folder`: cases, meshes or mechanisms."""
    package = Path(__file__).parents[1]
    files = {
        path.stem: path for place in (package, package.parent) for path in (place / folder).glob("*.toml")
    }
    return dict(sorted(files.items()))


def find_file(folder: str, name: str, near: Path, source: str, key: str) -> Path:
    """The file that `name` stands for: a path relative to the folder `near`, or a built-in of `folder`."""
    built_in = built_in_files(folder)
    path = near / name
    if name in built_in and not is_file(path):
        return built_in[name]
    if not is_file(path):
        raise InputError.at(
            source,
            key,
            f"{name!r}, no such file",
            f"a path, or one of {', '.join(built_in)}",
            given=Path(name).name,
            known=built_in,
        )
    return path.resolve()


def set_key(data: Table, key: str, value: Any, source: str, kept: Collection[str] = ()) -> None:
    """Set the entry at a dotted key such as `geometry.inlet.tma.velocity`; list entries are addressed by their name.

    It replaces other ways to say the same, except for the `kept` dotted keys: those were set beside it.
    """
    node: Any = data
    parts = key.split(".")
    for i, part in enumerate(parts[:-1]):
        place = ".".join(parts[: i + 1])
        if isinstance(node, dict):
            if part not in node:
                _replace(node, part, parts[:i], kept)
            node = node.setdefault(part, {})
        else:
            node = _entry(node, part, place, source)
        if not isinstance(node, (dict, list)):
            raise InputError.at(source, key, f"{place} = {node!r}", f"a key; {place} has no parts")
    if isinstance(node, list):
        raise InputError.at(source, key, "a whole entry", "a key of that entry, such as name", given="")
    value = value.tolist() if hasattr(value, "tolist") else value  # numpy scalars and arrays
    _replace(node, parts[-1], parts[:-1], kept)
    node[parts[-1]] = deepcopy(value)


def _replace(table: Table, key: str, place: Sequence[str], kept: Collection[str]) -> None:
    """Take out of a table what `key`, about to be written, says in another way, but for what is set beside it."""
    for rival in replaced(table, key):
        name = ".".join((*place, rival))
        if not any(other == name or other.startswith(f"{name}.") for other in kept):
            table.pop(rival, None)


def _entry(entries: list[Any], name: str, place: str, source: str) -> Any:
    named = {str(entry.get("name")): entry for entry in entries if isinstance(entry, dict)}
    if name not in named:
        raise InputError.at(
            source, place, f"no entry named {name!r}", f"one of {', '.join(named)}", known=named
        )
    return named[name]


def assemble(data: Mapping[str, Any], overrides: Mapping[str, Any], folder: Path, source: str) -> Table:
    """Put a complete table together from the file's own, everything it refers to, and the overrides.

    Paths in the file are relative to `folder`; `source` is what messages call the file. Entries of a wrong type are
    left as they are: validation, which comes next, says so.
    """
    result: Table = deepcopy(dict(data))
    for key in _SOURCES:  # these decide what the other keys refer to
        if key in overrides:
            set_key(result, key, overrides[key], source)
    if "geometry" in result:
        result["geometry"] = _with_base(result["geometry"], folder, source)
    result = merge(preset_tables(result.get("conventions")), result)
    _insert_mechanism(
        result, folder, source, "energy" in result or any(_is_below(k, "energy") for k in overrides)
    )
    _spread_equilibria(result)
    gas = result.setdefault("gas", {})
    if isinstance(gas, dict) and not isinstance(gas.get("diffusivity", {}), dict):
        gas["diffusivity"] = {"default": gas["diffusivity"]}
    for key, value in overrides.items():
        if key not in _OF_MECHANISM:  # its tables are all there by now
            set_key(result, key, value, source, overrides)
    _insert_materials(result, source)
    _spread_diffusivity(result)
    profile = _table(result, "motion").get("profile", "thesis")
    if isinstance(profile, str) and profile not in PRESETS:
        path = folder / profile
        result["motion"]["profile"] = str(path.resolve() if is_file(path) else path)
    return result


def _table(data: Mapping[str, Any], key: str) -> Table:
    value = data.get(key, {})
    return value if isinstance(value, dict) else {}


def _with_base(geometry: Any, folder: Path, source: str, seen: tuple[Path, ...] = ()) -> Any:
    """The geometry laid over the shared one that it names as its base, which may have a base itself."""
    if not isinstance(geometry, dict) or not isinstance(geometry.get("base"), str):
        return geometry
    path = find_file("meshes", geometry["base"], folder, source, "geometry.base")
    if path in seen:
        raise InputError.at(source, "geometry.base", f"{path.name}, which leads back here", "another file")
    shared = _with_base(
        name_walls(read_toml(path).get("geometry", {})), path.parent, str(path), (*seen, path)
    )
    return merge(shared, {key: value for key, value in geometry.items() if key != "base"})


def shared_geometry(
    data: Mapping[str, Any], overrides: Mapping[str, Any], folder: Path, source: str
) -> Table:
    """The geometry that a case names as its base, alone; empty without one."""
    name = overrides.get("geometry.base", _table(data, "geometry").get("base"))
    return _with_base({"base": name}, folder, source) if isinstance(name, str) else {}


def mechanism_tables(
    data: Mapping[str, Any], overrides: Mapping[str, Any], folder: Path, source: str
) -> Table:
    """The tables of the mechanism that a case names, alone; empty for an inline one."""
    chemistry = mechanism_source(data, overrides)
    name = chemistry["mechanism"]
    if is_cantera(name):
        return cantera_tables(chemistry, folder, source, heats=True)
    return {} if name == "inline" else read_toml(find_file("mechanisms", name, folder, source, ""))


def mechanism_source(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> Table:
    """What says where a case's mechanism comes from: `mechanism`, and of a file of Cantera `phase` and `gas_reactions`."""
    said = {key.rpartition(".")[2]: overrides[key] for key in _OF_MECHANISM if key in overrides}
    chemistry = _table(data, "chemistry")
    return {"mechanism": "alumina", **{key: chemistry[key] for key in _KEYS if key in chemistry}, **said}


def _is_below(key: str, table: str) -> bool:
    return key == table or key.startswith(f"{table}.")


def _insert_mechanism(data: Table, folder: Path, source: str, heats: bool) -> None:
    chemistry = data.setdefault("chemistry", {})
    name = chemistry.setdefault("mechanism", "alumina") if isinstance(chemistry, dict) else None
    if not isinstance(name, str) or name == "inline":
        return
    if is_cantera(name):
        tables = cantera_tables(mechanism_source(data, {}), folder, source, heats)
        own = {key: value for key, value in chemistry.items() if key not in _KEYS}
        data["chemistry"] = {**merge({"name": Path(name).stem, **tables}, own), "mechanism": "inline"}
        return
    path = find_file("mechanisms", name, folder, source, "chemistry.mechanism")
    data["chemistry"] = merge({"name": path.stem, **read_toml(path)}, chemistry)
    if path != built_in_files("mechanisms").get(name):
        data["chemistry"]["mechanism"] = (
            "inline"  # the tables are all here now: the case no longer needs the file
        )


def _spread_equilibria(data: Table) -> None:
    """Equilibrium constants as the tables that they are short for, whose keys can then be set."""
    reactions = _table(_table(data, "chemistry"), "reaction")
    for reaction in reactions.values():
        if isinstance(reaction, dict) and "equilibrium_constant" in reaction:
            reaction["equilibrium_constant"] = as_equilibrium_table(reaction["equilibrium_constant"])


def _insert_materials(data: Table, source: str) -> None:
    given = data.setdefault("material", {})
    layers = _table(data, "geometry").get("layer", [])
    if not isinstance(given, dict) or not isinstance(layers, list):
        return
    for layer in layers:
        name = layer.get("material") if isinstance(layer, dict) else None
        if not isinstance(name, str):
            continue
        if name not in given and name not in BUILT_IN:
            known = list(dict.fromkeys((*given, *BUILT_IN)))
            raise InputError.at(
                source,
                f"geometry.layer.{layer.get('name', '?')}.material",
                repr(name),
                f"a table [material.{name}], or one of {', '.join(known)}",
                given=name,
                known=known,
            )
        given.setdefault(name, {})
    sites = list(_table(_table(data, "chemistry"), "site"))
    for name, table in given.items():
        if isinstance(table, dict):
            given[name] = table = merge(BUILT_IN.get(name, {}), table)
            coverage = table.setdefault("initial_coverage", dict.fromkeys(sites[:1], 1.0))
            if isinstance(coverage, dict):
                table["initial_coverage"] = {**dict.fromkeys(sites, 0.0), **coverage}


def _spread_diffusivity(data: Table) -> None:
    gas = _table(data, "gas")
    values = gas.get("diffusivity", {})
    if isinstance(values, (dict, str)):
        values = {"default": values} if isinstance(values, str) else dict(values)
        if "default" in values:
            species = _table(_table(data, "chemistry"), "species")
            values = {**dict.fromkeys(species, values.pop("default")), **values}
        gas["diffusivity"] = values


def write_toml(data: Mapping[str, Any]) -> str:
    """Format a table as TOML; lists of tables come as `[[...]]`, everything else on its own line."""
    return tomli_w.dumps(data, indent=2)
