"""`mpm new`: a case file with every key, its meaning, unit and default, ready to be edited; equal to the case that it starts from.

What decides the case stands as `key = value`. Everything else stands as `#key = value`, so that taking the # away is enough to change it.
"""

from __future__ import annotations

import json
import os
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mpm.case.case import Case, build_case, case_schema, load_case
from mpm.case.keys import Address, Key, Value, keys_of, toml_name, toml_text, values
from mpm.case.names import case_file
from mpm.case.schema import for_people
from mpm.case.sources import mechanism_source, parse_toml
from mpm.errors import InputError
from mpm.files import is_file, write_atomically
from mpm.units import parse

SCHEMA_FILE = "mpm-case.schema.json"
"""Beside the case: editors (taplo, Even Better TOML) read the schema that its first line names from a file, and run no program for it."""
START = "first_case"
"""The built-in case that a new one starts from where none is named."""
WIDTH = 100
"""Columns of the comments."""

_HEAD = f"""\
#:schema ./{SCHEMA_FILE}
# A case of mpm. Lines "key = value" are what this case says. Lines "#key = value" are what holds
# without them: take the # away (and that of the [table] above) and change the value. Numbers that
# have a dimension carry their unit. mpm explain KEY says more about a key."""
_OWN_POWDER = (
    'A powder of your own: take the # away here and at what you know of it, then write material = "my_powder" '
    "at its layer. Without a permeability, the particle_diameter gives one."
)
_EXAMPLES = {
    "material": "my_powder",
    "geometry.inlet": "tma",
    "geometry.outlet": "out",
    "geometry.zone": "zone1",
    "geometry.wall": "bottom",
    "chemistry.reaction.<name>.coverage": "OH",
    "chemistry.reaction.<name>.reverse.coverage": "OH",
}
"""Names of the entries that are shown where a case has none of its own."""
_FOR_REFERENCE = ("material", "chemistry.reaction")
"""Built-in entries that are worth seeing although nothing in them is typed."""


def write_new_case(path: Path, start: str = START) -> list[Path]:
    """Write the case file, and beside it the schema; returns both. Raises InputError rather than replace a case."""
    if path.exists() or path.is_symlink():
        raise InputError.at(path, "", "a file that is there already", "the name of a new file")
    if not path.parent.is_dir():
        raise InputError.at(path, "", f"no directory {path.parent}", "a new file in one that exists")
    text = new_case(load_case(case_file(start)), path.parent.resolve())
    schema = path.with_name(SCHEMA_FILE)
    write_atomically(schema, json.dumps(case_schema(), indent=2) + "\n")
    write_atomically(path, text)
    return [path, schema]


def new_case(case: Case, folder: Path) -> str:
    """The commented text of `case` for a file in `folder`.

    What is typed in the case or comes from its shared geometry is active, and whatever else it takes for the text to give an equal case
    (a dose window that the case writes in another way); of [energy], whose presence says something, all.
    """
    found = values(case)
    active = {v.path for v in found if v.origin in ("typed", "base") or v.path[0] == "energy"}
    while True:
        text = "\n".join([_HEAD, *_Writer(case, found, active, folder).table("", ())]) + "\n"
        again = {
            value.path: value.written
            for value in values(build_case(parse_toml(text, "new case"), {}, folder, "new case"))
        }
        missing = {value.path for value in found if again.get(value.path) != value.written} - active
        if not missing:
            return text
        active |= missing


class _Writer:
    """Writes the tables of one case."""

    def __init__(self, case: Case, found: list[Value], active: set[Address], folder: Path) -> None:
        self.values = {value.path: value for value in found}
        self.active = active
        self.folder = folder
        self.mechanism = _mechanism(case, folder)
        self.of_cantera = mechanism_source(case.origin.data, {})

    def table(self, name: str, path: Address, described: bool = True, shown: bool = True) -> Iterator[str]:
        """The keys of one table and the tables below it; `described`: with comments, `shown`: with what is not active."""
        keys = keys_of(name)
        for key in (key for key in keys if not key.is_table):
            yield from self.line(key, (*path, key.last), described, shown)
        for key in (key for key in keys if key.is_table):
            if not described and not self.is_active((*path, key.last)):
                continue  # shown at the first entry
            yield ""
            yield from _comment(key.description, "## ")
            if key.entries:
                yield from self.entries(key, (*path, key.last))
            else:
                yield _header(self.is_active((*path, key.last)), f"[{_dotted((*path, key.last))}]")
                yield from self.table(key.name, (*path, key.last))

    def entries(self, key: Key, path: Address) -> Iterator[str]:
        """The entries of a list or table of tables: the first with comments, then the others."""
        names = list(dict.fromkeys(place[len(path)] for place in self.below(path)))
        names.sort(key=lambda name: not self.is_active((*path, name)))  # stable: what is active comes first
        if key.name in _EXAMPLES and not any(self.is_active((*path, name)) for name in names):
            names.insert(0, _EXAMPLES[key.name])
        is_list = "[[" in key.kind
        for index, name in enumerate(names):
            here = (*path, name)
            active = self.is_active(here)
            if index and not active and key.name not in _FOR_REFERENCE:
                continue
            if index == 0 and name == _EXAMPLES["material"]:
                yield from _comment(_OWN_POWDER, "# ")
            if index:
                yield ""
            yield _header(active, f"[[{key.name}]]" if is_list else f"[{_dotted(here)}]")
            yield from self.table(key.name, here, described=index == 0, shown=index == 0 or not active)

    def line(self, key: Key, path: Address, described: bool, shown: bool) -> Iterator[str]:
        """One key with its value: active, or behind a #."""
        below = self.below(path)
        cantera = key.table == "chemistry" and key.last != "mechanism" and key.last in self.of_cantera
        active = self.is_active(path) or cantera
        if cantera:
            text = toml_text(self.of_cantera[key.last])
        elif key.last == "name" and path[:1] == ("geometry",):
            text = json.dumps(path[-2])
        elif active or below:
            said = {place: value for place, value in below.items() if not active or place in self.active}
            text = self.value(key, path, said, active)
        else:
            text = key.default or key.example
        if described:
            yield ""
            yield from _comment(f"{key.description}{_after(key)}", "# ")
        if active or described or (shown and any(value.origin == "built-in" for value in below.values())):
            yield f"{'' if active else '#'}{key.last} = {text or json.dumps('')}"

    def value(self, key: Key, path: Address, found: Mapping[Address, Value], exact: bool) -> str:
        if key.name == "chemistry.mechanism":
            return json.dumps(self.mechanism)
        if path in found:
            written = found[path].written
            if key.name == "motion.profile" and is_file(Path(written)):
                written = os.path.relpath(written, self.folder)
            return toml_text(_for_people(key.unit, written, exact))
        table = {
            place[-1]: _for_people(value.key.unit, value.written, exact) for place, value in found.items()
        }
        one_for_all = key.name == "gas.diffusivity" and len(set(table.values())) == 1
        return toml_text(next(iter(table.values())) if one_for_all else table)

    def below(self, path: Address) -> dict[Address, Value]:
        """This value, or those below this table."""
        return {place: value for place, value in self.values.items() if place[: len(path)] == path}

    def is_active(self, path: Address) -> bool:
        """Whether this value, or one below this table, is part of what the case says."""
        return any(place[: len(path)] == path for place in self.active)


def _dotted(path: Address) -> str:
    """The name of a table as a file opens it; entries of tables by their names."""
    return ".".join(map(toml_name, path))


def _mechanism(case: Case, folder: Path) -> str:
    """The mechanism's name, or the path of its file from `folder`."""
    data, home = case.origin.data, case.origin.folder
    name = str(data.get("chemistry", {}).get("mechanism", case.chemistry.mechanism))
    return os.path.relpath(home / name, folder) if is_file(home / name) else name


def _header(active: bool, text: str) -> str:
    return text if active else f"#{text}"


def _after(key: Key) -> str:
    """What a comment says behind the meaning of a key: what it takes, and what holds without it."""
    takes = (
        "" if key.kind in ("text", "a table of numbers by name") else key.kind.removesuffix(" with its unit")
    )
    if key.choices and key.free:
        takes = f"{takes} or {'a preset' if takes else 'a name'}: ".removeprefix(" or ") + ", ".join(
            key.choices
        )
    if key.required:
        without = "required"
    elif key.worked_out:
        without = f"left out: {key.worked_out}"
    else:
        without = f"default {key.default}" if key.default else ""
    said = "; ".join(part for part in (takes, without) if part)
    return f" [{said}]" if said else ""


def _comment(text: str, mark: str) -> list[str]:
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=mark,
        subsequent_indent=mark,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _for_people(unit: str, written: Any, exact: bool) -> Any:
    """A value of a resolved case in the unit that people read; `exact`: it reads back as the same number."""
    if isinstance(written, list):
        return [
            _for_people(unit or "s", entry, exact) for entry in written
        ]  # lists are of one unit, or of times
    return for_people(parse(written, unit), unit, exact) if unit and isinstance(written, str) else written
