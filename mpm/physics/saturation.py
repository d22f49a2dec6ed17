"""What saturation with a precursor takes: all reactions of that precursor together, whatever their number and order.

A precursor may titrate several kinds of sites, one site in several ways, or one after another (OH -> X -> Y). The functions here follow a
surface until none of its reactions is left, and count.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from mpm.physics.mechanism import Mechanism
from mpm.physics.reaction import SurfaceReaction


def site_speeds(
    mechanism: Mechanism, species: str, site: str, temperature: float
) -> list[tuple[SurfaceReaction, float]]:
    """The reactions of `species` on `site`, each with k_r |nu_kr| [m/s]: times C/n_s, how fast it turns that site over."""
    return [
        (r, float(r.rate_constant(temperature)) * -r.nu_site[site])
        for r in mechanism.half_reactions(species)
        if r.site == site
    ]


def saturate(
    mechanism: Mechanism, species: str, coverage: Mapping[str, float], temperature: float
) -> tuple[dict[str, float], float] | None:
    """Coverage once `species` finds nothing more to react with, and molecules it has taken per site.

    Where reactions compete for a site they share it as their speeds are (equally when all are zero). None when sites come back to a state
    that was left: such a surface takes precursor without end.
    """
    left, molecules = dict(coverage), 0.0
    for _ in range(len(mechanism.site_names)):
        turning = {r.site for r in mechanism.half_reactions(species) if left.get(r.site, 0.0) > 0.0}
        if not turning:
            return left, molecules
        amounts = {site: left.pop(site) for site in turning}
        for site, amount in amounts.items():
            speeds = site_speeds(mechanism, species, site, temperature)
            whole = sum(speed for _, speed in speeds)
            for reaction, speed in speeds:
                part = amount * (speed / whole if whole > 0.0 else 1.0 / len(speeds))
                molecules += part * reaction.molecules_per_site
                for product in reaction.product_sites:
                    made = part * reaction.nu_site[product] / -reaction.nu_site[site]
                    left[product] = left.get(product, 0.0) + made
    return None


def coverage_met(
    mechanism: Mechanism, species: str, fresh: Mapping[str, float], temperature: float
) -> dict[str, float] | None:
    """Coverage that `species` finds: that of fresh solids, or, where it reacts with none of it, what other precursors make of it.

    So TMA meets OH, and water what TMA leaves. None when no order of precursors makes a site that it reacts with.
    """
    own = {r.site for r in mechanism.half_reactions(species)}
    current = dict(fresh)
    others = [name for name in mechanism.species_names if name != species]
    for _ in range(len(others) + 1):
        if any(current.get(site, 0.0) > 0.0 for site in own):
            return current
        for name in others:
            after = saturate(mechanism, name, current, temperature)
            current = after[0] if after is not None else current
    return None


def molecules_per_site(
    mechanism: Mechanism, species: str, fresh: Mapping[str, float], temperature: float
) -> float | None:
    """Molecules of `species` per site it reacts with until it is saturated: 1 for TMA on OH, 1.5 for water on what TMA leaves.

    None when nothing it reacts with can be there, or it is never saturated.
    """
    met = coverage_met(mechanism, species, fresh, temperature)
    if met is None:
        return None
    own = {r.site for r in mechanism.half_reactions(species)}
    reacting = sum(met.get(site, 0.0) for site in own)
    after = saturate(mechanism, species, met, temperature)
    return None if after is None or not math.isfinite(after[1]) else after[1] / reacting


def uptake(mechanism: Mechanism, species: str, coverage: Mapping[str, float], temperature: float) -> float:
    """Speed [m/s] at which the surface takes `species` out of the gas, sum_r k_r |nu_ir| theta_r: flux over concentration."""
    return sum(
        float(r.rate_constant(temperature)) * -r.nu_gas.get(species, 0.0) * coverage.get(r.site, 0.0)
        for r in mechanism.half_reactions(species)
    )


def slowest_turnover(
    mechanism: Mechanism, species: str, coverage: Mapping[str, float], temperature: float
) -> float:
    """Smallest sum_r k_r |nu_kr| [m/s] over the sites that `species` finds: the kind that is titrated last."""
    own = dict.fromkeys(r.site for r in mechanism.half_reactions(species))
    return min(
        sum(speed for _, speed in site_speeds(mechanism, species, site, temperature))
        for site in own
        if coverage.get(site, 0.0) > 0.0
    )
