"""What an engineer works out on paper before a run with temperature: `energy` of the report of `mpm check`, SI, and its warnings.

Properties of the gas are those at gas.temperature, in the numbers of Rayleigh those at the mean of the lowest and the highest temperature
that the case gives; the difference of these two is what drives natural convection at most.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from mpm.advice import engineering as eng
from mpm.case.throughflow import rising_velocity
from mpm.physics.gases import ideal_gas_density
from mpm.physics.porous import particle_surface
from mpm.physics.thermal import (
    CRITICAL_DARCY_RAYLEIGH,
    CRITICAL_RAYLEIGH,
    darcy_rayleigh,
    exchange_time,
    nusselt_of_particles,
    rayleigh,
    volumetric_heat_capacity,
)

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.energy import Energy
    from mpm.case.layers import Layer
    from mpm.case.materials import Material
    from mpm.physics.reaction import SurfaceReaction

SLOW_EXCHANGE = 0.1
"""Exchange between gas and solids over conduction through the layer from which two temperatures are not one."""


def energy_report(case: Case, energy: Energy) -> dict[str, Any]:
    """The numbers of a case with a table [energy]; a number that does not exist for the case is absent."""
    lowest, highest = case.temperatures[0], case.temperatures[-1]
    report: dict[str, Any] = {
        "conductivity_model": energy.conductivity_model,
        "lowest_temperature": lowest,
        "highest_temperature": highest,
        "gas": {"conductivity": case.gas.conductivity, "heat_capacity": case.gas.heat_capacity},
        "layers": {layer.name: _layer(case, energy, layer) for layer in case.geometry.layers},
        "heat_of_reaction": {
            r.key: case.mechanism.heat_of_reaction(r, case.gas.temperature) for r in case.mechanism.reactions
        },
        "without_heat": [r.key for r in case.mechanism.reactions if not case.mechanism.knows_heat(r)],
    }
    for layer in case.geometry.layers:
        report["layers"][layer.name] |= _convection(
            case, layer, report["layers"][layer.name], highest - lowest
        )
    moving = case.geometry.moving_layer
    if moving is not None:
        report["bed"] = _bed(case, moving, report["layers"][moving.name])
        report["bed"] |= _walls(case, moving, report["layers"])
    return report


def _walls(case: Case, bed: Layer, layers: dict[str, Any]) -> dict[str, float]:
    """C h/sum 1/R [s], in which walls below and above that have a temperature warm the bed through all that lies between.

    R = sum h_i/k_i [m2 K/W] of the layers between, half of the bed and the wall's own 1/h; gas that conducts alone: where it turns over,
    less. Absent where no wall has a temperature.
    """
    order = [layer.name for layer in case.geometry.layers]
    place = order.index(bed.name)
    passed = 0.0
    for side, between in (
        ("bottom", case.geometry.layers[:place]),
        ("top", case.geometry.layers[place + 1 :]),
    ):
        walls = [wall for wall in case.geometry.walls if wall.side == side and wall.heat_flux is None]
        resistance = sum(layer.height / layers[layer.name]["conductivity"] for layer in between)
        resistance += 0.5 * bed.height / layers[bed.name]["conductivity"]
        for wall in walls:
            own = 0.0 if wall.heat_transfer_coefficient is None else 1.0 / wall.heat_transfer_coefficient
            passed += (wall.end - wall.start) / case.geometry.length / (resistance + own)
    if passed == 0.0:
        return {}
    return {"wall_time": layers[bed.name]["heat_capacity"] * bed.height / passed}


def _layer(case: Case, energy: Energy, layer: Layer) -> dict[str, Any]:
    """Conductivity, heat capacity by volume and diffusivity of a layer, and which model the first is of."""
    gas, material = case.gas, layer.material
    by_volume = gas.density * gas.heat_capacity
    if material is None:
        numbers: dict[str, Any] = {
            "model": "gas",
            "conductivity": gas.conductivity,
            "heat_capacity": by_volume,
        }
    else:
        numbers = {
            "model": energy.model_of(material),
            "conductivity": energy.conductivity_of(material, gas.conductivity),
            "heat_capacity": volumetric_heat_capacity(
                material.porosity,
                gas=by_volume,
                density=material.density or 0.0,  # a case with [energy] has both
                heat_capacity=material.heat_capacity or 0.0,
            ),
        }
    numbers["diffusivity"] = numbers["conductivity"] / numbers["heat_capacity"]
    numbers["diffusion_time"] = layer.height**2 / numbers["diffusivity"]
    return numbers


def _convection(case: Case, layer: Layer, of: dict[str, Any], difference: float) -> dict[str, float]:
    """Number of Rayleigh of a layer of gas, of Darcy and Rayleigh of a porous one, each with its critical value."""
    gas, mean = case.gas, 0.5 * (case.temperatures[0] + case.temperatures[-1])
    density = ideal_gas_density(pressure=gas.pressure, molar_mass=gas.molar_mass, temperature=mean)
    viscosity = gas.viscosity_at(mean)
    if layer.material is None:
        ra = rayleigh(
            difference=difference,
            height=layer.height,
            temperature=mean,
            viscosity=viscosity,
            density=density,
            diffusivity=gas.conductivity_at(mean) / (density * gas.heat_capacity),
        )
        return {"Rayleigh": ra, "critical_Rayleigh": CRITICAL_RAYLEIGH}
    ra = darcy_rayleigh(
        difference=difference,
        height=layer.height,
        temperature=mean,
        viscosity=viscosity,
        density=density,
        permeability=layer.material.slip_permeability(gas.mean_free_path)[1],
        conductivity=of["conductivity"],
        gas_heat_capacity=gas.heat_capacity,
    )
    return {"Darcy_Rayleigh": ra, "critical_Darcy_Rayleigh": CRITICAL_DARCY_RAYLEIGH}


def _bed(case: Case, layer: Layer, of: dict[str, Any]) -> dict[str, Any]:
    """How fast the moving layer takes a temperature, and what its own reactions do to it."""
    speed, material = abs(case.conveying_velocity), layer.solid
    numbers: dict[str, Any] = {"diffusion_time": of["diffusion_time"]}
    if speed > 0.0:
        numbers["residence_over_diffusion_time"] = case.geometry.length / speed / of["diffusion_time"]
    if material.particle_diameter is not None:
        nusselt, time = _exchange(case, material, material.particle_diameter)
        numbers |= {"Nusselt": nusselt, "exchange_time": time}
    reacting = case.mechanism.running_surface(case.fed_species)
    numbers["adiabatic_rise"] = {r.key: _rise(case, material, r, of["heat_capacity"]) for r in reacting}
    return numbers


def _exchange(case: Case, material: Material, diameter: float) -> tuple[float, float]:
    """Nu of the particles in the rising gas, and the time [s] in which they take its temperature through their outer surface."""
    gas = case.gas
    centres = [inlet.center for inlet in case.geometry.inlets]
    rising = max((rising_velocity(case.geometry, gas, x) for x in centres), default=0.0)
    nusselt = nusselt_of_particles(
        gas.viscosity * gas.heat_capacity / gas.conductivity,
        eng.reynolds(density=gas.density, velocity=rising, length=diameter, viscosity=gas.viscosity),
    )
    return nusselt, exchange_time(
        porosity=material.porosity,
        density=material.density or 0.0,
        heat_capacity=material.heat_capacity or 0.0,
        transfer=nusselt * gas.conductivity / diameter,
        surface=particle_surface(material.porosity, diameter, material.sphericity),
    )


def _rise(case: Case, material: Material, reaction: SurfaceReaction, heat_capacity: float) -> float | None:
    """dT = -dH S n_s/(|nu| C_h) [K]: by how much an insulated bed warms when this reaction turns over every place, |nu| in one event.

    None for a reaction that leaves the sites as they are.
    """
    heat = case.mechanism.heat_of_reaction(reaction, case.gas.temperature)
    sites = material.surface_to_volume * material.site_density
    places = {site.name: site.places for site in case.mechanism.sites}
    turned = sum(-nu * places[name] for name, nu in reaction.nu_site.items() if nu < 0.0)
    return -heat * sites / (turned * heat_capacity) if turned else None


def heat_warnings(case: Case, report: dict[str, Any]) -> Iterator[str]:
    """What is legal but questionable of a case with temperature, one sentence each."""
    if "energy" not in report:
        return
    energy = report["energy"]
    if energy["without_heat"]:
        names = ", ".join(energy["without_heat"])
        yield (
            f"no heat of reaction is known of {names}: none is set free (chemistry.reaction.{energy['without_heat'][0]}.heat_of_reaction, "
            "or the enthalpy of all that takes part)"
        )
    yield from _turning_over(case, energy)
    bed = energy.get("bed", {})
    if bed.get("exchange_time", 0.0) > SLOW_EXCHANGE * bed.get("diffusion_time", 0.0):
        yield (
            f"gas and solids exchange heat within {bed['exchange_time']:.3g} s, conduction through the bed takes "
            f"{bed['diffusion_time']:.3g} s: they need not have one temperature, as the model has it"
        )


def _turning_over(case: Case, energy: dict[str, Any]) -> Iterator[str]:
    """Layers that natural convection may set in motion."""
    if case.energy is None or not case.energy.buoyancy:
        return
    for name, numbers in energy["layers"].items():
        for key, of in (("Rayleigh", "gas"), ("Darcy_Rayleigh", "porous")):
            if numbers.get(key, 0.0) <= numbers.get(f"critical_{key}", 0.0):
                continue
            inertia = (
                f"; fidelity {case.fidelity} finds the flow of each temperature anew, without the gas's own inertia"
                if case.fidelity == "averaged" and of == "gas"
                else ""
            )
            yield (
                f"layer {name} ({of}) may turn over by itself where it is warmer below: Ra = {numbers[key]:.3g} with the largest "
                f"difference of temperatures of the case, above {numbers[f'critical_{key}']:.4g}{inertia}"
            )
