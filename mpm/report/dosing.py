"""Whether what the inlets of a case dose is enough, and what is made of it; what they dose says the case itself."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from mpm.physics.saturation import Saturation, saturation, together

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.materials import Material
    from mpm.case.ports import Inlet
    from mpm.case.zones import Zone


def zone_of(case: Case, inlet: Inlet) -> Zone | None:
    """The zone whose inlet this is."""
    return next((zone for zone in case.geometry.zones if zone.inlet == inlet.name), None)


def made_sites(case: Case) -> list[str]:
    """Site species worth a map: of two that add up to one, the one the first dosing inlet makes.

    Those that dosing inlets make, then those that a gas makes which reactions give off, as hydrogen chloride that sits down again.
    """
    mechanism, fed = case.mechanism, case.fed_species
    made = dict.fromkeys(site for inlet in case.dosing_inlets for site in case.sites_made_by(inlet))
    for species in mechanism.species_names if made and not mechanism.is_first_order else ():
        if species not in fed:
            made |= dict.fromkeys(mechanism.titrated_sites(species))
    return list(made)[:1] if len(mechanism.site_names) == 2 else list(made)


def excess_number(
    *,
    velocity: float,
    width: float,
    concentration: float,
    bed_velocity: float,
    bed_height: float,
    surface_to_volume: float,
    site_density: float,
) -> float:
    """Precursor molecules fed per surface site that passes, gamma = v w C / (|u_bed| h S n_s) (thesis, 5-20)."""
    sites = abs(bed_velocity) * bed_height * surface_to_volume * site_density
    return velocity * width * concentration / sites if sites > 0.0 else math.inf


class Excess(NamedTuple):
    """What an inlet feeds: molecules of its `species` per passing site, and how many times what saturation needs that is.

    Saturation needs 1 molecule of TMA per site, 1.5 of water; where reactions go back, what the feed leaves on the solids
    (`mpm.physics.saturation`, whose numbers are `saturation`). `dose_ratio` is None where the precursor never saturates the surface.
    """

    species: str
    per_site: float
    dose_ratio: float | None
    saturation: Saturation


def inlet_excess(case: Case, inlet: Inlet) -> Excess | None:
    """The excess of an inlet; None without a moving bed or a surface reaction."""
    layer, species = case.geometry.moving_layer, case.precursor(inlet)
    if layer is None or layer.material is None or species is None or case.motion.mean_velocity == 0.0:
        return None
    # at the inlet's own temperature, as its velocity is
    concentration = case.feed_concentrations(inlet.mass_fractions)[species] * case.inlet_density(inlet)
    material = layer.material
    if material.surface_to_volume == 0.0:
        return None
    excess = excess_number(
        velocity=inlet.velocity,
        width=inlet.width,
        concentration=concentration,
        bed_velocity=case.motion.mean_velocity,
        bed_height=layer.height,
        surface_to_volume=material.surface_to_volume,
        site_density=material.site_density,
    )
    saturated = inlet_saturation(case, inlet, species, material)
    ratio = excess / saturated.need if saturated.need else None
    return Excess(species, excess, ratio, saturated)


def inlet_saturation(case: Case, inlet: Inlet, species: str, material: Material) -> Saturation:
    """What the feed of an inlet, its precursor `species` first, does to a fresh material, or to what other inlets make of it."""
    feeds = [case.feed_concentrations(i.mass_fractions) for i in case.dosing_inlets if i is not inlet]
    return saturation(
        case.mechanism,
        species,
        case.feed_concentrations(inlet.mass_fractions),
        material.initial_coverage,
        case.gas.temperature,
        material.site_density,
        others=feeds,
    )


def all_feeds(case: Case, inlet: Inlet) -> dict[str, float]:
    """Concentrations of all feeds as if they met [mol/m3], those of `inlet` as it feeds them."""
    return together(
        case.feed_concentrations(inlet.mass_fractions),
        (case.feed_concentrations(i.mass_fractions) for i in case.dosing_inlets if i is not inlet),
    )


def excess_numbers(case: Case) -> dict[str, float]:
    """Excess number by inlet, of those that have one."""
    return {i.name: e.per_site for i in case.geometry.inlets if (e := inlet_excess(case, i))}


def dose_ratios(case: Case) -> dict[str, float]:
    """Dose ratio by inlet, of those that have one."""
    found = ((i.name, inlet_excess(case, i)) for i in case.geometry.inlets)
    return {name: e.dose_ratio for name, e in found if e is not None and e.dose_ratio is not None}
