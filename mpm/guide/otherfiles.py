"""Keys of sweep, powder and mechanism files, read off their JSON Schemas, for `mpm explain`."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

Schema = Mapping[str, Any]


@dataclass(frozen=True)
class OtherKey:
    """A key: its dotted `name` (entries of free tables as <name>), the `file` it stands in, and what its schema says."""

    name: str
    file: str
    description: str
    default: str
    example: str
    choices: tuple[str, ...]
    is_table: bool


def schemas() -> dict[str, Schema]:
    """The schema of each kind of file beside cases."""
    from mpm.case.chemistry import mechanism_schema
    from mpm.dem.case import powder_schema
    from mpm.sweep.schema import sweep_schema

    return {"sweep": sweep_schema(), "powder": powder_schema(), "mechanism": mechanism_schema()}


@cache
def other_keys() -> tuple[OtherKey, ...]:
    """Every key of those files, in the order of the schemas."""
    return tuple(key for file, schema in schemas().items() for key in _walk(file, schema, schema, ()))


def find_other_keys(name: str) -> list[OtherKey]:
    """The keys that a dotted name, or its last parts, mean; a name of one's own stands for a <name>."""
    wanted = name.split(".")
    return [key for key in other_keys() if _means(key.name.split("."), wanted)]


def _means(key: list[str], wanted: list[str]) -> bool:
    end = key[-len(wanted) :]
    return (
        len(end) == len(wanted)
        and all(a in (b, "<name>") for a, b in zip(end, wanted, strict=True))
        and end[-1] == wanted[-1]
    )


def _walk(file: str, whole: Schema, schema: Schema, path: tuple[str, ...]) -> Iterator[OtherKey]:
    for parts, entry in _entries(whole, schema):
        here = (*path, *parts)
        inner = list(_entries(whole, entry))
        if here[-1] != "<name>":
            default = json.dumps(entry["default"]) if "default" in entry and not inner else ""
            examples = entry.get("examples", [])
            yield OtherKey(
                name=".".join(here),
                file=file,
                description=str(entry.get("description", "")),
                default=default,
                example=json.dumps(examples[0]) if examples else "",
                choices=tuple(map(str, entry.get("enum", ()))),
                is_table=bool(inner),
            )
        yield from _walk(file, whole, entry, here)


def _entries(whole: Schema, schema: Schema) -> Iterator[tuple[tuple[str, ...], Schema]]:
    """Keys below a schema: its properties, those of its alternatives, of the entries of a list, and of a free table as <name>."""
    schema = _resolved(whole, schema)
    seen = set()
    for choice in (schema, *schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())):
        choice = _resolved(whole, choice)
        if isinstance(choice.get("items"), Mapping):
            choice = _resolved(whole, choice["items"])
        for name, entry in choice.get("properties", {}).items():
            if name not in seen:
                seen.add(name)
                yield (name,), {**_resolved(whole, entry), **entry}
        free = choice.get("additionalProperties")
        if isinstance(free, Mapping) and _resolved(whole, free).get("properties"):
            yield ("<name>",), _resolved(whole, free)


def _resolved(whole: Schema, schema: Schema) -> Schema:
    reference = schema.get("$ref")
    if not isinstance(reference, str):
        return schema
    found: Any = whole
    for part in reference.removeprefix("#/").split("/"):
        found = found[part]
    return {**found, **{key: value for key, value in schema.items() if key != "$ref"}}
