"""The `[gas]` table of a case: the carrier gas and its state, with what the case leaves out filled in."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, PrivateAttr, WithJsonSchema, model_validator

from mpm.case.model import Frozen
from mpm.physics.diffusion import scaled_diffusivity
from mpm.physics.gases import CARRIERS, ideal_gas_density, molar_density, symbol
from mpm.physics.mechanism import Mechanism
from mpm.units import (
    DIFFUSIVITY,
    Diffusivity,
    GasDensity,
    MolarMass,
    Pressure,
    Temperature,
    Viscosity,
    in_range,
    reject,
    worked_out,
)

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
        """The species whose diffusivity the case leaves to `mpm.physics.diffusion`."""
        return self._scaled

    def complete(self, mechanism: Mechanism) -> None:
        """Fill in the diffusivities that are left out; the case does this once the mechanism is known."""
        left_out = [species for species in mechanism.species if species.name not in self.diffusivity]
        self._scaled = tuple(species.name for species in left_out)
        default = {
            species.name: scaled_diffusivity(
                species,
                self.carrier,
                molar_mass=self.molar_mass,
                temperature=self.temperature,
                pressure=self.pressure,
            )
            for species in left_out
        }
        for name, value in default.items():
            in_range(f"gas.diffusivity.{name}", value, "m^2/s")
        values = {**default, **self.diffusivity}
        self._fill(diffusivity={name: values[name] for name in mechanism.species_names})

    @property
    def molar_density(self) -> float:
        """p/(R T) [mol/m3]."""
        return molar_density(self.pressure, self.temperature)

    @model_validator(mode="after")
    def _fill_in(self) -> Self:
        model, given = CARRIERS.get(self.carrier), self.model_fields_set
        if model is None and not {"molar_mass", "viscosity"} <= given:
            raise reject(
                repr(self.carrier),
                f"one of {', '.join(CARRIERS)}, or any name with molar_mass and viscosity",
                key="carrier",
                given=symbol(self.carrier),
                known=list(CARRIERS),
            )
        if "molar_mass" not in given and model is not None:
            self._fill(molar_mass=model.molar_mass)
        if "viscosity" not in given and model is not None:
            self._fill(viscosity=in_range("viscosity", model.viscosity(self.temperature), "Pa s"))
        if "density" not in given:
            density = ideal_gas_density(
                pressure=self.pressure, molar_mass=self.molar_mass, temperature=self.temperature
            )
            self._fill(density=in_range("density", density, "kg/m^3"))
        return self
