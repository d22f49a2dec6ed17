"""`--set KEY=VALUE` of the command line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpm.errors import InputError


def parse_settings(settings: Sequence[str] | None, example: str = "motion.gamma=0.4") -> dict[str, Any]:
    """Split `KEY=VALUE` arguments; a value is TOML if it can be read as such, else a string."""
    from mpm.case.sources import parse_toml  # only where there is something to read: --help is quick

    overrides: dict[str, Any] = {}
    for setting in settings or ():
        key, equals, text = setting.partition("=")
        if not equals or not key.strip():
            raise InputError.at("--set", "", repr(setting), f"KEY=VALUE, e.g. {example}", given="")
        if any("\ud800" <= character <= "\udfff" for character in setting):  # bytes of another encoding
            raise InputError.at("--set", key, repr(text), "text that can be written as UTF-8", given="")
        try:
            table = parse_toml(f"value = {text}", "--set")
        except InputError:
            table = {"value": text}
        overrides[key.strip()] = _where_typed(key.strip(), table["value"] if len(table) == 1 else text)
    return overrides


PATHS = ("geometry.base", "chemistry.mechanism", "motion.profile", "waveform.file")
"""Keys whose value may be the path of a file."""


def _where_typed(key: str, value: Any) -> Any:
    """A path typed in a shell is relative to where the user stands; a name stays one, unless there is a file of it."""
    if key not in PATHS or not isinstance(value, str):
        return value
    of_cantera = key == "chemistry.mechanism" and Path(value).suffix in (
        ".yaml",
        ".yml",
    )  # which has files of its own
    looks_like_a_name = (of_cantera or not Path(value).suffix) and len(Path(value).parts) == 1
    found = file_in(Path.cwd(), key, value)
    return found if found != value or looks_like_a_name else str(Path.cwd() / value)


def file_in(folder: Path, key: str, value: Any) -> Any:
    """The file that a value names in `folder`, where it is one of a key that may be a path; else the value as it is."""
    if key not in PATHS or not isinstance(value, str):
        return value
    from mpm.files import is_file

    return str(folder / value) if is_file(folder / value) else value
