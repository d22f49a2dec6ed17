"""Rate laws of a reaction from its table: orders, the way there, the way back, what coverages do."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from mpm.case.chemistry import ReactionTable
from mpm.case.ratetables import CoverageTable, EquilibriumTable, ReverseTable
from mpm.case.rateunits import Orders, read_equilibrium
from mpm.physics.rates import Arrhenius, Dependence, Law, Sticking
from mpm.units import reject

Terms = Mapping[str, float]


@dataclass(frozen=True)
class Sides:
    """An equation read: coefficients on both sides, whether it goes both ways, and which of the names are gases, sites and films."""

    left: Terms
    right: Terms
    reversible: bool
    molar_mass: Mapping[str, float]
    sites: Collection[str]
    films: Collection[str]

    @property
    def gases(self) -> Collection[str]:
        return self.molar_mass.keys()

    @property
    def on_surface(self) -> bool:
        return any(name in self.sites for name in (*self.left, *self.right))

    @property
    def net(self) -> dict[str, float]:
        """Signed coefficients, products positive, without what the reaction gives back."""
        names = dict.fromkeys((*self.left, *self.right))
        net = {name: self.right.get(name, 0.0) - self.left.get(name, 0.0) for name in names}
        return {name: nu for name, nu in net.items() if nu}

    def of(self, terms: Terms, kind: Collection[str]) -> dict[str, float]:
        """Those of `terms` whose names are of a kind."""
        return {name: number for name, number in terms.items() if name in kind}

    def orders(self, given: Terms | None, side: Terms, mass_action: bool, key: str) -> Orders:
        """Orders in what a side consumes: 1 each or the coefficients, those that are given in place of them or beside them."""
        for name in given or ():
            if name in self.films:
                raise reject(
                    f"an order in the film {name}, which is as thick as needed",
                    "orders in gases and sites",
                    key=f"{key}.{name}",
                )
            if name not in self.gases and name not in self.sites:
                known = [*self.gases, *self.sites]
                raise reject(
                    f"an order in {name!r}",
                    f"one of {', '.join(known)}",
                    key=f"{key}.{name}",
                    given=name,
                    known=known,
                )
            if name in self.sites and not self.on_surface:
                raise reject(
                    f"an order in the site {name} of a reaction in the gas",
                    "orders in gases; a reaction on the surface has a site in its equation",
                    key=f"{key}.{name}",
                )
        own = {name: count if mass_action else 1.0 for name, count in side.items() if name not in self.films}
        orders = {**own, **(given or {})}
        orders = {name: order for name, order in orders.items() if order or name in own}
        return Orders(self.of(orders, self.gases), self.of(orders, self.sites), self.on_surface)


def forward_law(table: ReactionTable, sides: Sides) -> Law:
    """The way there, by A or by a sticking coefficient."""
    orders = sides.orders(table.orders, sides.left, sides.reversible, "orders")
    coverage = _coverage(table.coverage, sides, orders, "coverage")
    constant, per_site = _constant(table, sides, orders)
    return Law(
        constant=constant,
        gas_orders=orders.gas,
        site_orders=orders.site,
        per_site=per_site,
        coverage=coverage,
    )


def _constant(table: ReactionTable, sides: Sides, orders: Orders) -> tuple[Arrhenius | Sticking, float]:
    """The constant of the way there, and the power of the site density that goes with it."""
    if table.motz_wise and table.sticking is None:
        raise reject(
            "true without sticking", "motz_wise beside sticking, whose share it corrects", key="motz_wise"
        )
    if not sides.on_surface and (table.sticking is not None or table.A is None):
        found = "sticking in a reaction in the gas" if table.sticking is not None else "no A"
        raise reject(found, orders.accepted, key="A")
    if (table.sticking is None) == (table.A is None):
        found = "both sticking and A" if table.A else "neither sticking nor A"
        accepted = "one of sticking and A" + ("" if table.A else f"; A is {orders.accepted}")
        raise reject(found, accepted, key="sticking")
    if table.sticking is not None:
        share = Arrhenius(table.sticking, table.b, table.Ea, table.reference_temperature)
        gas = _sticking_gas(table, orders)
        return Sticking(share=share, molar_mass=sides.molar_mass[gas], motz_wise=table.motz_wise), 0.0
    A, per_site = orders.read(table.A or "", "A", _mass_action(table, sides))
    return Arrhenius(A, table.b, table.Ea, table.reference_temperature), per_site


def _sticking_gas(table: ReactionTable, orders: Orders) -> str:
    """The one gas whose collisions count."""
    gases = [name for name, order in orders.gas.items() if order]
    if len(gases) != 1 or orders.gas[gases[0]] != 1.0:
        found = f"a sticking coefficient in a reaction of order {' and '.join(f'{orders.gas[n]:g} in {n}' for n in gases)}"
        raise reject(
            found if gases else "a sticking coefficient in a reaction that meets no gas",
            f"a sticking coefficient of one gas, of order 1 in it; or A, {orders.accepted}",
            key="sticking",
        )
    if table.b and "reference_temperature" not in table.model_fields_set:
        raise reject(
            f"b = {table.b:g} beside sticking, and no reference_temperature",
            'reference_temperature, at which sticking holds, e.g. "473 K"; "1 K" for a T^b as in Chemkin and Cantera',
            key="b",
        )
    return gases[0]


def _mass_action(table: ReactionTable, sides: Sides) -> str:
    """What to add where A has the unit of mass action, and the orders of a one-way reaction are 1 each."""
    if sides.reversible or table.orders is not None:
        return ""
    own = {name: count for name, count in sides.left.items() if name not in sides.films and count != 1.0}
    meant = sides.orders(None, sides.left, True, "orders")
    if not own or not meant.fits(table.A or ""):
        return ""
    text = ", ".join(f"{_quoted(name)} = {count:g}" for name, count in own.items())
    return f"; or orders = {{ {text} }}: one way, orders are 1 in each reactant unless they are given"


def _quoted(name: str) -> str:
    plain = name.isascii() and name.replace("_", "a").replace("-", "a").isalnum()
    return name if plain else f'"{name}"'


def backward_law(table: ReactionTable, sides: Sides, forward: Law) -> tuple[Law | None, Arrhenius | None]:
    """The way back and the given equilibrium constant, if there are any; a law without a constant follows from an equilibrium."""
    for key, given in (("reverse", table.reverse), ("equilibrium_constant", table.equilibrium_constant)):
        if given is not None and not sides.reversible:
            raise reject(
                f"{key} of a reaction whose arrow goes one way",
                f"<=> as the arrow of its equation, or no {key}",
                key=key,
            )
    if not sides.reversible:
        return None, None
    if table.reverse is not None and table.equilibrium_constant is not None:
        raise reject(
            "both reverse and equilibrium_constant", "one of them: the other would follow", key="reverse"
        )
    if table.reverse is not None:
        return _given_back(table.reverse, sides), None
    law = _back_from_equilibrium(sides, forward)
    if table.equilibrium_constant is None:
        return law, None
    return law, _equilibrium(table.equilibrium_constant, sides)


def _given_back(table: ReverseTable, sides: Sides) -> Law:
    orders = sides.orders(table.orders, sides.right, True, "reverse.orders")
    if table.A is None:
        raise reject("nothing", orders.accepted, key="reverse.A")
    A, per_site = orders.read(table.A, "reverse.A")
    return Law(
        constant=Arrhenius(A, table.b, table.Ea, table.reference_temperature),
        gas_orders=orders.gas,
        site_orders=orders.site,
        per_site=per_site,
        coverage=_coverage(table.coverage, sides, orders, "reverse.coverage"),
    )


def _back_from_equilibrium(sides: Sides, forward: Law) -> Law:
    """Orders of the way back are those of the way there and what an event makes: only then both rest at K whatever the orders."""
    there = {**forward.gas_orders, **forward.site_orders}
    back = {
        name: there.get(name, 0.0) + sides.net.get(name, 0.0)
        for name in dict.fromkeys((*there, *sides.net))
        if name not in sides.films
    }
    back = {name: 0.0 if abs(order) < 1e-12 else order for name, order in back.items()}
    for name, order in back.items():
        if order < 0.0:
            raise reject(
                f"{there.get(name, 0.0):g}, which with the equilibrium makes the order of the way back in {name} {order:g}",
                f"at least {-sides.net[name]:g}, or a reverse of its own",
                key=f"orders.{name}",
            )
        if order + (forward.coverage[name].m if name in forward.coverage else 0.0) < 0.0:
            raise reject(
                f"{forward.coverage[name].m:g}, which makes the order of the way back in {name} "
                f"{order + forward.coverage[name].m:g}",
                f"at least {0.0 - order:g}",
                key=f"coverage.{name}.m",
            )
    back = {name: order for name, order in back.items() if order}
    return Law(
        constant=None,
        gas_orders=sides.of(back, sides.gases),
        site_orders=sides.of(back, sides.sites),
        coverage=forward.coverage,
    )


def _equilibrium(table: EquilibriumTable, sides: Sides) -> Arrhenius:
    gases = sum(sides.of(sides.net, sides.gases).values())
    key = "equilibrium_constant"
    if table.A is None:
        raise reject("nothing", 'a constant, e.g. "0.5 m^3/mol"', key=f"{key}.A")
    A = read_equilibrium(table.A, gases, key)
    return Arrhenius(A, table.b, table.Ea, table.reference_temperature)


def _coverage(
    tables: Mapping[str, CoverageTable] | None, sides: Sides, orders: Orders, key: str
) -> dict[str, Dependence]:
    """Dependence on the coverage of each site that is named; it must not make an order negative."""
    for name, table in (tables or {}).items():
        if name not in sides.sites:
            raise reject(
                f"a dependence on the coverage of {name!r}",
                f"one of the sites {', '.join(sides.sites)}" if sides.sites else "none: there are no sites",
                key=f"{key}.{name}",
                given=name,
                known=list(sides.sites),
            )
        if not sides.on_surface:
            raise reject(
                f"a dependence on the coverage of {name} of a reaction in the gas",
                "none; a reaction on the surface has a site in its equation",
                key=key,
            )
        order = orders.site.get(name, 0.0)
        if order + table.m < 0.0:
            raise reject(
                f"{table.m:g}, which makes the order in {name} {order + table.m:g}",
                f"at least {0.0 - order:g}",
                key=f"{key}.{name}.m",
            )
    return {name: Dependence(table.a, table.m, table.E) for name, table in (tables or {}).items()}
