"""Every key of a case file, with what a person wants to know of it; and for a case, where each of its values comes from.

    find_key("motion.gamma").description
    for value in values(case): print(value.name, value.text, value.origin)

All of it is read off the classes that parse a case, and their JSON Schema.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, get_args, get_origin

from pydantic import BaseModel

from mpm.caseio import built_in_files, mechanism_tables, shared_geometry
from mpm.errors import InputError, nearest
from mpm.materials import BUILT_IN
from mpm.schema import finished, for_people, number_text
from mpm.units import parse

if TYPE_CHECKING:
    from mpm.case import Case

Address = tuple[str, ...]

_ENTRIES = {
    "mass_fractions": "species",
    "diffusivity": "species",
    "initial_coverage": "site",
    "elements": "element",
}
"""What the entries of a table of numbers are named after."""

_CYCLE = "resolved; averaged and steady only with transport.vibrational_dispersion"
_TIMED = "resolved, averaged"
READ_BY = {
    **dict.fromkeys(
        (f"motion.{key}" for key in ("frequency", "angle", "angle_from", "liftoff_velocity", "inlet_frame")),
        _CYCLE,
    ),
    "motion.gamma": f"{_CYCLE} (0 is read by all)",
    "motion.profile": f"{_CYCLE} (the mean of a file is read by all)",
    "motion.liftoff_phase": _CYCLE,
    "motion.contact_phase": _CYCLE,
    "motion.startup": "resolved",
    "motion.start": _TIMED,
    "time.end": _TIMED,
    "time.step": "averaged",
    "time.steps_per_cycle": _CYCLE,
    "output.every": _TIMED,
    "output.checkpoint": _TIMED,
    "output.phases": "resolved",
    "transport.vibrational_dispersion": "averaged, steady",
}
"""Fidelities that read a key, where not all of them do (`mpm.idle` says so of a case)."""

_PARTICLES = ("porosity", "particle_diameter", "sphericity")
_TOGETHER = (
    ("motion.gamma", "motion.frequency", "motion.angle", "motion.angle_from", "motion.bed_velocity", "motion.profile"),
    ("motion.profile", "motion.liftoff_velocity", "motion.liftoff_phase", "motion.contact_phase", "motion.bed_velocity"),
    ("motion.bed_velocity", "geometry.layer.<name>.moving", "geometry.bed_inflow"),
    tuple(f"material.<name>.{key}" for key in ("permeability", *_PARTICLES, "kozeny_constant")),
    tuple(f"material.<name>.{key}" for key in ("surface_to_volume", *_PARTICLES)),
    ("material.<name>.surface_to_volume", "material.<name>.site_density", "material.<name>.initial_coverage"),
    ("geometry.inlet.<name>.start", "geometry.inlet.<name>.stop", "geometry.inlet.<name>.windows"),
    ("geometry.inlet.<name>.velocity", "geometry.inlet.<name>.width", "geometry.inlet.<name>.mass_fractions"),
    ("geometry.length", "geometry.cell_width", "geometry.periodic"),
    ("geometry.layer.<name>.height", "geometry.layer.<name>.cells", "geometry.layer.<name>.grading"),
    ("output.phases", "output.every", "time.steps_per_cycle", "motion.frequency"),
    ("gas.carrier", "gas.molar_mass", "gas.viscosity", "gas.density", "gas.temperature", "gas.pressure"),
    ("gas.diffusivity", "gas.carrier", "gas.temperature", "gas.pressure"),
    ("fidelity", "time.end", "time.step", "time.steps_per_cycle", "transport.vibrational_dispersion"),
    tuple(f"chemistry.reaction.<name>.{key}" for key in ("equation", "sticking", "A", "b", "Ea", "reference_temperature")),
)  # fmt: skip
"""Keys that are set with an eye on each other."""


_REQUIRED = {
    "geometry": "required, here or in geometry.base",
    "material": "required for a material of your own",
    "chemistry": "required for an entry of your own",
}


def _built_in_choices() -> dict[str, tuple[str, ...]]:
    """Names that a key takes beside the path of a file or a table of the case."""
    return {
        "geometry.base": tuple(built_in_files("meshes")),
        "geometry.layer.<name>.material": tuple(BUILT_IN),
        "chemistry.mechanism": (*built_in_files("mechanisms"), "inline"),
    }


@dataclass(frozen=True)
class Key:
    """One key of a case file. `name` is dotted; <name> stands for the name of an entry, as in `geometry.inlet.<name>.velocity`.

    kind: what may stand there, in words; unit: SI ("" for what has none); default, example: as a file writes them ("" if there is none);
    required: a case must give it; worked_out: what stands in for it when it is left out; choices: the names that it takes, all of them
    unless `free`; is_table: it holds keys (`keys_of`), those of its `entries` where it is a list or a table of tables.
    """

    name: str
    table: str
    description: str
    kind: str
    unit: str = ""
    default: str = ""
    required: bool = False
    worked_out: str = ""
    example: str = ""
    choices: tuple[str, ...] = ()
    free: bool = False
    is_table: bool = False
    entries: str = ""

    @property
    def last(self) -> str:
        """The last part of the name: what stands before the equals sign in a file."""
        return self.name.rpartition(".")[2]

    @property
    def default_text(self) -> str:
        """The default as a person reads it: a value, `required`, from what it is worked out, or `none`."""
        if self.required:
            return _REQUIRED.get(self.name.partition(".")[0], "required")
        if self.worked_out:
            return f"worked out: {self.worked_out}"
        return self.default or "none"

    @property
    def read_by(self) -> str:
        """The fidelities that read this key."""
        return READ_BY.get(self.name, "resolved, averaged, steady")

    @property
    def related(self) -> tuple[str, ...]:
        """Other keys that are set with an eye on this one."""
        return tuple(
            dict.fromkeys(
                other for group in _TOGETHER if self.name in group for other in group if other != self.name
            )
        )


@dataclass(frozen=True)
class Value:
    """One value of a case: `name` with the case's own names, `text` in the unit that people read, and where it comes from.

    origin: typed (in the file or by --set), base (the shared geometry), built-in (material, mechanism), default, or worked out.
    """

    name: str
    text: str
    origin: str
    key: Key


@cache
def all_keys() -> tuple[Key, ...]:
    """Every key and table of a case file, in the order of a file."""
    from mpm.case import Case

    return tuple(_keys_of_model(Case, ""))


def keys_of(table: str) -> list[Key]:
    """The keys right below a table, named as a `Key` is or "" for the whole case; of a list, those of its entries."""
    return [key for key in all_keys() if key.table in (table, f"{table}.<name>")]


def _keys_of_model(model: type[BaseModel], table: str) -> Iterator[Key]:
    properties = finished(model.model_json_schema(by_alias=True), sentences=False)["properties"]
    prefix = f"{table}." if table else ""
    for field_name, field in model.model_fields.items():
        name = field.alias or field_name
        entry, dotted = properties[name], f"{prefix}{name}"
        inner = _model_in(field.annotation)
        if inner is None:
            yield _leaf(dotted, table, entry, field.is_required())
            if name in _ENTRIES:
                yield _entry_of_table(dotted, entry, name)
            continue
        named = get_origin(field.annotation) in (tuple, dict)
        kind = {tuple: f"a list of tables [[{dotted}]]", dict: f"tables [{dotted}.NAME]"}
        yield Key(
            dotted,
            table,
            entry["description"],
            kind.get(get_origin(field.annotation), f"a table [{dotted}]"),  # type: ignore[arg-type]
            required=field.is_required(),
            worked_out=entry.get("worked_out", ""),
            is_table=True,
            entries=f"{dotted}.<name>" if named else "",
        )
        yield from _keys_of_model(inner, f"{dotted}.<name>" if named else dotted)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model whose tables a field holds, alone, in a list or by name."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := _model_in(part)) is not None), None)


def _leaf(dotted: str, table: str, entry: Mapping[str, Any], required: bool) -> Key:
    choices = entry.get("enum") or entry.get("presets") or _built_in_choices().get(dotted, ())
    example = entry.get("examples", [""])[0]
    default = entry.get("default")
    text = "" if default is None else toml_text(default)
    return Key(
        dotted,
        table,
        entry["description"],
        _kind(entry),
        unit=entry.get("unit", ""),
        default=text,
        required=required,
        worked_out=entry.get("worked_out", ""),
        example=toml_text(example) if example != "" else text or (toml_text(choices[0]) if choices else ""),
        choices=tuple(choices),
        free="enum" not in entry,
    )


def _entry_of_table(dotted: str, entry: Mapping[str, Any], name: str) -> Key:
    kinds = (kind.get("additionalProperties") for kind in (entry, *entry.get("anyOf", ())))
    number: dict[str, Any] = next(kind for kind in kinds if isinstance(kind, dict))
    about = {**number, "description": f"{entry['description']}; that of one {_ENTRIES[name]}"}
    if "worked_out" in entry:
        about["worked_out"] = entry["worked_out"]
    return _leaf(f"{dotted}.<{_ENTRIES[name]}>", dotted, about, False)


_KINDS = {"boolean": "true or false", "string": "text", "integer": "a whole number", "array": "a list of pairs of times"}  # fmt: skip


def _kind(entry: Mapping[str, Any]) -> str:
    """What may stand there, in words and without the example."""
    if "enum" in entry:
        return "one of " + ", ".join(entry["enum"])
    if "accepted" in entry:
        return str(entry["accepted"]).partition(", e.g.")[0]
    if "additionalProperties" in entry:
        return "a table of numbers by name"
    kind = _KINDS[entry["type"]]
    bounds = [
        f"{word} {entry[key]:g}" for word, key in (("from", "minimum"), ("to", "maximum")) if key in entry
    ]
    return " ".join([kind, *bounds])


def toml_text(value: Any) -> str:
    """A value as a case file writes it, on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_name(k)} = {toml_text(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_text(entry) for entry in value) + "]"
    if isinstance(value, float):
        return number_text(value) if float(number_text(value)) == value else repr(value)
    return json.dumps(value, ensure_ascii=False)


def toml_name(name: str) -> str:
    """A key as a case file writes it: in quotes where it holds more than letters, digits, _ and -."""
    plain = name.isascii() and name.replace("_", "a").replace("-", "a").isalnum()
    return name if plain else json.dumps(name, ensure_ascii=False)


def find_keys(name: str) -> list[Key]:
    """The keys that a name may mean: a dotted name, with <name> or an entry's own name in it, or the last parts of one."""
    wanted = [part.strip('"') for part in name.strip().strip("[]").split(".")]
    exact = [key for key in all_keys() if any(_matches(p, wanted) for p in (key.name, key.entries))]
    if exact:
        return [min(exact, key=lambda key: key.name.count("<"))]
    ends = ((key, key.name.split(".")[-len(wanted) :]) for key in all_keys())
    return [key for key, end in ends if end[0][:1] != "<" and _matches(".".join(end), wanted)]


def find_key(name: str) -> Key:
    """The one key that `find_keys` finds. Raises InputError, with the nearest names or with all that it may mean."""
    found = find_keys(name)
    if len(found) == 1:
        return found[0]
    if found:
        raise InputError.at(None, "", f"{name!r}", f"one of {', '.join(key.name for key in found)}", given="")
    raise unknown_key(name)


def _matches(pattern: str, name: Sequence[str]) -> bool:
    parts = pattern.split(".")
    return len(parts) == len(name) and all(
        p == g or (p[:1] == "<" and g != "") for p, g in zip(parts, name, strict=True)
    )


def unknown_key(name: str, others: Sequence[str] = ()) -> InputError:
    """The error for a name that is no key (and none of the `others`): the nearest one, and the tables to look into."""
    known = [*(key.name for key in all_keys()), *others]
    by_last = {full.rpartition(".")[2]: full for full in reversed(known)}
    close = nearest(name, known) or by_last.get(nearest(name.rpartition(".")[2], by_last) or "")
    tables = ", ".join(key.name for key in keys_of("") if key.is_table)
    guess = f" (did you mean {close}?)" if close else ""
    return InputError(
        f"found {name!r}, no key; accepted: a dotted key such as motion.gamma, or a table: {tables}{guess}"
    )


# Where the values of a case come from


def values(case: Case) -> list[Value]:
    """Every value of a case with its origin, in the order of a file."""
    typed, overrides, base, built_in = _sources(case)
    by_name = {key.name: key for key in all_keys()}
    found = []
    for path, pattern, value in _leaves(case.to_dict(), (), ()):
        key, name = by_name[".".join(pattern)], ".".join(path)
        if _given(typed, path) or any(
            _set_by(changed, value_set, path) for changed, value_set in overrides.items()
        ):
            origin = "typed"
        elif _given(base, path):
            origin = "base"
        elif _given(built_in, path):
            origin = "built-in"
        else:
            origin = "default" if key.default and not key.worked_out else "worked out"
        found.append(Value(name, text_of(key, value), origin, key))
    return found


def _leaves(tree: Any, path: Address, pattern: Address) -> Iterator[tuple[Address, Address, Any]]:
    """(names, names of the key, value) of every value; entries of lists by name. A pair of values is one value."""
    known = {key.name for key in all_keys()}
    items = tree.items() if isinstance(tree, Mapping) else ((entry["name"], entry) for entry in tree)
    for name, value in items:
        here = (*pattern, name)
        if ".".join(here) not in known:
            here = (*pattern, f"<{_ENTRIES.get(pattern[-1], 'name')}>")
        if isinstance(value, Mapping) or (
            isinstance(value, list) and all(isinstance(v, Mapping) for v in value)
        ):
            yield from _leaves(value, (*path, name), here)
        else:
            yield (*path, name), here, value


def text_of(key: Key, value: Any) -> str:
    """A value of a resolved case in the unit that people read, such as "3.5 cm/s"; windows as "0 s to 5 s"."""
    if isinstance(value, list):
        if value and isinstance(value[0], list):
            return ", ".join(" to ".join(for_people(parse(t, "s"), "s") for t in pair) for pair in value)
        return " / ".join(text_of(key, entry) for entry in value)
    if isinstance(value, str):
        return for_people(parse(value, key.unit), key.unit) if key.unit else value
    return toml_text(value)


def _sources(case: Case) -> tuple[Any, Mapping[str, Any], Any, Any]:
    """What a case is put together from: the file's own tables, dotted overrides, the shared geometry, built-in materials and mechanism."""
    data, overrides, folder, label = case._origin
    mechanism = mechanism_tables(data, overrides, folder, label)
    base = {"geometry": shared_geometry(data, overrides, folder, label)}
    return data, overrides, base, {"material": BUILT_IN, "chemistry": mechanism}


def _set_by(dotted: str, value: Any, path: Address) -> bool:
    """Whether an override of the key `dotted`, perhaps of a whole table, gives the value at this address."""
    parts = tuple(dotted.split("."))
    return path[: len(parts)] == parts and _given(value, path[len(parts) :])


def _given(tree: Any, path: Address) -> bool:
    """Whether a tree has an entry at this address, list entries by name; one value for all (`gas.diffusivity`) counts for each."""
    for part in path:
        if isinstance(tree, list):
            tree = next((e for e in tree if isinstance(e, Mapping) and e.get("name") == part), None)
        elif isinstance(tree, Mapping):
            tree = tree.get(part)
        else:
            break
    return tree is not None
