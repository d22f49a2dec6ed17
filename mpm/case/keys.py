"""Keys of a case file by name, with what a person wants to know of each; and for a case, where each of its values comes from.

find_key("motion.gamma").description
for value in values(case): print(value.name, value.text, value.origin)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpm.case.conventions import preset_tables
from mpm.case.keytable import ENTRIES, READ_BY, Key, all_keys, keys_of, toml_name, toml_text
from mpm.case.materials import BUILT_IN
from mpm.case.schema import for_people
from mpm.case.sources import mechanism_tables, shared_geometry
from mpm.errors import InputError, did_you_mean, nearest
from mpm.units import parse

if TYPE_CHECKING:
    from mpm.case.case import Case

__all__ = [
    "READ_BY",
    "Key",
    "Value",
    "all_keys",
    "find_key",
    "find_keys",
    "keys_of",
    "toml_name",
    "toml_text",
    "unknown_key",
    "values",
]

Address = tuple[str, ...]


@dataclass(frozen=True)
class Value:
    """One value of a case: `name` with the case's own names, `text` in the unit that people read, and where it comes from.

    origin: typed (in the file or by --set), base (the shared geometry), built-in (material, mechanism, preset of conventions), default, or
    worked out.
    """

    name: str
    text: str
    origin: str
    key: Key
    path: Address
    """The parts of the name, which may hold dots themselves."""
    written: Any
    """What a resolved case file holds: SI units as text, lists and numbers as they are."""


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
    accepted = f"a dotted key such as motion.gamma, or a table: {tables}{did_you_mean(close)}"
    return InputError.at(None, "", f"{name!r}, no key", accepted)


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
        found.append(Value(name, text_of(key, value), origin, key, path, value))
    return found


def _leaves(tree: Any, path: Address, pattern: Address) -> Iterator[tuple[Address, Address, Any]]:
    """(names, names of the key, value) of every value; entries of lists by name. A pair of values is one value."""
    known = {key.name for key in all_keys()}
    items = tree.items() if isinstance(tree, Mapping) else ((entry["name"], entry) for entry in tree)
    for name, value in items:
        here = (*pattern, name)
        if ".".join(here) not in known:
            here = (*pattern, f"<{ENTRIES.get(pattern[-1], 'name')}>")
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
    of = case.origin
    mechanism = mechanism_tables(of.data, of.overrides, of.folder, of.label)
    base = {"geometry": shared_geometry(of.data, of.overrides, of.folder, of.label)}
    built_in = {"material": BUILT_IN, "chemistry": mechanism, **preset_tables(case.conventions)}
    return of.data, of.overrides, base, built_in


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
