"""Profile, fit and the analysis on synthetic records whose answers are known; no LAMMPS."""

import csv
import math
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.case.profile import read_profile
from mpm.dem import analysis, summary
from mpm.dem.base import FLAT, frit_monolayer, loose_filling, sawtooth_baffle, tooth_area
from mpm.dem.case import load_case
from mpm.dem.gas import GasDrag, slab_solids
from mpm.dem.liftoff import acceleration_liftoff, flight_interval
from mpm.dem.powder import POWDERS
from mpm.dem.profile import Profile, conditions, piecewise_fit, scaled_to_mean
from mpm.dem.waveform import Sawtooth, sine
from mpm.errors import InputError
from mpm.physics.fluidisation import minimum_fluidisation_velocity

WAVE = sine(gamma=0.3, frequency=16.0, angle=math.radians(60))
N = 128
PHASE = np.arange(N) * 360.0 / N
BASE = WAVE.velocity(PHASE / 360.0 / 16.0)


def ideal_curve(liftoff: float, contact: float, flight: float) -> Profile:
    flying = (PHASE - liftoff) % 360.0 < (contact - liftoff) % 360.0
    velocity = np.where(flying, np.array([[flight], [-0.004]]), BASE)
    return Profile(phase=PHASE, velocity=velocity, contact=(~flying).astype(float))


def test_fit_recovers_an_ideal_profile() -> None:
    """A curve that is piecewise gives back its phases to a sample and its flight velocity exactly."""
    fit = piecewise_fit(ideal_curve(97.85, 18.71, 0.01435), BASE)
    assert fit.liftoff == pytest.approx(97.85, abs=360 / N)
    assert fit.contact == pytest.approx(18.71, abs=360 / N)
    assert fit.flight[0] == pytest.approx(0.01435) and fit.rms < 1e-12
    # the flight brings the bed back onto the base: no net vertical displacement over a cycle
    assert fit.profile.velocity[1].mean() == pytest.approx(0.0, abs=1e-12)


def test_fit_of_a_noisy_profile_keeps_the_phases() -> None:
    curve = ideal_curve(100.0, 20.0, 0.013)
    noise = np.random.default_rng(2).normal(0, 3e-4, N)
    fit = piecewise_fit(Profile(phase=PHASE, velocity=curve.velocity + noise, contact=curve.contact), BASE)
    assert fit.liftoff == pytest.approx(100.0, abs=8.0) and fit.contact == pytest.approx(20.0, abs=8.0)
    assert fit.flight[0] == pytest.approx(0.013, rel=0.02)


def test_scaling_keeps_the_phases_and_gives_the_mean() -> None:
    curve = ideal_curve(97.85, 18.71, 0.0100)
    fit = piecewise_fit(curve, BASE)
    scaled = scaled_to_mean(fit, curve, BASE, 0.013)
    assert scaled.profile.mean == pytest.approx(0.013, rel=1e-12)
    assert (scaled.liftoff, scaled.contact) == (fit.liftoff, fit.contact)


def test_reactor_reads_the_profile(tmp_path: Path) -> None:
    """The written table has the agreed header, comments do not disturb, and the mean survives."""
    curve = ideal_curve(97.85, 18.71, 0.01435)
    path = tmp_path / "profile.csv"
    curve.write(path, ["a remark", "SCALED: another"])
    assert path.read_text().splitlines()[0] == "phase_deg,u_x_m/s,u_y_m/s,contact"
    assert read_profile(path).mean == pytest.approx(curve.mean, rel=1e-6)
    rows = [r for r in csv.reader(path.open()) if not r[0].startswith("#")]
    assert len(rows) == N + 1


def test_a_profile_says_what_it_was_made_with(tmp_path: Path) -> None:
    """Fails when the reactor reads other conditions than the DEM vibrated under, or takes a sawtooth for a sine."""
    path = tmp_path / "profile.csv"
    ideal_curve(97.85, 18.71, 0.01435).write(path, ["a remark", conditions(WAVE, "harmonics").line()])
    made = read_profile(path).conditions
    assert made is not None
    assert (made.frequency, made.waveform) == (16.0, "sine")
    assert (made.gamma, made.angle) == pytest.approx((0.3, math.radians(60.0)), rel=1e-6)
    assert (
        conditions(Sawtooth(horizontal=1e-4, vertical=2e-4, frequency=20.0), "sawtooth").waveform
        == "sawtooth"
    )


def test_flight_interval_interpolates_and_wraps() -> None:
    """A gap open from 300 over 360 to 60 degrees is one interval; ripples elsewhere do not count."""
    gap = np.maximum(0.0, np.cos(np.radians(PHASE)) - 0.5) + 1e-3 * np.sin(np.radians(7 * PHASE))
    found = flight_interval(PHASE, gap, 0.01)
    assert found is not None
    liftoff, contact = found
    assert liftoff == pytest.approx(300.0, abs=2.0) and contact == pytest.approx(60.0, abs=2.0)
    tent = np.maximum(0.0, 30.0 - np.abs(PHASE - 180.5))  # straight between samples: its crossings are exact
    assert flight_interval(PHASE, tent, 12.3) == pytest.approx((162.8, 198.2), abs=1e-9)
    assert flight_interval(PHASE, np.zeros(N), 0.01) is None
    assert flight_interval(PHASE, np.ones(N), 0.01) is None


def test_acceleration_criterion() -> None:
    """Bed on the base until 100 degrees, then at constant speed: found there to a few samples, with the delay."""
    found = acceleration_liftoff(ideal_curve(100.0, 350.0, BASE[0, 36]), BASE, 1 / 16)
    assert found is not None
    phase, delay = found
    assert phase == pytest.approx(100.0, abs=9.0)
    assert delay == pytest.approx(phase / 360.0 / 16.0, abs=1e-9)
    assert acceleration_liftoff(Profile(phase=PHASE, velocity=BASE, contact=np.ones(N)), BASE, 1 / 16) is None
    assert (
        acceleration_liftoff(
            Profile(phase=PHASE, velocity=0.3 * np.roll(BASE, 20, axis=1), contact=np.ones(N)), BASE, 1 / 16
        )
        is None
    )


def test_phases_begin_at_zero() -> None:
    """Samples at interval ends numbered by their time: row and column must recover cycle and phase."""
    time = np.arange(1.0, 25.0)  # three cycles of eight samples, the first at 1/8 of a cycle
    assert (analysis.over_phase(time, 8, 1) == np.array([np.arange(8, 16), np.arange(16, 24)])).all()
    assert (analysis.over_phase(time, 8, 0)[0] == np.array([8, 1, 2, 3, 4, 5, 6, 7])).all()


def test_self_diffusivity_of_a_random_walk() -> None:
    """Independent steps of variance s^2 per cycle give D = s^2/2T at any lag; common drift does not count."""
    rng = np.random.default_rng(0)
    sigma, period = np.array([2e-6, 1e-6, 0.5e-6]), 1 / 16
    walk = np.cumsum(rng.normal(0, 1, (41, 3000, 3)) * sigma, axis=0) + np.arange(41)[:, None, None] * 1e-4
    for lag in (1, 8):
        diffusivity = summary.self_diffusivity({"cycle_end": walk}, 0, period, lag)
        assert np.diag(diffusivity) == pytest.approx(sigma**2 / (2 * period), rel=0.03)
    assert abs(diffusivity[0, 2]) < 0.03 * math.sqrt(diffusivity[0, 0] * diffusivity[2, 2])


def test_self_diffusivity_counts_cycles() -> None:
    """Fails when the lag is another number of cycles: two particles at +-v have D = v^2 lag/2, over four cycles at most of those kept."""
    speed, period = 1e-3, 1 / 16
    ends = np.arange(6)[:, None, None] * period * speed * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    for lag, cycles in ((1, 1), (3, 3), (4, 4), (5, 4), (9, 4)):
        found = summary.self_diffusivity({"cycle_end": ends}, 1, period, lag)
        assert found[0, 0] == pytest.approx(speed**2 * cycles * period / 2.0) and np.count_nonzero(found) == 1


def test_residence_times_and_cycle_velocity() -> None:
    """Two layers at 1 and 2 cm/s, one particle at rest: times, the share that never arrives, the mass mean."""
    speeds = np.array([0.01, 0.02, 0.0])
    ends = np.zeros((5, 3, 3))
    ends[:, :, 0] = np.arange(5)[:, None] / 16.0 * speeds
    times = analysis.residence_times({"cycle_end": ends}, 1, WAVE, 0.01)
    assert times == pytest.approx([1.0, 0.5, math.inf])
    mass = np.array([1.0, 1.0, 2.0])
    assert analysis.cycle_velocities({"cycle_end": ends}, mass, WAVE, 2) == pytest.approx([0.0075, 0.0075])


def test_slab_volumes_add_up() -> None:
    """Spheres cut by slab edges: all volume is found, and a sphere cut at its middle is halved."""
    d = np.array([1.0, 2.0])
    solids = slab_solids(height=np.array([1.0, 2.0]), diameter=d, edges=np.array([-1.0, 1.0, 2.0, 5.0]))
    assert solids.sum() == pytest.approx(np.pi / 6 * (d**3).sum())
    assert solids[0] == pytest.approx(np.pi / 12)


@pytest.mark.parametrize("name", ["GL56", "SS231"])
def test_drag_carries_the_bed_at_minimum_fluidisation(name: str) -> None:
    """At Ergun's velocity for the voidage, the drag on a particle of a uniform bed is its weight."""
    p = POWDERS[name]
    air, mu = 1.206, 18e-6
    velocity = minimum_fluidisation_velocity(
        diameter=p.diameter, sphericity=p.sphericity, density_solid=p.density, porosity=0.45,
        viscosity=mu, density_gas=air, ergun=p.ergun,
    )  # fmt: skip
    gas = GasDrag(powder=p, viscosity=mu, density=air, velocity=velocity)
    edges = gas.edges(20 * p.diameter)
    height = np.full(3, 10 * p.diameter)
    size = np.full(3, p.diameter)
    gamma = gas.coefficients(
        height=height,
        relative=np.full(3, velocity),
        diameter=size,
        edges=edges,
        solid=np.full(len(edges) - 1, 0.55),
    )
    assert gamma * velocity == pytest.approx(p.weight * (1 - air / p.density), rel=1e-3)
    assert gas.flux(0.01) == velocity - 0.01
    assert (
        GasDrag(powder=p, viscosity=mu, density=air, velocity=velocity, rests_in_lab=False).flux(0.01)
        == velocity
    )


def test_filling_touches_nothing_and_has_the_right_volume() -> None:
    """Loose packings do not overlap, hold every size class equally often, and fill 0.6 of the settled height."""
    sizes = POWDERS["GL56"].size_classes(5)
    d = POWDERS["GL56"].diameter
    frit = frit_monolayer(length=18 * 25e-6, depth=9 * 25e-6, diameter=25e-6)
    assert frit.top == pytest.approx(0.0) and len(frit.positions) == 162
    filling = loose_filling(
        length=18 * 25e-6, depth=9 * 25e-6, height=15 * d, diameters=sizes, base=frit, seed=3
    )
    diameter = sizes[filling.classes]
    volume = np.pi / 6 * (diameter**3).sum()
    assert volume == pytest.approx(0.6 * 18 * 9 * 25e-6**2 * 15 * d, rel=0.02)
    assert np.ptp(np.bincount(filling.classes)) <= 1
    offset = filling.positions[:, None] - filling.positions[None]
    box = np.array([18 * 25e-6, 9 * 25e-6])
    offset[..., :2] -= box * np.round(offset[..., :2] / box)
    distance = np.linalg.norm(offset, axis=-1) + np.eye(len(diameter))
    assert (distance > 0.5 * (diameter[:, None] + diameter[None])).all()
    assert (filling.positions[:, 2] - diameter / 2 > 0.0).all()


def test_sawtooth_has_its_height_width_and_no_holes() -> None:
    base = sawtooth_baffle(length=64 * 125e-6, depth=10 * 125e-6, diameter=125e-6, height=2e-3, width=2e-3)
    assert base.top == pytest.approx(2e-3, rel=1e-6)
    assert tooth_area(base) == pytest.approx(0.5 * 2e-3 * 2e-3, rel=0.05)
    profile = base.positions[np.isclose(base.positions[:, 1], 62.5e-6)]
    steps = np.sort(np.linalg.norm(profile[:, None] - profile[None], axis=-1), axis=1)[:, 1]
    assert steps.max() <= 125e-6 * (1 + 1e-9)
    assert FLAT.flat and tooth_area(FLAT) == 0.0


SINE = {"powder": "GL56", "waveform": {"kind": "sine", "gamma": 0.3, "frequency": "16 Hz"}}


def test_resolved_case_runs_as_it_is() -> None:
    case = load_case(SINE, {"box.stiffness": "300 N/m", "run.seeds": 2, "gas.velocity": "0.3 cm/s"})
    again = load_case(tomllib.loads(case.to_toml()))
    assert again.content_hash() == case.content_hash() and again.run.seeds == (1, 2)
    assert load_case(SINE, {"run.cycles": 20}).content_hash() == load_case(SINE).content_hash()
    assert load_case(SINE, {"box.length": 9}).content_hash() != load_case(SINE).content_hash()


@pytest.mark.parametrize(
    ("change", "key", "says"),
    [
        ({"powder": "GL57"}, "powder.base", "GL56"),
        ({"powder": {"diameter": "50 um"}}, "powder.density", "found nothing"),
        ({"waveform.kind": "sin"}, "waveform.kind", "did you mean sine?"),
        ({"waveform": {"gamma": 0.3}}, "waveform.kind", "found nothing; accepted: sine, sawtooth, seed"),
        ({"waveform.gama": 0.3}, "waveform.gama", "did you mean gamma?"),
        ({"box.frequency": "16 Hz"}, "box.frequency", "belongs elsewhere: waveform.frequency,"),
        ({"directory": "results"}, "directory", "an unknown key"),
        ({"waveform.frequency": 16}, "waveform.frequency", "without a unit"),
        ({"waveform.angle": "95 deg"}, "waveform.angle", "angle"),
        ({"box.lenght": 8}, "box.lenght", "did you mean length?"),
        ({"box.length": "3 mm"}, "box.length", "diameters"),
        ({"box.base": "round"}, "box.base", "frit"),
        ({"box": {"base": "sawtooth"}}, "box.baffle_width", "box.length"),
        ({"gas.velocity": "3 kg"}, "gas.velocity", "speed"),
        ({"run.seeds": 0}, "run.seeds", "seed"),
        ({"run.seeds": [1, 1]}, "run.seeds", "different"),
        ({"run.discard": 9}, "run.discard", "fewer"),
        ({"run.samples_per_cycle": 100}, "run.samples_per_cycle", "divisor"),
    ],
)
def test_bad_input_is_one_line_with_key_and_remedy(change: Any, key: Any, says: str) -> None:
    with pytest.raises(InputError) as info:
        load_case(SINE, change)
    message = str(info.value)
    assert f": {key}: " in message and says in message and "\n" not in message


def test_import_without_lammps() -> None:
    """`import mpm.dem` and reading a powder file load neither LAMMPS nor MPI."""
    code = (
        "import sys, mpm.dem, mpm.dem.case, mpm.dem.cli, mpm.dem.simulate, mpm.dem.run; "
        "sys.exit(any(m.partition('.')[0] in ('lammps', 'mpi4py', 'dolfinx') for m in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
