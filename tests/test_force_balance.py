"""`motion.profile = "force_balance"`: a case whose bed moves as weight, gas and friction make it."""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.advice.checks import check_case
from mpm.advice.doses import doses_of
from mpm.advice.idle import idle_keys
from mpm.case.balance import forces_on_bed, through_flow
from mpm.case.case import Case, load_case
from mpm.case.motion import Motion
from mpm.cli import main
from mpm.errors import InputError
from mpm.motion.kinematics import BedMotion, step_motion
from mpm.optimise import Search
from mpm.reactor.reactor import Reactor
from mpm.report.dosing import excess_numbers
from mpm.report.trees import flatten
from mpm.sweep.plan import plan
from mpm.sweep.sweepfile import read_sweep

from .cases import TINY, run, zone

FORCES: dict[str, Any] = {"motion.profile": "force_balance"}
PORTS = 2 * 0.035 * 4e-3 / 0.1397
OWN = {"porosity": 0.5, "particle_diameter": "50 um"}
LOW = {"name": "low", "side": "bottom", "center": "20 mm", "width": "3 mm"}
BOTH = {"geometry.outlet": [LOW, {"name": "high", "center": "20 mm", "width": "3 mm"}]}
HOPS = {
    "motion.gamma": 4.0,
    "motion.angle": "30 deg",
    "motion.through_velocity": "0 cm/s",
    "material.glass_beads.permeability": "1e-3 m^2",
}
"""Thrown high, and no gas to brake its flights."""
BELOW = {"geometry.outlet": [LOW], "geometry.inlet.tma.side": "top"}


def base(**changes: Any) -> Case:
    """The single zone with the bed under its own forces; keys of [motion] by name."""
    return load_case("single_zone", FORCES | {f"motion.{key}": value for key, value in changes.items()})


def test_the_balance_is_that_of_the_case() -> None:
    """Fails when mass, resistance or through-flow of the base bed are not m = rho (1 - eps) h, R = mu h/K, ports over area."""
    case = base()
    forces = forces_on_bed(case.motion, case.geometry, case.gas)
    assert forces is not None
    assert forces.weight == pytest.approx(39.7305, rel=1e-9)
    assert forces.resistance == pytest.approx(12141.18, rel=1e-6)
    assert forces.through_flow == pytest.approx(PORTS, rel=1e-12) and forces.lag == 0.0
    upright = case.with_(
        {"material.glass_beads.permeability": ["8.5 um^2", "4.25 um^2"]}
    )  # along and through
    across = forces_on_bed(upright.motion, upright.geometry, upright.gas)
    assert across is not None and across.resistance == pytest.approx(forces.resistance, rel=1e-12)
    assert 100.0 * case.motion.mean_velocity == pytest.approx(0.508, abs=5e-4)
    prescribed = load_case("single_zone")
    ratio = prescribed.motion.mean_velocity / case.motion.mean_velocity
    slower = excess_numbers(case)["tma"] / excess_numbers(prescribed)["tma"]
    assert slower == pytest.approx(ratio, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "velocity", "lag"),
    [
        ({}, PORTS, 0.0),
        ({"motion.gas_column": "lab"}, PORTS, 1.0),
        ({"motion.inlet_frame": "lab", "fidelity": "resolved"}, PORTS, 8e-3 / 0.1397),
        ({"motion.through_velocity": "0.1 cm/s"}, 1e-3, 0.0),
        ({"motion.through_velocity": "-0.1 cm/s"}, -1e-3, 0.0),
        (BELOW, -0.5 * PORTS, 0.0),
        ({"energy.initial_temperature": "473 K", "geometry.inlet.tma.temperature": "236.5 K"}, 1.5 * PORTS, 0.0),
    ],
)  # fmt: skip
def test_gas_that_passes_the_bed(changes: dict[str, Any], velocity: float, lag: float) -> None:
    """Fails when the through-flow or what of the reactor's velocity it lags is not what ports and keys say."""
    case = load_case("single_zone", FORCES | changes)
    flow = through_flow(case.motion, case.geometry, case.gas)
    assert flow is not None
    assert flow.velocity == pytest.approx(velocity, rel=1e-3) and flow.lag == pytest.approx(lag, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"motion.through_velocity": "0.4 cm/s"}, "force_balance with 0.4 cm/s of gas through the bed, 1.22 times what carries it"),
        ({"motion.gamma": 1e6}, "force_balance at gamma = 1e+06: the bed does not come down within 100 cycles"),
        (HOPS, "no cycle of the bed is like the one before"),
        ({"geometry.layer.bed.moving": False}, "motion.profile: found force_balance, and no layer that moves"),
        (BOTH, "motion.through_velocity: found nothing, and outlets on both sides"),
        ({"material.mine": OWN, "geometry.layer.bed.material": "mine"}, "material.mine.density: found nothing"),
        ({"motion.friction": 0}, "motion.friction: found 0"),
        ({"motion.adhesion": "-1 Pa"}, "motion.adhesion: found '-1 Pa'"),
    ],
)  # fmt: skip
def test_what_has_no_balance_is_one_line(changes: dict[str, Any], text: str) -> None:
    """Fails when a case without such a motion is accepted, or refused with other words."""
    with pytest.raises(InputError) as error:
        load_case("single_zone", FORCES | changes)
    assert text in str(error.value) and "\n" not in str(error.value)


def test_with_outlets_on_both_sides_the_typed_velocity_counts() -> None:
    """Fails when a case that says how much gas rises is refused for its outlets, or one that nothing shakes, where none is asked for."""
    assert load_case("single_zone", FORCES | BOTH | {"motion.gamma": 0.0}).motion.mean_velocity == 0.0
    case = load_case("single_zone", FORCES | BOTH | {"motion.through_velocity": f"{PORTS!r} m/s"})
    assert case.motion.mean_velocity == pytest.approx(base().motion.mean_velocity, rel=1e-9)


def test_a_resolved_case_moves_the_same() -> None:
    """Fails when the case that a run writes has another motion, or one with a bed_velocity that nothing reads; or others grow keys."""
    case = base(
        friction=0.3, gas_column="lab", adhesion="2 Pa", through_velocity="0.1 cm/s", bed_velocity="2 cm/s"
    )
    again = load_case(case.to_dict())
    assert again == case and again.motion.mean_velocity == case.motion.mean_velocity
    assert "bed_velocity" not in case.to_dict()["motion"]
    assert not {"friction", "adhesion", "gas_column"} & set(load_case("single_zone").to_dict()["motion"])
    assert case.content_hash() != case.with_({"motion.friction": 0.4}).content_hash()


def test_nothing_vibrates_and_the_bed_rests() -> None:
    """Fails when a bed that nothing shakes is conveyed, at bed_velocity or otherwise."""
    case = base(gamma=0.0, bed_velocity="1 cm/s")
    assert case.motion.mean_velocity == 0.0 and BedMotion(case.motion).at(1.0) == 0.0


def test_a_motion_alone_has_no_forces() -> None:
    """Fails when a table [motion] without its case, whose forces nobody has worked out, gives a speed."""
    with pytest.raises(ValueError, match="those of a case"):
        _ = Motion(profile="force_balance").mean_velocity


def test_keys_without_effect() -> None:
    """Fails when a key that forces leave nothing to say, or that only they read, is not named, or one that they read is."""
    forced = base(
        friction=0.3, angle="50 deg", gamma=0.4, bed_velocity="1 cm/s", liftoff_velocity="-0.3 cm/s"
    )
    told = " ".join(idle_keys(forced))
    assert "motion.bed_velocity" in told and "motion.liftoff_velocity" in told
    assert not any(key in told for key in ("friction", "angle", "gamma"))
    assert "motion.friction: motion.profile is not force_balance" in idle_keys(
        load_case("single_zone", {"motion.friction": 0.3})
    )
    still = load_case("single_zone", {"motion.gamma": 0.0, "motion.friction": 0.3})
    assert " ".join(idle_keys(still)).count("motion.friction") == 1
    both = base(through_flow="local", through_velocity="0.1 cm/s")
    assert any("motion.through_flow" in sentence for sentence in idle_keys(both))


@pytest.mark.parametrize("gamma", [0.30, 0.45, 0.60])
def test_steps_add_up_to_the_cycle(gamma: float) -> None:
    """Fails when means over steps, few or many, do not add up to the mean velocity, or are not the velocity of the bed."""
    case = base(gamma=gamma)
    bed, period, balance = BedMotion(case.motion), 1.0 / 16.0, case.motion.balance
    assert balance is not None
    for n in (4, 32, 1000):
        edges = np.linspace(period, 2 * period, n + 1)
        steps = [step_motion(bed, a, b) for a, b in pairwise(edges)]
        assert sum(s.slide for s in steps) == pytest.approx(case.motion.mean_velocity * period, rel=1e-9)
    for index in (100, 400, 700):
        phase = 2 * math.pi * (index + 0.5) / 1000
        relative = balance.velocity(phase) - bed.vibration.velocity(phase / bed.vibration.omega)[0]
        assert steps[index].bed_velocity == pytest.approx(relative, abs=1e-5)


@pytest.mark.parametrize("fidelity", ["resolved", "averaged", "steady"])
@pytest.mark.parametrize("gamma", [0.05, 0.3, 0.6])
def test_all_fidelities_run(fidelity: str, gamma: float) -> None:
    """Fails when a bed that rests, slides or flies breaks a law, or its way is not that of the forces."""
    changes = FORCES | {
        "fidelity": fidelity, "motion.gamma": gamma, "time.end": "0.3 s", "output.every": "0.1 s", "time.steps_per_cycle": 16,
    }  # fmt: skip
    case = zone(changes, TINY)
    reactor, _ = run(case)
    assert (case.motion.mean_velocity == 0.0) == (gamma == 0.05)
    if fidelity == "resolved":
        assert reactor.totals().slid == pytest.approx(BedMotion(case.motion).at(0.25), abs=1e-9)


def test_most_that_rises_above_a_port_carries_more() -> None:
    """Fails when `local` is not the estimate of `mpm check`, which in a narrow plenum is more than the mean, or gas that comes in cold does
    not expand."""
    narrow = load_case(
        "single_zone", FORCES | {"geometry.layer.plenum.height": "0.19 mm", "motion.through_flow": "local"}
    )
    flow = through_flow(narrow.motion, narrow.geometry, narrow.gas)
    assert flow is not None
    assert flow.velocity == check_case(narrow)["bed"]["gas_velocity"] > 1.5 * PORTS
    cold = {f"geometry.inlet.{name}.temperature": "430 K" for name in ("tma", "purge")}
    even = load_case("single_zone", FORCES | cold | {"energy": {}, "motion.through_flow": "local"})
    expanded = through_flow(even.motion, even.geometry, even.gas)
    assert expanded is not None
    assert expanded.velocity == pytest.approx(PORTS * 473.0 / 430.0, rel=1e-3)


def test_what_a_prescribed_flight_would_take() -> None:
    """Fails when the preset's flight is not said to need -283 to +428 Pa on 39.7 Pa, or is where nothing is known or nothing flies so."""
    resolved = load_case("single_zone", {"fidelity": "resolved"})
    report = check_case(resolved)
    (told,) = [w for w in report["warnings"] if "gas force" in w]
    assert "-283 to 428 Pa" in told and "39.7 Pa" in told and "\n" not in told
    motion, peak = report["motion"], 0.3 * 9.81 / (2 * math.pi * 16)
    resistance = 1.72e-5 * 3e-3 / 4.25e-12
    assert motion["flight_force_max"] == pytest.approx(resistance * (PORTS + peak + 0.004), rel=1e-9)
    assert motion["flight_force_min"] == pytest.approx(resistance * (PORTS - peak + 0.004), rel=1e-9)
    own = {"material.mine": OWN, "geometry.layer.bed.material": "mine"}
    for quiet in (own, FORCES, {"fidelity": "averaged"}, {"motion.gamma": 0.0}):
        found = check_case(resolved.with_(quiet))
        assert not any("gas force" in w for w in found["warnings"]), quiet
    assert "flight_force_max" in check_case(load_case("single_zone"))["motion"]
    by_phases = {
        "motion.profile": "phases",
        "motion.liftoff_phase": "89 deg",
        "motion.contact_phase": "91 deg",
    }
    assert not any("gas force" in w for w in check_case(resolved.with_(by_phases))["warnings"])


def test_check_says_what_the_bed_does(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the report or the screen of `mpm check` lack phases, gap, forces, share of the gas or through-flow."""
    case = base(gamma=0.45)
    motion = check_case(case)["motion"]
    kinds = [phase["kind"] for phase in motion["phases"]]
    assert kinds == ["stick", "slide", "flight", "slide", "stick"]
    assert math.degrees(motion["liftoff_phase"]) == pytest.approx(59.4443, abs=1e-4)
    assert motion["gap"] == pytest.approx(1.4354e-6, rel=1e-4)
    assert motion["contact_force_min"] == 0.0
    assert motion["contact_force_max"] == pytest.approx(33.27, abs=5e-3)
    assert set(motion["rising_velocity"]) == {"purge", "tma"}
    assert (
        main(["check", "single_zone", "--set", "motion.profile=force_balance", "--set", "motion.gamma=0.45"])
        == 0
    )
    screen = capsys.readouterr().out.replace("\u00a0", " ")
    for text in (
        "1.492 cm/s",
        "carries 61.2 % of its weight, 39.7 Pa",
        "from where the reactor passes its mean position upwards",
        "from 59.44 to 153.9 deg",
        "1.44 um",
        "0 to 33.3 Pa",
    ):
        assert text in screen
    assert "motion" not in flatten(Reactor(zone({"fidelity": "steady"}, TINY)).run().summary)


def test_sweeps_and_searches_take_forces(tmp_path: Path) -> None:
    """Fails when friction, gamma and angle are no axes, their cases do not differ in speed, or a search for doses does not take forces."""
    (tmp_path / "s.toml").write_text(
        '[sweep]\ncase = "single_zone"\n[sweep.set]\nfidelity = "steady"\n"motion.profile" = "force_balance"\n'
        + "".join(
            f'[[sweep.axis]]\nkey = "motion.{key}"\nvalues = {values}\n'
            for key, values in (
                ("friction", "[0.3, 0.4]"),
                ("gamma", "[0.0, 0.3]"),
                ("angle", '["30 deg", "60 deg"]'),
            )
        )
    )
    points = plan(read_sweep(tmp_path / "s.toml"))
    speeds = [point.case.motion.mean_velocity for point in points if point.case is not None]
    assert len(speeds) == 8 and speeds.count(0.0) == 4 and len(set(speeds)) == 5
    case = base()
    (fraction, velocity) = doses = doses_of(case, 0.9, velocities=True)
    search = Search(case, doses, 0.9, 0.0)
    values = {fraction.key: 3e-4, velocity.key: 0.05}
    assert (
        search.case_at(values).motion.mean_velocity > case.motion.mean_velocity
    )  # more gas carries more of it
    assert (
        search.point(np.log([3e-4, 0.12])) is None
    )  # and so much carries it away: not a dose, and no end of the search
