"""Reported temperatures, heats and balances against values made up by hand; a run that loses heat or gas is not done."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case, load_case
from mpm.errors import BalanceError
from mpm.mesh.grid import Grid
from mpm.reactor.reactor import Reactor
from mpm.report.balances import balance_errors, require_balance, worst_balance
from mpm.report.heat import energy, gas_balance, heat_balance, heat_capacity, heating_length, temperatures
from mpm.report.quantities import quantity, worst_balance_error
from mpm.report.records import HeatTotals, Totals
from mpm.report.rounding import natural_scale, shown
from mpm.report.trees import flatten
from mpm.transport.heat_ledger import HeatLedger

from .cases import CASES, MPI, SHORT, TINY
from .test_direction import conveyed

WARM = {"energy": {}, "geometry.bed_temperature": "300 K"}
HEAT = HeatTotals(
    inlets=np.array([-3.0, -1.0]),
    outlets=np.array([2.0]),
    walls=np.array([40.0, 60.0]),
    solids=-50.0,
    heating=7.0,
    reaction=0.5,
    stored=1055.5,
    stored_initially=1000.0,
    gas_passed=0.25,
    gas=2.25,
    gas_initially=2.0,
)
"""Of -4 + 2 + 100 - 50 + 7 + 0.5 = 55.5 J/m all is stored."""


def warm(changes: Mapping[str, Any] | None = None) -> Case:
    return load_case(CASES / "single_zone.toml", {**TINY, **WARM, **(changes or {})})


def ramp(case: Case) -> tuple[Grid, np.ndarray]:
    """A grid, and a temperature 300 K + 100 K x/length in its columns and 10 K higher in every row than in the one below."""
    grid = Grid.from_case(case)
    along = 300.0 + 100.0 * grid.centres / grid.length
    return grid, along[None, :] + 10.0 * np.arange(grid.rows)[:, None]


def test_temperatures_of_layers_are_means_over_their_volume() -> None:
    """Fails when rows of different heights count alike, or when extremes are those of another layer."""
    case = warm({"geometry.layer.bed.cells": 2, "geometry.layer.bed.grading": 3.0})
    grid, field = ramp(case)
    found = temperatures(case, grid, field)
    first = grid.layer_rows("bed").start
    low, high = grid.dy[grid.layer_rows("bed")]
    rows = 10.0 * (first * low + (first + 1) * high) / (low + high)
    half = 50.0 / grid.columns
    assert high / low > 1.5 or low / high > 1.5
    assert found["bed"]["mean"] == pytest.approx(350.0 + rows)
    assert found["bed"]["min"] == pytest.approx(300.0 + half + 10.0 * first)
    assert found["bed"]["max"] == pytest.approx(400.0 - half + 10.0 * (first + 1))
    assert found["bed_exit"] == pytest.approx(400.0 - half + rows)
    assert set(found) == {"plenum", "frit", "bed", "headspace", "bed_exit"}


def test_the_exit_is_where_solids_leave(tmp_path: Path) -> None:
    """Fails when a bed that moves to the left leaves at the right, or one at rest leaves at all."""
    backwards = conveyed(warm(), -0.013, tmp_path)
    grid, field = ramp(backwards)
    first = float(field[grid.moving][:, 0].mean())
    assert temperatures(backwards, grid, field)["bed_exit"] == pytest.approx(first)
    resting = warm({"motion.bed_velocity": "0 cm/s", "motion.gamma": 0})
    assert "bed_exit" not in temperatures(resting, grid, field)
    assert heating_length(resting, grid, field) == {} == temperatures(resting, grid, None)


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("degrees", [100.0, -100.0])
def test_heating_length_of_a_straight_way(backwards: bool, degrees: float, tmp_path: Path) -> None:
    """The bed warms (or cools) evenly until the last column's centre: 95 % of the way there. Fails when the length counts from the wrong
    end, or is that of a column, or when cooling has none."""
    case = conveyed(warm(), -0.013 if backwards else 0.013, tmp_path)
    grid = Grid.from_case(case)
    way = grid.length - 0.5 * grid.dx
    distance = grid.x[-1] - grid.centres if backwards else grid.centres
    field = np.full((grid.rows, grid.columns), 1.0) * (300.0 + degrees * distance / way)
    assert heating_length(case, grid, field)["length"] == pytest.approx(0.95 * way)


def test_heating_length_is_where_the_way_is_made_first() -> None:
    """Fails when a bed that is hotter on its way than at its exit is warm only there, when one that hardly warms has a length, or one whose
    solids come back in."""
    case = warm()
    grid = Grid.from_case(case)
    field = np.full((grid.rows, grid.columns), 340.0)
    field[:, :3] = 300.0, 320.0, 500.0
    expected = (1.5 + (0.95 * 40.0 - 20.0) / 180.0) * grid.dx
    assert heating_length(case, grid, field)["length"] == pytest.approx(expected)
    assert heating_length(case, grid, np.full_like(field, 300.9)) == {}
    assert "length" in heating_length(case, grid, np.full_like(field, 301.1))
    assert heating_length(warm({"geometry.bed_inflow": "periodic"}), grid, field) == {}


def test_terms_of_the_heat_balance() -> None:
    """Fails when a term is another sum, or has the other sign."""
    found = energy(warm(), HEAT)
    error = found.pop("balance_error")
    assert found == {
        "inlets": -4.0,
        "outlets": 2.0,
        "walls": 100.0,
        "solids": -50.0,
        "reaction": 0.5,
        "heating": 7.0,
        "stored": 55.5,
    }
    assert error == 0.0 and energy(warm(), None) == {}


def test_heat_that_is_lost_is_measured_by_the_largest_term() -> None:
    """Fails when the error is relative to something else, or a term takes no part in it."""
    for name, lost in (
        ("inlets", -1.0),
        ("outlets", -1.0),
        ("solids", -1.0),
        ("reaction", -1.0),
        ("heating", -1.0),
        ("stored", 1.0),
    ):
        spoilt = replace(
            HEAT, **{name: getattr(HEAT, name) + np.array([lost] if name == "outlets" else lost)}
        )
        expected = 2.0 if name == "inlets" else 1.0
        assert heat_balance(warm(), spoilt) == pytest.approx(expected / 100.0), name
    assert heat_balance(warm(), replace(HEAT, walls=np.array([40.0, 160.0]))) == pytest.approx(100.0 / 200.0)


def test_a_strip_at_one_temperature_is_in_balance() -> None:
    """Fails when rounding of no heat is an error of order one; heat that warms all by 1 uK is the least that counts."""
    case, nothing = warm(), np.zeros(2)
    capacity = heat_capacity(case)
    assert capacity == pytest.approx(by_hand(case), rel=1e-12)
    still = replace(
        HEAT,
        inlets=nothing,
        outlets=nothing[:1],
        walls=nothing,
        solids=0.0,
        heating=0.0,
        reaction=0.0,
        stored=1000.0,
    )
    assert heat_balance(case, still) == 0.0
    assert heat_balance(case, replace(still, reaction=1e-15)) < 1e-9
    assert heat_balance(case, replace(still, reaction=0.5e-6 * capacity)) == pytest.approx(0.5)


def by_hand(case: Case) -> float:
    gas = case.gas.density * case.gas.heat_capacity
    total = 0.0
    for layer in case.geometry.layers:
        if layer.material is None:
            total += layer.height * gas
            continue
        m = layer.material
        assert m.density is not None and m.heat_capacity is not None
        total += layer.height * (m.porosity * gas + (1.0 - m.porosity) * m.density * m.heat_capacity)
    return total * case.geometry.length


def test_the_gas_balances() -> None:
    """Fails when gas that is lost is measured by another scale than what the strip holds or has let out."""
    assert gas_balance(HEAT, 0.0) == 0.0
    lost = replace(HEAT, gas_passed=0.25 + 0.09)
    assert gas_balance(lost, 0.0) == pytest.approx(0.04)
    assert gas_balance(lost, 9.0) == pytest.approx(0.01)
    assert gas_balance(replace(HEAT, gas=1.0, gas_passed=-0.5), 0.0) == pytest.approx(0.25)


def test_both_take_part_in_the_worst_balance() -> None:
    """Fails when a run may end as done that has lost heat or gas, or when a case without [energy] has such a balance."""
    reactor = Reactor(warm(SHORT), MPI.COMM_SELF)
    totals = reactor.totals()
    assert {"energy", "gas"} <= set(balance_errors(reactor.case, totals))
    broken: tuple[tuple[str, dict[str, Any]], ...] = (
        ("energy", {"solids": 1.0}),
        ("gas", {"gas_passed": 1.0}),
        ("energy", {"stored": np.nan}),
    )
    assert totals.heat is not None
    for name, changes in broken:
        spoilt = Totals(**{**vars(totals), "heat": replace(totals.heat, **changes)})
        assert worst_balance(reactor.case, spoilt)[0] == name
        with pytest.raises(BalanceError, match=f"balance of {name}"):
            require_balance(reactor.case, spoilt)
    require_balance(reactor.case, totals)
    cool = load_case(CASES / "single_zone.toml", TINY)
    assert not {"energy", "gas"} & set(balance_errors(cool, Totals(**{**vars(totals), "heat": None})))


@pytest.mark.parametrize("fidelity", ["steady", "averaged"])
def test_a_run_that_loses_heat_fails(fidelity: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a thousandth of the heat that solids bring and take may get lost."""
    add = HeatLedger.add

    def miscounted(self: HeatLedger, **amounts: Any) -> None:
        add(self, **{name: value * (0.999 if name == "solids" else 1.0) for name, value in amounts.items()})

    monkeypatch.setattr(HeatLedger, "add", miscounted)
    with pytest.raises(BalanceError, match=r"balance of energy: off by 0\.00"):
        Reactor(warm({**SHORT, "fidelity": fidelity}), MPI.COMM_SELF).run()


@pytest.mark.parametrize("fidelity", ["steady", "averaged", "resolved"])
def test_a_run_reports_temperatures_and_balances(fidelity: str) -> None:
    """Fails when a number is missing from a file, is a mismatch that is none, or when heat or gas do not close to 1e-9."""
    wall = {"side": "top", "start": "0 mm", "end": "95 mm", "temperature": "473 K"}
    changes = {**SHORT, "time.end": "0.5 s", "fidelity": fidelity, "geometry.wall": [wall]}
    result = Reactor(warm(changes), MPI.COMM_SELF).run()
    numbers = flatten(result.summary)
    for name in (
        "temperature.bed.mean",
        "temperature.bed_exit",
        "heating.length",
        "energy.walls",
        "energy.balance_error",
    ):
        assert name in numbers and result.history[name][-1] == pytest.approx(numbers[name], rel=1e-12)
    assert numbers["energy.balance_error"] == result.history["balance.energy"][-1] < 1e-9
    assert numbers["flow.gas_balance_error"] == result.history["balance.gas"][-1] < 1e-12
    assert (
        300.0
        < numbers["temperature.bed.min"]
        < numbers["temperature.bed_exit"]
        <= numbers["temperature.bed.max"] + 1e-9
    )
    assert ("flow.mass_error" in numbers) == (fidelity == "steady")
    worst = worst_balance_error(numbers)
    assert worst is not None and numbers[worst] < 1e-9


def test_a_run_without_energy_reports_nothing_of_it() -> None:
    """Fails when files of an isothermal run get numbers of heat, or lose the mismatch of inflow and outflow."""
    result = Reactor(
        load_case(CASES / "single_zone.toml", {**TINY, **SHORT, "time.end": "0.1 s"}), MPI.COMM_SELF
    ).run()
    names = [*flatten(result.summary), *result.history]
    heads = {name.split(".")[0] for name in names}
    assert not heads & {"temperature", "energy", "heating"}
    assert not {"balance.energy", "balance.gas", "flow.gas_balance_error"} & set(names)
    assert "flow.mass_error" in names


def test_heat_in_a_steady_state_is_in_watts() -> None:
    """Fails when a rate of heat is in J/m/s, or rounding of heat is judged by species."""
    assert (
        quantity("energy.walls").unit == "J/m" and quantity("energy.walls", steady=True).unit_shown == "W/m"
    )
    numbers = {
        "energy.walls": 50.0,
        "energy.solids": -80.0,
        "energy.reaction": 1e-11,
        "energy.balance_error": 1e3,
    }
    assert natural_scale("energy.walls", numbers) == 80.0
    assert shown("energy.reaction", numbers, steady=True) == "0\u00a0W/m"
    assert shown("energy.solids", numbers, steady=True) == "-80\u00a0W/m"
