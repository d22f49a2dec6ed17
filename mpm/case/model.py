"""The base of the tables of input files as pydantic classes, and what their JSON Schemas do not demand."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict


class Frozen(BaseModel):
    """A table of an input file: values that do not change, keys that are known, each with its docstring as its description."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


def nothing_required(schema: dict[str, Any]) -> None:
    """Schema of a table that may lie over another (a shared geometry, a built-in material, a mechanism) and change one key of it."""
    schema.pop("required", None)


def only_name_required(schema: dict[str, Any]) -> None:
    """Schema of an entry of a list that may complete one of a shared geometry: there it need only say which."""
    schema["required"] = ["name"]
