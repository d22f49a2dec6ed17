"""The powder file of `mpm dem` (TOML): one set of classes reads it, checks it and writes it back.

Quantities carry units as everywhere in mpm; lengths of the box are pure numbers, counted in mean particle
diameters. Reading needs no LAMMPS.
"""

import hashlib
import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tomli_w
from pydantic import Field, PrivateAttr, ValidationError, field_validator, model_validator

from mpm.case.kinds import POWDER, read_input
from mpm.case.messages import to_input_error
from mpm.case.model import Frozen
from mpm.case.names import powder_file
from mpm.case.schema import DRAFT, finished
from mpm.case.sources import Table, set_key
from mpm.physics.fluidisation import mean_free_path
from mpm.physics.gases import ideal_gas_density
from mpm.units import (
    Density,
    Diameter,
    Dimension,
    Length,
    MolarMass,
    NonNegative,
    Positive,
    Pressure,
    Speed,
    Temperature,
    Viscosity,
    describe,
    reject,
)  # fmt: skip

from .base import SETTLED
from .powder import POWDERS, SMALLEST, Powder
from .waveform import Waveform
from .waveform_input import MeasuredInput, WaveformInput

MOST_SEEDS = 10_000
Stiffness = Annotated[float, Dimension("N/m", "a spring stiffness", "30 N/m", above=0.0)]
Hamaker = Annotated[float, Dimension("J", "a Hamaker constant", "3.1e-20 J", at_least=0.0)]
Spread = Annotated[float, Dimension("m", "a standard deviation", "13.9 um", at_least=0.0)]
Tilt = Annotated[float, Dimension("rad", "an angle", "3 deg", at_least=-math.pi / 4, at_most=math.pi / 4)]
Restitution = Annotated[float, Dimension("", "a coefficient of restitution", "0.97", above=0.0, at_most=1.0)]

MOST_PARTICLES = 5_000_000
"""More would take days for a cycle, and a box of some billions, by a slip of a unit, all memory before a word is said."""


class PowderInput(Frozen):
    """A built-in powder by name (`powder = "GL56"`), or one described or overridden key by key."""

    base: Annotated[str | None, Field(json_schema_extra={"enum": [*POWDERS]})] = None
    """a built-in powder to start from: GL50, GL29, GL56, GL223 or SS231; keys given here lie over it"""
    diameter: Diameter | None = None
    """mean diameter of the particles"""
    deviation: Spread | None = None
    """standard deviation of the diameters, by number"""
    density: Density | None = None
    """density of the solid"""
    sphericity: Annotated[float, Dimension("", "a sphericity", "0.79", above=0.0, at_most=1.0)] | None = None
    """surface of a sphere of the particle's volume over the particle's surface, in the drag"""
    friction: NonNegative | None = None
    """coefficient of friction between particles"""
    wall_friction: NonNegative | None = None
    """coefficient of friction between particle and base"""
    restitution: Restitution | None = None
    """coefficient of restitution between particles"""
    wall_restitution: Restitution | None = None
    """coefficient of restitution between particle and base"""
    hamaker: Hamaker | None = None
    """Hamaker constant between particles; 0: no cohesion"""
    wall_hamaker: Hamaker | None = None
    """Hamaker constant between particle and base"""
    asperity: Length | None = None
    """height of the roughness in the Rumpf force"""
    stiffness: Stiffness | None = None
    """spring stiffness of the real material, to which cohesion is scaled"""
    ergun: tuple[Positive, Positive] | None = None
    """factors A and B of the drag law"""

    @field_validator("base")
    @classmethod
    def known(cls, value: str | None) -> str | None:
        if value is not None and value not in POWDERS:
            raise reject(repr(value), "one of " + ", ".join(POWDERS), given=value, known=list(POWDERS))
        return value

    @model_validator(mode="after")
    def complete(self) -> "PowderInput":
        if self.base is None:
            for key in ("diameter", "density"):
                if getattr(self, key) is None:
                    raise reject("nothing", "this key, or base = one of " + ", ".join(POWDERS), key=key)
        return self

    def build(self) -> Powder:
        given: dict[str, Any] = {k: v for k, v in self if k != "base" and v is not None}
        if self.base is not None:
            powder = POWDERS[self.base]
            if not given:
                return powder
            # The fluidisation test was of the powder as it is, not of a changed one.
            return replace(powder, name=f"{self.base} (changed)", measured_umf=None, **given)
        defaults: dict[str, Any] = {"deviation": 0.0, "sphericity": 1.0, "source": "given in the powder file"}
        return Powder(name="powder", **{**defaults, **given})


class BoxInput(Frozen):
    """The periodic box; length, depth and bed height in mean particle diameters.

    `reduced_cohesion`: scale the Hamaker constants with the spring (supplement B), which keeps collisions alike
    but weakens the static adhesion of lasting contacts; false keeps the forces of the real material.
    """

    length: Annotated[float, Dimension("", "diameters", "8", at_least=3.0)] = 12.0
    """length of the periodic box along the conveyor, in mean particle diameters"""
    depth: Annotated[float, Dimension("", "diameters", "4", at_least=3.0)] = 5.0
    """depth of the periodic box, in mean particle diameters"""
    height: Annotated[float, Dimension("", "diameters", "15", above=0.0)] = 15.0
    """height of the settled bed, in mean particle diameters"""
    stiffness: Stiffness = 30.0
    """spring stiffness of the contacts in the simulation: softer ones allow longer steps"""
    size_classes: Annotated[int, Field(ge=1, le=20)] = 5
    """number of sizes that stand for the distribution"""
    cohesion: bool = True
    """whether particles attract each other"""
    reduced_cohesion: bool = True
    """scale the Hamaker constants with the spring, so that collisions stay alike; false: forces of the real material"""
    base: Literal["flat", "frit", "sawtooth"] = "flat"
    """what the bed lies on: a flat plate, a frit (a glued monolayer of particles), or a sawtooth (a glued baffle)"""
    frit_diameter: Diameter = 25e-6
    """diameter of the glued particles"""
    baffle_height: Length = 2e-3
    """height of the sawtooth"""
    baffle_width: Length = 2e-3
    """length of the sawtooth along the conveyor"""
    declination: Tilt = 0.0
    """angle by which the conveyor slopes down along its way"""
    steps_per_collision: Annotated[float, Dimension("", "steps", "14", at_least=1.0)] = 14.0
    """time steps in the shortest collision"""


class GasInput(Frozen):
    """Gas in the bed, aerated from below at the superficial `velocity` in the frame where the inlet rests.

    `frame = "lab"` is the seed's boundary condition (its inlet does not vibrate): the gas stands still while the
    bed moves through it, which is what lifts fine powders. `"reactor"`: the gas column moves with the conveyor.

    `molar_mass`, `temperature` and `pressure` enter the density, that is the inertial part of the drag, and the mean free
    path; the viscosity is given and follows none of them.
    """

    velocity: Speed = 0.0
    """superficial velocity of the gas from below"""
    frame: Literal["lab", "reactor"] = "lab"
    """where the inlet of the gas rests: in the laboratory, or on the moving reactor"""
    viscosity: Viscosity = 18e-6
    """dynamic viscosity of the gas"""
    molar_mass: MolarMass = 29e-3
    """molar mass of the gas, in the inertial part of the drag"""
    temperature: Temperature = 293.15
    """temperature of the gas"""
    pressure: Pressure = 101325.0
    """pressure of the gas"""

    @property
    def density(self) -> float:
        return ideal_gas_density(
            pressure=self.pressure, molar_mass=self.molar_mass, temperature=self.temperature
        )

    @property
    def mean_free_path(self) -> float:
        """Mean free path of the gas [m]."""
        return mean_free_path(
            viscosity=self.viscosity,
            pressure=self.pressure,
            temperature=self.temperature,
            molar_mass=self.molar_mass,
        )


class RunInput(Frozen):
    """Cycles per seed (the first `discard` are not averaged), the seeds, and the sampling of a cycle."""

    seeds: tuple[Annotated[int, Field(ge=1)], ...] = (1, 2, 3)
    """how many random packings (1, 2, ...), or a list of their numbers; the spread between them is the error"""
    cycles: Annotated[int, Field(ge=1)] = 8
    """cycles of the vibration per packing"""
    discard: Annotated[int, Field(ge=0)] = 3
    """first cycles that are not averaged"""
    updates_per_cycle: Annotated[int, Field(ge=64)] = 512
    """steps of the acceleration in a cycle"""
    samples_per_cycle: Annotated[int, Field(ge=16)] = 128
    """phases of the profile in a cycle, a divisor of updates_per_cycle"""
    dump_per_cycle: Annotated[int, Field(ge=0)] = 16
    """particle positions written per cycle; 0: none"""

    @field_validator("seeds", mode="before")
    @classmethod
    def count(cls, value: Any) -> Any:
        if isinstance(value, int) and not isinstance(value, bool):
            if not 1 <= value <= MOST_SEEDS:
                raise reject(describe(value), f"from 1 to {MOST_SEEDS} seeds")
            return tuple(range(1, value + 1))
        if not isinstance(value, list | tuple):
            raise reject(describe(value), "a number of seeds or a list of their numbers")
        return value

    @model_validator(mode="after")
    def consistent(self) -> "RunInput":
        if self.discard >= self.cycles:
            raise reject(f"{self.discard}", f"fewer than cycles = {self.cycles}", key="discard")
        if self.updates_per_cycle % self.samples_per_cycle:
            raise reject(
                f"{self.samples_per_cycle}", "a divisor of updates_per_cycle", key="samples_per_cycle"
            )
        if len(set(self.seeds)) < len(self.seeds) or not self.seeds:
            raise reject(f"{list(self.seeds)}", "a number of seeds or a list of different ones", key="seeds")
        return self


class ProfileInput(Frozen):
    """`mean_velocity`: scale the fitted profile to this cycle mean; `residence_length`: of the distribution."""

    mean_velocity: Speed | None = None
    """scale the fitted profile to this mean: profile_scaled.csv"""
    residence_length: Length = 5e-3
    """length of the bed that the residence times are given for"""


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

    def diameters(self) -> np.ndarray:
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
