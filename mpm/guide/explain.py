"""`mpm explain`: what a key of a case file, a table of keys, a reported number or a field means, as lines for a screen."""

from __future__ import annotations

import shlex
from collections.abc import Iterator

from mpm.case.keys import Key, all_keys, find_keys, keys_of, unknown_key
from mpm.errors import InputError
from mpm.guide.catalogue import sections
from mpm.guide.otherfiles import find_other_keys, other_keys
from mpm.report.quantities import QUANTITIES, known, quantity
from mpm.report.quantity import RATIO, Quantity

_NAMES = {
    "geometry.layer": "bed",
    "geometry.inlet": "tma",
    "geometry.outlet": "zone1",
    "geometry.zone": "zone1",
    "geometry.wall": "bottom",
    "material": "glass_beads",
    "chemistry.species": "TMA",
    "chemistry.site": "OH",
    "chemistry.film": "Al2O3",
    "chemistry.reaction": "tma",
    "chemistry.reaction.tma.coverage": "OH",
    "chemistry.reaction.tma.reverse.coverage": "OH",
}
"""An entry of each kind, for examples."""
_ENTRY = {"<species>": "TMA", "<site>": "OH", "<element>": "Al", "<substance>": "TMA"}
_OUTPUT = "summary.json; numbers of a run over time are in history.csv"

Line = tuple[int, str, int]
"""Columns of indentation; the text, which a screen may break between words; columns that further lines are indented beyond the first."""
_BLANK: Line = (0, "", 0)
_LABEL = 12


def explain(name: str) -> list[Line]:
    """What is known of a name. Raises InputError with the nearest names when it is no key, no number and nothing that `mpm list` has."""
    keys = find_keys(name)
    numbers = [quantity(name)] if known(name) else _numbers(name)
    lines: list[Line] = [] if keys or numbers else _built_in(name) or _other(name) or _field(name)
    if not keys and not numbers and not lines:
        others = [*(reported.name for reported in QUANTITIES), *(key.name for key in other_keys())]
        raise InputError(f"mpm explain: {unknown_key(name, others)}; mpm explain alone lists them all")
    for key in keys:
        lines += [*([_BLANK] if lines else []), *(_table(key) if key.is_table else _key(key))]
    if numbers:
        lines += [*([_BLANK] if lines else []), *_reported(numbers)]
    return lines


def overview() -> list[Line]:
    """All keys by table, all reported numbers and all fields, by name."""
    from mpm.report.fieldnames import FIELDS  # with numpy

    lines: list[Line] = [(0, "Keys of a case file (mpm explain KEY or TABLE says more)", 4)]
    for table in ("", *(key.name for key in all_keys() if key.is_table)):
        names = [key.last for key in keys_of(table) if not key.is_table]
        if names:
            lines.append((2, f"{table or 'at the top'}: {', '.join(names)}", 4))
    lines += [_BLANK, (0, "Numbers that a run reports", 4)]
    groups: dict[str, list[str]] = {}
    for reported in QUANTITIES:
        head, _, rest = reported.name.partition(".")
        groups.setdefault(head if rest else "of the run", []).append(rest or head)
    lines += [(2, f"{head}: {', '.join(rest)}", 4) for head, rest in groups.items()]
    return [*lines, _BLANK, (0, "Fields of a run", 4), (2, ", ".join(entry.name for entry in FIELDS), 4)]


def _key(key: Key) -> Iterator[Line]:
    yield 0, key.name, 0
    yield 2, key.description, 0
    yield _BLANK
    for label, text in (
        ("takes", key.kind),
        ("names" if key.free else "one of", ", ".join(key.choices)),
        ("SI unit", key.unit),
        ("default", _plain(key.default_text)),
        (
            "in a file",
            f"{key.last} = {key.example}{_place(key)}" if key.example and key.last[0] != "<" else "",
        ),
        ("in a shell", _setting(key)),
        ("read by", f"fidelity {key.read_by}"),
        ("see also", ", ".join(key.related)),
    ):
        if text and not (label == "one of" and key.kind.startswith("one of")):
            yield 2, f"{label:<{_LABEL}}{text}", _LABEL


def _with_entries(name: str) -> str:
    """A name with an entry of each kind in place of <name>."""
    for table, entry in _NAMES.items():
        name = name.replace(f"{table}.<name>", f"{table}.{entry}")
    for placeholder, entry in _ENTRY.items():
        name = name.replace(placeholder, entry)
    return name


def _place(key: Key) -> str:
    """The table that a key stands in, as a file opens it."""
    table = key.table.removesuffix(".<name>")
    if table not in _NAMES:
        table = _with_entries(key.table)
        return f" in [{table}]" if table else ""
    return f" in a [[{table}]]" if table.startswith("geometry.") else f" in [{table}.{_NAMES[table]}]"


def _setting(key: Key) -> str:
    """`--set` with an example of this key."""
    name = _with_entries(key.name)
    if not key.example or key.last == "name":
        return ""
    text = key.example.strip('"') if key.example.count('"') == 2 else key.example
    quoted = f"'{text}'" if set(text) & set(' {}[]"()>') else text
    return f"--set {name}={quoted}"


def _table(key: Key) -> Iterator[Line]:
    yield 0, f"{key.name}: {key.kind}", 0
    yield 2, key.description, 0
    yield _BLANK
    keys = keys_of(key.name)
    column = max(len(below.last) for below in keys) + 2
    for below in keys:
        default = f" [{_plain(below.default_text)}]" if below.default_text != "none" else ""
        yield 2, f"{below.last:<{column}}{below.description}{default}", column
    yield _BLANK
    example = _with_entries(f"{key.name}.<name>" if key.entries else key.name)
    yield 0, f"mpm explain {example}.{keys[0].last} says more of one of them.", 0


def _plain(text: str) -> str:
    """A value as TOML writes it, without the quotes."""
    return text.strip('"')


def _built_in(name: str) -> list[Line]:
    """What comes with mpm under this name: a material, a gas and so on."""
    return [
        line
        for section in sections()
        for entry in section.entries
        if entry.name == name
        for line in (
            (0, f"{name}, one of the {section.title.lower()}: {section.use}", 4),
            (2, entry.facts, 0),
        )
    ]


def _other(name: str) -> list[Line]:
    """A key of a sweep, powder or mechanism file."""
    lines: list[Line] = []
    found = find_other_keys(name)
    for key in found:
        lines += [
            *([_BLANK] if lines else []),
            (0, f"{key.name}, of {key.file} files", 4),
            (2, key.description, 0),
        ]
        if key.is_table:
            below = [
                k.name.removeprefix(f"{key.name}.") for k in other_keys() if k.name.startswith(f"{key.name}.")
            ]
            lines.append((2, f"{'keys':<{_LABEL}}{', '.join(dict.fromkeys(below))}", _LABEL))
        for label, text in (
            ("one of", ", ".join(key.choices)),
            ("default", _plain(key.default)),
            ("in a file", f"{key.name.rpartition('.')[2]} = {key.example}" if key.example else ""),
        ):
            if text:
                lines.append((2, f"{label:<{_LABEL}}{text}", _LABEL))
    return lines


def _field(name: str) -> list[Line]:
    """A field of the files for ParaView, as `mpm plot --field` takes it."""
    from mpm.report.fieldnames import FIELDS, field_name  # with numpy

    field = field_name(name)
    if field.name == field.label and field.name not in {entry.name for entry in FIELDS}:
        return []
    unit = {RATIO: "a ratio", "": "a whole number"}.get(field.unit, field.unit)
    shown = f", shown in {field.shown}" if field.shown else ""
    vibration = name == "velocity_lab"
    lines: list[Line] = [
        (0, f"{name}: a field, with a value in every cell", 0),
        (2, field.label, 0),
        (2, f"{'unit':<{_LABEL}}{unit}{shown}", _LABEL),
        (2, f"{'found in':<{_LABEL}}{'phases.pvd (output.phases)' if vibration else 'fields.pvd'}", _LABEL),
    ]
    picture = (2, f"{'a picture':<{_LABEL}}mpm plot DIR --field {shlex.quote(name)}", _LABEL)
    return lines if vibration else [*lines, picture]


def _numbers(name: str) -> list[Quantity]:
    """Reported numbers of a group (`titration`), or with this last part (`exit_mean`)."""
    wanted = name.strip()
    return [
        reported
        for reported in QUANTITIES
        if wanted and (reported.name.startswith(f"{wanted}.") or f".{reported.name}".endswith(f".{wanted}"))
    ]


def _reported(numbers: list[Quantity]) -> Iterator[Line]:
    for reported in numbers:
        label = quantity(reported.name).label
        yield 0, f"{reported.name}: a number that a run reports", 0
        yield 2, f"{label}: {quantity(reported.name).meaning}", 0
        unit = {"1": "a ratio", "": "a count"}.get(reported.unit, reported.unit)
        shown = f", shown in {reported.unit_shown}" if reported.shown else ""
        per_second = quantity(reported.name, steady=True).unit
        steady = f" ({per_second} in a steady run)" if reported.rate else ""
        yield 2, f"unit        {unit}{shown}{steady}", _LABEL
    yield 2, f"found in    {_OUTPUT}", _LABEL
