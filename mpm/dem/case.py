"""The powder file of `mpm dem` (TOML): one set of classes reads it, checks it and writes it back.

Quantities carry units as everywhere in mpm; lengths of the box are pure numbers, counted in mean particle
diameters. Reading needs no LAMMPS.
"""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tomli_w
from pydantic import Field, ValidationError, field_validator, model_validator

from mpm.errors import InputError
from mpm.gases import ideal_gas_density
from mpm.kinds import POWDER, read_input
from mpm.names import powder_file
from mpm.units import (
    Density,
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

from .powder import POWDERS, SMALLEST, Powder
from .reading import one_line, set_dotted
from .relations import mean_free_path
from .waveform import Waveform
from .waveform_input import MeasuredInput, Section, WaveformInput

MOST_SEEDS = 10_000
Stiffness = Annotated[float, Dimension("N/m", "a spring stiffness", "30 N/m", above=0.0)]
Hamaker = Annotated[float, Dimension("J", "a Hamaker constant", "3.1e-20 J", at_least=0.0)]
Spread = Annotated[float, Dimension("m", "a standard deviation", "13.9 um", at_least=0.0)]
Tilt = Annotated[float, Dimension("rad", "an angle", "3 deg", at_least=-math.pi / 4, at_most=math.pi / 4)]
Restitution = Annotated[float, Dimension("", "a coefficient of restitution", "0.97", above=0.0, at_most=1.0)]

MOST_PARTICLES = 5_000_000
"""More would take days for a cycle, and a box of some billions, by a slip of a unit, all memory before a word is said."""


class PowderInput(Section):
    """A built-in powder by name (`powder = "GL56"`), or one described or overridden key by key."""

    base: str | None = None
    diameter: Length | None = None
    deviation: Spread | None = None
    density: Density | None = None
    sphericity: Annotated[float, Dimension("", "a sphericity", "0.79", above=0.0, at_most=1.0)] | None = None
    friction: NonNegative | None = None
    wall_friction: NonNegative | None = None
    restitution: Restitution | None = None
    wall_restitution: Restitution | None = None
    hamaker: Hamaker | None = None
    wall_hamaker: Hamaker | None = None
    asperity: Length | None = None
    stiffness: Stiffness | None = None
    ergun: tuple[Positive, Positive] | None = None

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


class BoxInput(Section):
    """The periodic box; length, depth and bed height in mean particle diameters.

    `reduced_cohesion`: scale the Hamaker constants with the spring (supplement B), which keeps collisions alike
    but weakens the static adhesion of lasting contacts; false keeps the forces of the real material.
    """

    length: Annotated[float, Dimension("", "diameters", "8", at_least=3.0)] = 12.0
    depth: Annotated[float, Dimension("", "diameters", "4", at_least=3.0)] = 5.0
    height: Annotated[float, Dimension("", "diameters", "15", above=0.0)] = 15.0
    stiffness: Stiffness = 30.0
    size_classes: Annotated[int, Field(ge=1, le=20)] = 5
    cohesion: bool = True
    reduced_cohesion: bool = True
    base: Literal["flat", "frit", "sawtooth"] = "flat"
    frit_diameter: Length = 25e-6
    baffle_height: Length = 2e-3
    baffle_width: Length = 2e-3
    declination: Tilt = 0.0
    steps_per_collision: Annotated[float, Dimension("", "steps", "14", at_least=1.0)] = 14.0


class GasInput(Section):
    """Gas in the bed, aerated from below at the superficial `velocity` in the frame where the inlet rests.

    `frame = "lab"` is the seed's boundary condition (its inlet does not vibrate): the gas stands still while the
    bed moves through it, which is what lifts fine powders. `"reactor"`: the gas column moves with the conveyor.

    `molar_mass`, `temperature` and `pressure` enter the density, that is the inertial part of the drag, and the mean free
    path; the viscosity is given and follows none of them.
    """

    velocity: Speed = 0.0
    frame: Literal["lab", "reactor"] = "lab"
    viscosity: Viscosity = 18e-6
    molar_mass: MolarMass = 29e-3
    temperature: Temperature = 293.15
    pressure: Pressure = 101325.0

    @property
    def density(self) -> float:
        return ideal_gas_density(self.pressure, self.molar_mass, self.temperature)

    @property
    def mean_free_path(self) -> float:
        """Mean free path of the gas [m]."""
        return mean_free_path(self.viscosity, self.pressure, self.temperature, self.molar_mass)


class RunInput(Section):
    """Cycles per seed (the first `discard` are not averaged), the seeds, and the sampling of a cycle."""

    seeds: tuple[Annotated[int, Field(ge=1)], ...] = (1, 2, 3)
    cycles: Annotated[int, Field(ge=1)] = 8
    discard: Annotated[int, Field(ge=0)] = 3
    updates_per_cycle: Annotated[int, Field(ge=64)] = 512
    samples_per_cycle: Annotated[int, Field(ge=16)] = 128
    dump_per_cycle: Annotated[int, Field(ge=0)] = 16

    @field_validator("seeds", mode="before")
    @classmethod
    def count(cls, value: Any) -> Any:
        if isinstance(value, int) and not isinstance(value, bool):
            if not 1 <= value <= MOST_SEEDS:
                raise reject(describe(value), f"from 1 to {MOST_SEEDS} seeds")
            return tuple(range(1, value + 1))
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


class ProfileInput(Section):
    """`mean_velocity`: scale the fitted profile to this cycle mean; `residence_length`: of the distribution."""

    mean_velocity: Speed | None = None
    residence_length: Length = 5e-3


class DemCase(Section):
    """A powder file."""

    title: str = "DEM substudy"
    powder: PowderInput
    waveform: WaveformInput
    box: BoxInput = BoxInput()
    gas: GasInput | None = None
    run: RunInput = RunInput()
    profile: ProfileInput = ProfileInput()
    directory: Annotated[Path, Field(exclude=True)] = Path()

    @field_validator("powder", mode="before")
    @classmethod
    def by_name(cls, value: Any) -> Any:
        return {"base": value} if isinstance(value, str) else value

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
        bed = 0.6 * box.length * box.depth * box.height / (math.pi / 6.0)
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
        return self.waveform.build(self.directory)

    def diameters(self) -> np.ndarray:
        """Diameters of the size classes [m]."""
        return self.build_powder().size_classes(self.box.size_classes)

    def to_toml(self) -> str:
        """The resolved file, runnable as it is (paths of data files made absolute)."""
        data = self.model_dump(mode="json", exclude_none=True)
        if isinstance(self.waveform, MeasuredInput):
            data["waveform"]["file"] = str((self.directory / self.waveform.file).resolve())
        return tomli_w.dumps(data)

    def content_hash(self) -> str:
        """Identifies what determines one seed's trajectory: all but the title, the seeds and the profile."""
        data = self.model_dump(mode="json", exclude={"title", "profile"})
        for key in ("seeds", "cycles", "discard"):
            data["run"].pop(key)
        return hashlib.sha256(repr(data).encode()).hexdigest()[:16]


def load_case(source: Path | str | Mapping[str, Any], overrides: Mapping[str, Any] | None = None) -> DemCase:
    """Read a powder file or a dict, with dotted overrides such as {"box.stiffness": "3 N/m"}."""
    if isinstance(source, Mapping):
        name, directory, data = "powder file", Path(), dict(source)
    else:
        path = powder_file(source) if isinstance(source, str) else source
        name, directory = str(source), path.parent
        data = read_input(path, POWDER)
    if "directory" in data:
        raise InputError(f"{name}: directory: unknown key")
    for key, value in (overrides or {}).items():
        data = set_dotted(data, key, value)
    try:
        return DemCase.model_validate({**data, "directory": directory})
    except ValidationError as error:
        raise InputError(one_line(name, error, DemCase)) from None
