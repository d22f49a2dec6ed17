"""One line for what is wrong in a powder file: where, what was found, what is accepted, the nearest key."""

import difflib
from collections.abc import Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from mpm.units import describe

_KINDS = ("sine", "sawtooth", "seed", "harmonics", "table", "accelerometer")


def one_line(name: str, error: ValidationError, model: type[BaseModel]) -> str:
    """The first complaint of a validation as `file: key: found ...; accepted: ...`."""
    detail = error.errors()[0]
    context: dict[str, Any] = detail.get("ctx") or {}
    # Tags of the discriminated union are part of pydantic's address but not of the file's.
    parts = [str(p) for i, p in enumerate(detail["loc"]) if not (i == 1 and p in _KINDS)]
    if context.get("key"):
        parts.append(str(context["key"]))
    return f"{name}: {'.'.join(parts) or 'file'}: {_complaint(detail, context, model)}".replace("\n", " ")


def _complaint(detail: ErrorDetails, context: dict[str, Any], model: type[BaseModel]) -> str:
    kind, found = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        key = str(detail["loc"][-1])
        return "unknown key" + _nearest(key, sorted(_fields(model)))
    if kind == "missing":
        return "missing; this key is required"
    if kind.startswith("union_tag"):
        given = found.get("kind") if isinstance(found, Mapping) else found
        return f"found kind = {given!r}; accepted: {', '.join(_KINDS)}" + _nearest(str(given), list(_KINDS))
    if kind == "literal_error":
        return f"found {describe(found)}; accepted: {context['expected']}"
    if kind == "mpm":
        known = context.get("known") or []
        return detail["msg"] + _nearest(str(context.get("given", "")), known)
    return f"found {describe(found)}; {detail['msg'][:1].lower()}{detail['msg'][1:]}"


def _nearest(given: str, known: list[str]) -> str:
    close = difflib.get_close_matches(given, known, n=1, cutoff=0.5)
    return f" (nearest: {close[0]})" if close else ""


def _fields(model: type[BaseModel]) -> set[str]:
    """All key names of a model and of the models inside it."""
    names: set[str] = set()
    for key, field in model.model_fields.items():
        names.add(key)
        stack: list[Any] = [field.annotation]
        while stack:
            inner = stack.pop()
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                names |= _fields(inner)
            stack.extend(get_args(inner))
    return names


def set_dotted(data: Mapping[str, Any], key: str, value: Any) -> dict[str, Any]:
    """A copy of nested tables with the entry at a dotted key replaced."""
    head, _, rest = key.partition(".")
    inner = data.get(head)
    if not rest:
        return {**data, head: value}
    if isinstance(inner, str) and head == "powder":
        inner = {"base": inner}
    return {**data, head: set_dotted(inner if isinstance(inner, Mapping) else {}, rest, value)}
