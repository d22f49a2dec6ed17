"""The classes that parse a file, walked as the file is: which class, field or key stands at a place of it."""

from __future__ import annotations

import types
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

TAG = "kind"
"""The key that says which of several kinds a table is."""


def known_keys(model: type[BaseModel], location: Sequence[int | str]) -> list[str]:
    """Keys that the table at `location` may have."""
    table = table_at(model, location)
    return [field.alias or name for name, field in table.model_fields.items()] if table else []


def dotted_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Every dotted key of a file; an entry of a list or of named tables as <name>."""
    for name, field in model.model_fields.items():
        key = prefix + (field.alias or name)
        yield key
        named = get_origin(bare(field.annotation)) in (tuple, dict)
        keys = (
            inner
            for table in tables_in(field.annotation)
            for inner in dotted_keys(table, f"{key}.<name>." if named else f"{key}.")
        )
        yield from dict.fromkeys(keys)


def bare(annotation: Any) -> Any:
    """A type without what is annotated to it, and without the None of a key that may be left out."""
    while True:
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
            continue
        others = [part for part in get_args(annotation) if part is not type(None)]
        if get_origin(annotation) not in (Union, types.UnionType) or len(others) != 1:
            return annotation
        annotation = others[0]


def tables_in(annotation: Any) -> list[type[BaseModel]]:
    """The models that a field holds: alone, in a list, by name, or one of several."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for part in get_args(annotation) for table in tables_in(part)]


def _type(model: type[BaseModel], location: Sequence[int | str]) -> Any:
    """The type at `location`, walking through fields, tuples and dictionaries of models, and tables of several kinds."""
    current: Any = model
    for part in location:
        if isinstance(current, type) and issubclass(current, BaseModel):
            field = _field_of(current, str(part))
            current = field.annotation if field else None
        elif choices := _by_tag(current):
            current = choices.get(str(part))
        else:
            current = next((a for a in get_args(current) if a not in (str, Ellipsis, type(None))), None)
        if get_origin(current := bare(current)) in (Union, types.UnionType) and not _by_tag(current):
            current = next((a for a in get_args(current) if a is not type(None)), None)
    return current


def _by_tag(annotation: Any) -> dict[str, type[BaseModel]]:
    """The models of a table of several kinds by their tags; empty for another type."""
    if get_origin(annotation) not in (Union, types.UnionType) or type(None) in get_args(annotation):
        return {}
    return {
        tag: table for table in tables_in(annotation) for tag in get_args(table.model_fields[TAG].annotation)
    }


def kinds_at(model: type[BaseModel], location: Sequence[int | str]) -> dict[str, type[BaseModel]]:
    """The kinds of the table at `location`, where there are several: pydantic's next step is then the tag, which is no key."""
    return _by_tag(_type(model, location))


def table_at(model: type[BaseModel], location: Sequence[int | str]) -> type[BaseModel] | None:
    """The model class of the table at `location`."""
    current = _type(model, location)
    return current if isinstance(current, type) and issubclass(current, BaseModel) else None


def _field_of(model: type[BaseModel], key: str) -> FieldInfo | None:
    return next((f for name, f in model.model_fields.items() if (f.alias or name) == key), None)


def field_at(model: type[BaseModel], location: Sequence[int | str]) -> FieldInfo | None:
    table = table_at(model, location[:-1])
    return _field_of(table, str(location[-1])) if table else None
