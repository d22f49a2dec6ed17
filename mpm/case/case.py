"""A case: everything that defines one simulation, read from TOML, checked, in SI units.

The classes here are parser, JSON Schema and dump at once. Conversion of units happens while they are built (see
`mpm.units`); what a case file leaves out is filled in, so that `case.to_toml()` shows every value that is used.

    case = load_case("cases/single_zone.toml", {"geometry.inlet.tma.velocity": "4 cm/s"})
    faster = case.with_({"motion.gamma": 0.4})
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    PrivateAttr,
    Strict,
    ValidationError,
    model_validator,
)

from mpm.case.chemistry import Chemistry, build_mechanism, check_rates
from mpm.case.gas import Gas
from mpm.case.geometry import Flag, Geometry, Inlet, Layer, Outlet, Zone
from mpm.case.kinds import CASE, read_input
from mpm.case.materials import Material
from mpm.case.messages import to_input_error
from mpm.case.model import Frozen
from mpm.case.motion import Motion
from mpm.case.names import case_file
from mpm.case.profile import PRESETS
from mpm.case.schema import DRAFT, finished
from mpm.case.sources import assemble, write_toml
from mpm.files import read_text
from mpm.physics.mechanism import Mechanism, mole_fractions
from mpm.units import (
    Duration,
    Interval,
    RunTime,
    WallTime,
    reject,
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
    "TransportOptions",
    "Zone",
    "case_schema",
    "load_case",
]


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


class TransportOptions(Frozen):
    """Options of the species' transport."""

    vibrational_dispersion: Flag = False
    """in averaged and steady runs: add to diffusion what the swinging gas disperses, from the flow of a whole cycle"""


class Case(Frozen):
    """One simulation. Equal cases have equal content, wherever they were read from."""

    title: Annotated[str, Field(examples=["A wider TMA port"])] = ""
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
    transport: TransportOptions = TransportOptions()
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

    def feed_concentrations(self, mass_fractions: Mapping[str, float]) -> dict[str, float]:
        """Concentrations C_i = x_i p/(R T) [mol/m3] of a feed, with the mixture's mole fractions (it need not be dilute)."""
        shares = mole_fractions(self.mechanism, self.gas.molar_mass, mass_fractions)
        return {name: share * self.gas.molar_density for name, share in shares.items()}

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
        from mpm.case.notebook import case_html

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
