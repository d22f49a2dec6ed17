"""A sample of random mechanisms: any rate law, any layout, within the laws. `python scripts/mechanisms.py` tries as many as one likes."""

import sys
from pathlib import Path

import numpy as np
import pytest

from mpm.case.case import Case, load_case
from mpm.errors import Interrupted
from mpm.reactor.reactor import Reactor, Result

from .cases import MPI, assert_same_numbers

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import mechanisms

COMM = MPI.COMM_WORLD
QUICK = (4, 6, 10, 16, 18, 20, 22, 30, 39, 41)
"""Seeds of every layout but the slow ones: some whose steps are halved, on periodic solids, between walls, with heat, without ports."""
COMPARED = (6, 16)
"""Seeds whose bed rests, so that averaged steps may become as long as they like and nothing but rounding is between their end and the
steady state."""
SHARED = (37, 22, 39)
"""Seeds that several ranks share: two dosing inlets, a reversible reaction in the gas, sites that hold two places."""


@pytest.mark.parametrize("seed", QUICK)
def test_a_random_mechanism_obeys_the_laws(seed: int) -> None:
    """Fails when an averaged, resolved or steady run does not end as done, or is out of balance, or has a coverage outside [0, 1] or a
    concentration below zero, or needs a step below a hundredth of time.step."""
    found = mechanisms.one(seed, long=False)
    assert found.said == []
    assert 2.0**-found.halvings >= 0.01


@pytest.mark.parametrize("seed", COMPARED)
def test_steady_is_the_end_of_averaged(seed: int) -> None:
    """Fails when the steady state is further than 1e-6 of all sites, or of the gas, from where averaged steps of up to 1e7 s end."""
    found = mechanisms.one(seed)
    assert found.said == []
    assert found.gap < 1e-6, found.state


def test_what_is_drawn_differs() -> None:
    """Fails when the seeds no longer draw what the script promises: both arrows, ways back, orders, films, gas reactions, large sites."""
    seen: set[str] = set()
    for seed in range(60):
        chemistry = mechanisms.tables(seed)["chemistry"]
        for table in chemistry["reaction"].values():
            seen |= {*table, "<=>" if "<=>" in table["equation"] else "->"}
            if "<=>" in table["equation"] and not {"reverse", "equilibrium_constant"} & {*table}:
                seen.add("thermochemistry")
            if not any(site in table["equation"].split() for site in chemistry["site"]):
                seen.add("in the gas")
        seen |= {f"{site['sites']} places" for site in chemistry["site"].values()}
        seen |= {"film"} if chemistry["film"] else set()
        seen |= {"two surfaces"} if "o" in chemistry["site"] else set()
    assert seen >= {
        "->", "<=>", "A", "sticking", "motz_wise", "orders", "coverage", "reverse", "equilibrium_constant", "thermochemistry",
        "in the gas", "2 places", "film", "two surfaces", "heat_of_reaction",
    }  # fmt: skip


def _case(seed: int) -> Case:
    return load_case(mechanisms.tables(seed), {"time.end": "1 s", "output.every": "0.5 s"})


def _state(result: Result) -> list[np.ndarray]:
    """Concentrations and coverages, collective."""
    mechanism = result.case.mechanism
    gases = [result.field(f"C_{name}") for name in mechanism.species_names]
    return [*gases, *(result.coverage("bed", site) for site in mechanism.site_names)]


@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize("seed", SHARED)
def test_ranks_agree(seed: int) -> None:
    """Fails when a number of the summary, a concentration or a coverage depends on the number of ranks by more than 1e-8."""
    alone, together = Reactor(_case(seed), MPI.COMM_SELF).run(), Reactor(_case(seed), COMM).run()
    assert_same_numbers(alone.summary, together.summary, 1e-8)
    for a, b in zip(_state(alone), _state(together), strict=True):
        np.testing.assert_allclose(b, a, rtol=0.0, atol=1e-8 * np.abs(a).max())


@pytest.mark.parametrize("seed", SHARED)
def test_resumed_run_is_the_same(seed: int, tmp_path: Path) -> None:
    """Fails when a run that was stopped and goes on differs from the uninterrupted one in a single bit of its fields or numbers."""
    whole = Reactor(_case(seed), MPI.COMM_SELF).run()

    def stop(reactor: Reactor) -> None:
        if reactor.time > 0.4:
            reactor.stop()

    with pytest.raises(Interrupted):
        Reactor(_case(seed), MPI.COMM_SELF).run(output=tmp_path / "cut", callback=stop)
    resumed = Reactor(_case(seed), MPI.COMM_SELF).run(output=tmp_path / "cut", resume=True)
    assert_same_numbers(whole.summary, resumed.summary, 0.0)
    for a, b in zip(_state(whole), _state(resumed), strict=True):
        np.testing.assert_array_equal(a, b)
