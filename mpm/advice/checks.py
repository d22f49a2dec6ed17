"""`mpm check`: the numbers of `mpm.advice.engineering` for a case, and warnings about them."""

from __future__ import annotations

from typing import Any

from mpm.advice import engineering as eng
from mpm.advice.caveats import (
    feed_caveats,
    gas_caveats,
    mass_caveats,
    output_caveats,
    polynomial_caveats,
    profile_caveats,
    site_density_caveats,
    steady_caveats,
)
from mpm.advice.conventions import convention_caveats, convention_numbers
from mpm.advice.heat import energy_report, heat_warnings
from mpm.advice.idle import idle_keys
from mpm.advice.limits import beyond_limits
from mpm.advice.motion import flight_caveats, motion_report
from mpm.advice.notes import notes
from mpm.case.case import Case
from mpm.case.keys import values
from mpm.case.layers import Layer
from mpm.case.materials import Material
from mpm.case.ports import Inlet
from mpm.case.throughflow import fastest_rise, rising_velocity, spreading_length
from mpm.mesh.grid import Grid
from mpm.motion.schedule import Schedule
from mpm.physics.fluidisation import (
    minimum_fluidisation_velocity,
    wen_yu_minimum_fluidisation,
)
from mpm.physics.mechanism import mole_fractions
from mpm.physics.porous import effective_diffusivity
from mpm.plain import plain
from mpm.report.dosing import inlet_excess


def check_case(case: Case) -> dict[str, Any]:
    """The numbers of a case, SI, as one JSON object; a number that does not exist for the case is absent."""
    grid = Grid.from_case(case)
    report: dict[str, Any] = {
        "title": case.title,
        "fidelity": case.fidelity,
        "conventions": convention_numbers(case),
        "strip": _strip(case),
        "mesh": {
            "columns": grid.columns,
            "rows": grid.rows,
            "cells": grid.cells,
            "column_width": grid.dx,
            "smallest_row": float(min(grid.dy)),
        },
        "run": {
            "steps": eng.expected_steps(case),
            "step": None if case.fidelity == "steady" else Schedule.from_case(case).dt,
            "peak_memory_bytes": eng.expected_memory(case, grid.cells),
            "flow_courant": eng.flow_courant(case, grid),
            "numerical_diffusion": eng.numerical_diffusion(case, grid),
        },
        "gas": {
            "density": case.gas.density,
            "viscosity": case.gas.viscosity,
            "molar_mass": case.gas.molar_mass,
            "mean_free_path": case.gas.mean_free_path,
            "diffusivity": dict(case.gas.diffusivity),
            "diffusivity_from": {
                name: "scaled" if name in case.gas.scaled else "typed" for name in case.gas.diffusivity
            },
        },
        "pores": {
            layer.name: _pores(case, layer.material) for layer in case.geometry.layers if layer.material
        },
        "sites_per_nm2": {
            layer.name: eng.sites_per_square_nanometre(layer.material.site_density)
            for layer in case.geometry.layers
            if layer.material
        },
        "motion": motion_report(case),
        "inlets": {inlet.name: _inlet(case, inlet) for inlet in case.geometry.inlets},
        "reactions": [str(r) for r in (*case.mechanism.surface_reactions, *case.mechanism.gas_reactions)],
    }
    layer = case.geometry.moving_layer
    if layer is not None:
        report["bed"] = _bed(case, layer)
    if case.energy is not None:
        report["energy"] = energy_report(case, case.energy)
    report["origins"] = {value.name: value.origin for value in values(case)}
    report["notes"] = notes(case)
    report["without_effect"] = idle_keys(case)
    report["warnings"] = warnings(case, report)  # before anything is dropped that they speak of
    found: dict[str, Any] = plain(report)
    return found


def _strip(case: Case) -> dict[str, Any]:
    """What the gas and the solids meet at the ends."""
    geometry = case.geometry
    return {
        "length": geometry.length,
        "height": geometry.height,
        "ends": "periodic" if geometry.periodic else "walls",
        "bed_inflow": geometry.bed_inflow,
        "bed_direction": "right" if case.direction > 0 else "left",
        "moving_layer": geometry.moving_layer.name if geometry.moving_layer else None,
    }


def _pores(case: Case, material: Material) -> dict[str, Any]:
    diameter = material.pore_diameter or eng.pore_diameter(material)
    numbers: dict[str, Any] = {
        "diameter": diameter,
        "Knudsen": eng.knudsen(case.gas.mean_free_path, diameter),
    }
    if material.pore_diameter is not None:
        slipping = material.slip_permeability(case.gas.mean_free_path)
        numbers["permeability_factor"] = slipping[1] / material.permeability[1]
        numbers["diffusivity_factor"] = {
            s.name: material.pore_diffusivity(free, s.molar_mass, case.gas.temperature) / free
            for s in case.mechanism.species
            if (free := case.gas.diffusivity[s.name]) > 0.0
        }
    return numbers


def _inlet(case: Case, inlet: Inlet) -> dict[str, Any]:
    gas, layer, temperature = case.gas, case.geometry.moving_layer, case.inlet_temperature(inlet)
    standard = eng.standard_flow(inlet.velocity * inlet.width, temperature=temperature, pressure=gas.pressure)
    numbers: dict[str, Any] = {
        "velocity": inlet.velocity,
        "flow": inlet.velocity * inlet.width,
        "standard_flow": standard,
        "sccm_per_metre": eng.per_minute(standard),
        "mole_fractions": mole_fractions(case.mechanism, gas.molar_mass, inlet.mass_fractions),
        "Re": eng.reynolds(
            density=gas.density * case.inlet_density(inlet),
            velocity=inlet.velocity,
            length=inlet.width,
            viscosity=gas.viscosity_at(temperature),
        ),
        "concentrations": case.feed_concentrations(inlet.mass_fractions),
    }
    found = inlet_excess(case, inlet)
    if found is None or layer is None or layer.material is None:
        return numbers
    species, numbers["excess_number"], numbers["dose_ratio"], saturated = found
    mechanism, material, k = case.mechanism, layer.material, saturated.speed
    if saturated.endless:
        numbers["endless"] = True
    elif not mechanism.is_first_order:  # which leaves no site as it was
        covered = (saturated.left.get(site, 0.0) for site in mechanism.titrated_sites(species))
        numbers["saturated_coverage"] = sum(covered)
    molecular = material.pore_diffusivity(
        gas.diffusivity[species], mechanism.get(species).molar_mass, gas.temperature
    )
    diffusivity = effective_diffusivity(
        molecular, material.porosity, material.tortuosity_factor[1], case.porous.diffusion
    )
    velocity = rising_velocity(case.geometry, gas, inlet.center)
    surface = material.surface_to_volume
    numbers["species"] = species
    if k == 0.0 and not mechanism.is_first_order:
        return numbers  # nothing that it reacts with
    if diffusivity > 0.0:
        numbers["Pe_bed"] = eng.peclet(velocity=velocity, length=layer.height, diffusivity=diffusivity)
        numbers["Damkoehler_diffusion"] = eng.damkoehler_diffusion(
            surface_to_volume=surface, rate_constant=k, length=layer.height, diffusivity=diffusivity
        )
    if k > 0.0:
        numbers["front_thickness"] = eng.front_thickness(
            surface_to_volume=surface, rate_constant=k, diffusivity=diffusivity
        )
        numbers["gas_lifetime"] = material.porosity / (surface * k)
        numbers["site_lifetime"] = saturated.lifetime
    if velocity > 0.0:
        numbers["Damkoehler_convection"] = eng.damkoehler_convection(
            surface_to_volume=surface, rate_constant=k, length=layer.height, velocity=velocity
        )
    return numbers


def _bed(case: Case, layer: Layer) -> dict[str, Any]:
    gas, material, geometry = case.gas, layer.solid, case.geometry
    rising = fastest_rise(geometry, gas)
    permeability = material.slip_permeability(gas.mean_free_path)[1]
    numbers: dict[str, Any] = {
        "height": layer.height,
        "gas_velocity": rising,
        "spreading_length": spreading_length(geometry, gas.mean_free_path),
        "pressure_drop": gas.viscosity * rising * layer.height / permeability,
    }
    if case.motion.mean_velocity != 0.0:
        numbers["residence_time"] = geometry.length / abs(case.motion.mean_velocity)
    if material.particle_diameter is not None:
        numbers["Re_particle"] = eng.reynolds(
            density=gas.density, velocity=rising, length=material.particle_diameter, viscosity=gas.viscosity
        )
        if material.density is not None and material.density > gas.density:
            ergun = minimum_fluidisation_velocity(
                diameter=material.particle_diameter,
                sphericity=material.sphericity,
                density_solid=material.density,
                porosity=material.porosity,
                viscosity=gas.viscosity,
                density_gas=gas.density,
            )
            numbers["minimum_fluidisation_ergun"] = ergun
            numbers["minimum_fluidisation_wen_yu"] = wen_yu_minimum_fluidisation(
                diameter=material.particle_diameter,
                density_solid=material.density,
                viscosity=gas.viscosity,
                density_gas=gas.density,
            )
            numbers["gas_over_minimum_fluidisation"] = rising / ergun
    return numbers


def warnings(case: Case, report: dict[str, Any]) -> list[str]:
    """What is legal but questionable, one sentence each."""
    return [
        *profile_caveats(case),
        *flight_caveats(case),
        *convention_caveats(case),
        *gas_caveats(case),
        *mass_caveats(case),
        *site_density_caveats(case),
        *polynomial_caveats(case),
        *feed_caveats(case),
        *steady_caveats(case),
        *output_caveats(case),
        *beyond_limits(case, report),
        *heat_warnings(case, report),
    ]
