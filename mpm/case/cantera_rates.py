"""A reaction of Cantera as the table of one here; what cannot be said is refused by its name."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from mpm.case.merging import Table
from mpm.case.ratetables import unit_text
from mpm.case.rateunits import Orders
from mpm.physics.equation import write_equation

_TAKEN = "elementary reactions by A, b and Ea, and sticking coefficients"
_COOL = 300.0
"""[K], where a sticking coefficient A T^b is written down if its A is above 1."""


class Refused(Exception):
    """Something in the file that has no counterpart here: what was found, what is accepted, and which key of [chemistry] it is about."""

    def __init__(self, found: str, accepted: str, key: str = "mechanism"):
        super().__init__(found)
        self.found, self.accepted, self.key = found, accepted, key


@dataclass(frozen=True)
class Kinds:
    """Names of gases, sites and films, and those of the phases that are gas."""

    gases: Collection[str]
    sites: Collection[str]
    films: Collection[str]
    gas_phases: Collection[str]


def reaction_table(reaction: Any, where: str, kinds: Kinds) -> tuple[Table, list[str]]:
    """The table of a reaction, and the names of all that takes part; `where` says which it is."""
    label = f"{where}, {reaction.equation!r}"
    left, right = dict(reaction.reactants), dict(reaction.products)
    if met := _partner(reaction):
        for side in (left, right):
            side[met] = side.get(met, 0.0) + 1.0
    on_surface = any(name in kinds.sites for name in (*left, *right))
    _check(reaction, label, kinds)
    table: Table = {"equation": write_equation(left, right, reaction.reversible)}
    given = {name: float(order) for name, order in dict(reaction.orders).items() if name not in kinds.films}
    orders = {**{name: count for name, count in left.items() if name not in kinds.films}, **given}
    if any(order < 0.0 for order in orders.values()):
        raise Refused(f"{label}, with a negative order", "orders from 0")
    usual = dict.fromkeys(left, 1.0) if not reaction.reversible else left
    if typed := {name: order for name, order in orders.items() if order != usual.get(name)}:
        table["orders"] = typed
    of = Orders(_of(orders, kinds.gases), _of(orders, kinds.sites), on_surface)
    table |= (
        _sticking(reaction.rate, of, label)
        if "sticking" in reaction.rate.type
        else _arrhenius(reaction.rate, of, label)
    )
    if coverage := _coverage(reaction.rate, label):
        if "motz_wise" in table:
            raise Refused(
                f"{label}, whose sticking coefficient depends on coverage within the correction of Motz and Wise",
                "one of the two",
            )
        table["coverage"] = coverage
    return table, list(dict.fromkeys((*left, *right, *orders, *coverage)))


def _partner(reaction: Any) -> str | None:
    """The one species that takes part without being changed, which Cantera keeps apart (H + O2 + AR <=> HO2 + AR)."""
    body = reaction.third_body
    alone = body is not None and body.default_efficiency == 0.0 and list(body.efficiencies.values()) == [1.0]
    return next(iter(body.efficiencies)) if alone and body.mass_action else None


def _of(orders: Mapping[str, float], names: Collection[str]) -> dict[str, float]:
    return {name: order for name, order in orders.items() if name in names}


def _check(reaction: Any, label: str, kinds: Kinds) -> None:
    """Refuse kinds of reactions and of substances that have no counterpart."""
    any_body = reaction.third_body is not None and _partner(reaction) is None
    if any_body or reaction.rate.type not in (
        "Arrhenius",
        "interface-Arrhenius",
        "sticking-Arrhenius",
    ):
        raise Refused(f"{label}, of type {reaction.reaction_type}", _TAKEN)
    if getattr(reaction.rate, "uses_electrochemistry", False):
        raise Refused(f"{label}, which moves charge", "reactions without charge")
    for name in (*reaction.reactants, *reaction.products):
        if name not in kinds.gases and name not in kinds.sites and name not in kinds.films:
            raise Refused(f"{label}, with {name} of a solution", "gases, sites, and solids of one kind each")


def _arrhenius(rate: Any, orders: Orders, label: str) -> Table:
    """A in mol, per site on a surface; Cantera's is in kmol."""
    powers = orders.per_site if orders.on_surface else orders.of_shares
    A = float(rate.pre_exponential_factor) * 1e3 ** powers["mol"]
    if A < 0.0:
        raise Refused(f"{label}, with a negative A", "rate constants from 0")
    return {"A": f"{A!r} {unit_text(powers)}", **_activation(rate)}


def _sticking(rate: Any, orders: Orders, label: str) -> Table:
    """The share of collisions, at 1 K or where it is one."""
    gases = {name: order for name, order in orders.gas.items() if order}
    if gases != {rate.sticking_species: 1.0}:
        raise Refused(f"{label}, a sticking coefficient of order other than 1 in one gas", _TAKEN)
    share, b = float(rate.pre_exponential_factor), float(rate.temperature_exponent)
    table: Table = {"sticking": share, **_activation(rate)}
    if b:
        cooler = _COOL if share > 1.0 else 1.0
        table |= {"sticking": share * cooler**b, "reference_temperature": f"{cooler!r} K"}
    if rate.motz_wise_correction:
        table["motz_wise"] = True
    return table


def _activation(rate: Any) -> Table:
    """b and Ea where they are not 0."""
    table: Table = {}
    if rate.temperature_exponent:
        table["b"] = float(rate.temperature_exponent)
    if rate.activation_energy:
        table["Ea"] = f"{float(rate.activation_energy) * 1e-3!r} J/mol"
    return table


def _coverage(rate: Any, label: str) -> Table:
    """a, m and E by site; an energy that is a polynomial of coverage is refused beyond its first term."""
    coverage: Table = {}
    for name, of in dict(getattr(rate, "coverage_dependencies", None) or {}).items():
        E = of["E"]
        terms = [float(E)] if isinstance(E, (int, float)) else [float(term) for term in E]
        if any(terms[1:]):
            raise Refused(
                f"{label}, whose activation energy is a polynomial of the coverage of {name}",
                "one in proportion to it",
            )
        coverage[name] = {
            key: value
            for key, value in (
                ("a", float(of["a"])),
                ("m", float(of["m"])),
                ("E", f"{terms[0] * 1e-3!r} J/mol" if terms[0] else 0),
            )
            if value
        }
    return coverage
