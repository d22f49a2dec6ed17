"""What the shell may complete: built-in cases and case files, directories of runs, keys. Paths beyond that the shell completes itself."""

from __future__ import annotations

from pathlib import Path

import typer

from mpm.errors import MpmError


def complete_case(incomplete: str) -> list[str]:
    """Names of built-in cases, and what lies here; nothing, so that the shell takes over, where only directories fit."""
    from mpm.case.sources import built_in_files

    if "/" in incomplete:
        return []
    here = sorted(path for path in Path().iterdir() if path.suffix == ".toml" or path.is_dir())
    files = [path.name for path in here if path.is_file()]
    found = [name for name in (*built_in_files("cases"), *files) if name.startswith(incomplete)]
    folders = [f"{path.name}/" for path in here if path.is_dir() and path.name.startswith(incomplete or "\0")]
    return [*found, *folders] if found else []


def complete_mechanism(incomplete: str) -> list[str]:
    """Built-in mechanisms and files of Cantera beside what may be a case."""
    from mpm.case.sources import built_in_files

    if "/" in incomplete:
        return []
    here = sorted(path.name for path in Path().iterdir() if path.suffix in (".yaml", ".yml"))
    found = [name for name in (*built_in_files("mechanisms"), *here) if name.startswith(incomplete)]
    return [*found, *complete_case(incomplete)]


def complete_run(incomplete: str) -> list[str]:
    """Directories of runs in results/."""
    found = (str(file.parent) for file in sorted(Path("results").glob("*/case.toml")))
    return [name for name in found if name.startswith(incomplete)]


def complete_setting(context: typer.Context, incomplete: str) -> list[str]:
    """Keys of the case that stands before --set on the line; of no other, since only it knows its ports and layers."""
    from mpm.case.case import load_case
    from mpm.case.keys import values

    for case in filter(
        None, (context.params.get("case"), context.params.get("source"), *context.args)
    ):  # the latter while the line is unfinished
        try:
            return [value.name for value in values(load_case(case)) if value.name.startswith(incomplete)]
        except (MpmError, OSError):
            continue
    return []


def complete_key(incomplete: str) -> list[str]:
    """Every key that a case file may have."""
    from mpm.case.keys import all_keys

    return [key.name for key in all_keys() if key.name.startswith(incomplete)]
