"""The two columns of the document: verdicts under both conventions, with which revision, and the switches that turn a row."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from reproduction import ROWS
from reproduction.row import HOLDS
from reproduction.settings import alone
from reproduction.thesis_mesh import AT_THESIS_COLUMNS, END, WANTED

Found = dict[str, dict[str, Any]]
"""Findings by row."""
ONLY, NOT_FOR, WHOLE = "reproduced only for: ", " (not for: ", "the row"
"""How a verdict in part is written (`reproduction.row.Checks`), and the one condition of a row that names none."""
NAMES = {"mpm": "mpm", "closed-code": "closed code"}


@dataclass(frozen=True)
class Columns:
    """What has been measured: findings by row under both conventions, at the thesis' columns by convention, by switch alone, and
    by switch left out of the preset."""

    mpm: Found
    closed: Found
    alone: dict[str, Found]
    fine: dict[str, Found]
    without: dict[str, Found] = field(default_factory=dict)

    @property
    def both(self) -> dict[str, Found]:
        return {"mpm": self.mpm, "closed-code": self.closed}

    @property
    def turned(self) -> list[str]:
        """Rows measured under both conventions whose verdicts differ."""
        return [
            name
            for name in ROWS
            if name in self.mpm
            and name in self.closed
            and self.mpm[name]["verdict"] != self.closed[name]["verdict"]
        ]


def programs(found: Found) -> set[str]:
    """Revisions that a column's findings and their runs were made with, without the commit: version and digest decide numbers."""
    texts = [
        text
        for one in found.values()
        for text in (one.get("revision", "unknown"), *one.get("runs by", ["unknown"]))
    ]
    return {text.partition(", commit ")[0] for text in texts}


def commits(found: Found) -> set[str]:
    """The whole revisions, with their commits."""
    return {one.get("revision", "unknown") for one in found.values()}


def revision_text(columns: Columns) -> str:
    """With which revision the columns were measured; that they differ when they do."""
    used = {name: programs(found) for name, found in columns.both.items() if found}
    everything: set[str] = set().union(*used.values())
    if not everything:
        return ""
    if len(everything) == 1 and "unknown" not in everything:
        texts = "; ".join(sorted(set().union(*(commits(found) for found in columns.both.values()))))
        which = "Both columns were" if len(used) == 2 else "The column was"
        return f"{which} measured with one revision of the program: {texts}.\n\n"
    parts = "; ".join(f"*{NAMES[name]}* with {' and '.join(sorted(texts))}" for name, texts in used.items())
    return (
        f"**The columns were not measured with one revision of the program:** {parts}. Where they differ, the program may be the "
        "reason and not the conventions.\n\n"
    )


def strays(columns: Columns, geometry: dict[str, Found]) -> str:
    """Which of the other measurements were made with a program that neither column was measured with."""
    known = programs(columns.mpm) | programs(columns.closed)
    parts = {f"the switch `{key}` alone": found for key, found in columns.alone.items()}
    parts |= {f"the preset without `{key}`": found for key, found in columns.without.items()}
    parts |= {f"the thesis' columns, *{NAMES[key]}*": found for key, found in columns.fine.items()}
    parts |= {f"geometry, {point}": found for point, found in geometry.items()}
    lines = [
        f"* {what}: {' and '.join(sorted(programs(found) - known))}."
        for what, found in parts.items()
        if not programs(found) <= known
    ]
    return (
        "**Measured with another revision than the columns:**\n\n" + "\n".join(lines) + "\n\n"
        if lines
        else ""
    )


def counts(name: str, found: Found) -> str:
    """How many rows hold in a column."""
    holds = sum(one["verdict"] == HOLDS for one in found.values())
    fails = sum(one["verdict"].startswith("not") for one in found.values())
    return (
        f"*{NAMES[name]}*: of {len(found)} rows measured {holds} are reproduced, {fails} are not, "
        f"{len(found) - holds - fails} are reproduced in part or under a condition."
    )


def _cells(name: str, found: dict[str, Any] | None, fine: dict[str, Any] | None) -> tuple[str, str]:
    """Measured and verdict of a row in a column, at the thesis' columns too where that was measured."""
    measured, verdict = (found["measured"], f"**{found['verdict']}**") if found else ("", "not measured")
    if fine:
        measured += f"; at the thesis' columns: {fine['measured']}"
        so_far = " as far as measured" if unmeasured(name, fine["numbers"]) else ""
        verdict += f"; at the thesis' columns{so_far}: **{fine['verdict']}**"
    return measured, verdict


def _used(columns: Columns, name: str) -> str:
    """Meshes and fidelities of a row: of both columns where they are not the same."""
    texts = {key: found[name]["used"] for key, found in columns.both.items() if name in found}
    same = len(set(texts.values())) == 1
    used = next(iter(texts.values())) if same else "; ".join(f"*{NAMES[k]}*: {t}" for k, t in texts.items())
    fine = next((found[name]["used"] for found in columns.fine.values() if name in found), "")
    return "; ".join(text for text in (used, fine) if text)


def table(columns: Columns) -> str:
    """The table of all rows; one that has not been measured says so."""
    lines = [
        "| | figure | statement | expected | measured | verdict | measured, closed code | verdict, closed code "
        "| mesh: fidelity | command |",
        "|---" * 10 + "|",
    ]
    for name, row in ROWS.items():
        cells = [name, row.figure, row.statement, row.expected]
        for key, found in columns.both.items():
            cells += _cells(name, found.get(name), columns.fine.get(key, {}).get(name))
        cells += [_used(columns, name), f"`scripts/reproduce.py {name}`"]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    summary = " ".join(counts(name, found) for name, found in columns.both.items() if found)
    if columns.turned:
        summary += f" Verdicts differ in {len(columns.turned)} rows: {', '.join(columns.turned)}."
    return "## Verdicts\n\n" + summary + "\n\n" + revision_text(columns) + "\n".join(lines) + "\n\n"


def conditions(*verdicts: str) -> list[str]:
    """Names of the conditions that verdicts are made of, as far as one of them tells: one that holds or fails as a whole names none."""
    names: dict[str, None] = {}
    for verdict in verdicts:
        if verdict.startswith(ONLY):
            for part in verdict.removeprefix(ONLY).removesuffix(")").split(NOT_FOR):
                names |= dict.fromkeys(part.split("; "))
    return sorted(names) or [WHOLE]


def holds(verdict: str, condition: str) -> bool:
    """Whether a condition is fulfilled according to a verdict."""
    if not verdict.startswith(ONLY):
        return verdict == HOLDS
    return condition in verdict.removeprefix(ONLY).partition(NOT_FOR)[0].split("; ")


def turning(columns: Columns, name: str) -> dict[str, dict[str, bool]]:
    """Conditions of a row that a switch alone, or the whole preset, turns: which switches turn it, of those that were measured."""
    own, closed = columns.mpm[name]["verdict"], columns.closed[name]["verdict"]
    single = {key: found[name]["verdict"] for key, found in columns.alone.items() if name in found}
    found = {}
    for condition in conditions(own, closed, *single.values()):
        before = holds(own, condition)
        turns = {key: holds(verdict, condition) != before for key, verdict in single.items()}
        if any(turns.values()) or holds(closed, condition) != before:
            found[condition] = turns
    return found


def needed(columns: Columns, name: str, condition: str) -> str:
    """Switches without which the preset gives the model's own outcome of a condition; empty where that was not measured."""
    own = holds(columns.mpm[name]["verdict"], condition)
    if own == holds(columns.closed[name]["verdict"], condition):
        return ""
    left_out = {key: found[name]["verdict"] for key, found in columns.without.items() if name in found}
    if len(left_out) < len(alone()):
        return "not measured"
    return (
        ", ".join(f"`{key}`" for key, verdict in left_out.items() if holds(verdict, condition) == own)
        or "none"
    )


def source(columns: Columns, coarse: Columns | None, name: str) -> Columns:
    """Where the switches of a row are taken from: its own meshes, or the coarsest where they were measured there alone.

    The coarsest mesh counts only where both verdicts there are those of the columns.
    """
    here = any(name in found for found in columns.alone.values())
    if here or coarse is None or not any(name in found for found in coarse.alone.values()):
        return columns
    same = all(
        found.get(name, {}).get("verdict") == columns.both[key][name]["verdict"]
        for key, found in coarse.both.items()
    )
    return coarse if same else columns


def turns_text(columns: Columns, coarse: Columns | None = None) -> str:
    """The conditions of rows that the conventions turn, and which switch turns each, alone."""
    text = "## Rows that turn with the conventions\n\n"
    if not columns.turned:
        return text + "Of the rows measured under both conventions none.\n\n"
    text += (
        "Each switch of the preset was set alone in the model's own conventions (`scripts/reproduce.py --switches R8`). Listed is every "
        "condition of these rows that the preset or one of its switches turns. *Needed*: without it the preset does not turn the condition "
        "(`scripts/reproduce.py --without R12`).\n\n"
        "| | condition | mpm | closed code | turned by these switches, each alone | not measured alone | needed |\n"
        + "|---" * 7
        + "|\n"
    )
    for name in columns.turned:
        measured = source(columns, coarse, name)
        mesh = " (coarsest mesh, where both verdicts are the same)" if measured is coarse else ""
        own, closed = (found[name]["verdict"] for found in columns.both.values())
        for condition, turns in turning(measured, name).items():
            cells = [name + mesh, condition]
            cells += ["holds" if holds(verdict, condition) else "does not" for verdict in (own, closed)]
            cells.append(", ".join(f"`{key}`" for key, turned in turns.items() if turned) or "none")
            cells.append(", ".join(f"`{key}`" for key in alone() if key not in turns))
            cells.append(needed(measured, name, condition))
            text += "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"
    return text + "\n" + details(columns, coarse) + "\n"


def details(columns: Columns, coarse: Columns | None) -> str:
    """What was measured under each switch alone that changes a number of the row."""
    lines = []
    for name in columns.turned:
        measured = source(columns, coarse, name)
        for key in alone():
            one = measured.alone.get(key, {}).get(name)
            if one and one["measured"] != measured.mpm[name]["measured"]:
                lines.append(f"* **{name}**, `{key}` alone: {one['measured']}.\n")
    return "".join(lines)


def unmeasured(name: str, numbers: dict[str, Any]) -> list[str]:
    """States of a row at the thesis' columns that were not measured, or not to the end."""
    lacking = [state for state in WANTED[name] if state not in numbers]
    return lacking + [
        f"{state} after {one['time'][-1]:.1f} s of {END}"
        for state, one in numbers.items()
        if one.get("time") and one["time"][-1] < float(END.removesuffix(" s")) - 0.1
    ]


def missing_text(columns: Columns) -> str:
    """What the document asks for and has not been measured."""
    lines = []
    for key, found in columns.both.items():
        rows = [name for name in ROWS if name not in found]
        if rows:
            lines.append(f"* *{NAMES[key]}*: {', '.join(rows)}.")
        fine = columns.fine.get(key, {})
        for name in AT_THESIS_COLUMNS:
            lacking = unmeasured(name, fine.get(name, {}).get("numbers", {}))
            if lacking:
                lines.append(f"* {name} at the thesis' columns, *{NAMES[key]}*: {'; '.join(lacking)}.")
    return "Not measured:\n\n" + "\n".join(lines) + "\n\n" if lines else ""
