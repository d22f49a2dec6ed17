"""`--set KEY=VALUE` of the command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpm.errors import InputError


def parse_settings(settings: Sequence[str] | None, example: str = "motion.gamma=0.4") -> dict[str, Any]:
    """Split `KEY=VALUE` arguments; a value is TOML if it can be read as such, else a string."""
    from mpm.caseio import parse_toml  # only where there is something to read: --help is quick

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
        overrides[key.strip()] = table["value"] if len(table) == 1 else text
    return overrides
