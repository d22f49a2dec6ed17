"""The tables of a powder file beside powder and waveform: `[box]`, `[gas]`, `[run]` and `[profile]`."""

import math
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from mpm.case.model import Frozen
from mpm.physics.fluidisation import mean_free_path
from mpm.physics.gases import ideal_gas_density
from mpm.units import (
    Diameter,
    Dimension,
    Length,
    MolarMass,
    Pressure,
    Speed,
    Temperature,
    Viscosity,
    describe,
    reject,
)  # fmt: skip

from .powder_input import Stiffness

MOST_SEEDS = 10_000
Tilt = Annotated[float, Dimension("rad", "an angle", "3 deg", at_least=-math.pi / 4, at_most=math.pi / 4)]


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
