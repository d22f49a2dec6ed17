"""A mechanism at one temperature, as `mpm mechanism` shows it: what it is made of, its constants, what saturation with it takes. SI."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from mpm.physics.exposure import expose
from mpm.physics.reaction import Reaction, SurfaceReaction
from mpm.report.coating import conveyed_layer
from mpm.report.dosing import all_feeds, inlet_saturation
from mpm.report.rateunits import orders, rate_constants, unit_of_equilibrium

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.materials import Material
    from mpm.physics.rates import Law
    from mpm.physics.substances import Site, Species

BALANCED = 1e-6
"""Atoms or places per event that may be missing."""
SATURATED = 0.99
"""Share of all that a surface takes from which it counts as saturated."""


def mechanism_report(case: Case) -> dict[str, Any]:
    """The mechanism of a case at its temperature; per site with the places of its conveyed layer. What does not exist is left out."""
    mechanism, temperature = case.mechanism, case.gas.temperature
    layer, material = reactive_material(case)
    density = material.site_density if material is not None else math.nan
    report: dict[str, Any] = {
        "mechanism": mechanism.name,
        "temperature": temperature,
        "reference_pressure": mechanism.reference_pressure,
        "species": {part.name: _part(part, temperature) for part in mechanism.species},
        "sites": {part.name: {"places": part.places, **_part(part, temperature)} for part in mechanism.sites},
        "films": {part.name: _part(part, temperature) for part in mechanism.films},
        "reactions": {r.key: _reaction(case, r, temperature, density) for r in mechanism.reactions},
    }
    if material is not None:
        report |= {"layer": layer, "site_density": density, "precursors": _precursors(case, material)}
    return report


def reactive_material(case: Case) -> tuple[str | None, Material | None]:
    """Name of the layer whose places count, and what it is made of: the conveyed one, else the topmost that reacts."""
    name = conveyed_layer(case)
    layer = next((layer for layer in case.geometry.layers if layer.name == name), None)
    return name, None if layer is None else layer.material


def _part(part: Species | Site, temperature: float) -> dict[str, Any]:
    known = part.thermochemistry
    numbers: dict[str, Any] = {"molar_mass": part.molar_mass, "elements": dict(part.elements)}
    if known.knows_enthalpy:
        numbers["enthalpy_at_298_K"] = known.standard_enthalpy
    if known.knows_enthalpy and known.knows_entropy:
        numbers["gibbs_energy"] = float(known.gibbs(temperature))
    return numbers


def _reaction(case: Case, reaction: Reaction, temperature: float, density: float) -> dict[str, Any]:
    mechanism = case.mechanism
    ways = rate_constants(mechanism, reaction, temperature, density)
    report: dict[str, Any] = {
        "equation": reaction.equation,
        "kind": "surface" if isinstance(reaction, SurfaceReaction) else "gas",
        "reversible": reaction.backward is not None,
        "changes": dict(reaction.changes),
        "forward": {**_law(reaction.forward), **ways[0]},
        "missing": _missing(case, reaction),
    }
    if reaction.backward is not None:
        report["backward"] = {**_law(reaction.backward), **ways[1]}
        given = reaction.backward.constant is not None
        there, back = mechanism.rate_constants(reaction, temperature, density)
        constant = there / back if given and float(back) else None
        if not given:
            constant = mechanism.equilibrium_constant(reaction, temperature)
        if constant is not None:
            report["equilibrium_constant"] = float(constant)
            report["equilibrium_constant_unit"] = unit_of_equilibrium(reaction)
        report["equilibrium_from"] = (
            "both rate constants" if given else "given" if reaction.equilibrium else "thermochemistry"
        )
    if isinstance(reaction, SurfaceReaction):
        share = reaction.sticking_coefficient(temperature)
        report["sticking_coefficient"] = None if share is None else float(share)
    if mechanism.knows_heat(reaction):
        report["heat"] = float(mechanism.heat_of_reaction(reaction, temperature))
    return report


def _law(law: Law) -> dict[str, Any]:
    report: dict[str, Any] = {"orders": dict(orders(law))}
    if law.coverage:
        report["coverage"] = {name: {"a": d.a, "m": d.m, "E": d.E} for name, d in law.coverage.items()}
    return report


def _missing(case: Case, reaction: Reaction) -> dict[str, float]:
    """Atoms of each element, and `places` on the surface, that an event makes of nothing: none, as a case is refused otherwise."""
    mechanism = case.mechanism
    change: dict[str, float] = {}
    parts: tuple[Species | Site, ...] = (*mechanism.species, *mechanism.sites, *mechanism.films)
    for part in parts:
        for element, atoms in part.elements.items():
            change[element] = change.get(element, 0.0) + reaction.changes.get(part.name, 0.0) * atoms
    change["places"] = sum(reaction.changes.get(site.name, 0.0) * site.places for site in mechanism.sites)
    return {name: amount for name, amount in change.items() if abs(amount) > BALANCED}


def _precursors(case: Case, material: Material) -> dict[str, dict[str, Any]]:
    """Of each dosing inlet: what its precursor finds on the solids and takes until nothing changes, and in which time at its feed."""
    report = {}
    for inlet in case.dosing_inlets:
        species = case.precursor(inlet)
        if species is None:
            continue
        gas = case.feed_concentrations(inlet.mass_fractions)
        found = inlet_saturation(case, inlet, species, material)
        concentration = gas[species]
        if case.mechanism.is_first_order:  # which counts one precursor by itself
            gas = {species: concentration}
        elif found.beside:
            gas = all_feeds(case, inlet)
        after = expose(case.mechanism, gas, found.met, case.gas.temperature, material.site_density)
        report[inlet.name] = {
            "species": species,
            "concentration": concentration,
            "beside": list(found.beside),
            "coverage_met": {name: share for name, share in found.met.items() if share > BALANCED},
            "uptake_speed": found.speed or None,
            "molecules_per_place": found.need,
            "seconds": None if after is None else after.time(species, SATURATED),
            "endless": after is not None and species in after.endless,
            "coverage_left": None
            if after is None
            else {name: share for name, share in after.coverage.items() if share > BALANCED},
        }
    return report
