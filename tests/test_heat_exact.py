"""Temperature against exact solutions, with rates: conduction in layers and in time, a front of hot gas, a bed over a hot wall, reactions.

The gas of most cases is so thin (gas.density) that it carries no heat, where the solution is that of solids alone.
"""

from typing import Any

import numpy as np
import pytest
from scipy.special import erfc

from mpm.case.case import Case
from mpm.reactor.reactor import Reactor, Result

from .cases import MPI, assert_heat_balances, column_case, heat_of, norm, rate, strip_case, wall

BLOCK = {
    "porosity": 0.4,
    "permeability": "4 um^2",
    "tortuosity_factor": 1.5,
    "surface_to_volume": "0 1/m",
    "density": "2000 kg/m^3",
    "heat_capacity": "800 J/kg/K",
    "effective_conductivity": "0.5 W/m/K",
}
CAPACITY = 0.6 * 2000.0 * 800.0  # (1 - eps) rho_s c_s [J/m3/K]
ALPHA = 0.5 / CAPACITY
THIN = {"temperature": "300 K", "density": "1e-9 kg/m^3"}
STILL = {"gamma": 0.0, "bed_velocity": "0 m/s", "start": "0 s"}


def run(case: Case) -> tuple[Reactor, Result]:
    reactor = Reactor(case, MPI.COMM_SELF)
    return reactor, reactor.run(callback=assert_heat_balances)


def test_two_layers_between_walls() -> None:
    """Fails when the flux between cells of different conductivity is not continuous, or a wall is not half a cell away."""
    other = {**BLOCK, "effective_conductivity": "3 W/m/K"}
    layers = [
        {"name": "lower", "height": "2 mm", "cells": 3, "material": "block"},
        {"name": "upper", "height": "4 mm", "cells": 5, "grading": 2.0, "material": "other"},
    ]
    case = strip_case(
        layers,
        fidelity="steady",
        geometry={"wall": [wall("bottom", temperature="400 K"), wall("top", temperature="300 K")]},
        material={"block": BLOCK, "other": other},
        gas=THIN,
        energy={},
    )
    reactor, result = run(case)
    flux = 100.0 / (2e-3 / 0.5 + 4e-3 / 3.0)
    y = result.grid.row_centres - result.grid.y[0]
    exact = np.where(y < 2e-3, 400.0 - flux * y / 0.5, 300.0 + flux * (6e-3 - y) / 3.0)
    np.testing.assert_allclose(result.field("temperature"), exact[:, None] * np.ones(3), atol=1e-7)
    np.testing.assert_allclose(heat_of(reactor).walls, [flux * 3e-3, -flux * 3e-3], rtol=1e-9)


def test_walls_with_a_flux_and_with_surroundings() -> None:
    """Fails when a given flux or a heat transfer coefficient is off: q passes the strip and leaves through h."""
    case = strip_case(
        [{"name": "block", "height": "2 mm", "cells": 4, "material": "block"}],
        fidelity="steady",
        geometry={
            "wall": [
                wall("bottom", heat_flux="500 W/m^2"),
                wall("top", heat_transfer_coefficient="20 W/m^2/K", ambient="290 K"),
            ]
        },
        material={"block": BLOCK},
        gas=THIN,
        energy={},
    )
    _, result = run(case)
    y = result.grid.row_centres - result.grid.y[0]
    exact = 290.0 + 500.0 / 20.0 + 500.0 / 0.5 * (2e-3 - y)
    np.testing.assert_allclose(result.field("temperature")[:, 0], exact, atol=1e-7)


def slab(time: float, height: float, y: Any, terms: int = 200) -> Any:
    """(T_w - T)/(T_w - T_0) of a slab whose bottom is held at T_w from t = 0 on, adiabatic at the top (Carslaw and Jaeger 1959, 3.4)."""
    n = (2 * np.arange(terms) + 1) * np.pi / 2.0
    return np.sum(
        2.0 / n * np.sin(np.outer(y / height, n)) * np.exp(-(n**2) * ALPHA * time / height**2), axis=1
    )


def test_slab_with_a_sudden_wall_temperature() -> None:
    """Fails when storage, conduction or the wall are not of second order in the row height (steps go with its square)."""
    height, time = 2e-3, 1.5
    errors, cells = [], [4, 8, 16]
    for n in cells:
        case = strip_case(
            [{"name": "block", "height": f"{height} m", "cells": n, "material": "block"}],
            geometry={"wall": [wall("bottom", temperature="400 K")]},
            material={"block": BLOCK},
            gas=THIN,
            energy={"initial_temperature": "300 K"},
            motion=STILL,
            time={"end": f"{time} s", "step": f"{1.6 / n**2} s"},
            output={"every": "1.5 s"},
        )
        _, result = run(case)
        y = result.grid.row_centres - result.grid.y[0]
        errors.append(norm(result.field("temperature")[:, 0] - (400.0 - 100.0 * slab(time, height, y))))
    assert errors[-1] < 0.1, errors
    assert rate([1 / n for n in cells], errors) > 1.9, errors


def test_hot_gas_heats_a_bed() -> None:
    """Fails when gas and solids do not exchange heat as they must: the front moves at rho u c_p/C_h and widens by conduction.

    One kelvin, so that the density hardly changes. What enters first at the face of the bed is left out of the comparison.
    """
    u, height, time = 2.0, 0.02, 4.0
    errors, cells = [], [100, 200]
    for n in cells:
        case = column_case(
            height,
            n,
            u,
            {**BLOCK, "permeability": "1 mm^2"},
            inlet={"temperature": "301 K"},
            gas={"temperature": "300 K", "heat_capacity": "1000 J/kg/K"},
            energy={"buoyancy": False, "flow_update": 0.5},
            motion=STILL,
            time={"end": f"{time} s", "step": f"{4.0 / n} s"},
            output={"every": "4 s"},
        )
        _, result = run(case)
        unit = case.gas.density * 1000.0 * 300.0 / 301.0  # of what the inlet blows
        capacity = CAPACITY + 0.4 * unit
        speed, alpha = unit * u / capacity, 0.5 / capacity
        y = result.grid.row_centres - result.grid.y[0]
        d = 2.0 * np.sqrt(alpha * time)
        exact = 0.5 * (
            erfc((y - speed * time) / d)
            + 2.0 * np.sqrt(speed**2 * time / np.pi / alpha) * np.exp(-((y - speed * time) ** 2) / d**2)
            - (1.0 + speed * y / alpha + speed**2 * time / alpha)
            * np.exp(np.minimum(speed * y / alpha, 700.0))
            * erfc((y + speed * time) / d)
        )
        rise = result.field("temperature")[:, 0] - 300.0
        near = y < 0.8 * height
        errors.append(norm(rise[near] - exact[near]))
        # all heat that has come in is there, and the front is where it must be
        held = capacity * (rise * np.diff(result.grid.y)).sum()
        assert held == pytest.approx(unit * u * time, rel=2e-4)
    assert errors[-1] < 0.01, errors
    assert rate([1 / n for n in cells], errors) > 0.9, errors


def hot_floor(v: float, height: float, x: Any, y: Any, terms: int = 300) -> Any:
    """(T_w - T)/(T_w - T_0) of a bed in plug motion at v over a floor at T_w, adiabatic above, without conduction along x: (y, x)."""
    n = (2 * np.arange(terms) + 1) * np.pi / 2.0
    decay = np.exp(-np.outer(n**2, ALPHA * x / v / height**2))
    return (2.0 / n * np.sin(np.outer(y / height, n))) @ decay


def floor_case(rows: int, columns: int, **tables: Any) -> Case:
    """A bed that enters at 300 K over a floor at 400 K, 60 mm long and 2 mm high."""
    geometry = {"wall": [wall("bottom", temperature="400 K")], "bed_temperature": "300 K"}
    return strip_case(
        [{"name": "bed", "height": "2 mm", "cells": rows, "material": "block", "moving": True}],
        columns=columns,
        length=0.06,
        geometry=geometry,
        material={"block": BLOCK},
        gas=THIN,
        energy={"initial_temperature": "400 K"},
        motion={"gamma": 0.0, "bed_velocity": "1 cm/s", "start": "0 s"},
        **tables,
    )


def test_bed_over_a_hot_floor_steady() -> None:
    """Fails when solids do not bring their heat along with them, upwind, at first order in the column width."""
    errors, sizes = [], [60, 120, 240]
    for columns in sizes:
        reactor, result = run(floor_case(24, columns, fidelity="steady"))
        grid = result.grid
        there = grid.centres > 5e-3
        exact = 400.0 - 100.0 * hot_floor(0.01, 2e-3, grid.centres[there], grid.row_centres - grid.y[0])
        errors.append(norm(result.field("temperature")[:, there] - exact))
        heat = heat_of(reactor)
        assert heat.walls[0] == pytest.approx(-heat.solids, rel=1e-9)
    assert errors[-1] < 0.3, errors
    assert rate([1 / n for n in sizes], errors) > 0.8, errors


def test_bed_over_a_hot_floor_in_time() -> None:
    """Fails when columns do not take their heat along: at the end of 8 s, longer than the strip takes, it is the steady state.

    A column is somewhere in its cell, so it is compared with the time that it has been in the strip, half a column less or more.
    """
    case = floor_case(24, 120, time={"end": "8 s", "step": "25 ms"}, output={"every": "2 s"})
    _, result = run(case)
    grid = result.grid
    there = grid.centres > 5e-3
    exact = 400.0 - 100.0 * hot_floor(0.01, 2e-3, grid.centres[there], grid.row_centres - grid.y[0])
    assert norm(result.field("temperature")[:, there] - exact) < 0.4


@pytest.mark.parametrize("sites", [1.0, 100.0])
def test_heat_of_reaction_warms_an_adiabatic_bed(sites: float) -> None:
    """Fails when reactions give off another heat than dH per event: all sites react, dT = -dH S n_s/C_h in the mean."""
    material = {
        **BLOCK,
        "surface_to_volume": "58000 1/m",
        "site_density": f"{sites * 6.92e-8} mol/m^2",
        "effective_conductivity": "0.5 W/m/K",
    }
    case = column_case(
        3e-3,
        6,
        0.035,
        material,
        inlet={"mass_fractions": {"TMA": 0.05}},
        gas=THIN,
        energy={},
        chemistry={"reaction": {"tma": {"heat_of_reaction": "-200 kJ/mol"}}},
        motion=STILL,
        time={"end": f"{0.2 * sites} s", "step": f"{0.01 * sites} s"},
        output={"every": f"{0.1 * sites} s"},
    )
    _, result = run(case)
    assert result.coverage("packing", "OH").max() < 1e-6
    rise = np.average(result.field("temperature") - 300.0, axis=0, weights=np.diff(result.grid.y))
    np.testing.assert_allclose(rise, 200e3 * 58000.0 * sites * 6.92e-8 / CAPACITY, rtol=1e-6)


def test_heating_of_a_layer() -> None:
    """Fails when electrical heating is not what the case says: an adiabatic block warms by q t/C."""
    layer = {"name": "block", "height": "2 mm", "cells": 4, "material": "block", "heating": "1e5 W/m^3"}
    case = strip_case(
        [layer],
        material={"block": BLOCK},
        gas=THIN,
        energy={},
        motion=STILL,
        time={"end": "2 s", "step": "0.1 s"},
        output={"every": "1 s"},
    )
    reactor, result = run(case)
    np.testing.assert_allclose(result.field("temperature"), 300.0 + 2e5 / CAPACITY, rtol=1e-10)
    assert heat_of(reactor).heating == pytest.approx(2e5 * 6e-6, rel=1e-12)
