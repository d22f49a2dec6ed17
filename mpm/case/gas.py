"""The `[gas]` table of a case: the carrier gas and its state, with what the case leaves out filled in."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import (
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    WithJsonSchema,
    model_serializer,
    model_validator,
)

from mpm.arrays import Floats
from mpm.case.model import Flag, Frozen
from mpm.physics.diffusion import EXPONENT, scaled_diffusivity
from mpm.physics.fluidisation import mean_free_path
from mpm.physics.gases import CARRIERS, GASES_VARY, ideal_gas_density, molar_density, symbol
from mpm.physics.mechanism import Mechanism
from mpm.units import (
    DIFFUSIVITY,
    Conductivity,
    Diffusivity,
    GasDensity,
    HeatCapacity,
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
    """temperature of gas and solids, everywhere the same; with a table [energy], that at which the gas has the properties given here, and
    that of all that is given none"""
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
    heat_capacity: HeatCapacity = worked_out(
        "the carrier's at this temperature (Shomate, NIST)", 0.0, example="1040 J/kg/K"
    )
    """heat capacity of the gas at constant pressure, by mass; read where there is a table [energy]"""
    conductivity: Conductivity = worked_out(
        "the carrier's at this temperature (Sutherland)", 0.0, example="0.0375 W/m/K"
    )
    """thermal conductivity of the gas; read where there is a table [energy]"""
    mixture: Flag = False
    """whether density, viscosity and diffusivities follow the composition of the gas, too; false: they are those of the carrier, which is
    right where precursors are dilute. Read where there is a table [energy]"""
    _scaled: tuple[str, ...] = PrivateAttr(())
    _thermal: bool = PrivateAttr(False)

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

    def complete_thermal(self) -> None:
        """Fill in what a temperature field asks for; a case with [energy] does this."""
        self._thermal = True
        for key, accepted in (
            ("heat_capacity", 'a heat capacity, e.g. "1040 J/kg/K"'),
            ("conductivity", 'a thermal conductivity, e.g. "0.0375 W/m/K"'),
        ):
            if getattr(self, key) == 0.0:
                raise reject(
                    f"none, and nothing is known of {self.carrier}, whose temperature is asked for ([energy])",
                    f"{accepted}, or one of the carriers {', '.join(CARRIERS)}",
                    key=f"gas.{key}",
                    given="",
                )

    @property
    def molar_density(self) -> float:
        """p/(R T) [mol/m3]."""
        return molar_density(self.pressure, self.temperature)

    @property
    def mean_free_path(self) -> float:
        """Mean free path [m] of the carrier at the temperature and pressure of this table."""
        return mean_free_path(
            viscosity=self.viscosity,
            pressure=self.pressure,
            temperature=self.temperature,
            molar_mass=self.molar_mass,
        )

    def viscosity_at[Value: (float, Floats)](self, temperature: Value) -> Value:
        """Dynamic viscosity [Pa s] at `temperature` [K]: that of this table, scaled as the carrier's (Sutherland), or as T^0.75
        of an unknown one (`mpm.physics.gases.GASES_VARY`)."""
        model = CARRIERS.get(self.carrier)
        if model is None:
            value: Value = self.viscosity * (temperature / self.temperature) ** GASES_VARY
            return value
        return self.viscosity * (model.viscosity(temperature) / model.viscosity(self.temperature))

    def conductivity_at[Value: (float, Floats)](self, temperature: Value) -> Value:
        """Thermal conductivity [W/m/K] at `temperature` [K], scaled as the viscosity is."""
        model = CARRIERS.get(self.carrier)
        if model is None:
            value: Value = self.conductivity * (temperature / self.temperature) ** GASES_VARY
            return value
        return self.conductivity * (model.conductivity(temperature) / model.conductivity(self.temperature))

    def diffusivity_factor[Value: (float, Floats)](self, temperature: Value) -> Value:
        """(T/T_ref)^1.75: diffusivities at `temperature` [K] over those of this table (`mpm.physics.diffusion`)."""
        factor: Value = (temperature / self.temperature) ** EXPONENT
        return factor

    @model_serializer(mode="wrap")
    def _write_what_is_read(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        table: dict[str, Any] = handler(self)
        for key in ("heat_capacity", "conductivity", "mixture"):
            if not self._thermal and (key == "mixture" or key not in self.model_fields_set):
                table.pop(key, None)  # a mixture without [energy] is refused, so that it is none
        return table

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
        if "heat_capacity" not in given and model is not None:
            value = in_range("heat_capacity", model.heat_capacity(self.temperature), "J/kg/K")
            self._fill(heat_capacity=value)
        if "conductivity" not in given and model is not None:
            self._fill(conductivity=in_range("conductivity", model.conductivity(self.temperature), "W/m/K"))
        return self
