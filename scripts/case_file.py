"""Write docs/case_file.md, the reference of the case file, from what `mpm explain` knows: python scripts/case_file.py"""

from __future__ import annotations

from pathlib import Path

from mpm.case.keys import Key, all_keys, keys_of

HEAD = """\
# The case file

A case is a TOML file. Every value that has a dimension is a string with its unit (`"3.5 cm/s"`), and what is left out has a default.
`mpm new FILE` writes a case with all keys in it, `mpm explain KEY` says on the screen what stands here, and more: an example, which
fidelities read a key, and which keys belong together. In `--set` and in sweeps a key is written with dots, list entries by their names:
`geometry.inlet.tma.velocity`.

This file is written by `scripts/case_file.py` from the descriptions in the program.
"""


def reference() -> str:
    """The text of the document."""
    sections = [HEAD, "## At the top", *_table("")]
    for key in all_keys():
        if key.is_table and any(not below.is_table for below in keys_of(key.name)):
            sections += ["", f"## `{_header(key)}`", "", f"{_sentence(key.description)}.", *_table(key.name)]
    return "\n".join(sections) + "\n"


def _header(key: Key) -> str:
    if not key.entries:
        return f"[{key.name}]"
    return f"[[{key.name}]]" if "[[" in key.kind else f"[{key.name}.NAME]"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _table(name: str) -> list[str]:
    rows = [
        f"| `{key.last}` | {_cell(key.description)} | {_cell(_takes(key))} | {_cell(_default(key))} |"
        for key in keys_of(name)
        if not key.is_table
    ]
    return ["", "| key | meaning | takes | default |", "|---|---|---|---|", *rows]


def _takes(key: Key) -> str:
    names = ", ".join(f"`{choice}`" for choice in key.choices)
    if not names:
        return f"{key.kind}, e.g. `{key.example}`" if key.example != key.default else key.kind
    return f"{key.kind}: {names}" if key.free else names


def _default(key: Key) -> str:
    if key.required or key.worked_out:
        return key.default_text
    return f"`{key.default}`" if key.default else ""


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


if __name__ == "__main__":
    (Path(__file__).parents[1] / "docs" / "case_file.md").write_text(reference(), encoding="utf-8")
