"""Vibration, the piecewise bed velocity, and their means over time steps."""

import math
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import quad

from mpm.case.motion import Motion
from mpm.case.profile import read_profile
from mpm.constants import TURN
from mpm.motion.kinematics import REST, BedMotion, Flight, Tabulated, Vibration, step_motion, thesis_phases

# bed_velocity_reconstruction.csv of the project's reference numbers (classic conveyor theory, worked out without mpm, g = 9.81 m/s2):
# Gamma, mean [cm/s], lift-off [deg], contact [deg], share of the cycle in flight, flight velocity, peak velocities x and y [m/s].
TABLE = [
    (0.3, 1.3, 97.853313, 18.713359, 0.780167, 0.014354, 0.016902, 0.029275),
    (0.3, 0.5, 97.853313, 18.713359, 0.780167, 0.004099, 0.016902, 0.029275),
    (0.3, 2.0, 97.853313, 18.713359, 0.780167, 0.023326, 0.016902, 0.029275),
    (0.3, 3.0, 97.853313, 18.713359, 0.780167, 0.036144, 0.016902, 0.029275),
    (0.4, 1.3, 95.881885, 28.162171, 0.811890, 0.013703, 0.022536, 0.039033),
    (0.5, 1.3, 94.702525, 34.579599, 0.832992, 0.013297, 0.028169, 0.048791),
    (0.6, 1.3, 93.917425, 39.310117, 0.848313, 0.013015, 0.033803, 0.058549),
]


def bed(**changes: object) -> BedMotion:
    return BedMotion(Motion.model_validate(changes))


def lab_velocity(motion: BedMotion, t: float) -> float:
    """Horizontal velocity of the bed in the lab's frame at time `t` of the vibration [m/s]: what `BedMotion.at` has integrated."""
    phase, reactor = (motion.vibration.omega * t) % TURN, motion.vibration.velocity(t)[0]
    match motion.course:
        case Flight(velocity=velocity) as flight:
            return velocity if flight.is_airborne(phase) else reactor
        case Tabulated(phase=phases, velocity=velocities):
            return float(np.interp(phase, phases, velocities))
        case _:
            return motion.mean + reactor


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"gamma{row[0]}-{row[1]}cm/s")
def test_thesis_profile_against_conveyor_theory(row: tuple[float, ...]) -> None:
    """Fails when lift-off, contact, flight velocity or amplitudes differ from the independent table in its last printed digit."""
    gamma, mean, liftoff, contact, share, flight, peak_x, peak_y = row
    motion = bed(gamma=gamma, bed_velocity=f"{mean} cm/s")
    course = motion.course
    assert isinstance(course, Flight)
    assert np.degrees(course.liftoff) == pytest.approx(liftoff, abs=1e-6)
    assert np.degrees(course.contact) == pytest.approx(contact, abs=1e-6)
    assert ((course.contact - course.liftoff) % TURN) / TURN == pytest.approx(share, abs=1e-6)
    assert course.velocity == pytest.approx(flight, abs=1e-6)
    assert motion.vibration.velocity(0.0) == pytest.approx((peak_x, peak_y), abs=1e-6)


def test_bed_meets_the_reactor_at_contact() -> None:
    """Fails when the vertical positions differ at contact, or the bed is below the reactor anywhere in flight."""
    vibration = bed(gamma=0.3).vibration
    liftoff, contact = thesis_phases(vibration, -0.004)
    phase = np.linspace(liftoff, contact + TURN, 400)
    flying = vibration.ay * np.sin(liftoff) - 0.004 * (phase - liftoff) / vibration.omega
    gap = flying - vibration.ay * np.sin(phase)
    assert abs(gap[-1]) < 1e-12 and gap.min() > -1e-15
    assert gap.max() == pytest.approx(0.000463, abs=1e-6)  # max_gap_m of the table


@pytest.mark.parametrize(
    "changes",
    [
        {"gamma": 0.3},
        {"gamma": 0.6, "bed_velocity": "3 cm/s"},
        {"gamma": 0.45, "profile": "phases", "liftoff_phase": "300 deg", "contact_phase": "40 deg"},
        {"gamma": 0.45, "profile": "phases", "liftoff_phase": "20 deg", "contact_phase": "10 deg"},
        {"gamma": 0.3, "angle": "30 deg", "angle_from": "vertical"},
        {"gamma": 0.0, "bed_velocity": "1.3 cm/s"},
    ],
    ids=["base", "fast", "flight-over-zero", "nearly-always-flying", "from-vertical", "no-vibration"],
)
def test_position_is_the_integral_of_the_velocity(changes: dict[str, object]) -> None:
    """Fails when s(t) is not the integral of bed minus reactor velocity, or a cycle does not advance by mean times period."""
    motion = bed(**changes)
    period = motion.vibration.period

    def relative(t: float) -> float:
        return lab_velocity(motion, t) - motion.vibration.velocity(t)[0]

    course = motion.course
    breaks = [course.liftoff, course.contact] if isinstance(course, Flight) else []
    for t in (0.21 * period, 0.87 * period, period, 2.4 * period):
        inside = [b / motion.vibration.omega + n * period for n in range(3) for b in breaks]
        integral = quad(
            relative, 0.0, t, points=[b for b in inside if 0 < b < t] or None, epsabs=1e-13, limit=200
        )[0]
        assert motion.at(t) == pytest.approx(integral, abs=1e-11)
    for n in (1, 7, 320):
        assert motion.at(n * period) == pytest.approx(motion.mean * n * period, rel=1e-9)


def test_contact_phases_follow_the_reactor() -> None:
    """Fails when the bed slips while it is in contact; and at base conditions it must move backwards for part of each cycle."""
    motion = bed(gamma=0.3)
    flight = motion.course
    assert isinstance(flight, Flight)
    times = np.linspace(0.0, motion.vibration.period, 2001)
    velocity = np.array([lab_velocity(motion, t) - motion.vibration.velocity(t)[0] for t in times])
    phase = times * motion.vibration.omega
    contact = (phase > flight.contact) & (phase < flight.liftoff)
    assert np.abs(velocity[contact]).max() == 0.0
    assert velocity.min() < -1e-3


@pytest.mark.parametrize("steps", [4, 7, 32, 33])
def test_means_over_steps_sum_up_exactly(steps: int) -> None:
    """Fails when the number of steps changes what a cycle conveys (point samples give 1.31 instead of 1.30 cm/s), or the frame drifts."""
    motion = bed(gamma=0.3)
    dt = motion.vibration.period / steps
    parts = [step_motion(motion, k * dt, (k + 1) * dt) for k in range(steps)]
    assert np.mean([p.bed_velocity for p in parts]) == pytest.approx(0.013, rel=1e-12)
    assert sum(p.slide for p in parts) == pytest.approx(0.013 * motion.vibration.period, rel=1e-12)
    peak = motion.vibration.ax * motion.vibration.omega**2
    assert abs(np.mean([p.acceleration for p in parts])) < 1e-13 * peak
    assert abs(np.mean([p.frame_velocity_y for p in parts])) < 1e-15


def test_step_means_converge_to_the_instant() -> None:
    """Fails when a step's mean acceleration or frame velocity has the wrong sign or size: a = X''(t), V_y = Y'(t)."""
    motion = bed(gamma=0.3)
    t, dt = 0.013, 1e-7
    mean = step_motion(motion, t - dt / 2, t + dt / 2)
    vibration: Vibration = motion.vibration
    expected = -vibration.ax * vibration.omega**2 * np.sin(vibration.omega * t)
    assert mean.acceleration == pytest.approx(expected, rel=1e-6)
    assert mean.frame_velocity_y == pytest.approx(
        vibration.ay * vibration.omega * np.cos(vibration.omega * t), rel=1e-6
    )


def test_nothing_moves_before_the_start() -> None:
    """Fails when the steps before the vibration see a frame or bed that moves."""
    assert step_motion(bed(gamma=0.3), -0.05, -0.04) == REST
    assert step_motion(bed(gamma=0.3), -0.01, 0.0) == REST


def test_profile_from_a_file(tmp_path: Path) -> None:
    """Fails when a tabulated profile (here 1 cm/s + 2 cm/s cos, with a row that lacks phase 0) has another mean, integral or period."""
    phase = np.arange(5.0, 360.0, 10.0)
    velocity = 0.01 + 0.02 * np.cos(np.radians(phase))
    path = tmp_path / "profile.csv"
    lines = [f"{p},{u!r},0,1" for p, u in zip(phase, velocity.tolist(), strict=True)]
    path.write_text("# from a DEM\nphase_deg,u_x_m/s,u_y_m/s,contact\n" + "\n".join(lines) + "\n")
    motion = bed(gamma=0.3, profile=str(path), bed_velocity="5 cm/s")
    assert motion.mean == pytest.approx(0.01, rel=1e-6)  # the table's own mean, not bed_velocity
    period = motion.vibration.period
    for share in (0.1, 0.5, 0.9):

        def relative(t: float) -> float:
            return lab_velocity(motion, t) - motion.vibration.velocity(t)[0]

        assert motion.at(share * period) == pytest.approx(
            quad(relative, 0.0, share * period, limit=500)[0], abs=1e-9
        )
    assert motion.at(3 * period) == pytest.approx(3 * period * motion.mean, rel=1e-12)
    assert lab_velocity(motion, 0.0) == pytest.approx(0.03, abs=2e-4)


def test_liftoff_faster_than_the_reactor() -> None:
    """Fails when a lift-off velocity that the reactor never reaches is used instead of refused."""
    for velocity, speed in (("-5 cm/s", "-0.05"), ("0 m/s", "0"), ("1 cm/s", "0.01")):
        with pytest.raises(
            ValidationError,
            match=f"found {speed} m/s; accepted: between 0 m/s and the reactor's peak velocity",
        ):
            Motion.model_validate({"gamma": 0.3, "liftoff_velocity": velocity})


CONDITIONS = '# conditions = { frequency = "16 Hz", gamma = 0.3, angle = "60 deg", waveform = "sine" }\n'


def profile_file(path: Path, mean: float, comment: str = "") -> Path:
    """A profile of 2 cm/s cos + `mean` [m/s] with a comment line, as `mpm dem` writes it."""
    rows = (f"{p},{mean + 0.02 * math.cos(math.radians(p))!r},0,1" for p in range(0, 360, 10))
    path.write_text(f"phase_deg,u_x_m/s,u_y_m/s,contact\n{comment}" + "\n".join(rows) + "\n")
    return path


def test_a_profile_of_another_frequency_is_refused(tmp_path: Path) -> None:
    """Fails when a profile made at 20 Hz drives a reactor at 16 Hz, or one made at 16.1 Hz (a fit to a record) does not."""
    path = str(profile_file(tmp_path / "p.csv", 0.01, CONDITIONS.replace("16 Hz", "20 Hz")))
    with pytest.raises(
        ValueError, match=r"made at 20 Hz for a vibration at 16 Hz.*accepted: a profile made at 16 Hz"
    ):
        Motion(gamma=0.3, profile=path)
    assert bed(profile=path, frequency="20 Hz").mean == pytest.approx(0.01)
    near = str(profile_file(tmp_path / "near.csv", 0.01, CONDITIONS.replace("16 Hz", "16.1 Hz")))
    assert bed(profile=near).mean == pytest.approx(0.01)


@pytest.mark.parametrize(
    "comment",
    [
        CONDITIONS.replace("gamma", "gama"),
        CONDITIONS.replace("16 Hz", "16 mm"),
        CONDITIONS.replace("}", ""),
        CONDITIONS + CONDITIONS,
    ],
    ids=["unknown key", "wrong unit", "no TOML", "twice"],
)
def test_conditions_that_cannot_be_read_are_refused(tmp_path: Path, comment: str) -> None:
    """Fails when a damaged line of conditions counts as none."""
    with pytest.raises(ValueError, match="accepted: one line such as # conditions ="):
        read_profile(profile_file(tmp_path / "p.csv", 0.01, comment))


def test_mean_velocity_is_that_of_what_moves_the_bed(tmp_path: Path) -> None:
    """Fails when anything but the profile file sets the speed, its sign is lost, or a resolved case names a speed without effect."""
    path = str(profile_file(tmp_path / "p.csv", -0.01))
    motion = Motion.model_validate({"gamma": 0.3, "profile": path, "bed_velocity": "5 cm/s"})
    assert (
        motion.mean_velocity == pytest.approx(-0.01, rel=1e-12)
        and BedMotion(motion).mean == motion.mean_velocity
    )
    assert "bed_velocity" not in motion.model_dump(mode="json")
    with pytest.raises(
        ValueError, match="no such file"
    ):  # nothing vibrates, but a run keeps the file's content with its state
        Motion.model_validate({"gamma": 0.0, "profile": str(tmp_path / "none.csv")})
    still = Motion.model_validate({"gamma": 0.0, "profile": path, "bed_velocity": "5 cm/s"})
    assert still.mean_velocity == BedMotion(still).mean == 0.05
    assert (
        Motion.model_validate({"bed_velocity": "5 cm/s"}).model_dump(mode="json")["bed_velocity"]
        == "0.05 m/s"
    )
