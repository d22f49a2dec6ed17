"""What the tables of input files have in common: their base as pydantic classes, names, flags, and what their schemas do not demand."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Strict

from mpm.units import reject


class Frozen(BaseModel):
    """A table of an input file: values that do not change, keys that are known, each with its docstring as its description."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    def _fill(self, **values: Any) -> None:
        """Put in what the file leaves out and other values give; only while a file is read, before anybody has seen the table."""
        self.__dict__.update(values)


def nothing_required(schema: dict[str, Any]) -> None:
    """Schema of a table that may lie over another (a shared geometry, a built-in material, a mechanism) and change one key of it."""
    schema.pop("required", None)


def only_name_required(schema: dict[str, Any]) -> None:
    """Schema of an entry of a list that may complete one of a shared geometry: there it need only say which."""
    schema["required"] = ["name"]


def _name(value: str) -> str:
    if not value or not all(character.isalnum() or character in "_-" for character in value):
        raise reject(repr(value), "a name of letters, digits, _ and -")
    return value


Name = Annotated[str, AfterValidator(_name)]
"""What an entry is called in results and keys."""
Flag = Annotated[bool, Strict()]
