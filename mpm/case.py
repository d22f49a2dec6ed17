"""A case: everything that defines one simulation, read from TOML, checked, in SI units.

The classes here are parser, JSON Schema and dump at once. Conversion of units happens while they are built (see
`mpm.units`); what a case file leaves out is filled in, so that `case.to_toml()` shows every value that is used.

    case = load_case("cases/single_zone.toml", {"geometry.inlet.tma.velocity": "4 cm/s"})
    faster = case.with_({"motion.gamma": 0.4})
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    Strict,
    ValidationError,
    WithJsonSchema,
    model_serializer,
    model_validator,
)

from mpm.caseio import assemble, write_toml
from mpm.chemistry import Mechanism
from mpm.constants import GRAVITY
from mpm.diffusion import scaled_diffusivity
from mpm.files import read_text
from mpm.gases import CARRIERS, ideal_gas_density, symbol
from mpm.kinds import CASE, read_input
from mpm.layout import Flag, Frozen, Geometry, Inlet, Layer, Outlet, Zone
from mpm.materials import Material
from mpm.mechanism import Chemistry, build_mechanism, check_rates
from mpm.messages import to_input_error
from mpm.names import case_file
from mpm.profile import PRESETS, BedProfile, read_profile
from mpm.schema import DRAFT, finished
from mpm.units import (
    DIFFUSIVITY,
    Angle,
    BedSpeed,
    Diffusivity,
    Duration,
    Frequency,
    GasDensity,
    Instant,
    Interval,
    MolarMass,
    NonNegative,
    Pressure,
    RunTime,
    Temperature,
    Velocity,
    Viscosity,
    WallTime,
    in_range,
    reject,
    worked_out,
)

__all__ = [
    "Case",
    "Gas",
    "Geometry",
    "Inlet",
    "Layer",
    "Material",
    "Motion",
    "Outlet",
    "Output",
    "Time",
    "Transport",
    "Zone",
    "case_schema",
    "load_case",
]


SAME_FREQUENCY = 0.01
"""Relative difference up to which a profile belongs to a vibration: a DEM's waveform may be fitted to a record of the same machine."""

_ONE_DIFFUSIVITY = {"type": "string", **DIFFUSIVITY.about}
SpeciesDiffusivity = Annotated[
    dict[str, Diffusivity],
    WithJsonSchema(
        {
            "anyOf": [_ONE_DIFFUSIVITY, {"type": "object", "additionalProperties": _ONE_DIFFUSIVITY}],
            "accepted": f"{DIFFUSIVITY.accepted}, or a table of them by species",
            "examples": ["2.88e-5 m^2/s"],
        }
    ),
]


class Gas(Frozen):
    """The carrier gas, whose density and viscosity are those of the mixture (precursors are dilute)."""

    carrier: Annotated[str, Field(json_schema_extra={"presets": [*CARRIERS]})] = "N2"
    """the gas that all inlets blow: N2, Ar, He, or any other name with its molar_mass and viscosity"""
    temperature: Temperature = 473.0
    """temperature of gas and solids, everywhere the same"""
    pressure: Pressure = 101325.0
    """ambient pressure, at the outlets"""
    molar_mass: MolarMass = worked_out("that of the carrier")
    """molar mass of the carrier gas"""
    viscosity: Viscosity = worked_out("the carrier's at this temperature (Sutherland)")
    """dynamic viscosity of the gas"""
    density: GasDensity = worked_out("ideal gas law")
    """density of the gas"""
    diffusivity: SpeciesDiffusivity = worked_out(
        "2.88e-5 m^2/s (N2, 473 K, 101325 Pa), scaled to the carrier, temperature and pressure", {}
    )
    """of each species in the free gas: one value for all, e.g. "2.88e-5 m^2/s", or a table of them (and of a default)"""
    _scaled: tuple[str, ...] = PrivateAttr(())

    @property
    def scaled(self) -> tuple[str, ...]:
        """The species whose diffusivity the case leaves to `mpm.diffusion`."""
        return self._scaled

    def complete(self, mechanism: Mechanism) -> None:
        """Fill in the diffusivities that are left out; the case does this once the mechanism is known."""
        left_out = [species for species in mechanism.species if species.name not in self.diffusivity]
        self._scaled = tuple(species.name for species in left_out)
        default = {
            species.name: scaled_diffusivity(
                species, self.carrier, self.molar_mass, self.temperature, self.pressure
            )
            for species in left_out
        }
        for name, value in default.items():
            in_range(f"gas.diffusivity.{name}", value, "m^2/s")
        values = {**default, **self.diffusivity}
        self.__dict__["diffusivity"] = {name: values[name] for name in mechanism.species_names}

    @model_validator(mode="after")
    def _fill_in(self) -> Self:
        model, values, given = CARRIERS.get(self.carrier), self.__dict__, self.model_fields_set
        if model is None and not {"molar_mass", "viscosity"} <= given:
            raise reject(
                repr(self.carrier),
                f"one of {', '.join(CARRIERS)}, or any name with molar_mass and viscosity",
                key="carrier",
                given=symbol(self.carrier),
                known=list(CARRIERS),
            )
        if "molar_mass" not in given and model is not None:
            values["molar_mass"] = model.molar_mass
        if "viscosity" not in given and model is not None:
            values["viscosity"] = in_range("viscosity", model.viscosity(self.temperature), "Pa s")
        if "density" not in given:
            density = ideal_gas_density(self.pressure, self.molar_mass, self.temperature)
            values["density"] = in_range("density", density, "kg/m^3")
        return self


class Motion(Frozen):
    """Vibration of the reactor and conveying of the bed."""

    gamma: NonNegative = 0.30
    """largest vertical acceleration of the reactor over g; 0: no vibration, the bed moves steadily at bed_velocity"""
    frequency: Frequency = 16.0
    """frequency of the vibration"""
    angle: Angle = math.pi / 3.0
    """direction of the vibration, counted from angle_from; it must have a vertical component"""
    angle_from: Literal["horizontal", "vertical"] = "horizontal"
    """what the angle is counted from"""
    bed_velocity: BedSpeed = 0.013
    """mean speed at which the bed is conveyed, relative to the reactor, to the right; 0: it stays. A profile file brings its own"""
    profile: Annotated[str, Field(json_schema_extra={"presets": [*PRESETS]})] = "thesis"
    """how the bed moves within a cycle: thesis (lift-off at liftoff_velocity), phases (liftoff_phase and contact_phase), or the path
    of a CSV file from `mpm dem`"""
    liftoff_velocity: Velocity = -0.004
    """vertical velocity of the reactor at which the bed lifts off (profile thesis)"""
    liftoff_phase: Angle | None = None
    """phase of the cycle at which the bed lifts off, 0 deg to below 360 deg (profile phases)"""
    contact_phase: Angle | None = None
    """phase of the cycle at which the bed lands again, 0 deg to below 360 deg (profile phases)"""
    inlet_frame: Literal["reactor", "lab"] = "reactor"
    """what the inlets are fixed to: they ride on the reactor, or stand still in the laboratory while it moves over them"""
    start: Instant = 0.05
    """when vibration and conveying start"""
    startup: Literal["developed", "impulsive"] = "developed"
    """how a resolved run begins to vibrate: in the periodic state of the gas, or from rest with the true transient"""

    _table: BedProfile | None = PrivateAttr(None)

    @property
    def table(self) -> BedProfile | None:
        """The profile file's content; None without vibration or with a profile of phases."""
        return self._table

    @property
    def mean_velocity(self) -> float:
        """Cycle mean of the bed's velocity in the reactor's frame [m/s], negative to the left: the profile file's, else `bed_velocity`."""
        return self.bed_velocity if self._table is None else self._table.mean

    @property
    def peak_vertical_velocity(self) -> float:
        """Amplitude of the reactor's vertical velocity, Gamma g / w [m/s]."""
        return self.gamma * GRAVITY / (2.0 * math.pi * self.frequency)

    @model_validator(mode="after")
    def _check(self) -> Self:
        low, high = (0.0, math.pi / 2.0)
        steep = self.angle <= low if self.angle_from == "horizontal" else self.angle >= high
        if not low <= self.angle <= high or steep:
            raise reject(
                f"{math.degrees(self.angle):g} deg from the {self.angle_from}",
                "an angle from 0 deg to 90 deg that leaves a vertical component",
                key="angle",
            )
        if self.profile not in PRESETS:
            self._read_table()
        elif self.gamma == 0.0:
            pass  # nothing hops: a preset has no phases to check
        elif self.profile == "thesis":
            peak = self.peak_vertical_velocity
            if not -peak < self.liftoff_velocity < 0.0:
                raise reject(
                    f"{self.liftoff_velocity:g} m/s",
                    f"between 0 m/s and the reactor's peak velocity, {-peak:.4g} m/s",
                    key="liftoff_velocity",
                )
        else:
            for key in ("liftoff_phase", "contact_phase"):
                value = getattr(self, key)
                if value is None or not 0.0 <= value < 2.0 * math.pi:
                    raise reject(
                        "nothing" if value is None else f"{math.degrees(value):g} deg",
                        'an angle from 0 deg to below 360 deg, e.g. "97.85 deg", for profile = "phases"',
                        key=key,
                    )
            if self.liftoff_phase == self.contact_phase:
                raise reject("the phase of lift-off", "another phase", key="contact_phase")
        return self

    def _read_table(self) -> None:
        """Read the profile file; it must be one even where nothing vibrates, and of this frequency where something does."""
        table = read_profile(Path(self.profile), "profile")
        if self.gamma == 0.0:
            return
        made = table.conditions
        if made is not None and abs(made.frequency - self.frequency) > SAME_FREQUENCY * self.frequency:
            raise reject(
                f"{self.profile}: a profile made at {made.frequency:.6g} Hz for a vibration at {self.frequency:.6g} Hz, in whose cycle its "
                "bed would hop to another beat",
                f'a profile made at {self.frequency:.6g} Hz, or frequency = "{made.frequency:.6g} Hz"',
                key="profile",
            )
        self._table = table

    @model_serializer(mode="wrap")
    def _write_what_rules(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without `bed_velocity` where a profile file says how fast the bed moves."""
        table: dict[str, Any] = handler(self)
        if self._table is not None:
            table.pop("bed_velocity", None)
        return table


class Time(Frozen):
    """End of the simulation and its steps."""

    end: RunTime = 20.0
    """simulated time at which the run ends"""
    step: Duration = 0.01
    """longest time step of an averaged run; it is shortened to fit the shifts of the bed from column to column"""
    steps_per_cycle: Annotated[int, Strict(), Field(ge=4)] = 32
    """time steps per cycle of the vibration in a resolved run, and phases of the flow with vibrational_dispersion"""


class Output(Frozen):
    """How often results and restart states are written."""

    every: Interval = 0.25
    """simulated time between outputs: fields for pictures and ParaView, and rows of history.csv"""
    checkpoint: WallTime = 60.0
    """time on the clock between restart states, from which an interrupted run goes on"""
    phases: Annotated[int, Strict(), Field(ge=0, examples=[16])] = 0
    """phases of the vibration at which the last cycle is written for ParaView, with the points moving as the reactor does; a divisor of
    time.steps_per_cycle; 0: none"""


class Transport(Frozen):
    """Options of the species' transport."""

    vibrational_dispersion: Flag = False
    """in averaged and steady runs: add to diffusion what the swinging gas disperses, from the flow of a whole cycle"""


class Case(Frozen):
    """One simulation. Equal cases have equal content, wherever they were read from."""

    title: str = ""
    """a line that names the case on screens, pictures and in results"""
    fidelity: Literal["resolved", "averaged", "steady"] = "averaged"
    """resolved: every phase of every vibration; averaged: their mean, in time; steady: the state that an averaged run ends in"""
    geometry: Geometry
    """the strip: its size, layers from bottom to top, ports and zones"""
    materials: dict[str, Material] = Field({}, alias="material")
    """porous solids by name; built-in ones need no table, and a table overrides theirs key by key"""
    gas: Gas = Gas()
    """the carrier gas and its state"""
    chemistry: Chemistry = Chemistry()
    """species, surface sites and reactions"""
    motion: Motion = Motion()
    """vibration of the reactor and conveying of the bed"""
    time: Time = Time()
    """end of the simulation and its steps"""
    output: Output = Output()
    """how often results and restart states are written"""
    transport: Transport = Transport()
    """options of the species' transport"""

    _mechanism: Mechanism = PrivateAttr()
    _source: Path | None = PrivateAttr(None)
    _origin: tuple[Mapping[str, Any], Mapping[str, Any], Path, str] = PrivateAttr()

    @model_validator(mode="after")
    def _resolve(self) -> Self:
        self._mechanism = build_mechanism(self.chemistry)
        for layer in self.geometry.layers:
            if layer.material_name is not None:
                layer._material = self.materials[layer.material_name]
        self._check_chemistry()
        self._check_phases()
        check_rates(self._mechanism, self.gas.temperature)
        self.gas.complete(self._mechanism)
        if self.transport.vibrational_dispersion and self.fidelity == "resolved":
            raise reject(
                "true in a resolved run, which follows the vibration itself",
                'false, or fidelity "averaged" or "steady"',
                key="transport.vibrational_dispersion",
            )
        peak = self.motion.peak_vertical_velocity
        if self.motion.inlet_frame == "lab" and self.fidelity != "resolved":
            for inlet in self.geometry.inlets:
                if 0.0 < inlet.velocity < peak:
                    raise reject(
                        f"lab, with {inlet.name} at {inlet.velocity:g} m/s and a reactor at up to {peak:.4g} m/s: the port flow "
                        "reverses within a cycle",
                        'fidelity = "resolved", inlet_frame = "reactor", or a faster inlet',
                        key="motion.inlet_frame",
                    )
        return self

    def _check_phases(self) -> None:
        asked, steps = self.output.phases, self.time.steps_per_cycle
        if asked and self.fidelity != "resolved":
            raise reject(
                f"{asked} in a run with fidelity {self.fidelity}, which follows the mean of the cycle, not its phases",
                '0, or fidelity = "resolved"',
                key="output.phases",
            )
        if asked and steps % asked:
            fitting = ", ".join(str(n) for n in range(1, steps + 1) if steps % n == 0)
            raise reject(
                f"{asked}, phases that do not fall on the steps of the cycle",
                f"0 (none), or one of {fitting}, which divide time.steps_per_cycle = {steps}",
                key="output.phases",
            )

    def _check_chemistry(self) -> None:
        species, sites = self._mechanism.species_names, self._mechanism.site_names
        if "." in self.gas.carrier:
            raise reject(
                repr(self.gas.carrier),
                "a name without dots: results name mole fractions by it",
                key="gas.carrier",
            )
        if self.gas.carrier in species:
            raise reject(
                f"carrier {self.gas.carrier!r}, a species of the mechanism",
                "a gas that takes no part",
                key="gas.carrier",
            )
        for key, name in (
            ("gas.carrier", self.gas.carrier),
            *(("material", name) for name in self.materials),
        ):
            if not name or not name.isprintable():
                raise reject(repr(name), "a name of printable characters", key=key)
        for place, names, known in (
            *(
                (f"geometry.inlet.{i.name}.mass_fractions", i.mass_fractions, species)
                for i in self.geometry.inlets
            ),
            *(
                (f"material.{name}.initial_coverage", m.initial_coverage, sites)
                for name, m in self.materials.items()
            ),
            ("gas.diffusivity", self.gas.diffusivity, species),
        ):
            for name in names:
                if name not in known:
                    kind = "site" if known is sites else "species"
                    raise reject(
                        f"a {kind} that the mechanism does not have",
                        f"one of {', '.join(known)}",
                        key=f"{place}.{name}",
                        given=name,
                        known=list(known),
                    )

    @property
    def direction(self) -> int:
        """Which way solids are conveyed: -1 where a moving layer moves to the left in the mean, else 1.

        They enter the strip and every zone at the end that they come from, left or right, and leave at the other.
        """
        return -1 if self.conveying_velocity < 0.0 else 1

    @property
    def conveying_velocity(self) -> float:
        """Mean velocity of the moving layer [m/s], negative to the left; 0 in a strip without one."""
        return 0.0 if self.geometry.moving_layer is None else self.motion.mean_velocity

    @property
    def follows_cycle(self) -> bool:
        """Whether the flow is found for every step of the vibration cycle, not for its mean alone."""
        return self.fidelity == "resolved" or self.transport.vibrational_dispersion

    @property
    def mechanism(self) -> Mechanism:
        """The reaction mechanism, overrides included."""
        return self._mechanism

    @property
    def source(self) -> Path | None:
        """The file the case was read from, if any."""
        return self._source

    def typed(self, table: str) -> set[str]:
        """Keys below the dotted name of a table, such as `material.glass_beads`, that the file itself or an override gives."""
        data, overrides, _, _ = self._origin
        node: Any = data
        for part in table.split("."):
            node = node.get(part) if isinstance(node, Mapping) else None
        below = {
            key.removeprefix(f"{table}.").split(".")[0] for key in overrides if key.startswith(f"{table}.")
        }
        return below | (set(node) if isinstance(node, Mapping) else set())

    def with_(self, changes: Mapping[str, Any]) -> Case:
        """Return the case that the same file gives with these dotted keys changed; everything is checked anew."""
        data, overrides, folder, label = self._origin
        case = build_case(data, {**overrides, **changes}, folder, label)
        case._source = self._source
        return case

    def to_dict(self) -> dict[str, Any]:
        """The resolved case as the tables of a case file, dimensional values as strings in SI units."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)

    def to_toml(self) -> str:
        """The resolved case as a case file that can be run as it is."""
        return write_toml(self.to_dict())

    def content_hash(self) -> str:
        """Hexadecimal digest of everything that determines the results; a motion profile counts with its content."""
        content = self.to_dict()
        if self.motion.profile not in PRESETS:
            content["motion"]["profile"] = read_text(self.motion.profile)
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        from mpm.notebook import case_html

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
    tables = assemble(data, overrides, folder, label)
    try:
        case = Case.model_validate(tables)
    except ValidationError as error:
        raise to_input_error(error, Case, tables, label) from None
    case._origin = (data, dict(overrides), folder, label)
    return case
