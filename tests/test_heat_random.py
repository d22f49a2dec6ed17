"""Random heated strips, and the faults of heated runs that they found. `python scripts/heated.py` runs hundreds."""

import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case
from mpm.errors import ConvergenceError, InputError
from mpm.optimise import optimise
from mpm.physics.gases import CARRIERS
from mpm.reactor.reactor import Reactor
from mpm.report.balances import balance_errors, element_balances
from mpm.transport.diffusant import Diffusant

from .cases import MPI, TINY, heat_of, physical_numbers, run, strip_case, wall, zone

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import heated

STRIPS = 14
STILL = {"gamma": 0.0, "bed_velocity": "0 m/s", "start": "0 s"}
GAS = {"name": "gas", "height": "3 mm", "cells": 4}
OPEN = {"outlet": [{"name": "out", "center": "1.5 mm", "width": "1 mm"}]}
WARM: dict[str, Any] = {
    "energy": {},
    "geometry.bed_temperature": "300 K",
    "geometry.wall": [wall("top", temperature="600 K", end="95 mm")],
}


def gas_case(geometry: dict[str, Any], layer: dict[str, Any] = GAS, **tables: Any) -> Case:
    """A strip of gas that is still."""
    return strip_case(
        [layer],
        **{
            "geometry": geometry,
            "energy": {},
            "motion": STILL,
            "time": {"end": "2 s", "step": "20 ms"},
            **tables,
        },
        output={"every": "1 s"},
    )


@pytest.mark.parametrize("heat", [False, True])
def test_water_on_a_fresh_surface(heat: bool) -> None:
    """Fails when rounding of methane, which nothing makes, counts as carbon that got lost."""
    changes = {
        "geometry.inlet.tma.mass_fractions": {"H2O": 1e-4},
        "fidelity": "resolved",
        "time.end": "0.3 s",
    }
    reactor, _ = run(zone({**changes, **(WARM if heat else {})}, TINY))
    assert max(element_balances(reactor.case, reactor.totals()).values()) < 1e-9


@pytest.mark.parametrize("fidelity", ["averaged", "resolved"])
def test_traces_balance(fidelity: str) -> None:
    """Fails when a product of which there is a millionth of the feed is known to no more digits than the feed."""
    changes = {
        **WARM,
        "fidelity": fidelity,
        "geometry.inlet.tma.mass_fractions": {"TMA": 1e-7, "H2O": 1e-7},
        "geometry.inlet.tma.stop": "0.1 s",
        "time.end": "0.4 s",
    }
    reactor, _ = run(zone(changes, TINY))
    assert max(balance_errors(reactor.case, reactor.totals()).values()) < 1e-10


@pytest.mark.parametrize("fidelity", ["averaged", "resolved"])
def test_a_closed_inlet_feeds_nothing(fidelity: str) -> None:
    """Fails when the gas that heating drives out leaves by rounding through an inlet, which then feeds as much precursor."""
    changes = {f"geometry.inlet.{name}.velocity": "0 m/s" for name in ("tma", "purge")}
    changes["geometry.inlet.tma.side"] = "top"  # to there divergences add up
    changes["geometry.inlet.tma.center"] = "120 mm"
    reactor, _ = run(zone({**WARM, **changes, "fidelity": fidelity, "time.end": "0.3 s"}, TINY))
    assert heat_of(reactor).gas_passed != 0.0
    assert not reactor.totals().fed.any()


def test_drift_in_narrow_pores() -> None:
    """Fails when thermal diffusion and pores together are no number, or pores hinder diffusion and not the drift along with it."""
    block = {
        "porosity": 0.4,
        "permeability": "1 um^2",
        "tortuosity_factor": 2.0,
        "surface_to_volume": "0 1/m",
        "density": "2000 kg/m^3",
        "heat_capacity": "800 J/kg/K",
        "conductivity": "1 W/m/K",
    }
    ratios = []
    for more in ({}, {"pore_diameter": "30 nm"}):
        case = strip_case(
            [{"name": "bed", "height": "2 mm", "cells": 2, "material": "block"}],
            material={"block": {**block, **more}},
            energy={"soret": True},
        )
        reactor = Reactor(case, MPI.COMM_SELF)
        thermal, strip = reactor.system.thermal, reactor.system.strip
        assert thermal is not None
        thermal.heat.excess = np.linspace(0.0, 50.0, strip.owned)
        thermal.flow.density.take(thermal.heat.temperature, {})
        assembler = Diffusant.of(case, "TMA").assembler(case, strip, thermal.gas, 0.0)
        assert assembler.drift is not None
        there = assembler.drift != 0.0
        ratios.append(assembler.drift[there] / assembler.conductance[there])
    assert there.any()
    np.testing.assert_allclose(ratios[1], ratios[0], rtol=0.05)


def test_vibration_disperses_in_narrow_pores() -> None:
    """Fails when dispersion in a bed with pore_diameter is no number."""
    changes = {
        "material.glass_beads.pore_diameter": "1 um",
        "transport.vibrational_dispersion": True,
        "fidelity": "steady",
    }
    run(zone(changes, TINY))


def test_heat_of_reaction_in_a_steady_state() -> None:
    """Fails when flow and temperature are found anew without the heat that reactions give off, round after round."""
    changes = {
        **WARM,
        "fidelity": "steady",
        "geometry.inlet.tma.mass_fractions": {"TMA": 0.02},
        "material.glass_beads.site_density": "one-per-24-square-angstrom",
        "chemistry.reaction.tma.heat_of_reaction": "-2000 kJ/mol",
    }
    reactor, result = run(zone(changes, TINY))
    none = {"chemistry.reaction.tma.heat_of_reaction": "0 kJ/mol"}
    _, without = run(zone({**changes, **none}, TINY))
    assert heat_of(reactor).reaction > 1.0
    assert (result.field("temperature") - without.field("temperature")).max() > 0.5


@pytest.mark.parametrize("fidelity", ["averaged", "resolved", "steady"])
def test_cooling_and_heating_without_end(fidelity: str) -> None:
    """Fails when temperatures below zero, or of a star, end in a message about something else or in numbers that are none."""
    cold = [wall("bottom", heat_flux="-30 kW/m^2")]
    hot = {**GAS, "heating": "1e8 W/m^3"}
    for case, said in (
        (gas_case({"wall": cold}, fidelity=fidelity), "more heat is taken away than there is"),
        (gas_case({**OPEN, "wall": cold}, fidelity=fidelity), "more heat is taken away than there is"),
        (
            gas_case(OPEN, hot, fidelity=fidelity),
            "nothing may take away" if fidelity == "steady" else "nothing takes away as much heat",
        ),
    ):
        with pytest.raises(ConvergenceError) as caught:
            Reactor(case, MPI.COMM_SELF).run()
        assert said in str(caught.value), caught.value


@pytest.mark.parametrize("fidelity", ["averaged", "resolved"])
def test_gas_that_a_flux_cools_stays_at_rest(fidelity: str) -> None:
    """Fails when a closed strip whose temperatures no wall gives has no speed to measure the rest of its gas by."""
    case = gas_case(
        {"wall": [wall("bottom", heat_flux="-300 W/m^2")]},
        fidelity=fidelity,
        time={"end": "1 s", "step": "20 ms"},
    )
    reactor, result = run(case)
    assert np.ptp(result.field("temperature")) > 1.0
    assert np.abs(reactor.field("velocity")[..., 0]).max() < 1e-9


def test_sudden_heat_drives_gas_out_of_an_impulsive_run() -> None:
    """Fails when the gas that expands all at once is taken for a flow that diverges."""
    walls = [wall("bottom", temperature="600 K", end="4 mm"), wall("top", temperature="600 K", end="4 mm")]
    case = strip_case(
        [{"name": "gas", "height": "1 mm", "cells": 8}],
        columns=40,
        length=40e-3,
        geometry={"wall": walls, "outlet": [{"name": "out", "center": "39.5 mm", "width": "1 mm"}]},
        fidelity="resolved",
        energy={"initial_temperature": "300 K", "buoyancy": False},
        motion={**STILL, "startup": "impulsive"},
        time={"end": "0.01 s", "steps_per_cycle": 64},
    )
    run(case)


@pytest.mark.parametrize("fidelity", ["averaged", "resolved"])
def test_a_closed_strip_that_is_heated_evenly(fidelity: str) -> None:
    """Fails when gas whose density stays the same keeps the pressure, viscosity and rates of before: p rises by T/T0, nothing moves."""
    case = gas_case({}, {**GAS, "heating": "5e4 W/m^3"}, fidelity=fidelity)
    reactor, result = run(case)
    warmer = result.field("temperature") / 473.0
    assert warmer.min() > 1.2
    gas = reactor.system.gas
    assert gas is not None and gas.pressure == pytest.approx(warmer.mean(), rel=5e-3)
    np.testing.assert_allclose(gas.temperature, warmer.mean() * 473.0, rtol=5e-3)
    assert np.abs(reactor.field("velocity")).max() < 1e-12


def test_much_that_diffuses_through_an_inlet_is_not_gas() -> None:
    """Fails when the gas is counted as a small difference of what conducts heat both ways through the face of an inlet."""
    inlet = {"name": "in", "center": "1.5 mm", "width": "1 mm", "velocity": "1 cm/s", "temperature": "600 K"}
    case = gas_case(
        {**OPEN, "inlet": [inlet], "inlet_diffusion": True},
        gas={"pressure": "100 Pa"},
        time={"end": "0.1 s", "step": "5 ms"},
    )
    reactor, _ = run(case)
    assert balance_errors(reactor.case, reactor.totals())["gas"] < 1e-14


@pytest.mark.parametrize("fidelity", ["averaged", "steady"])
def test_the_temperature_of_the_gas_is_a_mere_reference(fidelity: str) -> None:
    """Fails when a number depends on gas.temperature where all temperatures and properties are given: doses, fronts, rates, velocities."""
    results = []
    for reference in (473.0, 350.0):
        changes = {
            **WARM,
            "fidelity": fidelity,
            "energy": {"initial_temperature": "420 K", "flow_update": 1e-9, "soret": True},
            "gas.temperature": f"{reference} K",
            "gas.viscosity": f"{CARRIERS['N2'].viscosity(reference)!r} Pa s",
            "gas.heat_capacity": "1050 J/kg/K",
            "gas.diffusivity": f"{2.88e-5 * (reference / 473.0) ** 1.75!r} m^2/s",
            "geometry.inlet.tma.temperature": "400 K",
            "geometry.inlet.purge.temperature": "500 K",
            "time.end": "0.2 s",
            **{
                f"chemistry.reaction.{key}.heat_of_reaction": "-200 kJ/mol" for key in ("tma", "water", "cvd")
            },
        }
        results.append(run(zone(changes, TINY))[1])
    one, other = (physical_numbers(result.summary) for result in results)
    of_the_reference = (
        "energy.",
        "flow.",
    )  # heat is counted from there, flows are told at that density, weight is that of a difference
    for name, value in one.items():
        if not name.startswith(of_the_reference):
            assert other[name] == pytest.approx(value, rel=1e-4, abs=1e-9), name
    for name in ("temperature", "velocity", "C_TMA"):
        a, b = (result.field(name) for result in results)
        np.testing.assert_allclose(b, a, rtol=1e-5, atol=1e-5 * np.abs(a).max(), err_msg=name)


def test_random_strips() -> None:
    """Fails when a strip of any kind ends with balances that do not close, temperatures that nothing makes, or anything but one line."""
    said = {seed: heated.verdict(seed) for seed in range(STRIPS)}
    assert {seed: words for seed, words in said.items() if words[0] == "failed"} == {}
    assert Counter(end for end, _ in said.values())["done"] > 0.8 * STRIPS


def test_outlets_that_draw_hot_gas_back_in() -> None:
    """Fails when a steady state is approached by a kelvin a step, because what an outlet draws in lags behind what leaves it."""
    gas_that_turns_over_at_an_outlet = 137
    assert heated.verdict(gas_that_turns_over_at_an_outlet) == ("done", "")


def test_what_passes_from_wall_to_wall_is_the_measure_of_heat() -> None:
    """Fails when thin gas between two walls, which holds next to nothing, is out of balance by rounding of nothing in all."""
    walls = [wall("bottom", temperature="300 K"), wall("top", heat_flux="1 kW/m^2", end="1 mm")]
    _, result = run(gas_case({**OPEN, "wall": walls}, fidelity="steady", gas={"pressure": "100 Pa"}))
    assert result.summary["energy"]["balance_error"] < 1e-9


def test_a_flow_is_not_handed_to_a_heated_case() -> None:
    """Fails when a heated run takes over a flow at other temperatures; `mpm optimise` must then find one at every step."""
    cool, warm = zone(mesh=TINY), zone(WARM, TINY)
    with pytest.raises(InputError, match=r"a case with \[energy\]"):
        Reactor(warm, MPI.COMM_SELF, flow=Reactor(cool, MPI.COMM_SELF).flow)
    _, _, search = optimise(warm, target=0.5, limit=4)
    assert len(search.points) > 1


def test_gas_far_from_its_reference_is_at_rest() -> None:
    """Fails when rounding of a weight that is everywhere the same is taken for a flow that is not found."""
    closed: dict[str, Any] = {f"geometry.{key}": [] for key in ("inlet", "outlet", "zone")}
    changes = {
        **closed,
        "energy.initial_temperature": "300 K",
        "gas.temperature": "900 K",
        "geometry.bed_inflow": "periodic",
    }
    Reactor(zone({**changes, "time.end": "0.1 s"}, TINY), MPI.COMM_SELF).run()
