"""Runs random heated strips and reports every one that ends otherwise than it may.

    python scripts/heated.py [--strips 400] [--first 0]

Layers, materials, walls, ports, temperatures, carriers, pressures, motion, chemistry and fidelity are drawn from a seed per strip; all are
so coarse that a run takes about a second. A strip must end as done, with balances closed, temperatures within those that are given where
nothing heats, and no number that is none; or be refused by an InputError or a ConvergenceError. Numpy's warnings count as failures.
"""

from __future__ import annotations

import argparse
import math
import random
import warnings
from collections import Counter
from itertools import groupby
from typing import Any

import numpy as np

import mpm.numerics.fem  # noqa: F401  (loads the finite-element stack before mpi4py)
from mpm.case.case import Case, load_case
from mpm.errors import BalanceError, ConvergenceError, InputError
from mpm.reactor.reactor import Reactor
from mpm.report.balances import balance_errors, element_balances

from mpi4py import MPI  # isort: skip  (after mpm.numerics.fem)

HEAT, GAS = 1e-9, 1e-12
"""Largest errors of these balances, as they are reported."""
TRACE = 1e-7
"""Of species, sites and elements: solvers leave 1e-12 of the feed, and balances of traces are measured against 1e-6 of it."""
OUTSIDE = 1e-6
"""Of the spread of the temperatures that are given."""
ROUNDING = 1e-14
"""Of the heat that a strip holds."""
Tables = dict[str, Any]


def temperature(r: random.Random) -> str:
    return f"{r.uniform(250.0, 900.0):.1f} K"


def condition(r: random.Random) -> Tables:
    """What a wall is told."""
    kind = r.random()
    if kind < 0.55:
        return {"temperature": temperature(r)}
    if kind < 0.75:
        return {"heat_flux": f"{r.choice([-1, 1, 1, 1]) * 10 ** r.uniform(1.0, 3.5):.4g} W/m^2"}
    return {
        "heat_transfer_coefficient": f"{10 ** r.uniform(0.0, 4.0):.4g} W/m^2/K",
        "ambient": temperature(r),
    }


def layers(r: random.Random) -> list[Tables]:
    """One to four layers, from the bottom to the top, most of them with a bed that moves."""
    kinds = [r.choice(["gas", "frit", "bed"]) for _ in range(r.randrange(1, 5))]
    if r.random() < 0.1:
        kinds = ["gas"] * r.randrange(1, 3)
    elif "bed" not in kinds and r.random() < 0.7:
        kinds[r.randrange(len(kinds))] = "bed"
    result: list[Tables] = []
    for number, kind in enumerate(kinds):
        height = r.choice([1, 2, 3, 5, 12]) * r.uniform(0.5, 1.2)
        layer: Tables = {"name": f"{kind}{number}", "height": f"{height:.3f} mm", "cells": r.randrange(2, 6)}
        if r.random() < 0.2:
            layer["grading"] = r.choice([0.3, 2.0, 4.0])
        if kind == "bed":
            layer["material"] = r.choice(["glass_beads", "powder"])
            layer["moving"] = not any(other.get("moving") for other in result) and r.random() < 0.85
        if kind == "frit":
            layer["material"] = r.choice(["sintered_powder", "foam"])
        if r.random() < 0.15:
            layer["heating"] = f"{10 ** r.uniform(2.0, 6.0):.4g} W/m^3"
        result.append(layer)
    return result


class Sides:
    """The columns of bottom and top, `dx` [m] wide, and which of them ports have taken."""

    def __init__(self, r: random.Random, columns: int, dx: float):
        self.r, self.columns, self.dx = r, columns, dx
        self.taken: dict[str, set[int]] = {"bottom": set(), "top": set()}

    def port(self) -> Tables | None:
        """Somewhere with a column between it and others, not always at the edges of columns; None where there is no room."""
        r, dx = self.r, self.dx
        for _ in range(50):
            side, wide = r.choice(["bottom", "top"]), r.randrange(1, max(2, self.columns // 3))
            first = r.randrange(0, self.columns - wide + 1)
            if set(range(first - 1, first + wide + 1)) & self.taken[side]:
                continue
            self.taken[side] |= set(range(first, first + wide))
            start, end = first * dx, (first + wide) * dx
            if r.random() < 0.3 and wide > 1:
                start, end = start + 0.4 * dx, end - 0.3 * dx
            return {"side": side, "center": f"{0.5 * (start + end)!r} m", "width": f"{end - start!r} m"}
        return None

    def walls(self) -> list[Tables]:
        """Between the ports, here and there."""
        result: list[Tables] = []
        for side, taken in self.taken.items():
            for port, run in groupby(range(self.columns), lambda column: column in taken):  # noqa: B023
                stretch = list(run)
                if port or self.r.random() > 0.7:
                    continue
                start, end = stretch[0] * self.dx, (stretch[-1] + 1) * self.dx
                if self.r.random() < 0.3:
                    end = start + 0.63 * (end - start)
                place = {"start": f"{start!r} m", "end": f"{end!r} m"}
                result.append({"name": f"{side}{len(result)}", "side": side, **place, **condition(self.r)})
        return result


def inlet(r: random.Random, number: int, place: Tables, steady: bool) -> Tables:
    """One that blows something at some temperature, perhaps in windows."""
    speed = r.choice([0, 1, 3.5, 3.5, 10, 100]) * r.uniform(0.5, 1.0)
    found: Tables = {"name": f"in{number}", **place, "velocity": f"{speed:.4g} cm/s"}
    if r.random() < 0.7:
        found["temperature"] = temperature(r)
    if r.random() < 0.7:
        found["mass_fractions"] = {r.choice(["TMA", "H2O"]): r.choice([1e-5, 2e-4, 2e-3, 0.05])}
        if r.random() < 0.2:
            found["mass_fractions"] = {"TMA": 1e-4, "H2O": 3e-4}
        if r.random() < 0.3 and not steady:
            found["windows"] = [["0 s", "0.2 s"], ["0.35 s", "0.6 s"]]
    return found


def geometry(r: random.Random, steady: bool) -> Tables:
    """A strip of 6 to 15 columns; some have no ports at all."""
    columns, dx = r.randrange(6, 16), r.choice([1e-3, 3e-3, 5e-3])
    sides, periodic = Sides(r, columns, dx), r.random() < 0.6
    inlets, outlets = [], []
    if r.random() > 0.15:
        places = [place for _ in range(r.randrange(1, 3)) if (place := sides.port())]
        outlets = [{"name": f"out{number}", **place} for number, place in enumerate(places)]
        places = [place for _ in range(r.choice([0, 1, 1, 2, 2, 3])) if (place := sides.port())]
        inlets = [inlet(r, number, place, steady) for number, place in enumerate(places)]
    walls = sides.walls()
    if not periodic:
        ends = [side for side in ("left", "right") if r.random() < 0.6]
        walls += [{"name": f"{side}_end", "side": side, **condition(r)} for side in ends]
    found: Tables = {
        "length": f"{columns * dx!r} m",
        "cell_width": f"{dx!r} m",
        "layer": layers(r),
        "periodic": periodic,
        "inlet": inlets,
        "outlet": outlets,
        "wall": walls,
        "zone": [{"name": "all", "start": "0 m", "end": f"{columns * dx!r} m"}],
        "bed_inflow": r.choice(["fresh", "fresh", "periodic"]),
        "inlet_diffusion": r.random() < 0.25,
    }
    if any(layer.get("moving") for layer in found["layer"]) and r.random() < 0.7:
        found["bed_temperature"] = temperature(r)
    return found


def materials(r: random.Random) -> Tables:
    """A powder of any kind, and a foam that holds hardly any heat."""
    powder: Tables = {
        "porosity": r.uniform(0.2, 0.9),
        "particle_diameter": f"{10 ** r.uniform(0.3, 2.5):.3g} um",
        "sphericity": 0.8,
        "density": f"{r.choice([200, 2500, 8000])} kg/m^3",
        "heat_capacity": f"{r.choice([100, 871, 2000])} J/kg/K",
        "conductivity": f"{10 ** r.uniform(-2.0, 2.3):.3g} W/m/K",
        "tortuosity_factor": 1.5,
    }
    if r.random() < 0.3:
        powder["pore_diameter"] = f"{10 ** r.uniform(-2.0, 1.5):.3g} um"
    if r.random() < 0.3:
        powder["site_density"] = "one-per-24-square-angstrom"
    foam = {
        "porosity": 0.99,
        "permeability": "1e-8 m^2",
        "tortuosity_factor": 1.1,
        "surface_to_volume": "1000 1/m",
        "density": "500 kg/m^3",
        "heat_capacity": "500 J/kg/K",
        "effective_conductivity": "0.05 W/m/K",
    }
    return {"powder": powder, "foam": foam}


def chemistry(r: random.Random) -> Tables:
    """Alumina, with activation energies and heats of reaction that may be far too large."""
    reactions: Tables = {}
    if r.random() < 0.5:
        energy = r.uniform(5.0, 80.0)
        constant = 0.9 * math.exp(energy * 1e3 / 8.314 / 473.0)
        reactions["tma"] = {"Ea": f"{energy:.3g} kJ/mol", "A": f"{constant:.5g} m/s"}
    if r.random() < 0.3:
        heat = r.choice(["-2000 kJ/mol", "-300 kJ/mol", "150 kJ/mol"])
        reactions["tma"] = {**reactions.get("tma", {}), "heat_of_reaction": heat}
    if r.random() < 0.3:
        reactions["cvd"] = {"heat_of_reaction": r.choice(["-2000 kJ/mol", "500 kJ/mol"])}
    return {"mechanism": "alumina", "reaction": reactions}


def tables(seed: int) -> Tables:
    """The case file of one strip."""
    r = random.Random(f"heated {seed}")
    fidelity = r.choice(["averaged", "averaged", "steady", "resolved", "resolved"])
    resolved = fidelity == "resolved"
    models = ["parallel", "series", "geometric", "zehner_bauer_schluender"]
    energy: Tables = {
        "conductivity_model": r.choice(models),
        "buoyancy": r.random() < 0.8,
        "soret": r.random() < 0.25,
        "flow_update": r.choice([0.01, 0.01, 0.05, 0.3]),
    }
    if r.random() < 0.6:
        energy["initial_temperature"] = temperature(r)
    return {
        "title": f"random heated strip {seed}",
        "fidelity": fidelity,
        "geometry": geometry(r, fidelity == "steady"),
        "material": materials(r),
        "gas": {
            "carrier": r.choice(["N2", "N2", "Ar", "He"]),
            "temperature": temperature(r),
            "pressure": f"{r.choice([101325, 101325, 1e2, 1e3, 1e4, 1e6])} Pa",
            "mixture": r.random() < 0.25,
        },
        "energy": energy,
        "chemistry": chemistry(r),
        "motion": {
            "gamma": r.choice([0, 0.3, 0.3, 0.6]),
            "bed_velocity": r.choice(["0 m/s", "1.3 cm/s", "1.3 cm/s", "4 cm/s"]),
            "start": r.choice(["0 s", "50 ms", "130 ms"]),
            "startup": r.choice(["developed", "developed", "impulsive"]),
            "inlet_frame": "lab" if r.random() < 0.1 else "reactor",
        },
        "transport": {"vibrational_dispersion": not resolved and r.random() < 0.15},
        "time": {
            "end": "0.4 s" if resolved else r.choice(["1 s", "3 s"]),
            "step": r.choice(["5 ms", "20 ms", "70 ms"]),
            "steps_per_cycle": r.choice([8, 16]),
        },
        "output": {"every": "0.1 s" if resolved else "0.5 s"},
    }


def heats(case: Case) -> bool:
    """Whether temperatures may leave the range of those that are given."""
    geometry, fed = case.geometry, bool(case.fed_species)
    reacts = fed and any(case.mechanism.heat_of_reaction(r, 473.0) for r in case.mechanism.reactions)
    return reacts or any(w.heat_flux for w in geometry.walls) or any(part.heating for part in geometry.layers)


def check(reactor: Reactor) -> None:
    """Assert what holds in every heated run at any time; usable as its callback."""
    case, totals, transport = reactor.case, reactor.totals(), reactor.system.transport
    errors = balance_errors(case, totals)
    heat = totals.heat
    assert heat is not None
    held, stored = max(abs(heat.stored), abs(heat.stored_initially)), heat.stored - heat.stored_initially
    off = abs(
        sum([*heat.inlets, *heat.outlets, *heat.walls, heat.solids, heat.heating, heat.reaction]) - stored
    )
    energy, gas = errors.pop("energy"), errors.pop("gas")
    assert energy <= HEAT or off <= ROUNDING * held, f"heat off by {energy:.2g}: {heat}"
    assert gas <= GAS, f"gas off by {gas:.2g}"
    errors |= element_balances(case, totals)
    assert max(errors.values()) <= TRACE, f"balances {errors}"
    assert transport.concentration.min(initial=0.0) >= -1e-14 * transport.ports.largest_feed
    for name in ("temperature", "velocity", "pressure", "density"):
        assert np.isfinite(reactor.field(name)).all(), f"{name} is no number"
    field, given = reactor.field("temperature"), case.temperatures
    if not heats(case):
        slack = OUTSIDE * (given[-1] - given[0] + 1e-3)
        assert given[0] - slack <= field.min() <= field.max() <= given[-1] + slack, (
            f"{field.min()} to {field.max()} K where {given[0]} to {given[-1]} K are given"
        )


def verdict(seed: int) -> tuple[str, str]:
    """How a strip ends: done, refused (input), stopped (no convergence) or failed, and what was said."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            reactor = Reactor(load_case(tables(seed)), MPI.COMM_SELF)
            reactor.run(callback=check)
            check(reactor)
    except InputError as error:
        return "refused", str(error)
    except BalanceError as error:
        return "failed", str(error)
    except ConvergenceError as error:
        return "stopped", str(error)
    except Exception as error:
        return "failed", f"{type(error).__name__}: {error}"
    return "done", ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--strips", type=int, default=400)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    ends: Counter[str] = Counter()
    for seed in range(options.first, options.first + options.strips):
        end, said = verdict(seed)
        ends[end] += 1
        if end != "done":
            print(f"{seed}: {end}: {said[:600]}", flush=True)
    print(dict(ends))
    return 1 if ends["failed"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
