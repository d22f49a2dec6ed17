"""What saturation with a precursor takes: all reactions of that precursor together, whatever their number and order.

A precursor may titrate several kinds of sites, one site in several ways, or one after another (OH -> X -> Y). Where every reaction is one
gas that meets one site and never goes back (`Mechanism.is_first_order`), the functions here follow a surface until none of its reactions
is left, and count. Of other mechanisms the surface is followed in time (`mpm.physics.exposure`): where reactions go back, what stays on it
depends on the concentration.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from mpm.physics.exposure import NOTHING, Exposed, expose
from mpm.physics.mechanism import Mechanism
from mpm.physics.reaction import SurfaceReaction
from mpm.physics.surface_rates import SurfaceRates

Gas = Mapping[str, float]
"""Concentrations [mol/m3] by species."""
_MORE = 1.01
"""Factor by which a surface must take more than another one to be what a precursor is for: less is an error of a time step."""


@dataclass(frozen=True)
class Saturation:
    """What a precursor does to the solids: the coverage that it `met`, and from there on

    `speed` [m/s] at which it is taken up at first, flux over concentration; `need`: molecules per place until nothing changes any more,
    None where that never comes, as with growth that does not stop and with catalysis; `lifetime` [s] of the sites, in which of what it
    takes all but 1/e has been taken; of the kind that it turns over last where several do, each by itself. `left` is the coverage in the
    end; `endless`: whether the precursor is taken up without end, as far as that has been followed. `beside`: the gases of other feeds that
    it is counted together with, because alone it finds nothing to do.
    """

    met: Mapping[str, float]
    speed: float
    need: float | None
    lifetime: float | None
    left: Mapping[str, float]
    endless: bool = False
    beside: tuple[str, ...] = ()


def saturation(
    mechanism: Mechanism,
    species: str,
    gas: Gas,
    fresh: Mapping[str, float],
    temperature: float,
    site_density: float,
    others: Iterable[Gas] = (),
) -> Saturation:
    """What `species` in a `gas` that is fed does to `fresh` solids with `site_density` [mol/m2] at `temperature` [K].

    `others`: the gases of other feeds, what they make of the solids counts too (`coverage_met`, `_met`). The gas is what the precursor is
    fed with; alone, where one is enough, which is so in a mechanism of first order.
    """
    if not mechanism.is_first_order:
        return _saturation_in_time(mechanism, species, gas, fresh, temperature, site_density, others)
    met = coverage_met(mechanism, species, fresh, temperature) or {}
    speed, lifetime = uptake(mechanism, species, met, temperature), None
    if speed > 0.0:
        per_site = slowest_turnover(mechanism, species, met, temperature) * gas[species]
        lifetime = site_density / per_site if per_site > 0.0 else None
    need = molecules_per_site(mechanism, species, fresh, temperature)
    after = saturate(mechanism, species, met, temperature) if met else None
    return Saturation(met, speed, need or None, lifetime, met if after is None else after[0])


def _saturation_in_time(
    mechanism: Mechanism,
    species: str,
    gas: Gas,
    fresh: Mapping[str, float],
    temperature: float,
    site_density: float,
    others: Iterable[Gas],
) -> Saturation:
    others = tuple(others)
    beside: tuple[str, ...] = ()
    met, after = _met(mechanism, species, gas, fresh, temperature, site_density, others)
    if after is None:  # deposition from two gases, say
        alone, gas = gas, together(gas, others)
        beside = tuple(name for name in gas if name not in alone)
        met, after = _met(mechanism, species, gas, fresh, temperature, site_density, ())
    if after is None:
        return Saturation({}, 0.0, None, None, {})
    rates = SurfaceRates(mechanism, gas, temperature, site_density)
    flux = site_density * rates.taken(met)[species]
    endless = species in after.endless
    return Saturation(
        met,
        speed=max(flux, 0.0) / gas[species],
        need=None if endless else after.taken[species],
        lifetime=after.time(species, 1.0 - math.exp(-1.0)),
        left=after.coverage,
        endless=endless,
        beside=beside,
    )


def together(gas: Gas, others: Iterable[Gas]) -> dict[str, float]:
    """A gas that holds what it is fed with and what other feeds hold beside it, at most."""
    mixed = dict(gas)
    for other in others:
        for name, amount in other.items():
            mixed[name] = gas[name] if name in gas else max(mixed.get(name, 0.0), amount)
    return mixed


def _met(
    mechanism: Mechanism,
    species: str,
    gas: Gas,
    fresh: Mapping[str, float],
    temperature: float,
    site_density: float,
    others: Iterable[Gas],
) -> tuple[Mapping[str, float], Exposed | None]:
    """The coverage that takes most of `species`, and what becomes of it: that of fresh solids, or what other feeds make of it in turn.

    So TMA meets OH, and water what TMA leaves although some of it may sit down on OH. None where all take none.
    """
    current, best, chosen, most = fresh, fresh, None, NOTHING
    feeds: list[Gas | None] = [None, *others]
    for feed in feeds:
        left = None if feed is None else expose(mechanism, feed, current, temperature, site_density)
        current = current if left is None else left.coverage
        after = expose(mechanism, gas, current, temperature, site_density)
        if after is not None and after.taken[species] > _MORE * most:
            best, chosen, most = current, after, after.taken[species]
    return best, chosen


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
