"""Species in gas that is not everywhere equally hot: mole fractions, drift, pores, rates; and the fidelities, which must agree."""

from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case, load_case
from mpm.constants import GAS_CONSTANT
from mpm.mesh.strip import Strip
from mpm.physics.diffusion import thermal_diffusion
from mpm.physics.kinetics import SurfaceKinetics
from mpm.reactor.reactor import Reactor
from mpm.transport.diffusant import Diffusant
from mpm.transport.heat_flux import Diffusing

from .cases import (
    HEATED,
    MPI,
    TINY,
    assert_heat_balances,
    column_case,
    heat_of,
    physical_numbers,
    run,
    strip_case,
    wall,
    zone,
)

TRACER = {
    "mechanism": "inline",
    "species": {
        "heavy": {"molar_mass": "100 g/mol", "formula": "C8H4"},
        "light": {"molar_mass": "4 g/mol", "formula": "He"},
    },
}
STILL = {"gamma": 0.0, "bed_velocity": "0 m/s", "start": "0 s"}
X = 1e-3


@pytest.mark.parallel
@pytest.mark.parametrize("fidelity", ["averaged", "resolved"])
def test_uniform_mole_fractions_stay_uniform(fidelity: str) -> None:
    """Fails when gas that expands or shrinks makes, loses or unmixes a species: 300 K of heating within seconds leave x as it was to
    1e-12."""
    masses = {"heavy": X * 100.0 / ((1.0 - 2.0 * X) * 28.01 + X * 104.0)}
    masses["light"] = masses["heavy"] * 0.04
    case = zone(
        {
            **HEATED,
            "fidelity": fidelity,
            "energy.initial_temperature": "300 K",
            "geometry.wall": [wall("top", temperature="600 K", end="95 mm")],
            "geometry.inlet.tma.mass_fractions": masses,
            "geometry.inlet.purge.mass_fractions": masses,
            "chemistry": TRACER,
            "material": {name: {"initial_coverage": {}} for name in ("glass_beads", "sintered_powder")},
            "motion.startup": "impulsive" if fidelity == "resolved" else "developed",
            "time.end": "0.5 s",
            "output.every": "0.1 s",
        },
        TINY,
    )
    reactor = Reactor(case, MPI.COMM_WORLD)
    transport, thermal = reactor.system.transport, reactor.system.thermal
    assert thermal is not None
    own = reactor.system.strip.owned
    fed = transport.ports.feed[0]
    np.testing.assert_allclose(fed, X * case.gas.molar_density, rtol=1e-12)
    transport.concentration = fed[:, None] * thermal.gas.relative[:own]
    reactor.system.count_from_here()

    def watch(now: Reactor) -> None:
        assert_heat_balances(now)
        for name in ("heavy", "light"):
            np.testing.assert_allclose(
                now.field(f"x_{name}"), X, rtol=1e-12, err_msg=f"{name}, {now.time:g} s"
            )

    reactor.run(callback=watch)
    heat = heat_of(reactor)
    assert abs(heat.gas - heat.gas_initially) > 1e-3 * heat.gas  # it has been heated


def test_bed_that_moves_is_heated_as_one_at_rest() -> None:
    """Fails when Darcy's gas or its heat depends on the frame: hot gas rising through a bed heats it alike at rest and moving along."""
    fields = []
    for speed in ("0 m/s", "1 cm/s"):
        case = strip_case(
            [{"name": "bed", "height": "6 mm", "cells": 12, "material": "glass_beads", "moving": True}],
            columns=6,
            length=0.06,
            geometry={
                "bed_inflow": "periodic",
                "inlet": [
                    {
                        "name": "in",
                        "center": "30 mm",
                        "width": "60 mm",
                        "velocity": "50 cm/s",
                        "temperature": "600 K",
                    }
                ],
                "outlet": [{"name": "out", "center": "30 mm", "width": "60 mm"}],
            },
            gas={"temperature": "300 K"},
            energy={},
            motion={**STILL, "bed_velocity": speed},
            time={"end": "3 s", "step": "20 ms"},
            output={"every": "1 s"},
        )
        _, result = run(case)
        fields.append(result.field("temperature"))
    assert fields[0].max() > 320.0
    np.testing.assert_allclose(fields[1], fields[0], rtol=1e-9)


POWDER = {
    "porosity": 0.4,
    "permeability": "1 um^2",
    "tortuosity_factor": 2.0,
    "surface_to_volume": "0 1/m",
    "density": "20 kg/m^3",
    "heat_capacity": "100 J/kg/K",
    "conductivity": "0.1 W/m/K",
}
"""Light, so that its temperature is soon steady."""


@pytest.mark.parametrize("law", [None, "effective", "free", "printed"])
def test_thermal_diffusion_separates_a_strip_at_rest(law: str | None) -> None:
    """Fails when the Soret flux is off: without flow D grad x = -(S/n) x grad ln T, so ln x falls by the integral of S/(n D) d ln T; in
    pores, too, whatever of D and of S they are taken to leave, as long as it is the same of both (`porous.diffusion`).

    What separates is put in beforehand: the inlet, which is closed, only says that the species are there.
    """
    inlet = {"name": "in", "center": "1.5 mm", "width": "1 mm", "velocity": "0 m/s", "side": "bottom"}
    porous: dict[str, Any] = (
        {} if law is None else {"material": {"powder": POWDER}, "porous": {"diffusion": law}}
    )
    case = strip_case(
        [{"name": "gas", "height": "10 mm", "cells": 40, **({} if law is None else {"material": "powder"})}],
        geometry={
            "wall": [
                {**wall("bottom", temperature="300 K", end="1 mm"), "name": "left"},
                {**wall("bottom", temperature="300 K", start="2 mm"), "name": "right"},
                wall("top", temperature="500 K"),
            ],
            "inlet": [{**inlet, "mass_fractions": {"heavy": 1e-4, "light": 1e-4}, "temperature": "300 K"}],
        },
        gas={"temperature": "300 K", "diffusivity": "2e-5 m^2/s"},
        chemistry=TRACER,
        energy={"soret": True, "buoyancy": False},
        motion=STILL,
        time={"end": "60 s", "step": "0.5 s"},
        output={"every": "20 s"},
        **porous,
    )
    reactor = Reactor(case, MPI.COMM_SELF)
    transport, thermal = reactor.system.transport, reactor.system.thermal
    assert thermal is not None
    transport.concentration = np.full_like(transport.concentration, X * case.gas.molar_density)
    reactor.system.count_from_here()
    for step in reactor.system.schedule.from_step(0):
        reactor.system.advance(step)
    assert_heat_balances(reactor)
    column = reactor.field("temperature")[:, 1]
    assert column.max() - column.min() > 150.0
    n = case.gas.pressure / (GAS_CONSTANT * column)
    d = 2e-5 * case.gas.diffusivity_factor(column)
    content = transport.concentration @ reactor.system.strip.gas_volume
    np.testing.assert_allclose(
        content, X * case.gas.molar_density * 30e-6 * (1.0 if law is None else 0.4), rtol=1e-10
    )
    for name, mass in (("heavy", 0.1), ("light", 4e-3)):
        x = reactor.field(f"x_{name}")[:, 1]
        slope = thermal_diffusion(mass, case.gas.molar_mass, column) / (n * d)
        expected = -np.trapezoid(slope, np.log(column))
        assert np.log(x[-1] / x[0]) == pytest.approx(expected, rel=0.01)
        assert (x[-1] < x[0]) == (name == "heavy")  # the top is hot


def test_narrow_pores_slow_a_species_by_its_mass() -> None:
    """Fails when Bosanquet's diffusivity does not reach the transport: D_eff = eps/tau2/(1/D + 1/D_K), and D_K ~ 1/sqrt(M)."""
    layers = [{"name": "bed", "height": "2 mm", "cells": 2, "material": "block"}]
    block = {
        "porosity": 0.4,
        "permeability": "1 um^2",
        "tortuosity_factor": 2.0,
        "surface_to_volume": "0 1/m",
    }
    case = strip_case(layers, material={"block": {**block, "pore_diameter": "100 nm"}}, chemistry=TRACER)
    strip = Strip(case, MPI.COMM_SELF)
    for name, mass in (("heavy", 0.1), ("light", 4e-3)):
        d = case.gas.diffusivity[name]
        assembler = Diffusant.of(case, name).assembler(case, strip, None, 0.0)
        knudsen = 1e-7 / 3.0 * np.sqrt(8.0 * GAS_CONSTANT * case.gas.temperature / (np.pi * mass))
        np.testing.assert_allclose(assembler.diffusivity, 0.4 / 2.0 / (1.0 / d + 1.0 / knudsen), rtol=1e-12)


def test_slip_lets_gas_through_narrow_pores() -> None:
    """Fails when Klinkenberg's factor does not reach the flow: the pressure drop of a column falls by 1 + 8 Kn."""
    block = {
        "porosity": 0.4,
        "permeability": "1 um^2",
        "surface_to_volume": "0 1/m",
        "tortuosity_factor": 2.0,
    }
    drops = []
    for more in ({}, {"pore_diameter": "2 um"}):
        case = column_case(
            5e-3, 5, 0.02, {**block, **more}, motion=STILL, time={"end": "20 ms", "step": "10 ms"}
        )
        drops.append(Reactor(case, MPI.COMM_SELF).run().summary["flow"]["pressure_drop"]["packing"])
    assert drops[0] / drops[1] == pytest.approx(1.0 + 8.0 * case.gas.mean_free_path / 2e-6, rel=1e-9)


def test_rates_are_those_of_the_temperature_of_each_cell() -> None:
    """Fails when reactions run at the temperature of the case: with Ea they take up only where it is hot."""
    case = zone(
        {
            **HEATED,
            "fidelity": "steady",
            "geometry.inlet.tma.temperature": "473 K",
            "geometry.inlet.tma.mass_fractions.TMA": 1e-5,
            "chemistry.reaction.tma.Ea": "150 kJ/mol",
            "chemistry.reaction.tma.A": f"{0.9 * np.exp(150e3 / GAS_CONSTANT / 473.0)} m/s",
        },
        TINY,
    )
    reactor, _ = run(case)
    kinetics, thermal = reactor.system.transport.reactions.surface, reactor.system.thermal
    assert thermal is not None and isinstance(kinetics, SurfaceKinetics)
    cells = reactor.system.coverage.cells
    hot = thermal.heat.temperature[cells]
    reaction = kinetics.reactions[0]
    np.testing.assert_allclose(kinetics.constant[0], reaction.rate_constant(hot), rtol=1e-6)
    assert kinetics.constant[0].max() / kinetics.constant[0].min() > 1.5


def test_energy_of_a_case_at_one_temperature_changes_nothing() -> None:
    """Fails when a table [energy] alone changes an isothermal run: the same numbers to 1e-9, heat of reaction left out."""
    changes = {"time.end": "0.5 s", "output.every": "0.25 s"}
    no_heat = {f"chemistry.reaction.{key}.heat_of_reaction": "0 J/mol" for key in ("tma", "water", "cvd")}
    for fidelity in ("averaged", "steady"):
        _, plain = run(zone({**changes, "fidelity": fidelity}, TINY))
        _, warm = run(zone({**changes, **no_heat, "fidelity": fidelity, "energy.buoyancy": True}, TINY))
        there = physical_numbers(warm.summary)
        for name, value in physical_numbers(plain.summary).items():
            assert there[name] == pytest.approx(value, rel=1e-9, abs=1e-14), name


def convection_oven(fidelity: str) -> Case:
    """Cold powder on a hot floor under a headspace with a warm feed and a hot roof; nothing in it takes longer than the powder to pass."""
    inlet = {"name": "tma", "side": "top", "center": "45 mm", "width": "5 mm", "velocity": "4 cm/s"}
    roof = {"name": "roof", "side": "top", "temperature": "473 K", "start": "20 mm", "end": "40 mm"}
    return load_case(
        {
            "fidelity": fidelity,
            "geometry": {
                "length": "60 mm",
                "cell_width": "1.5 mm",
                "layer": [
                    {"name": "bed", "height": "3 mm", "cells": 6, "material": "glass_beads", "moving": True},
                    {"name": "headspace", "height": "6 mm", "cells": 8},
                ],
                "inlet": [{**inlet, "mass_fractions": {"TMA": 2e-4}, "temperature": "420 K"}],
                "outlet": [{"name": "out", "center": "15 mm", "width": "5 mm"}],
                "wall": [wall("bottom", temperature="473 K"), roof],
                "bed_temperature": "298 K",
            },
            "energy": {},
            "motion": {"bed_velocity": "2 cm/s"},
            "time": {"end": "8 s", "steps_per_cycle": 16},
            "output": {"every": "4 s"},
        }
    )


def test_fidelities_agree() -> None:
    """Fails when resolved, averaged and steady runs with heat are not of one reactor: coverage within 0.02, temperatures within 1 K.

    Of the powder as it leaves and of every layer in the mean: near the entry a column is anywhere in its cell, and warms by tens of kelvin
    while it passes.
    """
    results = {f: run(convection_oven(f))[1] for f in ("steady", "averaged", "resolved")}
    steady, grid = results["steady"], results["steady"].grid
    for fidelity in ("averaged", "resolved"):
        result = results[fidelity]
        for name in ("box_mean", "exit_mean"):
            one, other = result.summary["titration"]["tma"][name], steady.summary["titration"]["tma"][name]
            assert one == pytest.approx(other, abs=0.02), f"{fidelity}, {name}"
        warmer = result.field("temperature") - steady.field("temperature")
        leaving = warmer[grid.layer_rows("bed"), -1]
        assert np.abs(leaving).max() < 1.0, f"{fidelity}: {leaving}"
        for layer in grid.layer_names:
            assert abs(warmer[grid.layer_rows(layer)].mean()) < 1.0, f"{fidelity}, {layer}"


def test_pressure_drop_of_a_cold_bed_is_that_of_its_own_gas() -> None:
    """Fails when viscosity or velocity of another temperature enter: mu(T) u h/K with u = m/rho(T) of a column that is cold all through."""
    block = {
        "porosity": 0.4,
        "permeability": "1 um^2",
        "surface_to_volume": "0 1/m",
        "tortuosity_factor": 2.0,
        "density": "2000 kg/m^3",
        "heat_capacity": "800 J/kg/K",
        "conductivity": "1 W/m/K",
    }
    case = column_case(
        *(5e-3, 2, 0.02, block),
        inlet={"temperature": "300 K"},
        gas={"temperature": "500 K"},
        energy={"initial_temperature": "300 K", "buoyancy": False},
        motion=STILL,
        time={"end": "20 ms", "step": "10 ms"},
    )
    drop = Reactor(case, MPI.COMM_SELF).run().summary["flow"]["pressure_drop"]["packing"]
    assert drop == pytest.approx(case.gas.viscosity_at(300.0) * 0.02 * 5e-3 / 1e-12, rel=1e-9)


def test_species_that_diffuse_take_heat_along() -> None:
    """Fails when sum_i (c_i - c) div(J_i h) is off: by hand of one face, and nothing of it is made or lost in the strip."""
    case = zone({**HEATED, "geometry.inlet.tma.mass_fractions": {"TMA": 1e-3}}, TINY)
    system = Reactor(case, MPI.COMM_SELF).system
    transport, strip = system.transport, system.strip
    thermal = system.thermal
    assert thermal is not None
    random = np.random.default_rng(7)
    transport.concentration = random.uniform(0.0, 1.0, transport.concentration.shape)
    excess = random.uniform(-100.0, 100.0, strip.owned)
    flux = transport.diffusion("TMA")
    gained = thermal.heat.fluxes.diffusing([Diffusing(50.0, flux)], excess)
    assert abs(gained.sum()) < 1e-12 * np.abs(gained).sum()
    face = int(np.argmax(np.abs(flux)))
    behind, ahead = strip.faces.behind[face], strip.faces.ahead[face]
    alone = np.where(np.arange(len(flux)) == face, flux, 0.0)
    carried = 50.0 * flux[face] * 0.5 * (excess[behind] + excess[ahead])
    one = thermal.heat.fluxes.diffusing([Diffusing(50.0, alone)], excess)
    assert one[ahead] == pytest.approx(carried) and one[behind] == pytest.approx(-carried)
    x = transport.concentration[transport.names.index("TMA")] / thermal.gas.relative[: strip.owned]
    assert np.sign(flux[face]) == np.sign(x[behind] - x[ahead])


def test_heat_balances_where_species_bring_their_own() -> None:
    """Fails when what species bring along does not enter runs, or enters the balance: it moves heat, and is none."""
    fields = []
    for capacity in ("29.1 J/mol/K", "3000 J/mol/K"):
        case = zone(
            {
                **HEATED,
                "geometry.inlet.tma.mass_fractions": {"TMA": 0.01},
                "chemistry.species.TMA.heat_capacity": capacity,
                "time.end": "1 s",
                "output.every": "0.5 s",
            },
            TINY,
        )
        fields.append(run(case)[1].field("temperature"))
    assert np.abs(fields[1] - fields[0]).max() > 0.1


def test_dose_of_a_cold_inlet_is_what_it_feeds() -> None:
    """Fails when the excess number counts molecules at another temperature than that of the port, where its velocity is measured."""
    case = zone({**HEATED, "geometry.inlet.tma.temperature": "300 K", "fidelity": "steady"}, TINY)
    _, result = run(case)
    fed = result.summary["species"]["TMA"]["fed"]  # mol/m/s
    bed = case.geometry.layers[2]
    passing = 0.013 * bed.height * bed.solid.surface_to_volume * bed.solid.site_density
    assert result.summary["excess_number"]["tma"] == pytest.approx(fed / passing, rel=1e-9)
