"""All tables of a case as frozen values: what a file may say, checked table against table, and what follows from several of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from mpm.case.balance import complete_motion
from mpm.case.chemistry import Chemistry
from mpm.case.energy import Energy, check_heats, check_layers, without_energy
from mpm.case.gas import Gas
from mpm.case.geometry import Geometry
from mpm.case.materials import Material
from mpm.case.model import Frozen
from mpm.case.motion import Motion
from mpm.case.options import Output, Porous, Time, TransportOptions
from mpm.case.ports import Inlet
from mpm.case.reactions import build_mechanism, check_rates
from mpm.physics.mechanism import Mechanism, mole_fractions
from mpm.units import reject


class CaseTables(Frozen):
    """One simulation, complete and consistent, wherever it was read from."""

    title: Annotated[str, Field(examples=["A wider TMA port"])] = ""
    """a line that names the case on screens, pictures and in results"""
    fidelity: Literal["resolved", "averaged", "steady"] = "averaged"
    """resolved: every phase of every vibration; averaged: their mean, in time; steady: the state that an averaged run ends in"""
    conventions: Literal["mpm", "closed-code"] = "mpm"
    """what the switches transport.scheme, transport.backflow_rows, porous.*, motion.drag_reference and geometry.inlet_diffusion are where
    the file leaves them out: those of this model, or those of the closed code with which the thesis computed"""
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
    """how species are carried from cell to cell"""
    porous: Porous = Porous()
    """conventions of a porous medium that codes do not share"""
    energy: Energy | None = None
    """temperature as a field: present, it is solved for; absent, all is at gas.temperature"""

    _mechanism: Mechanism = PrivateAttr()

    @model_validator(mode="after")
    def _resolve(self) -> Self:
        self._mechanism = build_mechanism(self.chemistry)
        self.geometry.complete(self.materials)
        self._check_chemistry()
        self._check_phases()
        check_rates(self._mechanism, self.gas.temperature)
        self.gas.complete(self._mechanism)
        self._complete_energy()
        complete_motion(self.motion, self.geometry, self.gas)
        self._check_cycle()
        return self

    def _complete_energy(self) -> None:
        """Fill in temperatures that are left out, and see that heat has what it takes; without [energy] nothing may ask for it."""
        if self.energy is None:
            without_energy(self.geometry)
            if self.gas.mixture:
                raise reject(
                    "true in a case without a table [energy]",
                    "true in one with [energy], which may be empty: density then follows temperature and composition",
                    key="gas.mixture",
                    given="",
                )
            return
        self.gas.complete_thermal()
        geometry = self.geometry
        if self.fidelity == "steady" and geometry.bed_inflow == "periodic" and not geometry.periodic:
            raise reject(
                "periodic solids between walls (geometry.periodic = false) in a steady case with [energy], where heat goes by cells",
                'fresh, geometry.periodic = true, or fidelity "averaged" or "resolved"',
                key="geometry.bed_inflow",
                given="",
            )
        self.energy.complete(self.gas.temperature)
        self.geometry.complete_temperatures(self.gas.temperature)
        check_layers(self.geometry.layers)
        check_heats(self._mechanism)
        for temperature in self.temperatures:
            check_rates(self._mechanism, temperature)

    def _check_cycle(self) -> None:
        """What a run that sees the mean of the vibration only cannot answer."""
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

    def _check_phases(self) -> None:
        """Phases are written of a run that has them, and fall on its steps."""
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
        """Species and sites that other tables name are those of the mechanism; names can be told apart in results."""
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

    def inlet_temperature(self, inlet: Inlet) -> float:
        """Temperature of what an inlet blows [K]."""
        return self.gas.temperature if inlet.temperature is None else inlet.temperature

    @property
    def bed_temperature(self) -> float:
        """Temperature of solids that enter fresh [K]."""
        given = self.geometry.bed_temperature
        return self.gas.temperature if given is None else given

    @property
    def temperatures(self) -> tuple[float, ...]:
        """All temperatures that the case gives to gas, solids and walls [K], in order; one without [energy]."""
        if self.energy is None:
            return (self.gas.temperature,)
        walls = (t for wall in self.geometry.walls for t in (wall.temperature, wall.ambient) if t is not None)
        inlets = (self.inlet_temperature(inlet) for inlet in self.geometry.inlets)
        return tuple(sorted({self.energy.initial_temperature, self.bed_temperature, *inlets, *walls}))

    @property
    def mechanism(self) -> Mechanism:
        """The reaction mechanism, overrides included."""
        return self._mechanism

    @property
    def follows_cycle(self) -> bool:
        """Whether the flow is found for every step of the vibration cycle, not for its mean alone."""
        return self.fidelity == "resolved" or self.transport.vibrational_dispersion

    @property
    def conveying_velocity(self) -> float:
        """Mean velocity of the moving layer [m/s], negative to the left; 0 in a strip without one."""
        return 0.0 if self.geometry.moving_layer is None else self.motion.mean_velocity

    @property
    def direction(self) -> int:
        """Which way solids are conveyed: -1 where a moving layer moves to the left in the mean, else 1.

        They enter the strip and every zone at the end that they come from, left or right, and leave at the other.
        """
        return -1 if self.conveying_velocity < 0.0 else 1

    def inlet_density(self, inlet: Inlet) -> float:
        """Density of what an inlet blows over that of the gas at gas.temperature: 1 unless its temperature is another."""
        return self.gas.temperature / self.inlet_temperature(inlet)

    # What inlets dose

    def feed_concentrations(self, mass_fractions: Mapping[str, float]) -> dict[str, float]:
        """Concentrations C_i = x_i p/(R T) [mol/m3] of a feed, with the mixture's mole fractions (it need not be dilute)."""
        shares = mole_fractions(self.mechanism, self.gas.molar_mass, mass_fractions)
        return {name: share * self.gas.molar_density for name, share in shares.items()}

    @property
    def fed_species(self) -> tuple[str, ...]:
        """Species that any inlet feeds, in the mechanism's order."""
        fed = {name for inlet in self.geometry.inlets for name in inlet.feed}
        return tuple(name for name in self.mechanism.species_names if name in fed)

    def fed_by(self, inlet: Inlet) -> tuple[str, ...]:
        """Species that an inlet feeds, in the mechanism's order."""
        return tuple(name for name in self.fed_species if name in inlet.feed)

    @property
    def dosing_inlets(self) -> tuple[Inlet, ...]:
        """Inlets that feed any species, reactive or not."""
        return tuple(inlet for inlet in self.geometry.inlets if inlet.feed)

    def precursors(self, inlet: Inlet) -> tuple[str, ...]:
        """Species of an inlet's feed that react on the surface, in the order of the file."""
        return tuple(name for name in inlet.feed if self.mechanism.half_reactions(name))

    def precursor(self, inlet: Inlet) -> str | None:
        """The species that an inlet doses: the first of its precursors, whose titration and excess are reported; or None."""
        return next(iter(self.precursors(inlet)), None)

    def sites_made_by(self, inlet: Inlet) -> tuple[str, ...]:
        """Site species whose coverage this inlet's titration counts; empty when nothing it feeds reacts on the surface."""
        species = self.precursor(inlet)
        return () if species is None else self.mechanism.titrated_sites(species)
