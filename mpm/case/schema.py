"""JSON Schemas for people: every property says what it means, what is accepted, and its default as a file would write it.

Pydantic makes the schema from the classes that parse a file; what it cannot know (`accepted`, `unit`, `worked_out`) their annotations add,
and `finished` puts it into words that an editor shows.
"""

from __future__ import annotations

import math
from typing import Any

from mpm.units import parse

DRAFT = "https://json-schema.org/draft/2020-12/schema"
"""What a schema says of the language it is written in."""

READ_IN: dict[str, tuple[tuple[float, str], ...]] = {
    "m": ((1e-6, "nm"), (1e-4, "um"), (10.0, "mm"), (math.inf, "m")),
    "m/s": ((1.0, "cm/s"), (math.inf, "m/s")),
    "s": ((0.1, "ms"), (math.inf, "s")),
    "m^2": ((1e-6, "um^2"), (math.inf, "m^2")),
    "rad": ((math.inf, "deg"),),
    "kg/mol": ((math.inf, "g/mol"),),
    "J/mol": ((math.inf, "kJ/mol"),),
    "Pa*s": ((math.inf, "Pa s"),),
}
"""SI unit: the units that people read such a quantity in, each up to a size."""
_SIZE_OF_ZERO = 0.2
"""The unit of a zero is that of a number of this size: "0 s", "0 mm", "0 cm/s"."""


def for_people(number: float, unit: str, exact: bool = False) -> str:
    """A quantity [unit] as a file would say it, such as "3.5 cm/s"; with `exact` it reads back as the same float."""
    size = abs(number) or _SIZE_OF_ZERO
    shown = next((name for limit, name in READ_IN.get(unit, ()) if size < limit), unit)
    text = f"{number_text(number / parse(f'1 {shown}', unit))} {shown}".strip()
    return text if not exact or parse(text, unit) == number else f"{number!r} {unit}"


def number_text(number: float) -> str:
    """Up to six digits, powers of ten as people type them: 2e-4, 101325, 0.46."""
    text = f"{number:.6g}"
    if 0.0 < abs(number) < 1e-3:
        text = f"{number:.5e}"
    mantissa, e, exponent = text.partition("e")
    return (
        text
        if not e
        else f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}e{int(exponent)}"
    )


def finished(schema: Any, sentences: bool = True) -> Any:
    """The schema with defaults as a file writes them and without `null`, which TOML does not have.

    `sentences`: what is accepted and what stands in for a key left out end its description, where an editor shows them.
    """
    if isinstance(schema, list):
        return [finished(entry, sentences) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    schema = _without_null({key: finished(value, sentences) for key, value in schema.items()})
    default = schema.get("default")
    if "unit" in schema and isinstance(default, float):
        schema["default"] = for_people(default, schema["unit"], exact=True)
    elif isinstance(default, dict) or default in ([], ""):  # of a table: its keys have theirs
        del schema["default"]
    if isinstance(schema.get("description"), str):
        schema["description"] = " ".join(schema["description"].split())
        if not sentences:
            return schema
        if "accepted" in schema:
            schema["description"] += f". Accepted: {schema['accepted']}"
        if "worked_out" in schema:
            schema["description"] += f". Left out: {schema['worked_out']}"
    return schema


def _without_null(schema: dict[str, Any]) -> dict[str, Any]:
    """A key that may be left out is optional, not null: `anyOf` of one kind and null is that kind."""
    if schema.get("default", 0) is None:
        del schema["default"]
    kinds = schema.get("anyOf")
    if not isinstance(kinds, list) or {"type": "null"} not in kinds:
        return schema
    kinds = [kind for kind in kinds if kind != {"type": "null"}]
    if len(kinds) > 1:
        return {**schema, "anyOf": kinds}
    return {**kinds[0], **{key: value for key, value in schema.items() if key != "anyOf"}}
