"""One table of a file laid over another: by key, entries of lists by their `name`, and one way to say a thing in place of the other."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, TypeGuard

Table = dict[str, Any]

_ACTIVATION = ("b", "Ea", "reference_temperature")
_REPLACES = {
    "sticking": ("A",),
    "A": ("sticking",),
    "reverse": ("equilibrium_constant",),
    "equilibrium_constant": ("reverse",),
    "nasa": ("enthalpy", "entropy", "heat_capacity"),
    **dict.fromkeys(("enthalpy", "entropy", "heat_capacity"), ("nasa",)),
    "windows": ("start", "stop"),
    "kozeny_constant": ("permeability",),
    "permeability": ("kozeny_constant",),
    "temperature": ("heat_flux", "heat_transfer_coefficient", "ambient"),
    "heat_flux": ("temperature", "heat_transfer_coefficient", "ambient"),
    "heat_transfer_coefficient": ("temperature", "heat_flux"),
}
"""A key written over a table removes the other ways to say the same from it."""


def replaced(table: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Keys of `table` that `key`, written over it, replaces; b and Ea of a rate constant go with it, not those of the same kind."""
    rivals = tuple(rival for rival in _REPLACES.get(key, ()) if rival in table)
    if key not in ("sticking", "A") or not rivals:
        return rivals
    return (*rivals, *_ACTIVATION, *(("motz_wise",) if key == "A" else ()))


def merge(under: Mapping[str, Any], over: Mapping[str, Any]) -> Table:
    """Lay table `over` upon table `under`: tables merge by key, lists of named tables by name, all else is replaced."""
    gone = {rival for key in over for rival in replaced(under, key)}
    result = {key: value for key, value in under.items() if key not in gone}
    for key, value in over.items():
        below = result.get(key)
        if isinstance(value, Mapping) and isinstance(below, Mapping):
            result[key] = merge(below, value)
        elif _named(value) and _named(below):
            result[key] = _merge_lists(below, value)
        else:
            result[key] = deepcopy(value)
    return result


def _named(value: Any) -> TypeGuard[list[Table]]:
    return (
        isinstance(value, list)
        and bool(value)
        and all(isinstance(v, Mapping) and isinstance(v.get("name"), str) for v in value)
    )


def _merge_lists(under: list[Table], over: list[Table]) -> list[Table]:
    result = [dict(entry) for entry in under]
    places = {entry["name"]: i for i, entry in enumerate(result)}
    for entry in over:
        place = places.pop(
            entry["name"], None
        )  # a second entry of the same name is appended, and found out later
        if place is None:
            result.append(deepcopy(dict(entry)))
        else:
            result[place] = merge(result[place], entry)
    return result
