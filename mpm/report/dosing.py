"""What the inlets of a case dose: species, sites that these make, zones, and whether it is enough."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from mpm.physics.saturation import molecules_per_site

if TYPE_CHECKING:
    from mpm.case.case import Case, Inlet, Zone


def dosed_species(case: Case, inlet: Inlet) -> str | None:
    """The precursor an inlet doses: its first species that reacts on surfaces, or None."""
    return case.mechanism.precursor(inlet.mass_fractions)


def zone_of(case: Case, inlet: Inlet) -> Zone | None:
    """The zone whose inlet this is."""
    return next((zone for zone in case.geometry.zones if zone.inlet == inlet.name), None)


def fed_by(inlet: Inlet, species: Sequence[str]) -> list[str]:
    """Those of the `species` that an inlet feeds, in their order."""
    return [name for name in species if inlet.mass_fractions.get(name, 0.0) > 0.0]


def dosing_inlets(case: Case) -> list[Inlet]:
    """Inlets that feed a species of the mechanism."""
    return [inlet for inlet in case.geometry.inlets if fed_by(inlet, case.mechanism.species_names)]


def fed_species(case: Case) -> list[str]:
    """Species fed by any inlet, in the mechanism's order."""
    fed = {name for inlet in case.geometry.inlets for name in fed_by(inlet, case.mechanism.species_names)}
    return [name for name in case.mechanism.species_names if name in fed]


def sites_made_by(case: Case, inlet: Inlet) -> tuple[str, ...]:
    """Site species whose coverage this inlet's titration counts; empty when nothing it feeds reacts on the surface."""
    species = dosed_species(case, inlet)
    return () if species is None else case.mechanism.titrated_sites(species)


def made_sites(case: Case) -> list[str]:
    """Site species worth a map: of two that add up to one, the one the first dosing inlet makes."""
    made = list(dict.fromkeys(site for inlet in dosing_inlets(case) for site in sites_made_by(case, inlet)))
    return made[:1] if len(case.mechanism.site_names) == 2 else made


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

    Saturation needs 1 molecule of TMA per site, 1.5 of water (`mpm.physics.saturation`). `dose_ratio` is None where the precursor never
    saturates the surface.
    """

    species: str
    per_site: float
    dose_ratio: float | None


def inlet_excess(case: Case, inlet: Inlet) -> Excess | None:
    """The excess of an inlet; None without a moving bed or a surface reaction."""
    layer, species = case.geometry.moving_layer, dosed_species(case, inlet)
    if layer is None or layer.material is None or species is None or case.motion.mean_velocity == 0.0:
        return None
    concentration = case.feed_concentrations(inlet.mass_fractions)[species]
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
    need = molecules_per_site(case.mechanism, species, material.initial_coverage, case.gas.temperature)
    return Excess(species, excess, excess / need if need else None)


def excess_numbers(case: Case) -> dict[str, float]:
    """Excess number by inlet, of those that have one."""
    return {i.name: e.per_site for i in case.geometry.inlets if (e := inlet_excess(case, i))}


def dose_ratios(case: Case) -> dict[str, float]:
    """Dose ratio by inlet, of those that have one."""
    found = ((i.name, inlet_excess(case, i)) for i in case.geometry.inlets)
    return {name: e.dose_ratio for name, e in found if e is not None and e.dose_ratio is not None}
