"""The table of all keys of a case file, read off the classes that parse it and their JSON Schema; `mpm.case.keys` looks into it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, get_origin

from pydantic import BaseModel

from mpm.case.conventions import SWITCHES
from mpm.case.materials import BUILT_IN
from mpm.case.motion import FORCES
from mpm.case.places import bare, tables_in
from mpm.case.schema import finished, number_text
from mpm.case.sources import built_in_files
from mpm.case.tables import CaseTables

ENTRIES = {
    "mass_fractions": "species",
    "diffusivity": "species",
    "initial_coverage": "site",
    "elements": "element",
    "orders": "substance",
}
"""What the entries of a table of numbers are named after."""

_CYCLE = "resolved; averaged and steady only with transport.vibrational_dispersion"
_FORCED = f"{_CYCLE} or with motion.profile force_balance"
_TIMED = "resolved, averaged"
READ_BY = {
    **dict.fromkeys(
        (f"motion.{key}" for key in ("frequency", "angle", "angle_from", "inlet_frame")), _FORCED
    ),
    "motion.liftoff_velocity": _CYCLE,
    "motion.gamma": f"{_FORCED} (0 is read by all)",
    "motion.profile": f"{_CYCLE} (the mean of a file or of forces is read by all)",
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
    "energy.initial_temperature": _TIMED,
    "energy.flow_update": _TIMED,
}
"""Fidelities that read a key, where not all of them do (`mpm.advice.idle` says so of a case)."""

_PARTICLES = ("porosity", "particle_diameter", "sphericity")
_TOGETHER = (
    ("motion.gamma", "motion.frequency", "motion.angle", "motion.angle_from", "motion.bed_velocity", "motion.profile"),
    ("motion.profile", "motion.liftoff_velocity", "motion.liftoff_phase", "motion.contact_phase", "motion.bed_velocity"),
    ("motion.profile", *(f"motion.{key}" for key in FORCES), "material.<name>.density", "material.<name>.permeability"),
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
    ("gas.temperature", "energy", "energy.initial_temperature", "geometry.bed_temperature", "geometry.inlet.<name>.temperature"),
    tuple(f"geometry.wall.<name>.{key}" for key in ("temperature", "heat_flux", "heat_transfer_coefficient", "ambient")),
    ("energy.conductivity_model", "gas.conductivity", *(f"material.<name>.{key}" for key in ("conductivity", "effective_conductivity"))),
    ("gas.mixture", "chemistry.species.<name>.viscosity", "chemistry.species.<name>.molar_mass", "gas.diffusivity"),
    *(("conventions", switch) for switch in SWITCHES),
    ("transport.scheme", "geometry.cell_width", "geometry.layer.<name>.cells"),
    ("porous.diffusion", "material.<name>.tortuosity_factor", "material.<name>.porosity", "gas.diffusivity"),
    ("motion.drag_reference", "porous.inertia", "motion.bed_velocity", "geometry.layer.<name>.moving"),
    ("gas.heat_capacity", "material.<name>.heat_capacity", "material.<name>.density"),
    ("material.<name>.pore_diameter", "material.<name>.permeability", "gas.pressure"),
    (*(f"chemistry.{k}.<name>.enthalpy" for k in ("species", "site", "film")), "chemistry.reaction.<name>.heat_of_reaction"),
    ("fidelity", "time.end", "time.step", "time.steps_per_cycle", "transport.vibrational_dispersion"),
    tuple(f"chemistry.reaction.<name>.{key}" for key in ("equation", "sticking", "A", "b", "Ea", "reference_temperature")),
    tuple(f"chemistry.reaction.<name>.{key}" for key in ("equation", "orders", "reverse", "equilibrium_constant", "coverage")),
    ("chemistry.reaction.<name>.sticking", "chemistry.reaction.<name>.motz_wise"),
    ("chemistry.reference_pressure", *(f"chemistry.{k}.<name>.{x}" for k in ("species", "site") for x in ("enthalpy", "entropy", "nasa"))),
    ("chemistry.site.<name>.sites", "material.<name>.site_density"),
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


@cache
def all_keys() -> tuple[Key, ...]:
    """Every key and table of a case file, in the order of a file."""
    return tuple(_keys_of_model(CaseTables, ""))


def keys_of(table: str) -> list[Key]:
    """The keys right below a table, named as a `Key` is or "" for the whole case; of a list, those of its entries."""
    return [key for key in all_keys() if key.table in (table, f"{table}.<name>")]


def _keys_of_model(model: type[BaseModel], table: str) -> Iterator[Key]:
    properties = finished(model.model_json_schema(by_alias=True), sentences=False)["properties"]
    prefix = f"{table}." if table else ""
    for field_name, field in model.model_fields.items():
        name = field.alias or field_name
        entry, dotted = properties[name], f"{prefix}{name}"
        tables = tables_in(field.annotation)
        if not tables:
            yield _leaf(dotted, table, entry, field.is_required())
            if name in ENTRIES:
                yield _entry_of_table(dotted, entry, name)
            continue
        container = get_origin(bare(field.annotation))
        named = container in (tuple, dict)
        kind: dict[Any, str] = {tuple: f"a list of tables [[{dotted}]]", dict: f"tables [{dotted}.NAME]"}
        yield Key(
            dotted,
            table,
            entry["description"],
            kind.get(container, f"a table [{dotted}]"),
            required=field.is_required(),
            worked_out=entry.get("worked_out", ""),
            is_table=True,
            entries=f"{dotted}.<name>" if named else "",
        )
        yield from _keys_of_model(tables[0], f"{dotted}.<name>" if named else dotted)


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
    about = {**number, "description": f"{entry['description']}; that of one {ENTRIES[name]}"}
    if "worked_out" in entry:
        about["worked_out"] = entry["worked_out"]
    return _leaf(f"{dotted}.<{ENTRIES[name]}>", dotted, about, False)


_KINDS = {"boolean": "true or false", "string": "text", "integer": "a whole number"}  # fmt: skip


def _kind(entry: Mapping[str, Any]) -> str:
    """What may stand there, in words and without the example."""
    if "enum" in entry:
        return "one of " + ", ".join(entry["enum"])
    if "accepted" in entry:
        return str(entry["accepted"]).partition(", e.g.")[0]
    if "additionalProperties" in entry:
        return "a table of numbers by name"
    if entry.get("type") == "array":
        return "a list of pairs of times" if entry["items"].get("type") == "array" else "a list of numbers"
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
