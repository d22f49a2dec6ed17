"""A bed that moves to the left: everything is the mirror image of the same bed moving to the right in the mirrored strip."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case
from mpm.mesh.grid import Grid
from mpm.mesh.strip import Strip
from mpm.motion.schedule import Schedule
from mpm.output.results import load_run
from mpm.parallel import on_root
from mpm.pictures.curves import exits
from mpm.pictures.outline import way
from mpm.reactor.reactor import Reactor
from mpm.transport.coverage import Coverage

from .cases import MPI, SHORT, TINY, assert_same_numbers, cycle, run, zone

STEADY = {"fidelity": "steady"}
TMA = "geometry.inlet.tma.mass_fractions.TMA"


def conveyed(case: Case, speed: float, folder: Path) -> Case:
    """`case` with a bed that a profile moves at a constant `speed` [m/s]; collective, rank 0 writes the file."""
    path = folder / f"profile_{speed:g}.csv"
    rows = "".join(f"{phase},{speed}\n" for phase in (0, 90, 180, 270))
    on_root(MPI.COMM_WORLD, lambda: path.write_text(f"phase_deg,u_x_m/s\n{rows}"))
    return case.with_({"motion.profile": str(path)})


def mirrored(case: Case) -> Case:
    """`case` with its ports and zones seen from behind."""
    geometry = case.geometry
    length = geometry.length
    changes: dict[str, Any] = {
        f"geometry.{kind}.{port.name}.center": f"{length - port.center!r} m"
        for kind, ports in (("inlet", geometry.inlets), ("outlet", geometry.outlets))
        for port in ports
    }
    changes["geometry.zone"] = [
        {"name": z.name, "start": f"{length - z.end!r} m", "end": f"{length - z.start!r} m", "inlet": z.inlet}
        for z in geometry.zones
    ]
    return case.with_(changes)


def reversed_x(summary: Mapping[str, Any]) -> dict[str, Any]:
    """`summary` with the one number that has a sign along x seen from behind."""
    flow = dict(summary["flow"])
    x, y = flow["bed_superficial_velocity"]
    return {**summary, "flow": {**flow, "bed_superficial_velocity": [-x, y]}}


@pytest.mark.parametrize("kind", [zone, cycle])
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param(STEADY, id="steady", marks=pytest.mark.parallel),
        pytest.param({**STEADY, "geometry.bed_inflow": "periodic"}, id="periodic"),
        pytest.param({**SHORT, TMA: 1e-3}, id="averaged"),
    ],
)
def test_mirror_image(kind: Any, changes: dict[str, Any], tmp_path: Path) -> None:
    """Fails when any number or field of a bed that moves to the left differs by more than 1e-10 from the mirror image of one that moves
    to the right (1e-8 on several ranks): entry, exit, box, fronts, film, dose ratio, utilisation, balances."""
    tolerance = 1e-10 if MPI.COMM_WORLD.size == 1 else 1e-8
    case = kind(changes, TINY)
    _, right = run(conveyed(case, 0.013, tmp_path), MPI.COMM_WORLD)
    _, left = run(conveyed(mirrored(case), -0.013, tmp_path), MPI.COMM_WORLD)
    if kind is cycle:  # the zone grows no film
        assert "per_area" in right.summary["film"]["Al2O3"]
    assert_same_numbers(right.summary, reversed_x(left.summary), tolerance)
    for name in ("C_TMA", "theta_OH"):
        a, b = right.field(name), left.field(name)[:, ::-1]
        np.testing.assert_allclose(b, a, rtol=0.0, atol=tolerance * a.max())


def test_solids_leave_at_the_left(tmp_path: Path) -> None:
    """Fails when a steady bed that moves to the left counts as at rest, or when its exit is not where it leaves: what is taken up, and no
    more, leaves at the first column."""
    case = conveyed(zone({**STEADY, TMA: 2e-4}), -0.013, tmp_path)
    _, result = run(case)
    tma, titration = result.summary["species"]["TMA"], result.summary["titration"]["tma"]
    taken_up = result.summary["dose_ratio"]["tma"] * (1.0 - tma["left"] / tma["fed"])
    assert 0.3 < tma["reacted"] / tma["fed"] < 0.9
    assert titration["exit_mean"] == pytest.approx(taken_up, abs=1e-8)
    bed = result.coverage("bed", "OAl(CH3)2")
    np.testing.assert_allclose(titration["exit_profile"], bed[:, 0], rtol=1e-12)
    assert bed[:, -1].mean() < bed[:, 0].mean()
    centres = result.grid.centres
    assert titration["box_mean"] == pytest.approx(bed[:, centres > case.geometry.inlets[1].center].mean())


@pytest.mark.slow
def test_long_time_limit_of_averaged(tmp_path: Path) -> None:
    """Fails when the mean coverage of a bed that moves to the left is more than 0.002 from where an averaged run on the same mesh ends
    (see the test of this name in test_steady.py)."""
    site = "OAl(CH3)2"
    changes: dict[str, Any] = {TMA: 2e-4}
    _, steady = run(conveyed(zone({**changes, **STEADY}), -0.05, tmp_path))
    leaving = steady.coverage("bed", site)
    entering = np.concatenate([leaving[:, 1:], np.zeros((len(leaving), 1))], axis=1)
    changes |= {"time.end": "16 s", "output.every": "10 ms"}
    changes |= {"material.sintered_powder.initial_coverage": {"OH": 0.0, site: 1.0}}
    averaged = Reactor(conveyed(zone(changes), -0.05, tmp_path), MPI.COMM_SELF)
    means: list[float] = []
    averaged.run(callback=lambda r: means.append(float(r.coverage("bed", site).mean())))
    assert 0.5 * (leaving + entering).mean() == pytest.approx(np.mean(means[-100:]), abs=0.002)


def test_resolved_bed_that_creeps_to_the_left(tmp_path: Path) -> None:
    """Fails when a bed that swings with the reactor and creeps to the left has no film per area, or has its exit on the right."""
    path = tmp_path / "uphill.csv"
    velocity = [-0.013 + 0.01 * np.cos(np.radians(phase)) for phase in range(0, 360, 10)]
    rows = [f"{10 * k},{u!r}" for k, u in enumerate(map(float, velocity))]
    path.write_text("\n".join(["phase_deg,u_x_m/s", *rows, ""]))
    changes = {
        **SHORT,
        "fidelity": "resolved",
        "motion.profile": str(path),
        "geometry.inlet.water.start": "0 s",
    }
    reactor, result = run(cycle({**changes, "output.every": "0.5 s"}, TINY))
    assert reactor.system.coverage.distance == pytest.approx(-0.013 * (1.0 - 0.05), rel=0.02)
    assert result.summary["film"]["Al2O3"]["per_area"] > 0.0
    exit_profile = result.summary["titration"]["tma"]["exit_profile"]
    np.testing.assert_array_equal(exit_profile, result.coverage("bed", "OAl(CH3)2")[:, 0])


def test_pictures_follow(tmp_path: Path) -> None:
    """Fails when the pictures of a bed that moves to the left say otherwise, or take another column than the summary for the exit."""
    case = conveyed(cycle(STEADY, TINY), -0.013, tmp_path)
    Reactor(case, MPI.COMM_SELF).run(tmp_path / "run")
    found = load_run(tmp_path / "run")
    grid = Grid.from_case(case)
    firsts = [int(np.flatnonzero(grid.zone_of_column == number)[0]) for number in (1, 2)]
    assert [column for *_, column in exits(found)] == firsts
    assert way(case) == " (the bed moves to the left)"
    assert way(conveyed(case, 0.013, tmp_path)) == " (the bed moves to the right)"
    assert way(case.with_({"motion.gamma": 0.0, "motion.bed_velocity": "0 m/s"})) == ""


@pytest.mark.parametrize("steps", [1, 2, 4, 5])
def test_columns_shift_alike_in_both_directions(steps: int, tmp_path: Path) -> None:
    """Fails when the bed slides by a column at another step to the left than to the right, half a column being met exactly."""
    case = zone({}, TINY)
    strip = Strip(case, MPI.COMM_SELF)
    right, left = Coverage(case, strip), Coverage(case, strip)
    way_of_a_step = strip.grid.dx / steps
    shifts = [(right.slide(way_of_a_step), left.slide(-way_of_a_step)) for _ in range(3 * steps)]
    assert all(a == -b for a, b in shifts)
    assert sum(a for a, _ in shifts) in (2, 3)


def test_steps_fit_the_columns_in_both_directions(tmp_path: Path) -> None:
    """Fails when the step of a bed that moves to the left is not aligned with its shifts as that to the right is."""
    case = zone(SHORT)
    left, right = conveyed(case, -0.013, tmp_path), conveyed(case, 0.013, tmp_path)
    assert Schedule.from_case(left).dt == Schedule.from_case(right).dt != case.time.step
