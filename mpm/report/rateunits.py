"""Rate constants and equilibrium constants with their units, in both conventions.

Per area, with coverages as shares of the places:  r = k prod C^eta prod theta^mu, k in mol/m2/s (m3/mol)^(sum eta)
Per site, as Chemkin and Cantera mean it:          r = k prod C^eta prod (theta n_s/sigma)^mu, the same over (mol/m2)^(sum mu)
Gas:                                               r = k prod C^eta, k in mol/m3/s (m3/mol)^(sum eta)
"""

from __future__ import annotations

from collections.abc import Mapping

from mpm.case.ratetables import unit_text
from mpm.case.rateunits import Orders
from mpm.physics.mechanism import Mechanism
from mpm.physics.rates import Law
from mpm.physics.reaction import Reaction, SurfaceReaction


def units_of(law: Law, on_surface: bool) -> tuple[str, str]:
    """Of the constant of one way of a reaction, coverages as shares, and per site; in the gas both are one."""
    orders = Orders(law.gas_orders, law.site_orders, on_surface)
    return unit_text(orders.of_shares), unit_text(orders.per_site if on_surface else orders.of_shares)


def unit_of_equilibrium(reaction: Reaction) -> str:
    """Of K in concentrations and coverages."""
    gases = sum(reaction.nu_gas.values())
    return unit_text({"mol": gases, "m": -3.0 * gases, "s": 0.0})


def rate_constants(
    mechanism: Mechanism, reaction: Reaction, temperature: float, site_density: float
) -> list[dict[str, float | str]]:
    """Of its one way or two: `per_area` or `in_gas` and, on surfaces, `per_site`, each with `..._unit`, SI, at `temperature` [K]."""
    found: list[dict[str, float | str]] = []
    places = {site.name: site.places for site in mechanism.sites}
    constants = mechanism.rate_constants(reaction, temperature, site_density)
    for value, law in zip(constants, reaction.laws, strict=False):
        if not isinstance(reaction, SurfaceReaction):
            found.append({"in_gas": float(value), "in_gas_unit": units_of(law, on_surface=False)[0]})
            continue
        per_area, per_site = units_of(law, on_surface=True)
        density = 1.0
        for name, order in law.site_orders.items():
            density *= (site_density / places[name]) ** order
        found.append(
            {
                "per_area": float(value),
                "per_area_unit": per_area,
                "per_site": float(value) / density,
                "per_site_unit": per_site,
            }
        )
    return found


def orders(law: Law) -> Mapping[str, float]:
    """Of gases and sites."""
    return {**law.gas_orders, **law.site_orders}


def peculiar_orders(reaction: Reaction) -> str:
    """The orders of a reaction where they differ from 1, in words; empty where none does."""
    parts = []
    for law, way in zip(reaction.laws, ("", "back: "), strict=False):
        odd = {name: order for name, order in orders(law).items() if order != 1.0}
        if odd:
            parts.append(way + "order " + ", ".join(f"{order:g} in {name}" for name, order in odd.items()))
    return "; ".join(parts)
