"""The quasi-steady state: found from a cold start over a grid of cases, the long-time limit of averaged runs, an exact mass balance,
the same on any number of ranks, and a failure that leaves something to look at."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mpm.reactor.steady.coarsening
import mpm.reactor.steady.solver
from mpm.case.case import Case, load_case
from mpm.cli import main
from mpm.errors import ConvergenceError
from mpm.numerics.linear import DirectSolver
from mpm.output.results import load_run
from mpm.physics.exponentials import phi1, phi2
from mpm.reactor.flow import Flow
from mpm.reactor.reactor import Reactor
from mpm.reactor.steady.coarsening import coarser
from mpm.report.fronts import coverage_front

from .cases import (
    CASES,
    COARSE,
    MPI,
    SHORT,
    TINY,
    assert_laws,
    assert_same_numbers,
    cycle,
    physical_numbers,
    run,
    zone,
)

STEADY = {"fidelity": "steady"}
TMA, WATER = "geometry.inlet.tma.mass_fractions.TMA", "geometry.inlet.water.mass_fractions.H2O"
DOSES = (1e-5, 1e-4, 2e-4, 1e-3, 1e-2)
SPEEDS = (0.1, 0.5, 1.3, 5.0)  # cm/s


def grid_case(kind: str, dose: float, speed: float, mesh: dict[str, Any]) -> Case:
    """Single zone, or single cycle with the stoichiometric amount of water (molar 1 : 1.5)."""
    changes = {**STEADY, TMA: dose, "motion.bed_velocity": f"{speed} cm/s"}
    return cycle({**changes, WATER: 0.375 * dose}, mesh) if kind == "cycle" else zone(changes, mesh)


@pytest.mark.slow
@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("kind", ["zone", "cycle"])
def test_converges_from_a_cold_start(kind: str, speed: float) -> None:
    """Fails when any dose from 1e-5 to 1e-2 does not converge at this bed speed, or converges to something that is out of balance."""
    kept: Flow | None = None  # it does not depend on the dose
    for dose in DOSES:
        reactor = Reactor(grid_case(kind, dose, speed, COARSE), MPI.COMM_SELF, flow=kept)
        result = reactor.run(callback=assert_laws)
        kept = reactor.flow
        assert result.summary["status"] == "done", (dose, speed)
        assert 0 < reactor.steps < 300, reactor.steps


@pytest.mark.parametrize(("dose", "speed"), [(1e-5, 1.3), (1e-4, 5.0), (2e-4, 5.0)])
def test_exit_coverage_is_the_dose_ratio(dose: float, speed: float) -> None:
    """Fails when fresh solids that take up all that is fed do not leave the zone with the dose ratio, to 1e-6: it is a mass balance.

    These doses are below saturation and short of reaching the outlet; less than 1e-9 of the precursor leaves in the gas.
    """
    _, result = run(grid_case("zone", dose, speed, COARSE))
    tma = result.summary["species"]["TMA"]
    assert tma["left"] < 1e-9 * tma["fed"]
    ratio, titration = result.summary["dose_ratio"]["tma"], result.summary["titration"]["tma"]
    assert ratio < 0.5
    assert titration["exit_mean"] == pytest.approx(ratio, abs=1e-6)


@pytest.mark.parametrize(("dose", "speed"), [(1e-4, 1.3), (2e-4, 1.3), (1e-5, 0.1), (1e-2, 5.0)])
def test_exit_coverage_when_precursor_leaves(dose: float, speed: float) -> None:
    """Fails when what the solids carry out of the zone is not what was fed less what left in the gas, saturated or not."""
    _, result = run(grid_case("zone", dose, speed, COARSE))
    tma = result.summary["species"]["TMA"]
    taken_up = result.summary["dose_ratio"]["tma"] * (1.0 - tma["left"] / tma["fed"])
    assert result.summary["titration"]["tma"]["exit_mean"] == pytest.approx(taken_up, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("dose", "speed", "end"), [(1e-4, "1.3 cm/s", 40), (2e-4, "5 cm/s", 16)])
def test_long_time_limit_of_averaged(dose: float, speed: str, end: int) -> None:
    """Fails when the mean coverage of the bed is more than 0.002 from where an averaged run on the same mesh ends.

    There whole columns slide: the coverage of a cell goes from that of the solids entering it to that of those leaving, so its mean
    over some slides is compared with the mean of both. The frit starts saturated, which it would become after hours.
    """
    changes = {TMA: dose, "motion.bed_velocity": speed}
    site = "OAl(CH3)2"
    _, steady = run(zone({**changes, **STEADY}))
    leaving = steady.coverage("bed", site)
    entering = np.concatenate([np.zeros((len(leaving), 1)), leaving[:, :-1]], axis=1)
    averaged = Reactor(
        zone(
            {
                **changes,
                "time.end": f"{end} s",
                "output.every": "10 ms",
                "material.sintered_powder.initial_coverage": {"OH": 0.0, site: 1.0},
            }
        ),
        MPI.COMM_SELF,
    )
    means: list[float] = []
    averaged.run(callback=lambda r: means.append(float(r.coverage("bed", site).mean())))
    period = averaged.grid.dx / averaged.system.bed_motion.mean / averaged.case.time.step  # steps per slide
    late, before = (
        np.mean(means[-round(10 * period) :]),
        np.mean(means[-round(20 * period) : -round(10 * period)]),
    )
    assert abs(late - before) < 0.001, "not settled"
    assert 0.1 < late < 0.9
    assert 0.5 * (leaving + entering).mean() == pytest.approx(late, abs=0.002)


RETURNS = {"geometry.outlet.zone1.width": "69 mm"} | {
    f"geometry.inlet.{name}.velocity": "0.1 cm/s" for name in ("purge", "tma")
}
"""Three quarters of what leaves through the wide outlet come back through it."""


def test_products_where_the_outlet_draws_back_in() -> None:
    """Fails when methane that an outlet draws back in is lost: all that is made must leave, whatever share of it comes back first.

    The mole fraction in the outlet is that which an averaged run has after 4000 s.
    """
    _, result = run(zone({**RETURNS, **STEADY}))
    methane, outlet = result.summary["species"]["CH4"], result.summary["outlets"]["zone1"]
    assert outlet["backflow"] > 0.7
    assert methane["left"] == pytest.approx(methane["produced"], rel=1e-9)
    assert outlet["x"]["CH4"] == pytest.approx(3.627e-5, rel=1e-3)


def test_backflow_of_an_interval() -> None:
    """Fails when the backflow in a row of the history is not that since the row before: in a steady flow it is the same in all."""
    _, result = run(zone({**RETURNS, **SHORT}, TINY))
    share = result.history["outlets.zone1.backflow"]
    assert len(share) > 4 and share[-1] > 0.5
    np.testing.assert_allclose(share[2:], share[-1], rtol=1e-9)


@pytest.mark.parametrize("speed", [0.001, 0.1, 0.5])
def test_precursor_where_the_outlet_draws_back_in(speed: float) -> None:
    """Fails when Newton's method does not know that precursor which leaves comes back: at 0.1 cm/s it then stops after 400 steps."""
    velocities = {f"geometry.inlet.{name}.velocity": f"{speed} cm/s" for name in ("purge", "tma")}
    reactor, result = run(zone({**RETURNS, **velocities, **STEADY, TMA: 1e-2}))
    assert result.summary["outlets"]["zone1"]["backflow"] > 0.1
    assert reactor.steps < 20


def test_time_does_not_change_the_steady_state() -> None:
    """Fails when gas that is drawn back in holds something else in a steady than in an averaged run: an averaged step must leave the
    steady concentrations of a bed at rest, of precursor and products, where they are."""
    changes = {
        **RETURNS,
        "geometry.inlet.purge.mass_fractions": {"CH4": 1e-4},
        "motion.bed_velocity": "0 m/s",
        "motion.start": "0 s",
    }
    steady, _ = run(zone({**changes, **STEADY}, TINY))
    system = Reactor(zone(changes, TINY), MPI.COMM_SELF, flow=steady.flow).system
    before = steady.system.transport.concentration
    system.transport.concentration = before
    system.coverage.become(steady.system.coverage.theta)
    system.transport.advance(system.operators(system.velocity), 0.0, 1.0)
    after = system.transport.concentration
    np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-9 * before.max())


def test_solids_at_rest_are_saturated() -> None:
    """Fails when the frit under the port, which precursor crosses for ever, is not converted, or the frit far from any is."""
    _, result = run(zone(STEADY))
    frit = result.coverage("frit", "OAl(CH3)2")
    assert frit.min() > 1.0 - 1e-9  # diffusion brings some everywhere
    _, both = run(cycle(STEADY, TINY))
    oh = both.coverage("frit", "OH")
    columns = oh.shape[1]
    assert oh[:, int(0.875 * columns)].min() > 0.99 and oh[:, int(0.375 * columns)].max() < 0.01


def test_periodic_solids_saturate() -> None:
    """Fails when solids that return are not saturated by a single precursor in the end, whatever its dose: all of it then leaves."""
    _, result = run(zone({**STEADY, "geometry.bed_inflow": "periodic"}, TINY))
    tma = result.summary["species"]["TMA"]
    assert result.summary["titration"]["tma"]["exit_min"] > 1.0 - 1e-9
    assert tma["left"] == pytest.approx(tma["fed"], rel=1e-9)


@pytest.mark.parametrize(("dose", "speed"), [(1e-5, 1.3), (1e-4, 5.0)])
def test_periodic_solids_between_two_precursors(
    dose: float, speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when solids that return to two precursors are not found at a state where both half-reactions run equally often, or when
    pseudo-time, which takes over where Newton's method alone does not arrive, ends elsewhere.

    The level of coverage hangs on the small difference of two doses.
    """
    case = grid_case("cycle", dose, speed, COARSE).with_({"geometry.bed_inflow": "periodic"})
    _, straight = run(case)
    monkeypatch.setattr(mpm.reactor.steady.solver, "TRIES", 3)
    reactor, result = run(case)
    np.testing.assert_allclose(result.coverage("bed", "OH"), straight.coverage("bed", "OH"), atol=1e-6)
    events = reactor.totals().surface.sum(axis=(1, 2))
    sites = np.array([r.nu_site["OH"] for r in reactor.system.transport.reactions.surface.reactions])
    assert abs(events @ sites) < 1e-9 * np.abs(events).max()
    assert 0.5 < result.coverage("bed", "OH").mean() < 0.999


def test_front_that_is_reported_is_that_of_the_field() -> None:
    """Fails when the front of the coverage in the bed is not reported, or is that of another layer, site or place."""
    reactor, result = run(zone({**STEADY, TMA: 1e-4}, TINY))
    profile = result.coverage("bed", "OAl(CH3)2").mean(axis=0)
    (tma,) = (inlet for inlet in reactor.case.geometry.inlets if inlet.name == "tma")
    expected = coverage_front(reactor.grid, profile, center=tma.center, incoming=0.0)
    assert expected is not None
    assert result.summary["front"]["tma"]["bed"]["coverage"] == pytest.approx(expected, abs=1e-12)


def test_nothing_fed_is_nothing_lost() -> None:
    """Fails when the rounding of a state without feed counts as a balance that is off by its largest term, 1.0."""
    closed = {"geometry.inlet.tma.velocity": "0 m/s", "geometry.inlet.purge.velocity": "0 m/s"}
    _, result = run(zone({**STEADY, **closed}))
    summary = result.summary
    assert summary["species"]["TMA"]["fed"] == 0.0 and summary["species"]["TMA"]["balance_error"] < 1e-12
    assert all(entry["balance_error"] < 1e-12 for entry in summary["elements"].values())
    assert "utilisation" not in summary and "mass_error" not in summary["flow"]


def test_a_coarser_mesh_has_half_the_columns_and_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a layer loses more than half its rows, or its last two, or a small mesh is made coarser still."""
    monkeypatch.setattr(mpm.reactor.steady.coarsening, "FEWEST", 200)
    case = zone({"geometry.layer.bed.cells": 7, "geometry.layer.frit.cells": 3})
    coarse = coarser(case)
    assert coarse is not None and coarse.geometry.columns == case.geometry.columns // 2
    rows = {layer.name: layer.cells for layer in coarse.geometry.layers}
    assert rows == {"plenum": 2, "frit": 2, "bed": 4, "headspace": 4}
    coarsest = coarser(coarse)
    assert coarsest is not None and min(layer.cells for layer in coarsest.geometry.layers) == 2
    assert coarser(coarsest) is None


@pytest.mark.parallel
@pytest.mark.parametrize("kind", ["zone", "cycle"])
def test_a_coarser_mesh_first_changes_nothing(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the steady state depends on whether it was reached from that of a coarser mesh, or when that saves no Newton step."""
    case = grid_case(kind, 2e-4, 1.3, COARSE)
    cold, alone = run(case, MPI.COMM_WORLD)
    monkeypatch.setattr(mpm.reactor.steady.coarsening, "FEWEST", 200)
    warm, after = run(case, MPI.COMM_WORLD)
    assert warm.steps < cold.steps
    assert_same_numbers({**alone.summary, "steps": warm.steps}, after.summary, 1e-8)


@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize(("kind", "changes"), [("zone", {}), ("cycle", {}), ("zone", {**RETURNS, TMA: 1e-2})])
def test_ranks_agree(kind: str, changes: dict[str, Any]) -> None:
    """Fails when any physical number or field of the steady state depends on the number of ranks by more than 1e-8."""
    case = grid_case(kind, 2e-4, 1.3, TINY).with_(changes)
    _, alone = run(case, MPI.COMM_SELF)
    _, together = run(case, MPI.COMM_WORLD)
    assert_same_numbers(alone.summary, together.summary, 1e-8)
    for field in ("C_TMA", "C_CH4"):
        a, b = alone.field(field), together.field(field)
        np.testing.assert_allclose(b, a, rtol=0.0, atol=1e-8 * a.max())
    for layer in ("bed", "frit"):
        np.testing.assert_allclose(together.coverage(layer, "OH"), alone.coverage(layer, "OH"), atol=1e-8)


def test_failure_leaves_the_last_iterate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a solve that stops ends otherwise than with exit 3, one line that says where and what to try, and the last iterate."""
    monkeypatch.setattr(mpm.reactor.steady.solver, "TRIES", 2)
    monkeypatch.setattr(mpm.reactor.steady.solver, "STEP_TRIES", 1)
    monkeypatch.setattr(mpm.reactor.steady.solver, "LOOSE", 0.0)  # no step of pseudo-time ends well
    monkeypatch.setattr(mpm.reactor.steady.solver, "SHORTEST_STEP", 0.1)
    settings = [f"{key}={json.dumps(value)}" for key, value in {**TINY, **STEADY}.items()]
    arguments = [part for setting in settings for part in ("--set", setting)]
    status = main(["run", str(CASES / "single_zone.toml"), "-o", str(tmp_path / "run"), "-q", *arguments])
    message = capsys.readouterr().err.strip()
    assert status == 3
    assert "\n" not in message
    for part in ("steady state: Newton stopped", "of the feed", "x = ", "y = ", "averaged"):
        assert part in message
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert all(np.isfinite(v) for v in physical_numbers(summary).values())
    assert (tmp_path / "run" / "fields.pvd").exists()
    assert "Newton stopped" in (tmp_path / "run" / "run.log").read_text()


def test_no_number_is_written_that_is_none(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Fails when a linear system without a solution ends otherwise than with ConvergenceError, or leaves NaN in a field or number."""
    solve = DirectSolver.solve

    def spoilt(self: Any, rhs: Any, solution: Any) -> None:
        solve(self, rhs, solution)
        if self.name == "steady state":
            solution.array[0] = np.nan

    monkeypatch.setattr(DirectSolver, "solve", spoilt)
    case = zone({**STEADY, "geometry.bed_inflow": "periodic"}, TINY)
    with pytest.raises(ConvergenceError, match="steady state: Newton stopped"):
        Reactor(case, MPI.COMM_SELF).run(tmp_path / "run")
    found = load_run(tmp_path / "run")
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["status"] == "failed"
    assert all(np.isfinite(values).all() for values in found.snapshot().cell_data.values())
    assert all(np.isfinite(values).all() for values in found.history.values())


GAS_ONLY: dict[str, Any] = {
    "fidelity": "steady",
    "geometry": {
        "length": "60 mm",
        "cell_width": "2 mm",
        "periodic": False,
        "layer": [{"name": "gas", "height": "6 mm", "cells": 6}],
        "inlet": [
            {
                "name": "i",
                "center": "5 mm",
                "width": "4 mm",
                "velocity": "2 cm/s",
                "mass_fractions": {"TMA": 1e-3},
            }
        ],
        "outlet": [{"name": "o", "center": "55 mm", "width": "4 mm"}],
    },
}


@pytest.mark.parametrize("fidelity", ["steady", "averaged", "resolved"])
@pytest.mark.parallel(alone=False)
def test_a_rank_without_cells(fidelity: str) -> None:
    """Fails (by timeout) when ranks wait for one that holds nothing, as of a strip with fewer columns than ranks, or its numbers are not
    those of one rank."""
    columns = MPI.COMM_WORLD.size - 1
    geometry = {
        **GAS_ONLY["geometry"],
        "cell_width": f"{60 / columns!r} mm",
        "inlet": [
            {**GAS_ONLY["geometry"]["inlet"][0], "center": "30 mm", "width": "20 mm", "side": "bottom"}
        ],
        "outlet": [{"name": "o", "center": "30 mm", "width": "60 mm", "side": "top"}],
    }
    case = load_case({**GAS_ONLY, "geometry": geometry, "fidelity": fidelity}, SHORT)
    reactor, result = run(case, MPI.COMM_WORLD)
    assert reactor.grid.columns == columns
    assert min(MPI.COMM_WORLD.allgather(reactor.system.strip.owned)) == 0
    _, alone = run(case, MPI.COMM_SELF)
    assert_same_numbers(result.summary, alone.summary, 1e-8)


@pytest.mark.parallel
def test_gas_without_solids() -> None:
    """Fails when a strip of gas alone has no steady state, or one in which not all that is fed leaves, as it came in."""
    _, result = run(load_case(GAS_ONLY), MPI.COMM_WORLD)
    assert result.summary["species"]["TMA"]["left"] == pytest.approx(
        result.summary["species"]["TMA"]["fed"], rel=1e-9
    )
    field = result.field("x_TMA")
    np.testing.assert_allclose(field, field.max(), rtol=1e-9)  # one inlet: the same mixture everywhere


@pytest.mark.parametrize("changes", [{}, RETURNS], ids=["", "drawn back in"])
def test_a_tracer_alone(changes: dict[str, Any]) -> None:
    """Fails when a gas that does not react has no steady state, or when that is not where an averaged run ends."""
    fed = {"geometry.inlet.tma.mass_fractions": {"CH4": 1e-3}}
    _, steady = run(zone({**changes, **fed, **STEADY}, TINY))
    methane = steady.summary["species"]["CH4"]
    assert methane["left"] == pytest.approx(methane["fed"], rel=1e-10)
    assert steady.coverage("bed", "OH").min() == 1.0
    late = {"time.end": "20000 s", "time.step": "100 s", "output.every": "20000 s"}
    _, averaged = run(zone({**changes, **fed, **late}, TINY))
    a, b = steady.field("C_CH4"), averaged.field("C_CH4")
    np.testing.assert_allclose(b, a, rtol=0.0, atol=1e-6 * a.max())


@pytest.mark.parametrize(
    "changes",
    [
        {TMA: 0.0},
        {"geometry.inlet.tma.stop": "5 s"},
        {"geometry.inlet.tma.velocity": "0 m/s"},
        {"geometry.inlet.tma.velocity": "0 m/s", "geometry.inlet.purge.velocity": "0 m/s"},
    ],
    ids=["no precursor", "closed for good", "no flow of it", "no flow at all"],
)
def test_nothing_is_dosed(changes: dict[str, Any]) -> None:
    """Fails when a steady state in which no precursor comes in is not that: gas without it, solids as they were."""
    _, result = run(zone({**STEADY, **changes}, TINY))
    assert result.field("C_TMA").max() == 0.0
    assert result.coverage("bed", "OH").min() == 1.0


@pytest.mark.parametrize("dose", [1e-6, 1e-9])
def test_traces(dose: float) -> None:
    """Fails when the solids at rest still take up a part of a small dose in the last step of pseudo-time."""
    _, result = run(zone({**STEADY, TMA: dose}, TINY))
    titration, ratio = result.summary["titration"]["tma"], result.summary["dose_ratio"]["tma"]
    assert titration["exit_mean"] == pytest.approx(ratio, rel=1e-9)


def test_solids_that_stand_still() -> None:
    """Fails when a bed that does not move is not saturated by a single precursor, all of which then leaves."""
    _, result = run(zone({**STEADY, "motion.bed_velocity": "0 m/s"}, TINY))
    assert result.coverage("bed", "OH").max() < 1e-9
    tma = result.summary["species"]["TMA"]
    assert tma["left"] == pytest.approx(tma["fed"], rel=1e-9)


def test_sites_are_counted_to_rounding() -> None:
    """Fails when sites that cross a cell at a small turnover are lost or made by more than rounding: it adds up over all cells."""
    x = np.geomspace(1e-8, 10.0, 2001)
    np.testing.assert_allclose(np.exp(-x) + x * phi1(x), 1.0, rtol=0.0, atol=5e-16)
    np.testing.assert_allclose(phi1(x) + x * phi2(x), 1.0, rtol=0.0, atol=5e-16)
