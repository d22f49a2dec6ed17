"""The `[energy]` table of a case: its presence switches temperature on; and what it takes for a case to have one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from pydantic_core import PydanticCustomError

from mpm.case.model import Flag, Frozen
from mpm.physics.thermal import ConductivityModel, effective_conductivity
from mpm.units import FlowUpdate, Temperature, reject, worked_out

if TYPE_CHECKING:
    from mpm.arrays import Floats
    from mpm.case.geometry import Geometry
    from mpm.case.layers import Layer
    from mpm.case.materials import Material
    from mpm.physics.mechanism import Mechanism

NEEDED = {
    "heat_capacity": 'a heat capacity of the solid, e.g. "871 J/kg/K"',
    "density": 'a density of the solid, e.g. "2500 kg/m^3"',
    "conductivity": 'a conductivity of the solid, e.g. "1.3 W/m/K", or an effective_conductivity',
}
"""Properties of a material without which nothing can be said of its temperature."""


class Energy(Frozen):
    """Temperature of gas and solids, one field of both; without this table it is one number, gas.temperature."""

    initial_temperature: Temperature = worked_out("gas.temperature", 0.0)
    """temperature of gas and solids at the start"""
    conductivity_model: ConductivityModel = "parallel"
    """how gas and solid conduct side by side: parallel (most; the thesis), series (least), geometric, zehner_bauer_schluender (beads)"""
    flow_update: FlowUpdate = 0.01
    """relative change of temperature, mean over a layer, after which the flow is solved for anew"""
    buoyancy: Flag = True
    """whether weight and the reactor's acceleration act on differences of the gas's density"""
    soret: Flag = False
    """whether species also diffuse along gradients of temperature"""

    def model_of(self, material: Material) -> str:
        """Where the conductivity of a layer comes from: `given` (its effective_conductivity), or the model."""
        return self.conductivity_model if material.effective_conductivity is None else "given"

    def conductivity_of[Value: (float, Floats)](self, material: Material, gas: Value) -> Value:
        """Conductivity [W/m/K] of a porous solid full of gas that conducts `gas` [W/m/K] at the temperatures in question."""
        if material.effective_conductivity is not None:
            return material.effective_conductivity + 0.0 * gas  # in the shape of `gas`
        if material.conductivity is None:
            raise ValueError("a material without conductivity")  # the case refuses it
        solid, porosity = material.conductivity + 0.0 * gas, material.porosity + 0.0 * gas
        return effective_conductivity(self.conductivity_model, porosity, gas, solid)

    def complete(self, temperature: float) -> None:
        """Fill in what is left out; the case does this once the gas is read."""
        if "initial_temperature" not in self.model_fields_set:
            self._fill(initial_temperature=temperature)


def check_layers(layers: tuple[Layer, ...]) -> None:
    """Every porous layer has what its temperature needs."""
    for layer in layers:
        if layer.material is None:
            continue
        for key, accepted in NEEDED.items():
            effective = key == "conductivity" and layer.material.effective_conductivity is not None
            if getattr(layer.material, key) is None and not effective:
                raise reject(
                    f"none, and layer {layer.name} has a temperature ([energy])",
                    accepted,
                    key=f"material.{layer.material_name}.{key}",
                )


def check_heats(mechanism: Mechanism) -> None:
    """Enthalpies of a reaction are known of all that it changes, or of nothing: a part of them would be any heat at all."""
    kinds = {
        **{part.name: "species" for part in mechanism.species},
        **{part.name: "site" for part in mechanism.sites},
        **{part.name: "film" for part in mechanism.films},
    }
    for reaction in mechanism.reactions:
        missing = mechanism.without_enthalpy(reaction)
        if reaction.given_heat is None and missing and len(missing) < len(reaction.changes):
            raise reject(
                f"no enthalpy of {', '.join(missing)}, and one of others in reaction {reaction.key}",
                f'an enthalpy of formation, e.g. "-86.5 kJ/mol", of each, or chemistry.reaction.{reaction.key}.heat_of_reaction',
                key=f"chemistry.{kinds[missing[0]]}.{missing[0]}.enthalpy",
            )


def without_energy(geometry: Geometry) -> None:
    """Refuse keys of temperature in a case without [energy], which would do nothing."""
    for key, what in _thermal_keys(geometry):
        raise _needs_energy(f"geometry.{key}", what)


def _thermal_keys(geometry: Geometry) -> Iterator[tuple[str, str]]:
    for wall in geometry.walls:
        yield f"wall.{wall.name}", "a wall"
    for inlet in geometry.inlets:
        if inlet.temperature is not None:
            yield f"inlet.{inlet.name}.temperature", "a temperature"
    if geometry.bed_temperature is not None:
        yield "bed_temperature", "a temperature"
    for layer in geometry.layers:
        if layer.heating:
            yield f"layer.{layer.name}.heating", "a heating"


def _needs_energy(key: str, what: str) -> PydanticCustomError:
    return reject(
        f"{what} in a case without a table [energy]",
        f"{what} in one with [energy], which switches temperature on and may be empty; without it all is at gas.temperature",
        key=key,
        given="",
    )
