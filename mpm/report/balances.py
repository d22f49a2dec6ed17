"""Balances of species, sites, elements, heat and gas, and whether a run may call its numbers done: all of them within LIMIT.

Amounts are per metre of depth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm.errors import BalanceError
from mpm.report.heat import heat_and_gas
from mpm.report.records import Totals, running_gas, running_surface

if TYPE_CHECKING:
    from mpm.case.case import Case

TERMS = ("fed", "produced", "reacted", "left", "stored")
"""Of a species' balance: fed + produced = reacted + left + stored."""
FLOOR = 1e-6  # of the run's largest feed: balances of smaller amounts are measured against this
LIMIT = 1e-6
"""Relative to the largest term of a balance: solvers leave 1e-9 and less, so more than this is a fault, not their tolerance."""


def species_balances(case: Case, totals: Totals) -> dict[str, dict[str, float]]:
    """Per species: fed + produced = left + reacted + stored [mol/m].

    `left` is what went out minus what an outlet drew back in, `stored` final minus initial, in the gas. `balance_error` is the residual
    over the largest of these terms, or over 1e-6 of the run's largest feed (of the sites on the solids when nothing has been fed) when all
    are smaller. A species that nothing can bring about has zeros.
    """
    mechanism = case.mechanism
    events = {"surface": totals.surface.sum(axis=(1, 2)), "gas": totals.gas.sum(axis=1)}
    largest = float(totals.fed.sum(axis=0).max(initial=0.0)) or float(totals.sites_initially.sum())
    result = {}
    for name in mechanism.species_names:
        if name not in totals.names:
            result[name] = dict.fromkeys(
                ("fed", "left", "reacted", "stored", "produced", "balance_error"), 0.0
            )
            continue
        i = totals.names.index(name)
        made = used = 0.0
        for number, nu in _stoichiometry(case, totals.names, name):
            kind, index = number
            amount = nu * events[kind][index]
            made, used = made + max(amount, 0.0), used - min(amount, 0.0)
        fed = float(totals.fed[:, i].sum())
        left = float((totals.out[:, i] - totals.back[:, i]).sum())
        stored = float(totals.stored[i] - totals.stored_initially[i])
        residual = fed + made - left - used - stored
        scale = max(abs(fed), abs(left), used, abs(stored), made, FLOOR * largest)
        result[name] = {
            "fed": fed,
            "left": left,
            "reacted": used,
            "stored": stored,
            "produced": made,
            "balance_error": abs(residual) / scale if scale else 0.0,
        }
    return result


def _stoichiometry(case: Case, names: tuple[str, ...], species: str) -> list[tuple[tuple[str, int], float]]:
    """((kind, running reaction), signed molecules per event) of `species`."""
    terms: list[tuple[tuple[str, int], float]] = []
    for index, surface in enumerate(running_surface(case, names)):
        terms.append((("surface", index), surface.nu_gas.get(species, 0.0)))
    for index, gas in enumerate(running_gas(case, names)):
        terms.append((("gas", index), gas.nu_gas.get(species, 0.0)))
    return terms


def site_balance(case: Case, totals: Totals) -> float:
    """Largest error over the site species of: initial + made by reactions - left the strip = final, relative to all sites involved.

    Counted in places on the surface, of which a site species may hold several. Events are net where a reaction is reversible.
    """
    names, places = case.mechanism.site_names, case.mechanism.places
    residual = totals.sites - totals.sites_initially + totals.sites_passed
    turned = 0.0
    for index, reaction in enumerate(running_surface(case, totals.names)):
        events = float(totals.surface[index].sum())
        residual = residual - events * places * np.array([reaction.nu_site.get(k, 0.0) for k in names])
        turned += abs(events)
    scale = max(float(totals.sites_initially.sum()), turned)
    return float(np.abs(residual).max(initial=0.0) / scale) if scale else 0.0


def element_balances(case: Case, totals: Totals) -> dict[str, float]:
    """Per element: what came in with gas and solids = what left with them + what is stored in the gas, on surfaces and in the film.

    The carrier takes no part. Relative to the largest of these terms, or to 1e-6 of the atoms on the solids (of the sites when nothing has
    been fed), or of the run's largest feed when all are smaller.
    """
    mechanism = case.mechanism
    largest = float(totals.fed.sum(axis=0).max(initial=0.0))
    errors = {}
    elements = sorted(
        {
            e
            for part in (mechanism.species, mechanism.sites, mechanism.films)
            for p in part
            for e in p.elements
        }
    )
    for element in elements:
        terms = []
        for i, name in enumerate(totals.names):
            atoms = mechanism.get(name).elements.get(element, 0.0)
            terms += [
                atoms * float(totals.fed[:, i].sum()),
                -atoms * float((totals.out[:, i] - totals.back[:, i]).sum()),
                -atoms * float(totals.stored[i] - totals.stored_initially[i]),
            ]
        for k, site in enumerate(mechanism.sites):
            atoms = site.elements.get(element, 0.0) / site.places  # per place, which is what is counted
            terms += [
                -atoms * float(totals.sites_passed[k]),
                -atoms * float(totals.sites[k] - totals.sites_initially[k]),
            ]
        atoms_of_film = {film.name: film.elements.get(element, 0.0) for film in mechanism.films}
        terms += [-atoms_of_film[name] * amount for name, amount in film_made(case, totals).items()]
        on_solids = sum(
            s.elements.get(element, 0.0) / s.places * n
            for s, n in zip(mechanism.sites, totals.sites_initially, strict=True)
        )
        if not totals.fed.any():
            on_solids = max(on_solids, totals.sites_initially.sum())
        scale = max(FLOOR * max(float(on_solids), largest), *(abs(t) for t in terms))
        errors[element] = abs(sum(terms)) / scale if scale else 0.0
    return errors


def film_made(case: Case, totals: Totals) -> dict[str, float]:
    """Formula units of each solid product on the particles and the frit [mol/m]; below 0 of one that reactions have used up."""
    made = {film.name: 0.0 for film in case.mechanism.films}
    for index, reaction in enumerate(running_surface(case, totals.names)):
        for name, count in reaction.film.items():
            made[name] += count * float(totals.surface[index].sum())
    return made


def balance_errors(case: Case, totals: Totals) -> dict[str, float]:
    """Of every species by its name, of the `sites`, and with `[energy]` of the heat (`energy`) and the `gas`."""
    errors = {name: entry["balance_error"] for name, entry in species_balances(case, totals).items()}
    return errors | {"sites": site_balance(case, totals), **heat_and_gas(case, totals)}


def worst_balance(case: Case, totals: Totals) -> tuple[str, float]:
    """Name and relative error of the worst of all balances; one that is not a number is worse than any."""
    errors = balance_errors(case, totals)
    errors |= {f"element {name}": error for name, error in element_balances(case, totals).items()}
    return max(errors.items(), key=lambda item: item[1] if item[1] == item[1] else float("inf"))


def require_balance(case: Case, totals: Totals) -> None:
    """Raise BalanceError unless every balance is within LIMIT."""
    name, error = worst_balance(case, totals)
    if not error <= LIMIT:
        raise BalanceError(
            f"balance of {name}: off by {error:.3g} of its largest term, more than {LIMIT:g}: the numbers of this run cannot be trusted"
        )
