"""Whole runs: balances and bounds in every mode, fidelities that agree, titration, and what happens when a step fails.

Every run goes through `cases.run`, which asserts the laws (balances of species, sites and elements, no negative concentration, coverage
in [0, 1], no divergence) at each output time.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mpm.transport.species
from mpm.case.case import Case
from mpm.errors import ConvergenceError, InputError
from mpm.reactor.reactor import Reactor
from mpm.transport.step_matrix import StepMatrix

from .cases import MPI, SHORT, TINY, assert_laws, assert_same_numbers, cycle, physical_numbers, run, zone

RESOLVED = {**SHORT, "fidelity": "resolved"}


def backwards(folder: Path) -> str:
    """A motion profile that conveys to the left at 2 cm/s and swings by as much."""
    path = folder / "backwards.csv"
    rows = [f"{p},{-0.02 + 0.04 * np.cos(np.radians(p))},0,1" for p in range(0, 360, 10)]
    path.write_text("phase_deg,u_x_m/s,u_y_m/s,contact\n" + "\n".join(rows) + "\n")
    return str(path)


MODES: dict[str, Callable[[Path], Case]] = {
    "averaged": lambda _: zone(SHORT),
    "resolved": lambda _: zone(RESOLVED, TINY),
    "impulsive start-up": lambda _: zone({**RESOLVED, "motion.startup": "impulsive"}, TINY),
    "impulsive, aligned start": lambda _: zone({**RESOLVED, "motion.startup": "impulsive", "motion.start": "0 s"}, TINY),
    "no vibration": lambda _: zone({**SHORT, "motion.gamma": 0.0}, TINY),
    "no vibration, resolved": lambda _: zone({**RESOLVED, "motion.gamma": 0.0}, TINY),
    "everything at rest": lambda _: zone({**SHORT, "motion.gamma": 0.0, "motion.bed_velocity": "0 m/s"}, TINY),
    "inlet diffusion": lambda _: zone({**SHORT, "geometry.inlet_diffusion": True}),
    "inlets that only diffuse": lambda _: zone(
        {
            **SHORT, "geometry.inlet_diffusion": True,
            "geometry.inlet.tma.velocity": "0 m/s", "geometry.inlet.purge.velocity": "0 m/s",
        },
        TINY,
    ),
    "ports that reverse in the lab": lambda _: zone(
        {**RESOLVED, "motion.inlet_frame": "lab", "motion.gamma": 0.6, "geometry.inlet.purge.velocity": "0 m/s"}, TINY
    ),
    "ports that reverse, with diffusion": lambda _: zone(
        {**RESOLVED, "motion.inlet_frame": "lab", "motion.gamma": 0.6, "geometry.inlet_diffusion": True}, TINY
    ),
    "dose windows": lambda _: zone(
        {**SHORT, "geometry.inlet.tma.windows": [["0.1 s", "0.333 s"], ["0.5 s", "0.72 s"]]}, TINY
    ),
    "periodic solids": lambda _: zone(
        {**SHORT, "time.end": "12 s", "geometry.bed_inflow": "periodic", "time.step": "20 ms", "output.every": "2 s"}, TINY
    ),
    "walls at the ends": lambda _: zone({**RESOLVED, "geometry.periodic": False}, TINY),
    "bed moving backwards": lambda folder: zone(
        {**SHORT, "time.end": "4 s", "motion.profile": backwards(folder)}, {**TINY, "geometry.cell_width": "1 mm"}
    ),
    "inlets in the roof": lambda _: zone(
        {
            **SHORT, "geometry.inlet.purge.side": "top", "geometry.inlet.tma.side": "top",
            "geometry.outlet.zone1.side": "bottom",
        },
        TINY,
    ),
    "partly titrated solids": lambda _: zone(
        {**SHORT, "material.glass_beads.initial_coverage": {"OH": 0.3, "OAl(CH3)2": 0.7}}, TINY
    ),
    "every species its own diffusivity": lambda _: cycle(
        {
            **SHORT, "time.end": "3 s",
            "gas.diffusivity": {"TMA": "1e-5 m^2/s", "H2O": "4e-5 m^2/s", "CH4": "3e-5 m^2/s", "Al(OH)3": "8e-6 m^2/s"},
        },
        TINY,
    ),
    "high dose, long steps": lambda _: cycle(
        {
            **SHORT, "time.end": "10 s", "time.step": "100 ms", "output.every": "1 s",
            "geometry.inlet.tma.mass_fractions.TMA": 1e-2, "geometry.inlet.water.mass_fractions.H2O": 3.75e-3,
        },
        TINY,
    ),
}  # fmt: skip


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_conserves(mode: str, tmp_path: Path) -> None:
    """Fails when a mode of operation breaks a balance or a bound, or does not do anything."""
    reactor, result = run(MODES[mode](tmp_path))
    tma = result.summary["species"]["TMA"]
    assert tma["fed"] > 0.0 and tma["reacted"] > 0.0
    assert reactor.time == reactor.case.time.end
    if mode == "bed moving backwards":
        assert reactor.system.coverage.shifted < -60 and reactor.system.bed_motion.mean == pytest.approx(
            -0.02, rel=1e-3
        )
    if mode == "ports that reverse in the lab":
        assert reactor.system.transport.ledger.passed.back.sum() > 0.0, "no outlet drew gas back in"
    if mode == "dose windows":
        feed = reactor.case.feed_concentrations({"TMA": 2e-4})["TMA"]
        assert tma["fed"] == pytest.approx(0.035 * 4e-3 * feed * (0.233 + 0.22), rel=1e-9)
    if mode == "inlet diffusion":
        feed = reactor.case.feed_concentrations({"TMA": 2e-4})["TMA"]
        assert tma["fed"] > 1.02 * 0.035 * 4e-3 * feed * reactor.time
    if mode == "high dose, long steps":
        assert result.summary["species"]["Al(OH)3"]["produced"] > 0.0


def shifted_columns(reactor: Reactor, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """By how many columns the bed moves in each step from now on."""
    slide, shifts = reactor.system.coverage.slide, list[int]()

    def counted(distance: float) -> int:
        shifts.append(slide(distance))
        return shifts[-1]

    monkeypatch.setattr(reactor.system.coverage, "slide", counted)
    return shifts


def test_bed_swings_backwards_within_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when columns that shift back and forth within each cycle lose their coverage: a swing of 1 mm, narrower columns."""
    changes = {
        **RESOLVED,
        "time.end": "0.3 s",
        "time.steps_per_cycle": 16,
        "motion.gamma": 0.9,
        "motion.bed_velocity": "1 mm/s",
    }
    reactor = Reactor(zone(changes, {**TINY, "geometry.cell_width": "0.7 mm"}), MPI.COMM_SELF)
    shifts = shifted_columns(reactor, monkeypatch)
    reactor.run(callback=assert_laws)
    assert shifts.count(-1) >= 4 and shifts.count(1) >= 4


def test_averaged_bed_does_not_shake(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the bed of an averaged run follows the vibration, which its steps sample at random: some columns would stay in a cell
    several times as long as their neighbours, and stripes of single columns would cross the coverage. Here one must pass in two steps."""
    case = zone({**SHORT, "time.end": "0.5 s"}, {**TINY, "geometry.cell_width": "0.34 mm"})
    reactor = Reactor(case, MPI.COMM_SELF)
    assert 2.0 * reactor.system.bed_motion.vibration.ax > 0.9 * reactor.grid.dx  # it would shake by a column
    shifts = shifted_columns(reactor, monkeypatch)
    reactor.run(callback=assert_laws)
    sliding = shifts[reactor.system.schedule.resting_steps :]
    assert len(sliding) > 30 and sliding == [k % 2 for k in range(len(sliding))]
    assert reactor.system.coverage.distance == pytest.approx(0.013 * (reactor.time - 0.05), rel=1e-12)


def test_both_precursors_and_their_reaction_in_the_gas() -> None:
    """Fails when TMA and water, fed side by side, do not conserve while all three reactions run; Al(OH)3 must come from CVD alone."""
    case = cycle({"time.end": "20 s", "time.step": "20 ms", "output.every": "2 s"})
    _, result = run(case)
    species, cvd = result.summary["species"], result.summary["cvd"]
    assert cvd["rate_mean"] > 0.0
    assert sum(cvd["share_in_zone"].values()) == pytest.approx(1.0)
    assert species["Al(OH)3"]["produced"] > 0.0
    water_on_surface = species["H2O"]["reacted"] - 3.0 * species["Al(OH)3"]["produced"]
    tma_on_surface = species["TMA"]["reacted"] - species["Al(OH)3"]["produced"]
    assert species["CH4"]["produced"] == pytest.approx(
        tma_on_surface + 4.0 / 3.0 * water_on_surface + 3.0 * species["Al(OH)3"]["produced"], rel=1e-10
    )
    assert result.summary["film"]["Al2O3"]["amount"] == pytest.approx(water_on_surface / 3.0, rel=1e-10)
    # with equal diffusivities TMA + CH4 + 4/3 H2O + 2 Al(OH)3 is untouched by all three reactions: it stays what the inlets feed
    c = {n: result.field(f"C_{n}") for n in ("TMA", "CH4", "H2O", "Al(OH)3")}
    whole = c["TMA"] + c["CH4"] + 4.0 / 3.0 * c["H2O"] + 2.0 * c["Al(OH)3"]
    feed = {n: case.feed_concentrations({n: y})[n] for n, y in (("TMA", 2e-4), ("H2O", 7.5e-5))}
    assert whole.max() < max(feed["TMA"], 4.0 / 3.0 * feed["H2O"]) * (1 + 1e-9)


def test_a_combination_that_no_reaction_touches() -> None:
    """Fails when transport and sources of any species disagree: TMA + CH4 + 4/3 H2O + 2 Al(OH)3 must follow a run with inert gas alone."""
    changes = {"time.end": "4 s", "time.step": "20 ms", "output.every": "1 s"}
    case = cycle(changes, TINY)
    _, reacting = run(case)
    feed = {n: case.feed_concentrations({n: y})[n] for n, y in (("TMA", 2e-4), ("H2O", 7.5e-5))}
    # feed methane instead, in the same amounts of the combination: nothing reacts
    inert: dict[str, np.ndarray] = {}
    for inlet, name, weight in (("tma", "TMA", 1.0), ("water", "H2O", 4.0 / 3.0)):
        other = {"tma": "water", "water": "tma"}[inlet]
        replaced = {
            f"geometry.inlet.{inlet}.mass_fractions": {"TMA": 0.0, "H2O": 0.0, "CH4": 1e-4},
            f"geometry.inlet.{other}.mass_fractions": {"TMA": 0.0, "H2O": 0.0},
        }
        methane = case.with_(replaced)
        _, result = run(methane)
        fed = methane.feed_concentrations({"CH4": 1e-4})["CH4"]
        inert[inlet] = result.field("C_CH4") * weight * feed[name] / fed
    c = {n: reacting.field(f"C_{n}") for n in ("TMA", "CH4", "H2O", "Al(OH)3")}
    whole = c["TMA"] + c["CH4"] + 4.0 / 3.0 * c["H2O"] + 2.0 * c["Al(OH)3"]
    np.testing.assert_allclose(whole, inert["tma"] + inert["water"], atol=1e-8 * whole.max())


def test_a_third_kind_of_site_changes_nothing_when_nothing_makes_it() -> None:
    """Fails when the general solver for three kinds of sites and the closed form for two give different runs."""
    changes = {"time.end": "2 s", "time.step": "20 ms", "output.every": "1 s"}
    _, two = run(cycle(changes, TINY))
    reactor, three = run(cycle({**changes, "chemistry.site.inert.formula": "O"}, TINY))
    assert len(reactor.system.coverage.theta) == 3
    assert_same_numbers(two.summary, three.summary, 1e-8)


# --- fidelities ---


@pytest.mark.slow
def test_averaged_agrees_with_resolved() -> None:
    """Fails when the steps of the shipped case in the mean flow titrate otherwise than 32 steps per cycle in the periodic one: mean
    coverage of the bed and of the box at t = 20 s within 0.02."""
    means = {}
    for fidelity in ("averaged", "resolved"):
        _, result = run(zone({"fidelity": fidelity, "output.every": "5 s"}, TINY))
        means[fidelity] = np.array(
            [result.coverage("bed", "OAl(CH3)2").mean(), result.summary["titration"]["tma"]["box_mean"]]
        )
    assert (
        means["averaged"].min() > 0.2 and means["averaged"].max() < 0.95
    )  # neither fresh nor done: the comparison says something
    np.testing.assert_allclose(means["averaged"], means["resolved"], rtol=0.0, atol=0.02)


@pytest.mark.parametrize(("mass_fraction", "untitrated"), [(1e-4, True), (1e-3, False)])
def test_top_of_the_bed_at_the_exit(mass_fraction: float, untitrated: bool) -> None:
    """Fails when Y = 1e-4 (0.896 molecules per site) does not leave a thin untitrated top layer at the exit, or 1e-3 (8.96) leaves one."""
    changes = {
        "geometry.inlet.tma.mass_fractions.TMA": mass_fraction,
        "output.every": "5 s",
        "time.step": "20 ms",
    }
    _, result = run(zone(changes))
    profile = result.summary["titration"]["tma"]["exit_profile"]
    assert result.summary["excess_number"]["tma"] == pytest.approx(mass_fraction / 1e-4 * 0.896, rel=1e-2)
    if untitrated:
        assert profile[-1] < 0.5 and min(profile[:-1]) > 0.97, profile
    else:
        assert min(profile) > 0.9999, profile


def test_steps_of_the_averaged_run_converge() -> None:
    """Fails when the averaged result depends on its step: 40, 20 and 10 ms agree to what half a column (2.5 mm) of slide may change."""
    means = []
    for step in ("40 ms", "20 ms", "10 ms"):
        _, result = run(zone({"time.end": "8 s", "time.step": step, "output.every": "4 s"}, TINY))
        means.append(result.summary["titration"]["tma"]["box_mean"])
    assert max(means) - min(means) < 0.005, means


# --- what a run hands back ---


def test_result_and_callback() -> None:
    """Fails when the callback misses an output time, the history lacks a row or column, or fields have the wrong shape or name."""
    times: list[float] = []
    reactor = Reactor(zone(SHORT, TINY), MPI.COMM_SELF)
    result = reactor.run(callback=lambda r: times.append(r.time))
    late = np.array(times) - [0.0, 0.25, 0.5, 0.75, 1.0]  # the first step that reaches the output time
    assert late.min() >= -1e-9 and late.max() < reactor.system.schedule.dt
    assert result.history["time"].tolist() == times
    for column in (
        "titration.tma.box_mean",
        "outlets.zone1.x.CH4",
        "cvd.rate_mean",
        "balance.TMA",
        "balance.sites",
    ):
        assert column in result.history
    grid = reactor.grid
    assert result.field("C_TMA").shape == (grid.rows, grid.columns)
    assert result.field("velocity").shape == (grid.rows, grid.columns, 2)
    assert result.coverage("bed", "OH").shape == (3, grid.columns)
    fractions = sum(result.field(f"x_{n}") for n in ("TMA", "H2O", "CH4", "Al(OH)3", "N2"))
    np.testing.assert_allclose(fractions, 1.0, rtol=1e-12)
    assert all(np.isfinite(v) for v in physical_numbers(result.summary).values())
    assert result.summary["flow"]["mass_error"] < 1e-10


def test_outlet_fractions_are_flux_weighted() -> None:
    """Fails when the mole fractions reported at the outlet, times its volume flow, do not add up to what left, or the summary has others
    than the last row of the history."""
    reactor, result = run(zone({**SHORT, "time.end": "2 s"}, TINY))
    molar = reactor.case.gas.pressure / (8.31446261815324 * reactor.case.gas.temperature)
    flow = result.summary["flow"]["outflow"]
    dt = np.diff(result.history["time"])
    for name in ("TMA", "CH4"):
        assert (
            result.summary["outlets"]["zone1"]["x"][name]
            == result.history[f"outlets.zone1.x.{name}"][-1]
            > 0.0
        )
        left = (result.history[f"outlets.zone1.x.{name}"][1:] * molar * flow * dt).sum()
        assert left == pytest.approx(result.summary["species"][name]["left"], rel=0.03, abs=1e-14)


# --- steps that fail ---


def test_newton_knows_what_rounding_allows() -> None:
    """Fails when the accepted residual lies below what rounding leaves of it: rows of 0.0125 mm, between which diffusion carries a
    million times what is fed."""
    run(zone(SHORT, {**TINY, "geometry.layer.plenum.cells": 400}))


def test_a_failed_step_is_halved(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a step whose solver gives up is not repeated in halves from the state before it, coverage included."""
    solve, calls = StepMatrix.solve, {"n": 0}

    def sometimes(self: StepMatrix, *arguments: Any) -> Any:
        calls["n"] += 1
        if calls["n"] % 7 == 3:  # after Newton has succeeded
            raise ConvergenceError("linear solver, on purpose")
        return solve(self, *arguments)

    monkeypatch.setattr(StepMatrix, "solve", sometimes)
    reactor, halved = run(zone(SHORT, TINY))
    assert calls["n"] > 1.3 * reactor.steps
    monkeypatch.undo()
    _, whole = run(zone(SHORT, TINY))
    for key in ("fed", "reacted"):
        assert halved.summary["species"]["TMA"][key] == pytest.approx(
            whole.summary["species"]["TMA"][key], rel=2e-3
        )


def test_newton_failure_keeps_the_last_good_state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Fails when a run whose Newton iteration gives up raises another error than ConvergenceError (naming system, step and residual),
    loses the last good state, or cannot be resumed to the result of an undisturbed run."""
    case = zone({**SHORT, "output.every": "0.1 s"}, TINY)
    _, undisturbed = run(case, output=tmp_path / "undisturbed")
    reactor = Reactor(case, MPI.COMM_SELF)

    def spoil(r: Reactor) -> None:
        if r.time > 0.55:
            monkeypatch.setattr(mpm.transport.species, "NEWTON_LIMIT", 1)

    with pytest.raises(ConvergenceError, match=r"step 4\d.*t = 0\.\d+ s.*TMA.*Newton.*residual"):
        reactor.run(output=tmp_path / "failed", callback=spoil)
    assert_laws(reactor)
    assert 0.55 < reactor.time < 0.75
    monkeypatch.undo()
    _, resumed = run(case, output=tmp_path / "failed", resume=True)
    assert_same_numbers(undisturbed.summary, resumed.summary, 1e-12)
    np.testing.assert_array_equal(undisturbed.history["time"], resumed.history["time"])


AVERAGED_IMPULSE = {**SHORT, "motion.gamma": 0.0, "motion.startup": "impulsive"}


def test_a_transient_takes_no_flow_of_another_run() -> None:
    """Fails when a run that begins from rest replays the developed flow that it is handed, its steps and forcing being the same."""
    developed = Reactor(zone(AVERAGED_IMPULSE, TINY), MPI.COMM_SELF).flow
    with pytest.raises(InputError, match="another fidelity"):
        Reactor(zone({**AVERAGED_IMPULSE, "fidelity": "resolved"}, TINY), MPI.COMM_SELF, flow=developed)


@pytest.mark.parallel
def test_flow_of_other_ranks_is_refused() -> None:
    """Fails when a reactor takes the flow of one that is spread over other ranks for that of its own cells."""
    case = zone(SHORT, TINY)
    flow = Reactor(case, MPI.COMM_WORLD).flow
    assert Reactor(case, MPI.COMM_WORLD, flow=flow).flow.sequence is flow.sequence
    if MPI.COMM_WORLD.size > 1:
        with pytest.raises(InputError, match="other ranks"):
            Reactor(case, MPI.COMM_SELF, flow=flow)


@pytest.mark.parametrize("fidelity", ["averaged", "steady"])
def test_a_reactor_runs_once(fidelity: str) -> None:
    """Fails when a second run of a reactor goes on where the first one ended and reports balances and rates that count from there."""
    reactor = Reactor(zone({**SHORT, "fidelity": fidelity}, TINY), MPI.COMM_SELF)
    reactor.run()
    with pytest.raises(InputError, match="has run"):
        reactor.run()
