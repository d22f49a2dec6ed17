"""What a file or directory is that somebody names, and which verb takes it: for those who gave it to another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.case.merging import Table
from mpm.case.sources import parse_toml, read_source, read_toml
from mpm.errors import InputError


@dataclass(frozen=True)
class Kind:
    """One kind of input or result: `words` for it, and the `use` of one at {path}."""

    words: str
    use: str


CASE = Kind("a case file", "mpm check {path} looks at it, mpm run {path} runs it")
SWEEP = Kind("a sweep file", "mpm sweep {path} runs it")
POWDER = Kind("a powder file", "mpm dem {path} runs it")
MECHANISM = Kind("a mechanism file", "a case names it: chemistry.mechanism = '{path}'")
WAVEFORM = Kind("a waveform", "it belongs into a powder file, which mpm dem runs")
RUN = Kind(
    "the directory of a run",
    "mpm resume {path} goes on with it, mpm run {path}/case.toml runs it again, mpm plot {path} draws it",
)
SWEEP_RUN = Kind(
    "the directory of a sweep",
    "mpm report {path} shows it on a page, mpm sweep FILE.toml -o {path} goes on with it; its table is {path}/results.csv, "
    "its runs are in {path}/points",
)
DEM_RUN = Kind(
    "the directory of a particle simulation",
    "its pictures are in {path}/plots, its profile.csv is for motion.profile; mpm dem {path}/case.toml -o {path} --resume goes on with it",
)
SEARCH = Kind(
    "the directory of mpm optimise",
    "its pictures are in {path}/plots; mpm run {path}/case.toml runs the best doses",
)
_BY_ENDING = {
    ".csv": Kind("a table", "motion.profile names one of bed velocities, mpm dem waveform takes one of accelerations"),
    ".msh": Kind("a mesh", "mpm makes its own from a case: mpm mesh CASE"),
    ".json": Kind("a JSON file", "cases are TOML files"),
    ".pvd": Kind("a list of fields", "ParaView opens it"),
    ".vtu": Kind("fields", "ParaView opens them"),
    ".py": Kind("a Python program", "python {path} runs it"),
}  # fmt: skip
_CASE_KEYS = {"geometry", "fidelity", "material", "gas", "chemistry", "motion", "time", "output", "transport", "porous",
    "energy"}  # fmt: skip


def kind_of_tables(data: Mapping[str, Any]) -> Kind | None:
    """What a TOML file holds, by its first keys; None for what could be anything, as an empty one."""
    keys = set(data)
    if "sweep" in keys:
        return SWEEP
    if keys & {"powder", "box"}:
        return POWDER
    if keys & _CASE_KEYS:
        return CASE
    if keys & {"species", "site", "reaction", "film"}:
        return MECHANISM
    return WAVEFORM if "waveform" in keys else None


def kind_of_directory(path: Path) -> Kind | None:
    """What a directory holds; None for one that mpm has not written."""
    if any((path / name).exists() for name in ("sweep.json", "driver")):
        return SWEEP_RUN
    searched = (path / "points.csv").exists() or (path / "over.csv").exists()
    if searched and not (path / "run.log").exists():
        return SEARCH
    if not (path / "case.toml").is_file():
        return None
    if any(path.glob("seed_*")):
        return DEM_RUN
    return RUN


def what_it_is(path: Path) -> str:
    """Something at `path` in words, with what to do with it."""
    if path.is_dir():
        kind = kind_of_directory(path)
        files = sorted(file.name for file in path.glob("*.toml"))
        if kind is None:
            return f"a directory with {', '.join(files)}" if files else "a directory without case.toml"
    elif path.exists():
        kind = _BY_ENDING.get(path.suffix) or _kind_of_file(path)
    else:
        return "no such file or directory"
    return f"{kind.words}: {kind.use.format(path=path)}" if kind else "a file"


def _kind_of_file(path: Path) -> Kind | None:
    try:
        return kind_of_tables(read_toml(path))
    except InputError:
        return None


def read_input(path: Path, wanted: Kind) -> Table:
    """The tables of an input file. Raises InputError for what is of another kind than `wanted`, naming the verb that takes it."""
    return parse_input(path, read_input_text(path, wanted), wanted)


def read_input_text(path: Path, wanted: Kind) -> str:
    """The text of an input file; InputError for a directory, or a file that cannot be read."""
    if path.is_dir():
        raise InputError.at(path, "", what_it_is(path), wanted.words)
    return read_source(path)


def parse_input(path: Path, text: str, wanted: Kind) -> Table:
    """The tables in the text of an input file; InputError for another kind than `wanted`."""
    try:
        data = parse_toml(text, path)
    except InputError:
        if path.suffix in _BY_ENDING:
            raise InputError.at(path, "", what_it_is(path), wanted.words) from None
        raise
    kind = kind_of_tables(data)
    if kind not in (wanted, None):
        raise InputError.at(path, "", what_it_is(path), wanted.words)
    return data
