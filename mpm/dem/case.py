"""The powder file of `mpm dem` (TOML): one set of classes reads it, checks it and writes it back.

Quantities carry units as everywhere in mpm; lengths of the box are pure numbers, counted in mean particle
diameters. Reading needs no LAMMPS.
"""

import hashlib
import math
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import PrivateAttr, ValidationError, model_validator

from mpm.arrays import Floats
from mpm.case.kinds import POWDER, read_input
from mpm.case.merging import Table
from mpm.case.messages import to_input_error
from mpm.case.model import Frozen
from mpm.case.names import powder_file
from mpm.case.schema import DRAFT, finished
from mpm.case.sources import set_key
from mpm.units import reject

from .base import SETTLED
from .powder import POWDERS, SMALLEST, Powder
from .powder_input import PowderInput
from .tables import MOST_SEEDS, BoxInput, GasInput, ProfileInput, RunInput
from .waveform import Waveform
from .waveform_input import MeasuredInput, WaveformInput

MOST_PARTICLES = 5_000_000
"""More would take days for a cycle, and a box of some billions, by a slip of a unit, all memory before a word is said."""


class DemCase(Frozen):
    """A powder file."""

    title: str = "DEM substudy"
    """a line that names the simulation"""
    powder: PowderInput
    """the particles: the name of a built-in powder, or a table"""
    waveform: WaveformInput
    """how the conveyor moves; its kind says which keys there are"""
    box: BoxInput = BoxInput()
    """the periodic box, its bed, base and contacts"""
    gas: GasInput | None = None
    """gas in the bed; left out: none"""
    run: RunInput = RunInput()
    """packings, cycles and sampling"""
    profile: ProfileInput = ProfileInput()
    """what is made of the velocity of the bed"""
    _directory: Path = PrivateAttr(Path())

    @model_validator(mode="after")
    def baffle_fits(self) -> "DemCase":
        if (
            self.box.base == "sawtooth"
            and self.box.baffle_width > self.box.length * self.build_powder().diameter
        ):
            raise reject(f"{self.box.baffle_width:g} m", "up to box.length", key="box.baffle_width")
        return self

    @model_validator(mode="after")
    def can_be_held(self) -> "DemCase":
        box, d = self.box, self.build_powder().diameter
        bed = SETTLED * box.length * box.depth * box.height / (math.pi / 6.0)
        glued = 0.0 if box.base == "flat" else box.length * box.depth * (d / box.frit_diameter) ** 2
        if bed + glued > MOST_PARTICLES:
            raise reject(
                f"a box of about {bed:.2g} particles on {glued:.2g} glued ones",
                f"up to {MOST_PARTICLES:,} in all",
                key="box",
            )
        return self

    @model_validator(mode="after")
    def sizes_keep_the_mean(self) -> "DemCase":
        powder, count = self.build_powder(), self.box.size_classes
        largest = powder.largest_deviation(count)
        if powder.deviation > largest:
            raise reject(
                f"{powder.deviation * 1e6:.4g} um beside a mean diameter of {powder.diameter * 1e6:.4g} um in {count} size classes, "
                f"of which the smallest would lie below {SMALLEST:g} of the mean",
                f"up to {largest * 1e6:.4g} um, or fewer classes (box.size_classes)",
                key="powder.deviation",
            )
        return self

    def build_powder(self) -> Powder:
        return self.powder.build()

    def build_waveform(self) -> Waveform:
        return self.waveform.build(self._directory)

    def diameters(self) -> Floats:
        """Diameters of the size classes [m]."""
        return self.build_powder().size_classes(self.box.size_classes)

    def to_toml(self) -> str:
        """The resolved file, runnable as it is (paths of data files made absolute)."""
        data = self.model_dump(mode="json", exclude_none=True)
        if isinstance(self.waveform, MeasuredInput):
            data["waveform"]["file"] = str((self._directory / self.waveform.file).resolve())
        return tomli_w.dumps(data)

    def content_hash(self) -> str:
        """Identifies what determines one seed's trajectory: all but the title, the seeds and the profile."""
        data = self.model_dump(mode="json", exclude={"title", "profile"})
        for key in ("seeds", "cycles", "discard"):
            data["run"].pop(key)
        return hashlib.sha256(repr(data).encode()).hexdigest()[:16]


def powder_schema() -> dict[str, Any]:
    """JSON Schema of a powder file, for editors."""
    schema = finished(DemCase.model_json_schema())
    table = schema["properties"]["powder"]
    schema["properties"]["powder"] = {
        "description": table["description"],
        "anyOf": [{"type": "string", "enum": [*POWDERS]}, {"$ref": table["$ref"]}],
    }
    seeds = schema["$defs"]["RunInput"]["properties"]["seeds"]
    one = {"type": "integer", "minimum": 1, "maximum": MOST_SEEDS}
    schema["$defs"]["RunInput"]["properties"]["seeds"] = {
        "description": seeds["description"],
        "default": 3,
        "anyOf": [one, {"type": "array", "items": {"type": "integer", "minimum": 1}, "minItems": 1}],
    }
    return {"$schema": DRAFT, **schema}


def load_case(source: Path | str | Mapping[str, Any], overrides: Mapping[str, Any] | None = None) -> DemCase:
    """Read a powder file or a dict, with dotted overrides such as {"box.stiffness": "3 N/m"}."""
    if isinstance(source, Mapping):
        name, directory, data = "powder file", Path(), deepcopy(dict(source))
    else:
        path = powder_file(source) if isinstance(source, str) else source
        name, directory = str(source), path.parent
        data = read_input(path, POWDER)
    _spell_out_powder(data)
    for key, value in (overrides or {}).items():
        set_key(data, key, value, name)
        _spell_out_powder(data)
    try:
        case = DemCase.model_validate(data)
    except ValidationError as error:
        raise to_input_error(error, DemCase, data, name) from None
    case._directory = directory
    return case


def _spell_out_powder(data: Table) -> None:
    """The table that the name of a built-in powder stands for."""
    if isinstance(data.get("powder"), str):
        data["powder"] = {"base": data["powder"]}
