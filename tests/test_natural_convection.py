"""Gas that is heated from below or from the side against what is known: when it turns over, and how much heat it carries.

Temperatures differ by a hundredth, so that density is linear in them and properties are constant (Boussinesq), as in the references.
"""

from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case
from mpm.errors import ConvergenceError
from mpm.flow.heated import HeatedCycle
from mpm.reactor.reactor import Reactor

from .cases import HEATED, MPI, TINY, assert_heat_balances, heat_of, run, strip_case, wall, zone

MEAN, APART = 300.0, 3.0  # K
FOAM = {  # hardly any solid, so that gas and layer have one diffusivity; no shear at its walls
    "porosity": 0.999,
    "permeability": "2e-6 m^2",
    "tortuosity_factor": 1.0,
    "surface_to_volume": "0 1/m",
    "density": "1 kg/m^3",
    "heat_capacity": "1 J/kg/K",
    "effective_conductivity": "0.0258 W/m/K",
    "viscosity_ratio": 1e-6,
}


def heated(
    layer: dict[str, Any],
    columns: int,
    length: float,
    hot: str,
    cold: str,
    step: float,
    end: float,
    **tables: Any,
) -> Case:
    """A closed strip with one hot and one cold side."""
    walls = [
        wall(hot, temperature=f"{MEAN + 0.5 * APART} K"),
        wall(cold, temperature=f"{MEAN - 0.5 * APART} K"),
    ]
    return strip_case(
        [layer],
        columns=columns,
        length=length,
        geometry={"wall": walls, **tables.pop("geometry", {})},
        material={"foam": FOAM},
        gas={"temperature": f"{MEAN} K"},
        energy={"initial_temperature": f"{MEAN} K"},
        motion={
            "gamma": 0.0,
            "bed_velocity": "0 m/s",
            "start": "0 s",
            "startup": "impulsive",
            "frequency": f"{0.1 / step} Hz",
        },
        time={"end": f"{end} s", "steps_per_cycle": 10},
        output={"every": f"{end / 4} s"},
        **tables,
    )


def properties() -> tuple[float, float, float]:
    """Kinematic viscosity, thermal diffusivity of the gas [m2/s] and its heat capacity per volume [J/m3/K]."""
    gas = heated({"name": "gas", "height": "1 mm", "cells": 1}, 3, 1e-3, "bottom", "top", 0.1, 1.0).gas
    unit = gas.density * gas.heat_capacity
    return gas.viscosity / gas.density, gas.conductivity / unit, unit


def growth(height: float, length: float, rows: int, columns: int, **layer: Any) -> float:
    """Rate [1/s] at which one pair of rolls grows in a layer that is heated from below, from a hundredth of the difference."""
    case = heated(
        {"name": "layer", "height": f"{height} m", "cells": rows, **layer},
        *(columns, length, "bottom", "top", 0.1, 60.0),
        fidelity="resolved",
    )
    reactor = Reactor(case, MPI.COMM_SELF)
    strip, thermal = reactor.system.strip, reactor.system.thermal
    assert thermal is not None
    y = (strip.grid.row_centres - strip.grid.y[0])[strip.row[: strip.owned]] / height
    x = strip.grid.centres[strip.column[: strip.owned]] / length
    roll = 0.01 * np.cos(2.0 * np.pi * x) * np.sin(np.pi * y)
    thermal.heat.excess = APART * (0.5 - y + roll)
    thermal.count_from_here()
    sizes, times = [], []

    def watch(now: Reactor) -> None:
        assert_heat_balances(now)
        field = now.field("temperature")
        sizes.append(np.sqrt(np.mean((field - field.mean(axis=1, keepdims=True)) ** 2)))
        times.append(now.time)

    reactor.run(callback=watch)
    return float(np.log(sizes[-1] / sizes[2]) / (times[-1] - times[2]))


def test_layer_between_plates_turns_over_above_its_critical_rayleigh_number() -> None:
    """Fails when buoyancy, viscosity or conduction are off by more than 3 %: rolls decay at Ra 1650 and grow at 1760 (critical: 1707.8)."""
    nu, alpha, _ = properties()
    rates = []
    for rayleigh in (1650.0, 1760.0):
        height = (rayleigh * nu * alpha * MEAN / APART / 9.81) ** (1.0 / 3.0)
        rates.append(growth(height, 2.016 * height, 20, 40))
    assert rates[0] < 0.0 < rates[1], rates
    critical = 1650.0 - 110.0 * rates[0] / (rates[1] - rates[0])
    assert critical == pytest.approx(1707.8, rel=0.02)


def test_porous_layer_turns_over_above_its_critical_rayleigh_number() -> None:
    """Fails when weight and Darcy's drag are off: critical Ra K/h2 = 4 pi2 (Horton and Rogers 1945, Lapwood 1948), rolls 2 h long."""
    nu, _, unit = properties()
    alpha = 0.0258 / unit
    rates, tried = [], (38.0, 41.0)
    for rayleigh in tried:
        height = rayleigh * nu * alpha * MEAN / APART / 9.81 / 2e-6
        rates.append(growth(height, 2.0 * height, 16, 32, material="foam"))
    assert rates[0] < 0.0 < rates[1], rates
    critical = tried[0] - (tried[1] - tried[0]) * rates[0] / (rates[1] - rates[0])
    assert critical == pytest.approx(4.0 * np.pi**2, rel=0.01)


def nusselt(rayleigh: float, cells: int, fidelity: str, step: float = 0.1) -> float:
    """Heat through a square cavity between a hot and a cold side wall over what conduction alone would carry, Pr 0.71."""
    nu, alpha, _ = properties()
    size = (rayleigh * nu * alpha * MEAN / APART / 9.81) ** (1.0 / 3.0)
    case = heated(
        {"name": "gas", "height": f"{size} m", "cells": cells},
        *(cells, size, "left", "right", step, 150.0),
        fidelity=fidelity,
        geometry={"periodic": False},
    )
    reactor = Reactor(case, MPI.COMM_SELF)
    result = reactor.run(callback=assert_heat_balances)
    if fidelity == "steady":
        return float(heat_of(reactor).walls[0] / (case.gas.conductivity * APART))
    beside = result.field("temperature")[:, 0]
    return float(2.0 * np.sum(MEAN + 0.5 * APART - beside) / APART)


@pytest.mark.parametrize(
    ("rayleigh", "cells", "known", "within"),
    [(1e3, (12, 24), 1.118, 0.003), (1e4, (16, 32), 2.243, 0.003), (1e5, (24, 36), 4.519, 0.01)],
)
def test_square_cavity(rayleigh: float, cells: tuple[int, int], known: float, within: float) -> None:
    """Fails when flow and heat do not find each other in the steady state, or not at second order (de Vahl Davis 1983)."""
    coarse, fine = (nusselt(rayleigh, n, "steady") for n in cells)
    extrapolated = fine + (fine - coarse) / ((cells[1] / cells[0]) ** 2 - 1.0)
    assert abs(fine - known) < abs(coarse - known)
    assert extrapolated == pytest.approx(known, rel=within)


def test_square_cavity_in_time() -> None:
    """Fails when the transient with inertia does not end in the flow of Ra 1e6, Nu 8.800 (de Vahl Davis 1983)."""
    coarse, fine = nusselt(1e6, 24, "resolved"), nusselt(1e6, 36, "resolved", 0.08)
    assert fine + 0.8 * (fine - coarse) == pytest.approx(8.800, rel=0.02)


def test_flow_that_is_not_found_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when one temperature at which no steady flow is found ends a run, or when it is never asked for again, or for ever."""
    case = zone({**HEATED, "time.end": "3 s", "output.every": "1 s"}, TINY)
    found = HeatedCycle.find
    asked: list[float] = []

    def find(self: HeatedCycle, *args: Any, **options: Any) -> Any:
        asked.append(self._wait)
        if len(asked) in lost:
            raise ConvergenceError("steady flow: not found")
        return found(self, *args, **options)

    monkeypatch.setattr(HeatedCycle, "find", find)
    monkeypatch.setattr("mpm.flow.heated.LONGEST", 2)
    lost = {3}
    assert run(case)[1].summary["status"] == "done"
    assert asked[2:5] == [1, 2, 1]
    asked.clear()
    lost = set(range(3, 1000))
    with pytest.raises(ConvergenceError, match="not found"):
        run(case)
