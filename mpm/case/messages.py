"""Turns the first error that pydantic found into mpm's one line: file, key, what was found, what is accepted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from mpm.case.materials import BUILT_IN
from mpm.case.places import TAG, dotted_keys, field_at, kinds_at, known_keys, tables_in
from mpm.errors import InputError, nearest
from mpm.units import Dimension, describe

_LATER = {"missing": 1, "too_short": 2}
"""A misspelt key is both unknown and missing: say the former. A list whose entries are all wrong counts as empty: say what is wrong."""


def to_input_error(error: ValidationError, model: type[BaseModel], data: Any, source: str) -> InputError:
    """Return the InputError for the first thing that is wrong with `data`, read as `model` from `source`."""
    first = min(error.errors(include_url=False), key=lambda e: _LATER.get(e["type"], 0))
    kind, context = first["type"], first.get("ctx") or {}
    location = first["loc"]
    key = address([part for i, part in enumerate(location) if not kinds_at(model, location[:i])], data)
    if kind == "mpm":
        key = ".".join(part for part in (key, context.get("key", "")) if part)
        if context["found"] == "nothing":
            return _missing(source, key, context["accepted"], location, data)
        return InputError.at(
            source,
            key,
            context["found"],
            context["accepted"],
            known=context.get("known", ()),
            given=context.get("given", ""),
        )
    if kind == "extra_forbidden":
        return _unknown(source, key, str(location[-1]), known_keys(model, location[:-1]), model)
    if kind == "missing":
        return _missing(source, key, _expected(field_at(model, location)), location, data)
    if kind.startswith("union_tag"):
        tags = list(kinds_at(model, location))
        given = context.get("tag")
        found = "nothing" if given is None else repr(given)
        return InputError.at(source, f"{key}.{TAG}", found, ", ".join(tags), known=tags, given=str(given))
    found = describe(first["input"])
    if kind == "literal_error":
        choices = [choice.strip("'") for choice in context["expected"].replace(" or ", ", ").split(", ")]
        return InputError.at(source, key, found, ", ".join(choices), known=choices, given=str(first["input"]))
    text = first["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
    accepted = _expected(field_at(model, location)) if kind == "tuple_type" else _WORDS.get(kind, text)
    return InputError.at(source, key, found, accepted, given="")


def _unknown(source: str, key: str, given: str, known: Sequence[str], model: type[BaseModel]) -> InputError:
    """A key is unknown here: misspelt, or the key of another table of the file."""
    accepted = f"one of {', '.join(known)}"
    elsewhere = [name for name in dotted_keys(model) if name.rpartition(".")[2] == given]
    if elsewhere:
        accepted += f"; {given} belongs elsewhere: {', '.join(elsewhere)}"
        return InputError.at(source, key, "an unknown key", accepted, given="")
    return InputError.at(source, key, "an unknown key", accepted, known=known, given=given)


def _missing(source: str, key: str, accepted: str, location: Sequence[int | str], data: Any) -> InputError:
    """A key is missing: perhaps because the name of its table is misspelt, and what was meant is there under another."""
    name, others = _entry_and_others(location, data)
    if nearest(name, others) is None:
        return InputError.at(source, key, "nothing", accepted, given="")
    accepted = f"{accepted}; or one of the names {', '.join(others)} in place of {name}"
    return InputError.at(source, key, "nothing", accepted, given=name, known=others)


_NAMED = (
    ("material",),
    ("chemistry", "species"),
    ("chemistry", "site"),
    ("chemistry", "film"),
    ("chemistry", "reaction"),
)
"""Tables whose keys are names."""


def _entry_and_others(location: Sequence[int | str], data: Any) -> tuple[str, list[str]]:
    """The name of the entry that `location` lies in, and the names of its neighbours (of a material: the built-in ones too)."""
    name, others = "", []
    for place, part in enumerate(location):
        if isinstance(part, int) and isinstance(data, list) and part < len(data):
            names = [str(entry.get("name")) for entry in data if isinstance(entry, dict)]
            name = str(data[part].get("name")) if isinstance(data[part], dict) else ""
            others, data = [other for other in names if other != name], data[part]
        elif isinstance(data, dict):
            if tuple(location[:place]) in _NAMED:
                name = str(part)
                others = [
                    str(key)
                    for key in (*data, *(BUILT_IN if location[0] == "material" else ()))
                    if key != part
                ]
            data = data.get(part)
    return name, list(dict.fromkeys(others))


_WORDS = {
    "model_type": "a table",
    "dict_type": "a table",
    "model_attributes_type": "a table",
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "too_short": "at least one entry",
}


def address(location: Sequence[int | str], data: Any) -> str:
    """Dotted key of an entry; list entries appear under their name (or their number while they have none)."""
    parts = []
    for part in location:
        inside = None
        if isinstance(part, int):
            inside = data[part] if isinstance(data, (list, tuple)) and part < len(data) else None
            name = inside.get("name") if isinstance(inside, dict) else None
            parts.append(name if isinstance(name, str) and name else str(part + 1))
        elif part != "[key]":
            inside = data.get(part) if isinstance(data, dict) else None
            parts.append(part)
        data = inside
    return ".".join(parts)


def _expected(field: FieldInfo | None) -> str:
    for item in field.metadata if field else ():
        if isinstance(item, Dimension):
            return item.accepted
    if field is not None and get_origin(field.annotation) is tuple and tables_in(field.annotation):
        return "a list of tables, [[...]]"
    if field is not None and field.annotation is int:
        return "a whole number"
    return field.description.partition(". ")[0] if field and field.description else "a value"
