"""`mpm optimise --over KEY=VALUE,VALUE,...`: the best doses at each value of another key, as of Gamma or friction."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpm.advice.idle import reason
from mpm.case.settings import parse_settings
from mpm.errors import ConvergenceError, InputError
from mpm.files import write_atomically
from mpm.report.dosing import inlet_excess
from mpm.screen import number, say

if TYPE_CHECKING:
    from rich.console import Console

    from mpm.case.case import Case
    from mpm.optimise import Search

EXAMPLE = "motion.gamma=0.3,0.45,0.6"
BED = "motion.bed_velocity"
"""The column of the bed's speed [m/s]; a search over it has the number there in place of the text."""


@dataclass(frozen=True, kw_only=True)
class Variant:
    """The case at one value of the key: `text` as it was typed, which names its directory too."""

    text: str
    case: Case


def variants(case: Case, over: str, velocities: bool) -> tuple[str, list[Variant]]:
    """The key, and the case at each value. Raises InputError for what is no such list, for a dose, which the search chooses itself (port
    velocities too with `velocities`), for a key that steady states of the case do not read, and where a case is refused."""
    key, equals, values = over.partition("=")
    texts = [text.strip() for text in values.split(",")]
    if not equals or not key.strip() or not all(texts) or len(set(texts)) < len(texts):
        raise InputError.at("--over", "", repr(over), f"KEY=VALUE,VALUE,..., e.g. {EXAMPLE}", given="")
    if key.strip() in _chosen(case, velocities):
        raise InputError.at(
            "--over", "", f"{key.strip()}, which the search chooses", "a key that is no dose", given=""
        )
    found = []
    for text in texts:
        settings: dict[str, Any] = parse_settings([f"{key}={text}"])
        found.append(Variant(text=text, case=case.with_(settings)))
    why = _unread(key.strip(), found)
    if why:
        raise InputError.at(
            "--over", "", f"{key.strip()}, which has no effect here ({why})", "a key that has", given=""
        )
    return key.strip(), found


def _unread(key: str, cases: list[Variant]) -> str | None:
    """Why the steady states that are searched are the same at all values of a key; None where two values or more may count.

    The default says nothing (`mpm.advice.idle`) and so has no reason, but only one value can be that.
    """
    found = [reason(one.case.with_({"fidelity": "steady"}), key) for one in cases]
    return next((why for why in found if why), None) if found.count(None) < 2 else None


def _chosen(case: Case, velocities: bool) -> set[str]:
    """Keys of the doses that the search varies."""
    found = set()
    for inlet in case.geometry.inlets:
        excess = inlet_excess(case, inlet)
        if excess is not None:
            found.add(f"geometry.inlet.{inlet.name}.mass_fractions.{excess.species}")
            found |= {f"geometry.inlet.{inlet.name}.velocity"} if velocities else set()
    return found


def folder_of(directory: Path, text: str) -> Path:
    """Where the search at a value goes: its text without what a path would not take."""
    return directory / "".join(c if c.isalnum() or c in "._+-" else "_" for c in text)


def search_over(
    key: str,
    cases: list[Variant],
    directory: Path,
    search: Callable[[Case, Path], Search],
    console: Console | None,
) -> None:
    """Search at each value; `over.csv` grows by a row after each, `console` (on one rank) is told.

    A value at which no dose can be chosen, or none reaches the target, has its reason in place of numbers. Raises ConvergenceError where
    that is so of all.
    """
    rows: list[dict[str, Any]] = []
    for variant in cases:
        row: dict[str, Any] = {key: variant.text, BED: variant.case.conveying_velocity}
        if console is not None:
            console.print()
            say(console, f"{key} = {variant.text}: bed at {_speed(row)}")
        try:
            row |= _numbers(search(variant.case, folder_of(directory, variant.text)))
        except (InputError, ConvergenceError) as error:
            row["reason"] = str(error)
            if console is not None:
                say(console, str(error), 2)
        rows.append(row)
        if console is not None:
            write_atomically(directory / "over.csv", _table(rows))
    if console is not None:
        print_over(key, [variant.text for variant in cases], rows, directory, console)
    if all("reason" in row for row in rows):
        raise ConvergenceError(f"optimise: no value of {key} has doses that reach the target")


def _numbers(search: Search) -> dict[str, Any]:
    best = search.found()
    numbers: dict[str, Any] = dict(best.doses)
    for inlet, value in best.exits.items():
        numbers[f"titration.{inlet}.exit_mean"] = value
        numbers[f"excess_number.{inlet}"] = best.excess[inlet]
    return {**numbers, "fed": best.fed, "cvd.total": best.cvd}


def _table(rows: list[dict[str, Any]]) -> str:
    names = dict.fromkeys(name for row in rows for name in row)
    text = io.StringIO()
    table = csv.DictWriter(text, list(names), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue()


def print_over(
    key: str, texts: list[str], rows: list[dict[str, Any]], directory: Path, console: Console
) -> None:
    """The best doses side by side, by the values as they were typed."""
    console.print()
    say(console, f"Best doses over {key}:")
    for text, row in zip(texts, rows, strict=True):
        if "reason" in row:
            said = "no doses found"
        else:
            inlets = [name.split(".")[1] for name in row if name.startswith("excess_number.")]
            doses = [
                f"{name.split('.')[2]} {value:.4g}"
                for name, value in row.items()
                if ".mass_fractions." in name
            ]
            doses += [
                f"{name.split('.')[2]} at {number(1e2 * value, 'cm/s')}"
                for name, value in row.items()
                if name.startswith("geometry.inlet.") and name.endswith(".velocity") and name != key
            ]
            used = ", ".join(f"{row[f'excess_number.{inlet}']:.4g} of {inlet}" for inlet in inlets)
            said = f"mass fraction {', '.join(doses)}; molecules per site {used}"
        say(console, f"{text}: bed at {_speed(row)}; {said}", 2)
    say(console, f"Results: {directory}: over.csv, and a directory per value")


def _speed(row: dict[str, Any]) -> str:
    return number(1e2 * row[BED], "cm/s")
