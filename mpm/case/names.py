"""Files that a person names on the command line: a path, or the name of what comes with mpm. A wrong name lists the right ones."""

from __future__ import annotations

from pathlib import Path

from mpm.case.sources import built_in_files
from mpm.errors import InputError
from mpm.files import is_file

POWDER_FILES = "cases/dem"
"""Folder of the powder files that come with mpm."""
SWEEP_FILES = "cases/sweeps"
"""The same for sweep files."""


def case_file(name: str) -> Path:
    """The file of a case: a path, or a built-in case by name."""
    return _file(name, "cases", "the path of a case file, or a built-in case")


def powder_file(name: str) -> Path:
    """The file of a powder, for `mpm dem`: a path, or a built-in one by name."""
    return _file(name, POWDER_FILES, "the path of a powder file, or a built-in one")


def sweep_file(name: str) -> Path:
    """The file of a sweep: a path, or a built-in one by name."""
    return _file(name, SWEEP_FILES, "the path of a sweep file, or a built-in one")


def case_or_geometry(name: str) -> str | Path:
    """What `mpm mesh` takes: a shared geometry by name beside whatever is a case."""
    geometry = built_in_files("meshes").get(name)
    return name if geometry is None or is_file(Path(name)) or name in built_in_files("cases") else geometry


def _file(name: str, folder: str, accepted: str) -> Path:
    path, built_in = Path(name), built_in_files(folder)
    if is_file(path):
        return path
    if name in built_in:
        return built_in[name]
    accepted = f"{accepted}: {', '.join(built_in)}"
    if folder == "cases" and name in built_in_files("meshes"):
        raise InputError.at(
            name,
            "",
            "the name of a geometry, which alone is no case",
            f'{accepted}; a case with base = "{name}" in its [geometry] can be run, and mpm mesh {name} meshes it',
            given="",
        )
    if _is_dir(path):
        return path  # reading it says what is wrong
    raise InputError.at(name, "", "no such file", accepted, given=name, known=[*built_in, *_beside(path)])


def _is_dir(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def _beside(path: Path) -> list[str]:
    """TOML files in the folder where `path` should be, as they would be typed."""
    try:
        return [str(path.with_name(entry.name)) for entry in sorted(path.parent.glob("*.toml"))]
    except (OSError, ValueError):  # a name that no file can have
        return []
