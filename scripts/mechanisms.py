"""Runs random mechanisms on a coarse zone and reports every one that ends otherwise than it may.

    python scripts/mechanisms.py [--mechanisms 60] [--first 0]

Species, sites on one or two kinds of surface, films, reactions, orders (0.5 to 2), rate constants (ten decades around the one at which a
site lives for a second), ways back, dependence on coverage, feeds and layouts are drawn from a seed per mechanism; elements are dealt out
so that the reactions balance. Each mechanism is run averaged, some of them resolved, then steady, and then averaged for long: from the case
and from the steady state. All must end as done with balances closed, coverages within [0, 1] and no concentration below zero. Where the
averaged run does not end at the steady state, the list says whether it swings, is still on its way, or rests elsewhere.
"""

from __future__ import annotations

import argparse
import math
import random
import time
import warnings
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

import mpm.numerics.fem  # noqa: F401  (loads the finite-element stack before mpi4py)
from mpm.arrays import Floats
from mpm.case.case import Case, load_case
from mpm.case.ratetables import unit_text
from mpm.case.rateunits import Orders
from mpm.constants import GAS_CONSTANT
from mpm.errors import BalanceError, ConvergenceError, InputError
from mpm.reactor.flow import Flow
from mpm.reactor.reactor import Reactor
from mpm.reactor.steady.conveyor import Conveyor
from mpm.reactor.system import System
from mpm.report.balances import balance_errors, element_balances
from mpm.transport.species import Operators, Transport

from mpi4py import MPI  # isort: skip  (after mpm.numerics.fem)

Tables = dict[str, Any]
Amounts = dict[str, int]

BALANCE, TRACE = 1e-9, 1e-7
"""Largest error of a balance, as it is reported: in time, and of a steady state, whose solver leaves 1e-12 of the feed; balances of traces
are measured against 1e-6 of it."""
SUM = 1e-11
"""Of the coverages of a cell, which are 1 together."""
CLOSE = 0.02
"""Of all sites and of the largest feed: what columns 3 mm wide may set the steady and the averaged mean of a layer apart."""
SAME = 1e-6
"""The same of a bed at rest, which columns have no say in."""
RESTS = 1e-3
"""The same, of a run from one passage of the bed to the next: it has come to rest."""
DECADES = 10.0
"""Of rate constants, about the one at which they matter."""
TEMPERATURE, SITES, FEED = 473.0, 6.92e-8, 5e-3
"""[K], [mol/m2] and [mol/m3] of the zone: of these rates are made."""
LENGTH, WIDTH = 24e-3, 3e-3
"""[m]"""
LAYOUTS = (
    "zone",
    "zone",
    "no frit",
    "no frit",
    "cycle",
    "at rest",
    "at rest",
    "periodic",
    "walls",
    "warm",
    "closed",
)


# --- substances and reactions ---


@dataclass(frozen=True)
class Stuff:
    """A gas, a site or a film: its atoms, and for a site the kind of surface it lies on and the places it holds there."""

    name: str
    atoms: tuple[int, int]
    surface: int = -1
    places: int = 1


@dataclass(frozen=True)
class Side:
    """One side of an equation."""

    gases: tuple[Stuff, ...]
    sites: tuple[Stuff, ...]
    films: tuple[Stuff, ...] = ()

    @property
    def conserved(self) -> tuple[int, ...]:
        """Atoms of both elements, places on both surfaces."""
        everything = (*self.gases, *self.sites, *self.films)
        atoms = [sum(one.atoms[e] for one in everything) for e in (0, 1)]
        return (*atoms, *(sum(s.places for s in self.sites if s.surface == kind) for kind in (0, 1)))

    @property
    def counts(self) -> Amounts:
        names = [one.name for one in (*self.gases, *self.sites, *self.films)]
        return {name: names.count(name) for name in dict.fromkeys(names)}

    @property
    def text(self) -> str:
        return " + ".join(name if n == 1 else f"{n} {name}" for name, n in self.counts.items())


def substances(r: random.Random) -> tuple[list[Stuff], list[Stuff], list[Stuff]]:
    """One to six gases, two to five sites on one or two surfaces, at most two films; atoms of two elements, X and Y."""
    atoms = [(1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (2, 1), (1, 2)]
    gases = [Stuff(f"G{i}", a) for i, a in enumerate(r.sample(atoms[:5], k=min(5, r.randrange(1, 7))))]
    if r.random() < 0.3:
        gases.append(Stuff(f"G{len(gases)}", r.choice(atoms)))
    second = r.random() < 0.25
    sites = [Stuff("*", (0, 0), 0)] + ([Stuff("o", (0, 0), 1)] if second else [])
    for i in range(r.randrange(2, 6) - len(sites)):
        places = 2 if r.random() < 0.2 else 1
        sites.append(Stuff(f"s{i}", r.choice(atoms), r.randrange(2) if second else 0, places))
    films = [Stuff("F", (1, 0)), Stuff("H", (0, 1))]
    return gases, sites, films if r.random() < 0.4 else []


def sides(gases: list[Stuff], sites: list[Stuff], films: list[Stuff]) -> dict[tuple[int, ...], list[Side]]:
    """All sides of surface reactions, by what is conserved."""
    found = defaultdict(list)
    for c in (0, 1, 2):
        for some in combinations_with_replacement(gases, c):
            for held in [*combinations_with_replacement(sites, 1), *combinations_with_replacement(sites, 2)]:
                for film in [(), *combinations_with_replacement(films, 1)]:
                    side = Side(some, held, film)
                    found[side.conserved].append(side)
    return found


def equations(
    r: random.Random, gases: list[Stuff], sites: list[Stuff], films: list[Stuff]
) -> list[tuple[Side, Side]]:
    """One to eight surface reactions and now and then some in the gas, no two of them alike."""
    groups = [g for g in sides(gases, sites, films).values() if len(g) > 1]
    chosen: list[tuple[Side, Side]] = []
    if not groups:
        return chosen
    wanted = r.randrange(1, 9)
    for _ in range(40 * wanted):
        left, right = r.sample(r.choice(groups), 2)
        crowded = len(left.gases) + len(left.sites) + len(right.gases) + len(right.sites) + len(left.films)
        useless = set(left.gases) & set(right.gases) or left.counts == right.counts
        if useless or r.random() < 0.15 * crowded - 0.3 or (left.films and r.random() < 0.8):
            continue
        if len(chosen) < wanted and not any({left, right} == {*pair} for pair in chosen):
            chosen.append((left, right))
    only_gas = defaultdict(list)
    for side in [Side(some, ()) for c in (1, 2) for some in combinations_with_replacement(gases, c)]:
        only_gas[side.conserved].append(side)
    pairs = [g for g in only_gas.values() if len(g) > 1]
    if pairs and r.random() < 0.4:
        chosen += [tuple(r.sample(r.choice(pairs), 2))]  # type: ignore[list-item]
    return chosen


@dataclass
class Draw:
    """What turns equations into tables: names of gases and sites, and how a rate constant is written."""

    r: random.Random
    sites: dict[str, Stuff]
    gases: set[str]

    def size(self) -> float:
        return float(10.0 ** self.r.uniform(-0.5 * DECADES, 0.5 * DECADES))

    def constant(self, orders: Orders) -> str:
        """A at which a site would live for a second, or a molecule in the gas, times or over up to five decades."""
        value = self.size() * (SITES if orders.on_surface else FEED) * FEED ** -sum(orders.gas.values())
        if not orders.on_surface or self.r.random() < 0.5:
            return f"{value:.6g} {unit_text(orders.of_shares)}"
        for name, order in orders.site.items():
            value *= (self.sites[name].places / SITES) ** order
        return f"{value:.6g} {unit_text(orders.per_site)}"

    def orders(
        self, counts: Amounts, given: dict[str, float] | None, mass_action: bool, on_surface: bool
    ) -> Orders:
        own = {
            n: float(c) if mass_action else 1.0
            for n, c in counts.items()
            if n in self.gases or n in self.sites
        }
        own |= given or {}
        return Orders(
            {n: o for n, o in own.items() if n in self.gases},
            {n: o for n, o in own.items() if n in self.sites},
            on_surface,
        )

    def given(self, counts: Amounts, lowest: Amounts | None = None) -> dict[str, float]:
        """Orders from 0.5 to 2 of reactants, or from those that a way back needs."""
        names = [n for n in counts if n in self.gases or n in self.sites]
        least = {n: float((lowest or {}).get(n, 0.5)) for n in names}
        return {
            n: self.r.choice([0.5, 1.5, 2.0, round(self.r.uniform(0.5, 2.0), 2)])
            if least[n] <= 0.5
            else least[n]
            for n in names
        }

    def coverage(self) -> Tables:
        """How the coverage of one site changes a rate constant."""
        r = self.r
        kind = r.randrange(3)
        entry: Tables = (
            {"E": f"{r.uniform(-10.0, 10.0):.3g} kJ/mol"}
            if kind == 0
            else {"a": round(r.uniform(-2.0, 2.0), 2)}
        )
        if kind == 2:
            entry = {"m": r.choice([0.5, 1.0])}
        return {r.choice(sorted(self.sites)): entry}

    def reaction(self, left: Side, right: Side, thermal: bool) -> Tables:
        """The table of one reaction."""
        r, on_surface = self.r, bool(left.sites)
        reversible = r.random() < 0.5
        table: Tables = {"equation": f"{left.text} {'<=>' if reversible else '->'} {right.text}"}
        way = r.choice(["reverse", "equilibrium", "thermal" if thermal else "reverse"]) if reversible else ""
        given: dict[str, float] | None = None
        if r.random() < 0.5 and way in ("", "reverse"):
            given = self.given(left.counts)
        elif r.random() < 0.3 and way == "equilibrium":
            given = self.given(left.counts, left.counts)
        if given:
            table["orders"] = given
        there = self.orders(left.counts, given, reversible, on_surface)
        if on_surface and list(there.gas.values()) == [1.0] and r.random() < 0.25:
            table["sticking"] = min(1.0, self.size() * SITES / FEED / 130.0)
            table["motz_wise"] = r.random() < 0.5
        else:
            table["A"] = self.constant(there)
        if on_surface and r.random() < 0.2:
            table["coverage"] = self.coverage()
        if way == "reverse":
            backward = self.given(right.counts) if r.random() < 0.3 else None
            back = self.orders(right.counts, backward, True, on_surface)
            table["reverse"] = {"A": self.constant(back), **({"orders": backward} if backward else {})}
        if way == "equilibrium":
            more = len(right.gases) - len(left.gases)
            value = 10.0 ** r.uniform(-3.0, 3.0) * FEED**more
            table["equilibrium_constant"] = (
                f"{value:.6g} {unit_text({'mol': more, 'm': -3.0 * more})}" if more else value
            )
        return table


def reached(pairs: list[tuple[Side, Side]], fed: set[str]) -> int:
    """How many of these can run one way at least, from empty surfaces and what is fed on."""
    there, running = {*fed, "*", "o", "F", "H"}, -1
    while True:
        runs = [pair for pair in pairs if {*pair[0].counts} <= there]
        there |= {name for pair in runs for name in pair[1].counts}
        if len(runs) == running:
            return running
        running = len(runs)


def mechanism(r: random.Random, warm: bool) -> tuple[Tables, list[Stuff]]:
    """The table `[chemistry]`, and the gases that are fed; most reactions can run."""
    while True:
        gases, sites, films = substances(r)
        pairs = equations(r, gases, sites, films)
        fed = r.sample(gases, k=min(len(gases), r.randrange(1, 4)))
        if len(pairs) > 0 and 2 * reached(pairs, {g.name for g in fed}) > len(pairs):
            break
    draw = Draw(r, {s.name: s for s in sites}, {g.name for g in gases})
    thermal = r.random() < 0.4
    reactions = {f"r{i}": draw.reaction(left, right, thermal) for i, (left, right) in enumerate(pairs)}
    if warm:
        for table in reactions.values():
            table["heat_of_reaction"] = f"{r.uniform(-300.0, 300.0):.4g} kJ/mol"

    def known(one: Stuff, gas: bool) -> Tables:
        entry: Tables = {"elements": {e: n for e, n in zip("XY", one.atoms, strict=True) if n}}
        if thermal:
            heat = r.uniform(-60.0, 60.0) * 1e3
            gibbs = GAS_CONSTANT * TEMPERATURE * (r.uniform(-4.0, 4.0) + (8.5 if gas else 0.0))
            entry |= {
                "enthalpy": f"{heat:.6g} J/mol",
                "entropy": f"{(heat - gibbs) / TEMPERATURE:.6g} J/mol/K",
            }
        return entry

    return {
        "mechanism": "inline",
        "species": {
            g.name: {**known(g, True), "molar_mass": f"{20 * g.atoms[0] + 30 * g.atoms[1]} g/mol"}
            for g in gases
        },
        "site": {s.name: {**known(s, False), "sites": s.places} for s in sites},
        "film": {f.name: known(f, False) for f in films},
        "reaction": reactions,
    }, fed


# --- cases ---


def geometry(r: random.Random, layout: str, fed: list[Tables]) -> Tables:
    """A short zone; some without a frit, with a bed at rest or one that comes back, with walls at its ends or no ports."""
    length = LENGTH
    bed = {
        "name": "bed",
        "height": "3 mm",
        "cells": 3,
        "material": "glass_beads",
        "moving": layout != "at rest",
    }
    frit = {"name": "frit", "height": "1.59 mm", "cells": 2, "material": "sintered_powder"}
    gas = [
        {"name": name, "height": height, "cells": 2}
        for name, height in (("plenum", "2 mm"), ("headspace", "4 mm"))
    ]
    held = [] if layout in ("no frit", "closed") else [frit]
    places = [0.3 * length, 0.8 * length] if len(fed) > 1 else [0.6 * length]
    inlets = [
        {
            "name": f"in{i}",
            "center": f"{x:.5g} m",
            "width": "4 mm",
            "velocity": "3.5 cm/s",
            "mass_fractions": fractions,
        }
        for i, (x, fractions) in enumerate(zip(places, fed, strict=True))
    ]
    return {
        "length": f"{length!r} m",
        "cell_width": f"{WIDTH!r} m",
        "layer": [gas[0], *held, bed, gas[1]],
        "periodic": layout not in ("walls", "closed"),
        "bed_inflow": "periodic" if layout == "periodic" else "fresh",
        "inlet": [] if layout == "closed" else inlets,
        "outlet": []
        if layout == "closed"
        else [{"name": "out", "center": f"{0.6 * length!r} m", "width": "6 mm"}],
    }


def feeds(r: random.Random, fed: list[Stuff], inlets: int) -> list[Tables]:
    """What every inlet brings."""
    found: list[Tables] = [{} for _ in range(inlets)]
    for gas in fed:
        mass = 1e-3 * (20 * gas.atoms[0] + 30 * gas.atoms[1])
        r.choice(found)[gas.name] = float(f"{FEED * 10.0 ** r.uniform(-1.0, 0.7) * mass / 0.72:.4g}")
    return found


def tables(seed: int) -> Tables:
    """The case file of one mechanism; `title` says its layout."""
    r = random.Random(f"mechanism {seed}")
    layout = LAYOUTS[seed % len(LAYOUTS)]
    chemistry, which = mechanism(r, layout == "warm")
    fed = feeds(r, which, 2 if layout == "cycle" else 1)
    initial = {"*": 0.6, "o": 0.4} if "o" in chemistry["site"] else {"*": 1.0}
    found = {
        "title": layout,
        "geometry": geometry(r, layout, fed),
        "material": {name: {"initial_coverage": initial} for name in ("glass_beads", "sintered_powder")},
        "chemistry": chemistry,
        "motion": {"bed_velocity": "0 m/s", "start": "0 s"}
        if layout == "at rest"
        else {"bed_velocity": "1.3 cm/s"},
        "time": {"end": "4 s", "step": "0.1 s", "steps_per_cycle": 8},
        "output": {"every": "1 s"},
    }
    return found | ({"energy": {}} if layout == "warm" else {})


# --- checks ---


class Halvings:
    """Counts how often steps of the transport have been halved, the deepest of all."""

    def __init__(self) -> None:
        self.deepest = 0

    def __enter__(self) -> Halvings:
        self._whole = whole = Transport.advance

        def advance(
            transport: Transport,
            operators: Operators,
            t0: float,
            dt: float,
            halvings: int = 0,
        ) -> None:
            self.deepest = max(self.deepest, halvings)
            whole(transport, operators, t0, dt, halvings)

        Transport.advance = advance  # type: ignore[method-assign, assignment]
        return self

    def __exit__(self, *_: object) -> None:
        Transport.advance = self._whole  # type: ignore[method-assign]


@dataclass
class Found:
    """What is known of one mechanism once it has been tried: worst balances in time and of the steady state, deepest halving of a step, gap
    between the ends of averaged runs and the steady state."""

    seed: int
    layout: str
    said: list[str] = field(default_factory=list)
    balance: dict[str, float] = field(default_factory=lambda: {"in time": 0.0, "steady": 0.0})
    halvings: int = 0
    gap: float = math.nan
    state: str = ""

    @property
    def failed(self) -> bool:
        return bool(self.said)

    def check(self, reactor: Reactor) -> None:
        """Assert what holds in every run at any time, and keep the worst balance."""
        kind = "steady" if reactor.case.fidelity == "steady" else "in time"
        self.balance[kind] = max(self.balance[kind], check(reactor))


def check(reactor: Reactor) -> float:
    """Assert what holds in every run at any time; returns the worst error of a balance."""
    case, totals, transport = reactor.case, reactor.totals(), reactor.system.transport
    errors = balance_errors(case, totals)
    warm = {errors.pop("energy", 0.0), errors.pop("gas", 0.0)}
    assert max(warm) <= 1e-6, f"heat {warm}"
    errors |= {f"element {name}": error for name, error in element_balances(case, totals).items()}
    name = max(errors, key=errors.__getitem__)
    limit = TRACE if case.fidelity == "steady" else BALANCE
    assert errors[name] <= limit, f"t = {reactor.time:g} s: balance of {name} off by {errors[name]:.2g}"
    lowest = transport.concentration.min(initial=0.0)
    most = max(transport.ports.largest_feed, transport.concentration.max(initial=0.0))
    assert lowest >= -1e-14 * most, f"concentration {lowest:g} mol/m3"
    theta = reactor.system.coverage.theta
    assert theta.min(initial=0.0) >= 0.0 and theta.max(initial=0.0) <= 1.0, (
        f"coverage {theta.min()} ... {theta.max()}"
    )
    assert np.abs(theta.sum(axis=0) - 1.0).max(initial=0.0) <= SUM, "coverages do not sum to 1"
    return errors[name]


def means(system: System, concentration: Floats, theta: Floats) -> Floats:
    """Mean coverages of every row of reactive cells and mean concentrations, over the largest feed (or all sites in the gas)."""
    coverage, transport = system.coverage, system.transport
    rows = [theta[:, coverage.place == row].mean(axis=1) for row in range(len(coverage.rows))]
    volume = transport.reactions.gas_volume
    scale = max(transport.ports.largest_feed, 1e-3 * FEED, concentration.max(initial=0.0))
    return np.concatenate([*rows, concentration @ volume / volume.sum() / scale])


class Marching:
    """A case that is followed in time by itself, from its start or from a state of the same mesh."""

    def __init__(self, case: Case, flow: Flow | None = None, start: System | None = None):
        self.system = System(case, MPI.COMM_SELF)
        self.system.find_flow(known=flow)
        if start is not None:
            self.system.transport.concentration = start.transport.concentration
            self.system.coverage.become(start.coverage.theta)
            self.system.count_from_here()
        self.steps = self.system.schedule.from_step(self.system.schedule.resting_steps)
        self.passage = LENGTH / max(abs(self.system.bed_motion.mean), 1e-300)

    def mean(self, count: int) -> Floats:
        """Follow it for so many steps; the mean of them all."""
        found = []
        for _ in range(count):
            self.system.advance(next(self.steps))
            found.append(means(self.system, self.system.transport.concentration, self.system.coverage.theta))
        return np.asarray(np.mean(found, axis=0))


def steady_means(system: System) -> Floats:
    """Those of a steady state: solids that move are in the middle of a cell on the mean of those that enter it and leave it."""
    conveyor, theta = Conveyor(system), system.coverage.theta.copy()
    if conveyor.runs:
        theta[:, conveyor.moving] = 0.5 * (theta[:, conveyor.moving] + conveyor.incoming(theta))
    return means(system, system.transport.concentration, theta)


PASSAGES = 12


def settle(marching: Marching, target: Floats) -> tuple[float, float]:
    """How far the mean over a passage of the bed ends from the steady state, and from the passage before."""
    count = round(marching.passage / marching.system.schedule.dt)
    before = marching.mean(count)
    for _ in range(PASSAGES):
        now = marching.mean(count)
        change, before = float(np.abs(now - before).max()), now
        if change < 0.1 * RESTS:
            break
    return float(np.abs(now - target).max()), change


def at_rest(case: Tables, steady: Reactor, flow: Flow | None) -> tuple[float, float]:
    """The same of a bed that stays where it is: steps become longer, until nothing is slow in them."""
    state: System | None = None
    for step in (0.1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12):
        changed = load_case(case, {"time.step": f"{step} s", "time.end": f"{1e3 * step} s"})
        marching = Marching(changed, flow, state)
        before = marching.mean(15)
        now = marching.mean(1)
        state = marching.system
    target = steady_means(steady.system)
    return float(np.abs(now - target).max()), float(np.abs(now - before).max())


def both_ways(
    case: Tables, steady: Reactor, flow: Flow | None, step: float
) -> tuple[float, float, float, float]:
    """The same of an averaged run from the steady state, and of one from the start of the case."""
    target = steady_means(steady.system)
    long = load_case(case, {"time.end": "1e5 s", "time.step": f"{step} s"})
    from_steady = Marching(long, flow, steady.system)
    fresh = Marching(long, flow)
    resting = Conveyor(fresh.system).resting
    theta = fresh.system.coverage.theta.copy()
    theta[:, resting] = steady.system.coverage.theta[:, resting]  # a frit may take years
    fresh.system.coverage.become(theta)
    return *settle(from_steady, target), *settle(fresh, target)


def compare(case: Tables, steady: Reactor, flow: Flow | None, found: Found) -> None:
    """Whether the averaged case ends at the steady state; where columns are too wide to tell, with narrower ones."""
    if found.layout == "at rest":
        found.gap, change = at_rest(case, steady, flow)
        found.state = "agrees" if found.gap < SAME else f"still {change:.1g} in 1e13 s"
        return
    step = 0.08
    stays, drift, cold, change = both_ways(case, steady, flow, step)
    first = f"steady {stays:.2g} (still {drift:.1g}), start {cold:.2g} (still {change:.1g})"
    found.state, found.gap = "agrees", max(stays, cold)
    if found.gap < CLOSE:
        return
    if max(drift, change) < RESTS and abs(cold - stays) < CLOSE:
        narrow = {**case, "geometry": {**case["geometry"], "cell_width": f"{0.5 * WIDTH} m"}}
        reactor = Reactor(load_case(narrow, {"fidelity": "steady"}), MPI.COMM_SELF)
        reactor.run()
        stays, drift, cold, change = both_ways(narrow, reactor, None, 0.5 * step)
        first += f"; columns half as wide: steady {stays:.2g} (still {drift:.1g}), start {cold:.2g} (still {change:.1g})"
        if max(stays, cold) < 0.7 * found.gap:
            found.state = f"agrees, {first}"
            return
    if stays < CLOSE:
        found.state = f"stays there, comes from the start too slowly or not: {first}"
    else:
        found.state = f"leaves it: {first}"


def one(seed: int, long: bool = True) -> Found:
    """All that is asked of one mechanism."""
    case, flow = tables(seed), None
    found = Found(seed, case["title"])
    kinds = [
        "averaged",
        *(["resolved"] if seed % 4 == 1 else []),
        *(["steady"] if found.layout != "closed" else []),
    ]
    with warnings.catch_warnings(), Halvings() as halvings:
        warnings.simplefilter("error")
        for fidelity in kinds:
            short = {"time.end": "0.15 s", "output.every": "50 ms"} if fidelity == "resolved" else {}
            try:
                reactor = Reactor(load_case(case, {"fidelity": fidelity, **short}), MPI.COMM_SELF)
                reactor.run(callback=found.check)
                found.check(reactor)
                if fidelity == "averaged" and found.layout != "warm":
                    flow = reactor.flow
                if fidelity == "steady" and long:
                    compare(case, reactor, flow, found)
            except (InputError, BalanceError, ConvergenceError, AssertionError) as error:
                found.said.append(f"{fidelity}: {type(error).__name__}: {str(error)[:400]}")
            except Exception as error:
                found.said.append(
                    f"{fidelity}: {type(error).__name__}, which nothing foresees: {str(error)[:400]}"
                )
        found.halvings = halvings.deepest
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--mechanisms", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    all_found = []
    for seed in range(options.first, options.first + options.mechanisms):
        start = time.monotonic()
        found = one(seed)
        all_found.append(found)
        print(
            f"{seed} {found.layout}: balance {found.balance['in time']:.1g}, steady {found.balance['steady']:.1g}, "
            f"halvings {found.halvings}, gap {found.gap:.2g}, "
            f"{found.state or 'no comparison'} ({time.monotonic() - start:.0f} s)",
            *found.said,
            sep="\n    ",
            flush=True,
        )
    failed = [found for found in all_found if found.failed]
    gaps = [found.gap for found in all_found if found.state.startswith("agrees")]
    worst = {kind: max(found.balance[kind] for found in all_found) for kind in ("in time", "steady")}
    print(
        f"{len(all_found) - len(failed)} of {len(all_found)} end; worst balance {worst['in time']:.2g}, steady {worst['steady']:.2g}, "
        f"deepest cut 1/{2 ** max(f.halvings for f in all_found)} of a step; {len(gaps)} rest at the steady state, "
        f"worst gap {max(gaps, default=math.nan):.2g}"
    )
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
