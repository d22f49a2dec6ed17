"""The shipped cases with temperature: what they say of themselves, and that they balance."""

import re
from typing import Any

import pytest

from mpm.case.case import Case, load_case
from mpm.reactor.reactor import Reactor
from mpm.sweep.sweepfile import read_sweep

from .cases import CASES, MPI, TINY

NAMES = ("heating", "hot_cycle")


def side_covered(case: Case, side: str) -> float:
    """Length of walls and ports on a side of the strip [m]."""
    ports = (*case.geometry.inlets, *case.geometry.outlets)
    walls = sum(wall.end - wall.start for wall in case.geometry.walls if wall.side == side)
    return walls + sum(port.width for port in ports if port.side == side)


@pytest.mark.parametrize("name", NAMES)
def test_hot_walls_lie_between_all_ports(name: str) -> None:
    """Fails when a stretch of floor or roof is left out, as after a port has moved."""
    case = load_case(name)
    for side in ("bottom", "top"):
        assert side_covered(case, side) == pytest.approx(case.geometry.length, rel=1e-12)
    assert {wall.temperature for wall in case.geometry.walls} == {473.15} == {case.gas.temperature}


@pytest.mark.parametrize("name", NAMES)
def test_a_coarse_steady_run_balances(name: str) -> None:
    """Fails when heat, gas or species of a shipped case do not close, or powder leaves colder than it enters."""
    case = load_case(name, {**TINY, "fidelity": "steady"})
    summary: dict[str, Any] = Reactor(case, MPI.COMM_SELF).run().summary
    assert summary["status"] == "done" and summary["energy"]["balance_error"] < 1e-9
    assert summary["flow"]["gas_balance_error"] < 1e-12
    leaves = summary["temperature"]["bed_exit"]
    assert case.bed_temperature < leaves < case.gas.temperature
    said = re.search(r"state \(--set fidelity=steady\) at (\d+) K", (CASES / f"{name}.toml").read_text())
    if said is not None:
        assert leaves == pytest.approx(float(said[1]), abs=3.0)


def test_water_reacts_as_in_the_mechanism_where_that_is_known() -> None:
    """Fails when the rate constant at 473 K is another, or does not fall with the temperature as the case says."""

    def constant(name: str, temperature: float) -> float:
        mechanism = load_case(name).mechanism
        water = next(r for r in mechanism.surface_reactions if r.key == "water")
        return float(water.rate_constant(temperature))

    assert constant("hot_cycle", 473.0) == pytest.approx(constant("single_cycle", 473.0), rel=1e-3)
    falls = constant("hot_cycle", 373.15) / constant("hot_cycle", 473.0)
    assert falls == pytest.approx(0.12, abs=0.005)


def test_the_sweep_asks_for_numbers_that_there_are() -> None:
    """Fails when the sweep draws another number, or varies another key."""
    sweep = read_sweep("heating")
    assert [axis.keys for axis in sweep.axes] == [("geometry.bed_temperature",), ("motion.bed_velocity",)]
    assert sweep.pictures == ("temperature.bed_exit", "heating.length") and sweep.base.fidelity == "steady"
