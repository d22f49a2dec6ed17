"""Conventions that codes for the same equations do not share: which switches of a case there are, and presets of them.

Each switch is a key of its own, whose default is that of this model. `conventions = "closed-code"` puts the other values under those that a
case types: those of the solver with which the thesis computed, as far as manuals and the equations printed in the thesis tell, and where
they do not a guess. docs/conventions.md says which is which.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpm.case.tables import CaseTables

CLOSED_CODE: Mapping[str, Any] = {
    "transport.scheme": "upwind",
    "transport.backflow_rows": 2,
    "porous.diffusion": "free",
    "porous.inertia": "superficial",
    "porous.reaction_volume": "total",
    "motion.drag_reference": "superficial",
    "geometry.inlet_diffusion": True,
}
"""The switches by their dotted keys, with the values of the closed code."""
SWITCHES = tuple(CLOSED_CODE)
ADDED: Mapping[str, Any] = {
    "transport.scheme": "fitted",
    "transport.backflow_rows": 1,
    "porous.diffusion": "effective",
    "porous.inertia": "interstitial",
    "porous.reaction_volume": "gas",
    "motion.drag_reference": "pore",
}
"""Those that cases did not always have, with their defaults, under which a case is what it was without them."""
PRESETS: Mapping[str, Mapping[str, Any]] = {"mpm": {}, "closed-code": CLOSED_CODE}


def preset_tables(name: Any) -> dict[str, dict[str, Any]]:
    """The tables of a preset, to be laid under those of a case; none for a name that is no preset, which validation refuses."""
    tables: dict[str, dict[str, Any]] = {}
    for key, value in PRESETS.get(name, {}).items() if isinstance(name, str) else ():
        table, _, last = key.partition(".")
        tables.setdefault(table, {})[last] = value
    return tables


def drop_own(tables: dict[str, Any]) -> None:
    """Take out of a resolved case what says no more than that its conventions are this model's, and the name of the preset: what counts is
    how the switches stand."""
    del tables["conventions"]
    for key, value in ADDED.items():
        table, _, last = key.partition(".")
        if tables[table][last] == value:
            del tables[table][last]
    if not tables["porous"]:
        del tables["porous"]


def switches(case: CaseTables) -> dict[str, Any]:
    """Every switch of a case by its dotted key."""
    found: dict[str, Any] = {}
    for key in SWITCHES:
        table, _, last = key.partition(".")
        found[key] = getattr(getattr(case, table), last)
    return found


def conventions_of(case: CaseTables) -> dict[str, Any]:
    """The table `conventions` of summary.json: the preset, and every switch as it is."""
    return {"preset": case.conventions, **switches(case)}
