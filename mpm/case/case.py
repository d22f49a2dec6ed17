"""A case: everything that defines one simulation, read from TOML, checked, in SI units.

The classes of its tables are parser, JSON Schema and dump at once. Conversion of units happens while they are built (see
`mpm.units`); what a case file leaves out is filled in, so that `case.to_toml()` shows every value that is used.

    case = load_case("cases/single_zone.toml", {"geometry.inlet.tma.velocity": "4 cm/s"})
    faster = case.with_({"motion.gamma": 0.4})
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import PrivateAttr, ValidationError

from mpm.case.cantera_file import cantera_site_density
from mpm.case.chemistry import drop_heats
from mpm.case.conventions import drop_own
from mpm.case.kinds import CASE, read_input
from mpm.case.messages import to_input_error
from mpm.case.names import case_file
from mpm.case.notebook import case_html
from mpm.case.schema import DRAFT, finished
from mpm.case.sources import assemble, mechanism_source, write_toml
from mpm.case.tables import CaseTables
from mpm.case.walls import named_walls


@dataclass(frozen=True)
class Origin:
    """What a case was put together from: the tables of the file, dotted overrides, the folder that its paths start from, its name."""

    data: Mapping[str, Any]
    overrides: Mapping[str, Any]
    folder: Path
    label: str


class Case(CaseTables):
    """One simulation. Equal cases have equal content, wherever they were read from."""

    _source: Path | None = PrivateAttr(None)
    _origin: Origin = PrivateAttr()

    @property
    def source(self) -> Path | None:
        """The file the case was read from, if any."""
        return self._source

    @property
    def origin(self) -> Origin:
        """What the case was put together from."""
        return self._origin

    def typed(self, table: str) -> set[str]:
        """Keys below the dotted name of a table, such as `material.glass_beads`, that the file itself or an override gives."""
        overrides = self.origin.overrides
        node: Any = self.origin.data
        for part in table.split("."):
            node = node.get(part) if isinstance(node, Mapping) else None
        below = {
            key.removeprefix(f"{table}.").split(".")[0] for key in overrides if key.startswith(f"{table}.")
        }
        return below | (set(node) if isinstance(node, Mapping) else set())

    @property
    def mechanism_site_density(self) -> float | None:
        """Sites per area [mol/m2] that the file of the mechanism is written for; None unless it is one of Cantera."""
        of = self.origin
        return cantera_site_density(mechanism_source(of.data, of.overrides), of.folder)

    def with_(self, changes: Mapping[str, Any]) -> Case:
        """Return the case that the same file gives with these dotted keys changed; everything is checked anew."""
        of = self.origin
        case = build_case(of.data, {**of.overrides, **changes}, of.folder, of.label)
        case._source = self._source
        return case

    def to_dict(self) -> dict[str, Any]:
        """The resolved case as the tables of a case file, dimensional values as strings in SI units."""
        tables: dict[str, Any] = self.model_dump(mode="json", by_alias=True, exclude_none=True)
        if self.energy is None and self.chemistry.mechanism != "inline":
            drop_heats(tables["chemistry"], self.mechanism.equilibrated)
        return tables

    def to_toml(self) -> str:
        """The resolved case as a case file that can be run as it is."""
        return write_toml(self.to_dict())

    def content_hash(self) -> str:
        """Hexadecimal digest of everything that determines the results; a motion profile counts with its content, conventions where they
        are not this model's."""
        content = self.to_dict()
        drop_own(content)
        content["motion"]["profile"] = self.motion.profile_content
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return case_html(self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Case) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(self.content_hash())


def load_case(source: str | Path | Mapping[str, Any], overrides: Mapping[str, Any] | None = None) -> Case:
    """Read and check a case.

    source: path of a TOML file, name of a built-in case, or the tables themselves (paths in them are then relative
    to the working directory). overrides: dotted keys, list entries by name, as `{"geometry.inlet.tma.start": "5 s"}`.
    Raises InputError, whose message is one line.
    """
    if isinstance(source, Mapping):
        return build_case(source, overrides or {}, Path.cwd(), "case")
    path = case_file(source) if isinstance(source, str) else source
    case = build_case(read_input(path, CASE), overrides or {}, path.resolve().parent, str(source))
    case._source = path
    return case


def case_schema() -> dict[str, Any]:
    """JSON Schema of a case file, for editors."""
    schema = finished(Case.model_json_schema(by_alias=True))
    return {"$schema": DRAFT, **schema}


def build_case(data: Mapping[str, Any], overrides: Mapping[str, Any], folder: Path, label: str) -> Case:
    data, overrides = named_walls(data), named_walls(overrides)
    tables = assemble(data, overrides, folder, label)
    try:
        case = Case.model_validate(tables)
    except ValidationError as error:
        raise to_input_error(error, Case, tables, label) from None
    case._origin = Origin(data, dict(overrides), folder, label)
    return case
