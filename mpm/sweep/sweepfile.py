"""Reads a sweep file. Starts nothing, writes nothing.

    [sweep]
    case = "base.toml"                    # beside this file, or the name of a built-in case
    mode = "grid"                         # grid | zip | sample
    samples = 64                          # sample: how many, by method = "sobol" | "latin_hypercube", seed = 0
    where = ["width <= 2 * height"]       # combinations to keep
    columns = ["titration.*.exit_mean"]   # which numbers of summary.json go into the table
    pictures = ["titration.*.exit_mean"]  # which of them are drawn
    ranks = 1                             # more than 1: every point under mpirun
    [[sweep.axis]]
    key = "geometry.inlet.tma.width"      # or a list of keys that get the same value
    name = "width"                        # optional: the axis's name in tables (default: the key)
    values = ["2.2 mm", "4 mm"]           # or linspace / logspace = { start, stop, num }
    [sweep.set]                           # fixed overrides; files (motion.profile) beside this one, else beside the case
    "time.end" = "10 s"
    [sweep.slurm]                         # for --scheduler slurm, see mpm.sweep.cluster

Everything wrong with the file is an InputError of one line: file, key, what was found, what is accepted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.case.case import Case, load_case
from mpm.case.kinds import SWEEP, parse_input, read_input_text
from mpm.case.names import sweep_file
from mpm.case.settings import file_in
from mpm.errors import InputError
from mpm.files import is_file
from mpm.sweep.conditions import Condition
from mpm.sweep.values import Range, to_number, unit_as_written
from mpm.units import LARGEST, describe

MOST_POINTS = 100_000
MODES = ("grid", "zip", "sample")
METHODS = ("sobol", "latin_hypercube")
SWEEP_KEYS = (
    *("axis", "case", "columns", "method", "mode", "pictures", "ranks", "samples"),
    *("seed", "set", "slurm", "title", "where"),
)
AXIS_KEYS = ("key", "linspace", "logspace", "name", "values")
RANGE_KEYS = ("num", "start", "stop")
DEFAULT_COLUMNS = (
    *("excess_number.*", "dose_ratio.*", "titration.*", "utilisation.*", "outlets.*", "cvd.*"),
    *("temperature.*", "heating.*", "energy.*", "species.*.balance_error", "simulated_seconds"),
)
DEFAULT_PICTURES = (
    *("titration.*.exit_mean", "utilisation.*", "cvd.rate_mean"),
    *("temperature.bed_exit", "heating.length"),
)


@dataclass(frozen=True)
class Axis:
    """One parameter: its levels as the file says them, or (mode "sample") the range they are drawn from."""

    name: str
    keys: tuple[str, ...]
    levels: tuple[Any, ...]
    span: Range | None
    unit: str
    """The unit as written, for labels; numbers in tables are SI."""
    si_unit: str

    @property
    def logarithmic(self) -> bool:
        """Whether the axis was asked for in equal ratios."""
        return self.span is not None and self.span.logarithmic

    def draw(self, fraction: float) -> Any:
        """The level at `fraction` in [0, 1): from the range, else one of the listed values."""
        if self.span is not None:
            return self.span.at(fraction)
        return self.levels[min(int(fraction * len(self.levels)), len(self.levels) - 1)]


@dataclass(frozen=True)
class Sweep:
    """A sweep file, read and checked; `base` already has the fixed overrides."""

    path: Path
    text: str
    title: str
    case: str
    base: Case
    mode: str
    axes: tuple[Axis, ...]
    fixed: Mapping[str, Any]
    conditions: tuple[Condition, ...]
    columns: tuple[str, ...]
    pictures: tuple[str, ...]
    samples: int
    method: str
    seed: int
    ranks: int
    slurm: Mapping[str, Any]
    idle: tuple[str, ...]
    """Keys that the file gives and that its mode does not read."""


def _known(path: Path, where: str, table: Mapping[str, Any], keys: Sequence[str]) -> None:
    for key in table:
        if key not in keys:
            raise InputError.at(path, f"{where}.{key}", "an unknown key", ", ".join(keys), known=keys)


def _take[T](
    path: Path, where: str, table: Mapping[str, Any], key: str, kind: type[T], default: T | None
) -> T:
    value = table.get(key, default)
    if value is None:
        raise InputError.at(path, f"{where}.{key}", "nothing", NOUNS[kind])
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise InputError.at(path, f"{where}.{key}", repr(value), NOUNS[kind])
    return value


NOUNS: dict[type, str] = {str: "text", int: "a whole number", list: "a list", dict: "a table"}


def _texts(path: Path, key: str, table: Mapping[str, Any], default: Sequence[str]) -> tuple[str, ...]:
    value = table.get(key, list(default))
    value = [value] if isinstance(value, str) else value
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise InputError.at(path, f"sweep.{key}", repr(value), "a list of texts")
    return tuple(value)


def _choice(path: Path, key: str, table: Mapping[str, Any], choices: Sequence[str]) -> str:
    value = _take(path, "sweep", table, key, str, choices[0])
    if value not in choices:
        raise InputError.at(path, f"sweep.{key}", repr(value), ", ".join(choices), known=choices, given=value)
    return value


def _at_least(
    path: Path, key: str, table: Mapping[str, Any], least: int, default: int | None, where: str = "sweep"
) -> int:
    value = _take(path, where, table, key, int, default)
    if not least <= value <= MOST_POINTS:
        raise InputError.at(
            path, f"{where}.{key}", describe(value), f"a whole number from {least} to {MOST_POINTS}"
        )
    return value


def _axis(path: Path, number: int, table: Any, sampled: bool) -> Axis:
    where = f"sweep.axis[{number}]"
    if not isinstance(table, dict):
        raise InputError.at(path, where, repr(table), "a table [[sweep.axis]]")
    _known(path, where, table, AXIS_KEYS)
    keys = table.get("key")
    keys = [keys] if isinstance(keys, str) else keys
    if not isinstance(keys, list) or not keys or not all(isinstance(key, str) and key for key in keys):
        found = "nothing" if keys is None else repr(keys)
        raise InputError.at(path, f"{where}.key", found, "a dotted key of the case, or a list of them")
    name = _take(path, where, table, "name", str, keys[0])
    given = [kind for kind in ("values", "linspace", "logspace") if kind in table]
    if len(given) != 1:
        raise InputError.at(
            path, f"{where} ({name})", " and ".join(given) or "no values", "one of values, linspace, logspace"
        )
    where = f"{where}.{given[0]} ({name})"
    if given == ["values"]:
        levels = table["values"]
        if not isinstance(levels, list) or not levels:
            raise InputError.at(path, where, repr(levels), "a list with at least one value")
        for level in levels:
            if isinstance(level, int | float) and not abs(level) <= LARGEST:
                raise InputError.at(path, where, describe(level), f"numbers of at most {LARGEST:g}")
        kinds = {(type(number).__name__, unit) for number, unit in map(to_number, levels)}
        if len(kinds) > 1:
            units = ", ".join(sorted(unit or "1" for _, unit in kinds))
            raise InputError.at(path, where, f"{levels!r} (units {units})", "values of one dimension")
        _, si_unit = to_number(levels[0])
        return Axis(name, tuple(keys), tuple(levels), None, unit_as_written(levels[0]), si_unit)
    ends = table[given[0]]
    if not isinstance(ends, dict):
        raise InputError.at(path, where, repr(ends), "a table { start, stop, num }")
    _known(path, where, ends, RANGE_KEYS)
    for key in ("start", "stop") if sampled else RANGE_KEYS:
        if key not in ends:
            raise InputError.at(
                path, f"{where}.{key}", "nothing", "start, stop" if sampled else "start, stop, num"
            )
    try:
        span = Range(ends["start"], ends["stop"], logarithmic=given == ["logspace"])
    except InputError as error:
        raise InputError(f"{path}: {where}: {error}") from None
    num = ends.get("num", 1)
    if not isinstance(num, int) or isinstance(num, bool) or not 1 <= num <= MOST_POINTS:
        raise InputError.at(path, f"{where}.num", describe(num), f"a whole number from 1 to {MOST_POINTS}")
    _, si_unit = to_number(ends["start"])
    return Axis(name, tuple(keys), () if sampled else span.levels(num), span, span.unit, si_unit)


def _slurm(path: Path, table: Mapping[str, Any]) -> Mapping[str, Any]:
    """[sweep.slurm] as it is, with the two numbers that are ours checked; dask_jobqueue looks at its own."""
    for key in ("workers", "points_per_job"):
        _at_least(path, key, table, 1, 1, where="sweep.slurm")
    return table


def _fixed(table: Mapping[str, Any]) -> dict[str, Any]:
    """`"time.end" = ...` as it is; `time.end = ...`, which TOML reads as nested tables, to dotted keys."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict) and "." not in key:
            flat |= {f"{key}.{inner}": item for inner, item in _fixed(value).items()}
        else:
            flat[key] = value
    return flat


def _base(path: Path, name: str, fixed: Mapping[str, Any]) -> Case:
    beside = path.parent / name
    source: str | Path = beside if is_file(beside) or name.endswith(".toml") else name
    try:
        return load_case(source, {key: file_in(path.resolve().parent, key, v) for key, v in fixed.items()})
    except InputError as error:
        if fixed:
            raise InputError(f"{path}: sweep.case with sweep.set: {error}") from None
        raise InputError(f"{path}: sweep.case: {error}") from None


def _idle(mode: str, table: Mapping[str, Any], items: Sequence[Any], axes: Sequence[Axis]) -> tuple[str, ...]:
    if mode != "sample":
        return tuple(f"sweep.{key}" for key in ("samples", "method", "seed") if key in table)
    ranges = [
        (axis, item.get("linspace") or item.get("logspace") or {})
        for axis, item in zip(axes, items, strict=True)
    ]
    return tuple(f"sweep.axis ({axis.name}).num" for axis, ends in ranges if "num" in ends)


def read_sweep(source: str | Path) -> Sweep:
    """Parse and check a sweep file and its base case; InputError for everything wrong with either."""
    path = sweep_file(source) if isinstance(source, str) else source
    text = read_input_text(path, SWEEP)
    document = parse_input(path, text, SWEEP)
    if "sweep" not in document:
        raise InputError.at(path, "sweep", "nothing", "a table [sweep] (is this a case? then: mpm run)")
    table = _take(path, "", document, "sweep", dict, None)
    for key in document.keys() - {"sweep"}:
        raise InputError.at(path, key, "an unknown table", "sweep", known=("sweep",), given=key)
    _known(path, "sweep", table, SWEEP_KEYS)
    mode = _choice(path, "mode", table, MODES)
    items = _take(path, "sweep", table, "axis", list, None)
    axes = tuple(_axis(path, number, item, mode == "sample") for number, item in enumerate(items))
    if not axes:
        raise InputError.at(path, "sweep.axis", "no axis", "at least one [[sweep.axis]]")
    fixed = _fixed(_take(path, "sweep", table, "set", dict, {}))
    taken: dict[str, str] = dict.fromkeys(fixed, "sweep.set")
    for axis in axes:
        for key in axis.keys:
            if key in taken:
                raise InputError.at(
                    path, f"sweep.axis ({axis.name})", f"{key} is also in {taken[key]}", "every key once"
                )
            taken[key] = f"axis {axis.name}"
    names = [axis.name for axis in axes]
    if len(set(names)) < len(names):
        raise InputError.at(path, "sweep.axis", f"names {', '.join(names)}", "every name once")
    if mode == "zip" and len({len(axis.levels) for axis in axes}) > 1:
        found = ", ".join(f"{axis.name}: {len(axis.levels)}" for axis in axes)
        raise InputError.at(path, "sweep.axis", f"mode zip with {found} values", "axes of equal length")
    aliases = {axis.name: axis.name for axis in axes if axis.name.isidentifier()}
    try:
        conditions = tuple(Condition(text, aliases) for text in _texts(path, "where", table, ()))
    except InputError as error:
        raise InputError(f"{path}: sweep.where: {error}") from None
    case = _take(path, "sweep", table, "case", str, None)
    return Sweep(
        path=path,
        text=text,
        title=_take(path, "sweep", table, "title", str, path.stem),
        case=case,
        base=_base(path, case, fixed),
        mode=mode,
        axes=axes,
        fixed=fixed,
        conditions=conditions,
        columns=_texts(path, "columns", table, DEFAULT_COLUMNS),
        pictures=_texts(path, "pictures", table, table.get("columns", DEFAULT_PICTURES)),
        samples=_at_least(path, "samples", table, 1, None if mode == "sample" else 1),
        method=_choice(path, "method", table, METHODS),
        seed=_at_least(path, "seed", table, 0, 0),
        ranks=_at_least(path, "ranks", table, 1, 1),
        slurm=_slurm(path, _take(path, "sweep", table, "slurm", dict, {})),
        idle=_idle(mode, table, items, axes),
    )
