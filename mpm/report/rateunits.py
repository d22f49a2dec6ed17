"""Rate constants and equilibrium constants with their units, in both conventions.

Per area, with coverages as shares of the places:  r = k prod C^eta prod theta^mu, k in mol/m2/s (m3/mol)^(sum eta)
Per site, as Chemkin and Cantera mean it:          r = k prod C^eta prod (theta n_s/sigma)^mu, the same over (mol/m2)^(sum mu)
Gas:                                               r = k prod C^eta, k in mol/m3/s (m3/mol)^(sum eta)
"""

from __future__ import annotations

from collections.abc import Mapping

from mpm.physics.mechanism import Mechanism
from mpm.physics.rates import Law
from mpm.physics.reaction import Reaction, SurfaceReaction

WHOLE = 1e-9
"""Difference of a power from a whole number that is rounding."""


def unit(mol: float, metre: float, second: float = 0.0) -> str:
    """A product of powers as people write it: `m^3/mol/s`, `1/s`, empty without any."""
    powers = [
        (name, power) for name, power in (("mol", mol), ("m", metre), ("s", second)) if abs(power) > WHOLE
    ]
    above = " ".join(_power(name, power) for name, power in powers if power > 0.0)
    below = "".join(f"/{_power(name, -power)}" for name, power in powers if power < 0.0)
    return above + below if above else f"1{below}" if below else ""


def _power(name: str, power: float) -> str:
    return name if abs(power - 1.0) < WHOLE else f"{name}^{power:.4g}"


def unit_per_area(law: Law, on_surface: bool) -> str:
    """Of the constant of one way of a reaction, coverages as shares; in the gas there is no other."""
    gases = sum(law.gas_orders.values())
    return unit(1.0 - gases, 3.0 * gases - (2.0 if on_surface else 3.0), -1.0)


def unit_per_site(law: Law) -> str:
    """The same with amounts per area in place of shares."""
    gases, sites = sum(law.gas_orders.values()), sum(law.site_orders.values())
    return unit(1.0 - gases - sites, 3.0 * gases - 2.0 + 2.0 * sites, -1.0)


def unit_of_equilibrium(reaction: Reaction) -> str:
    """Of K in concentrations and coverages."""
    gases = sum(reaction.nu_gas.values())
    return unit(gases, -3.0 * gases)


def rate_constants(
    mechanism: Mechanism, reaction: Reaction, temperature: float, site_density: float
) -> list[dict[str, float | str]]:
    """Of its one way or two: `per_area` or `in_gas` and, on surfaces, `per_site`, each with `..._unit`, SI, at `temperature` [K]."""
    found: list[dict[str, float | str]] = []
    places = {site.name: site.places for site in mechanism.sites}
    constants = mechanism.rate_constants(reaction, temperature, site_density)
    for value, law in zip(constants, reaction.laws, strict=False):
        if not isinstance(reaction, SurfaceReaction):
            found.append({"in_gas": float(value), "in_gas_unit": unit_per_area(law, on_surface=False)})
            continue
        density = 1.0
        for name, order in law.site_orders.items():
            density *= (site_density / places[name]) ** order
        found.append(
            {
                "per_area": float(value),
                "per_area_unit": unit_per_area(law, on_surface=True),
                "per_site": float(value) / density,
                "per_site_unit": unit_per_site(law),
            }
        )
    return found


def orders(law: Law) -> Mapping[str, float]:
    """Of gases and sites."""
    return {**law.gas_orders, **law.site_orders}


def orders_in_words(law: Law) -> str:
    """`order 1 in TMA and OH, 0.5 in *`; `order 0` where nothing sets the rate."""
    by_order: dict[float, list[str]] = {}
    for name, order in orders(law).items():
        by_order.setdefault(order, []).append(name)
    if not by_order:
        return "order 0"
    return "order " + ", ".join(f"{order:g} in {' and '.join(names)}" for order, names in by_order.items())


def peculiar_orders(reaction: Reaction) -> str:
    """The orders of a reaction where they differ from 1, in words; empty where none does."""
    parts = []
    for law, way in zip(reaction.laws, ("", "back: "), strict=False):
        odd = {name: order for name, order in orders(law).items() if order != 1.0}
        if odd:
            parts.append(way + "order " + ", ".join(f"{order:g} in {name}" for name, order in odd.items()))
    return "; ".join(parts)
