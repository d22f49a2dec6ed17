"""A bed under its own forces: closed forms, figures worked out without mpm, a block on a conveyor, and a general integrator."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from mpm.constants import GRAVITY, TURN
from mpm.physics.bed_cycle import BedCycle, NoCycle, bed_cycle, mean_speed
from mpm.physics.bed_forces import BedForces, Carried

PORTS = 2 * 0.035 * 4e-3 / 0.1397
"""Through-flow of the base zone: both ports over the strip [m/s]."""


def forces(gamma: float, *, angle: float = 60.0, frequency: float = 16.0, **changes: Any) -> BedForces:
    """The base bed: 3 mm of glass (2500 kg/m3, porosity 0.46) on 4.25 um2, in nitrogen of 1.72e-5 Pa s; angle from the horizontal [deg]."""
    omega = TURN * frequency
    ay = gamma * GRAVITY / omega**2
    base: dict[str, Any] = {
        "mass": 2500.0 * 0.54 * 3e-3,
        "resistance": 1.72e-5 * 3e-3 / 4.25e-12,
        "through_flow": PORTS,
        "friction": 0.4,
        "ax": ay / math.tan(math.radians(angle)),
        "ay": ay,
        "omega": omega,
    }
    return BedForces(**{**base, **changes})


def block(gamma: float, **changes: Any) -> BedForces:
    """The same without gas."""
    return forces(gamma, resistance=0.0, through_flow=0.0, **changes)


def kinds(cycle: BedCycle) -> list[str]:
    return [segment.kind for segment in cycle.segments]


def test_figures_of_the_base_bed() -> None:
    """Fails when the flight at Gamma 0.45, the gaps or the weight are not those integrated without mpm.

    Landing is 153.8854 deg here and by `solve_ivp` (below). The figure handed down, 153.8867 deg, is what any integration from lift-off in
    steps of 1/100,000 or 1/50,000 of a cycle (0.0036 or 0.0072 deg) finds that takes the end of the last step for the landing.
    """
    cycle = bed_cycle(forces(0.45))
    ((liftoff, landing),) = cycle.flights
    assert cycle.forces.gas_share == pytest.approx(0.6125, abs=2e-5)
    assert cycle.forces.weight == pytest.approx(39.7, abs=0.05)
    assert math.degrees(liftoff) == pytest.approx(59.4443, abs=5e-5)
    assert math.degrees(landing) == pytest.approx(153.8854, abs=5e-5)
    for step in (TURN / 100_000, TURN / 50_000):
        end_of_step = liftoff + math.ceil((landing - liftoff) / step) * step
        assert math.degrees(end_of_step) == pytest.approx(153.8867, abs=5e-5)
    assert cycle.largest_gap == pytest.approx(1.4354e-6, abs=5e-11)
    assert kinds(cycle) == ["stick", "slide", "flight", "slide", "stick"]
    assert bed_cycle(forces(0.30)).flights == () and bed_cycle(forces(0.30)).largest_gap == 0.0
    assert bed_cycle(forces(0.60)).largest_gap == pytest.approx(7.9e-6, abs=5e-8)


@pytest.mark.parametrize(("angle", "speed"), [(60.0, 0.51), (45.0, 1.34), (30.0, 2.24)])
def test_a_bed_that_gas_carries_in_part_slides(angle: float, speed: float) -> None:
    """Fails when the bed at Gamma 0.30 leaves the base, or slides at another speed [cm/s]."""
    cycle = bed_cycle(forces(0.30, angle=angle))
    assert cycle.share("flight") == 0.0
    assert 100.0 * cycle.mean == pytest.approx(speed, abs=5e-3)


def test_over_an_open_floor_it_flies_and_hardly_conveys() -> None:
    """Fails when gas at rest in the lab does not lift the bed by 0.54 mm at Gamma 0.30, or conveys it at other than 0.09 cm/s."""
    cycle = bed_cycle(forces(0.30, lag=1.0))
    assert cycle.largest_gap == pytest.approx(0.54e-3, abs=5e-6)
    assert 100.0 * cycle.mean == pytest.approx(0.09, abs=5e-3)


@pytest.mark.parametrize("gamma", [0.42, 0.45, 0.60, 0.9])
@pytest.mark.parametrize("adhesion", [0.0, 1.0])
def test_it_lifts_off_where_weight_is_used_up(gamma: float, adhesion: float) -> None:
    """Fails when lift-off is not at asin((1 - R U/(m g) + sigma/(m g))/Gamma)."""
    cycle = bed_cycle(forces(gamma, adhesion=adhesion))
    left = 1.0 - cycle.forces.gas_share + adhesion / cycle.forces.weight
    assert cycle.flights[0][0] == pytest.approx(math.asin(left / gamma), abs=1e-9)


@pytest.mark.parametrize("angle", [30.0, 45.0, 60.0])
@pytest.mark.parametrize("friction", [0.2, 0.4])
def test_it_moves_from_the_acceleration_on_that_friction_does_not_hold(angle: float, friction: float) -> None:
    """Fails when a block sticks above, or slides below, Gamma = mu tan(b)/(1 + mu tan(b))."""
    steep = friction * math.tan(math.radians(angle))
    onset = steep / (1.0 + steep)
    still = bed_cycle(block(onset * (1 - 1e-9), angle=angle, friction=friction))
    assert still.rides and still.mean == 0.0
    assert bed_cycle(block(onset * 1.001, angle=angle, friction=friction)).mean > 0.0


def test_a_weightless_grain_of_time() -> None:
    """Fails when a bed without gas (k = 0) and one in almost none (k -> 0) differ: the closed forms must not cancel."""
    none, hardly = bed_cycle(block(1.2)), bed_cycle(replace(block(1.2), resistance=1e-9))
    assert hardly.mean == pytest.approx(none.mean, rel=1e-7)
    assert hardly.flights[0] == pytest.approx(none.flights[0], abs=1e-8)
    assert hardly.largest_gap == pytest.approx(none.largest_gap, rel=1e-7)


CASES = [
    forces(0.30), forces(0.45), forces(0.60, angle=30.0, friction=0.2), forces(0.5, lag=0.057), forces(0.5, adhesion=2.0),
    forces(0.30, lag=1.0), forces(0.45, resistance=500.0, through_flow=-0.01), block(0.9, friction=0.2), block(1.6),
]  # fmt: skip


@pytest.mark.parametrize(
    "acting", [forces(0.45), forces(0.60), forces(0.30, lag=1.0), forces(0.5, adhesion=2.0), block(1.6)]
)
def test_an_integrator_that_knows_no_closed_form_agrees(acting: BedForces) -> None:
    """Fails when phases, gap or distance are not those of the equations, integrated by DOP853 with events.

    The bed slips, lifts off, lands and is caught again, in this order.
    """
    cycle = bed_cycle(acting)
    slip, liftoff, landing, caught, gap, distance = _integrated(acting, cycle.flights[0][0])
    assert math.remainder(cycle.flights[0][0] - liftoff, TURN) == pytest.approx(0.0, abs=1e-8)
    assert math.remainder(cycle.flights[0][1] - landing, TURN) == pytest.approx(0.0, abs=1e-7)
    assert cycle.largest_gap == pytest.approx(gap, rel=1e-7)
    sticks = [s for s in cycle.segments if s.kind == "stick"]
    assert any(abs(math.remainder(s.stop - slip, TURN)) < 1e-8 for s in sticks)
    assert any(abs(math.remainder(s.start - caught, TURN)) < 1e-7 for s in sticks)
    assert cycle.distance(TURN) == pytest.approx(distance, abs=1e-7 * acting.ax)


def _integrated(acting: BedForces, near: float) -> tuple[float, ...]:
    """Phases of slip, lift-off, landing and catch [rad], largest gap and distance over a cycle [m]; lift-off is near a phase."""
    m, mu, omega, k = acting.mass, acting.friction, acting.omega, acting.resistance / acting.mass

    def held(p: float) -> float:
        v, a = acting.ay * omega * math.cos(p), -acting.ay * omega**2 * math.sin(p)
        return (
            m * (GRAVITY + a) - acting.resistance * (acting.through_flow - acting.lag * v) + acting.adhesion
        )

    def base(p: float) -> float:
        return acting.ax * omega * math.cos(p)

    def course(rates: Any, start: float, state: list[float], passes: Any) -> Any:
        """Integrated over the phase until `passes` falls through zero."""
        passes.terminal, passes.direction = True, -1.0
        found = solve_ivp(
            rates, (start, start + 3 * TURN), state, "DOP853", events=passes, rtol=1e-12, atol=1e-17, max_step=5e-3,
            dense_output=True,
        )  # fmt: skip
        assert found.status == 1
        return found

    slip = brentq(
        lambda p: mu * held(p) - m * acting.ax * omega**2 * math.sin(p), 0.0 if near < 1.5 else 1.4, near
    )
    slide = course(
        lambda p, y: [y[1] / omega, -mu * held(p) / m / omega], slip, [0.0, base(slip)], lambda p, y: held(p)
    )
    liftoff, (x, u) = float(slide.t[-1]), slide.y[:, -1]
    flight = course(
        lambda p, y: [y[1] / omega, (-(held(p) - acting.adhesion) / m - k * y[1]) / omega],
        liftoff,
        [0.0, 0.0],
        lambda p, y: y[0] if y[1] < 0.0 else 1.0,
    )
    landing = float(flight.t[-1])
    gap = max(flight.sol(p)[0] for p in flight.t)
    top = minimize_scalar(
        lambda p: -flight.sol(p)[0], bounds=(liftoff, landing), method="bounded", options={"xatol": 1e-10}
    )
    catch = mu * abs(flight.y[1, -1])
    x, u = x + u * (landing - liftoff) / omega, u + float(np.clip(base(landing) - u, -catch, catch))
    way = math.copysign(1.0, u - base(landing))
    end = course(
        lambda p, y: [y[1] / omega, -way * mu * held(p) / m / omega],
        landing,
        [x, u],
        lambda p, y: way * (y[1] - base(p)),
    )
    caught = float(end.t[-1])
    stuck = acting.ax * (math.sin(slip) - math.sin(caught))
    return slip, liftoff, landing, caught, max(gap, -top.fun), float(end.y[0, -1]) + stuck


@pytest.mark.parametrize("acting", CASES)
def test_the_cycle_is_one_piece(acting: BedForces) -> None:
    """Fails when velocity is not the derivative of distance, jumps but at landings, or force and gap contradict each other."""
    cycle = bed_cycle(acting)
    assert cycle.segments[0].start == 0.0 and cycle.segments[-1].stop == TURN
    assert all(a.stop == b.start for a, b in pairwise(cycle.segments))
    speed = acting.ax * acting.omega
    for a, b in pairwise([*cycle.segments, cycle.segments[0]]):
        if a.kind != "flight" or b.kind == "flight":
            before, after = a.stretch.velocity(a.stop), b.stretch.velocity(b.start)
            assert before == pytest.approx(after, abs=1e-9 * speed)
    step = 1e-4
    for phase in np.linspace(0.01, TURN - 0.01, 200):
        if any(abs(phase - s.stop) < 2 * step for s in cycle.segments):
            continue
        slope = (cycle.distance(phase + step) - cycle.distance(phase - step)) / (2 * step) * acting.omega
        assert cycle.velocity(phase) == pytest.approx(slope, abs=1e-6 * speed)
        gap, force = cycle.gap(phase), cycle.contact_force(phase)
        assert gap >= 0.0 and force >= -acting.adhesion - 1e-9 * acting.weight and gap * force == 0.0
        low, high = cycle.contact_range
        assert low <= force <= high


@pytest.mark.parametrize("make", [forces, block])
@pytest.mark.parametrize("gamma", [0.3, 0.45, 0.95, 2.0])
@pytest.mark.parametrize("friction", [0.01, 0.1, 0.3, 1.0])
def test_speed_that_is_looked_for_is_that_which_is_come_to(
    make: Any, gamma: float, friction: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cycle by bisection and that after 4,000 cycles (friction 0.01) to 10, to 1e-10 of the base's speed. Fails when the one looked for
    is another, has other stretches, or begins otherwise than it ends."""
    monkeypatch.setattr("mpm.physics.bed_cycle.PATIENCE", 1)
    acting = make(gamma, friction=friction)
    cycle, peak = bed_cycle(acting), acting.ax * acting.omega
    assert cycle.mean == pytest.approx(
        mean_speed(acting, skip=int(40 / friction), cycles=1), abs=1e-10 * peak
    )
    monkeypatch.setattr("mpm.physics.bed_cycle.PATIENCE", 2000)
    marched = bed_cycle(acting)
    assert np.ravel(cycle.flights) == pytest.approx(np.ravel(marched.flights), abs=1e-10)
    assert cycle.contact_range == pytest.approx(marched.contact_range, rel=1e-12)
    assert cycle.velocity(TURN) == pytest.approx(cycle.velocity(0.0), abs=1e-10 * peak)
    for phase in np.linspace(0.001, TURN, 40):
        assert cycle.velocity(phase) == pytest.approx(marched.velocity(phase), abs=1e-9 * peak)


@pytest.mark.parametrize("friction", [1e-3, 1e-4, 1e-6])
@pytest.mark.parametrize("lag", [-0.05, 0.0, 0.05])
def test_a_bed_that_hardly_rubs(friction: float, lag: float) -> None:
    """Friction that tends to nothing leaves the bed at the speed at which its base pulls it forward as long and hard as back. Where they
    meet, at phases +-p, speed is A w cos p, and with N = c + a sin + b cos the pulls are alike at p + (b/c) sin p = pi/2; the next term is
    of the order of friction. Fails when a bed with little friction is refused, or creeps at another speed."""
    acting = forces(0.2, friction=friction, lag=lag)
    contact, peak = acting.contact, acting.ax * acting.omega
    p = brentq(lambda p: p + contact.b / contact.c * math.sin(p) - 0.5 * math.pi, 0.0, math.pi)
    cycle = bed_cycle(acting)
    assert set(kinds(cycle)) == {"slide"}
    assert cycle.mean == pytest.approx(peak * math.cos(p), abs=5.0 * friction * peak)
    assert (abs(cycle.mean) > 0.1 * peak) == (lag != 0.0)


def test_beds_that_repeat_no_cycle() -> None:
    """Fails when a bed that gas carries, or one that hops over cycles, gets a cycle."""
    with pytest.raises(Carried):
        bed_cycle(forces(0.30, through_flow=0.0033))
    with pytest.raises(NoCycle):
        bed_cycle(block(4.0, angle=30.0))
    assert mean_speed(block(4.0, angle=30.0), skip=50, cycles=100) > 0.0
    held = bed_cycle(
        forces(0.30, through_flow=0.0033, adhesion=60.0)
    )  # gas lifts it, adhesion does not let go
    assert held.rides


# conveyor_block.csv of the project's reference numbers (a block on a conveyor by steps of 1/1500 cycle, without mpm): f [Hz], angle [deg],
# friction, then the mean speed [cm/s] at Gamma 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 0.95, 1.5, 2.0, 3.0.
GAMMAS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 0.95, 1.5, 2.0, 3.0)
TABLE = {
    (16.0, 60.0, 0.2): (0.0, 0.0340, 0.2996, 0.7172, 1.1998, 2.1918, 3.0535, 4.9660, 5.7038, 16.6642),
    (16.0, 60.0, 0.4): (0.0, 0.0, 0.0, 0.1168, 0.4442, 1.4618, 2.4139, 5.5656, 8.1312, 16.5252),
    (18.5, 60.0, 0.2): (0.0, 0.0294, 0.2591, 0.6203, 1.0377, 1.8956, 2.6408, 4.2949, 4.9334, 14.4123),
    (18.5, 60.0, 0.4): (0.0, 0.0, 0.0, 0.1011, 0.3842, 1.2643, 2.0877, 4.8135, 7.0324, 14.2920),
    (16.0, 30.0, 0.2): (0.4246, 1.0184, 1.5255, 1.9934, 2.4635, 3.3586, 4.0283, 4.9696, 5.6983, 50.3826),
    (16.0, 30.0, 0.4): (0.0116, 0.6825, 1.6634, 2.7212, 3.9541, 6.0444, 7.4683, 9.9477, 11.4009, 50.1832),
    (16.0, 45.0, 0.2): (0.0483, 0.5024, 0.9946, 1.6204, 2.1600, 3.1334, 3.8347, 4.9693, 5.6945, 29.0059),
    (16.0, 45.0, 0.4): (0.0, 0.0067, 0.3400, 0.9913, 1.8248, 3.7009, 5.1887, 9.6504, 11.3911, 28.8182),
}
STEP = TURN / 1500
"""Phase of a step [rad]: what an event is misplaced by, and the speed by as large a share of the conveyor's."""


@pytest.mark.parametrize(("conditions", "speeds"), TABLE.items())
def test_a_block_without_gas_is_that_of_the_conveyor_table(
    conditions: tuple[float, float, float], speeds: tuple[float, ...]
) -> None:
    """Fails when a speed differs by more than a step of the table does: 0.42 % of the conveyor's largest.

    Gamma 1.5 and 2.0 are left to the next test: there the table's block does not fly.
    """
    frequency, angle, friction = conditions
    for gamma, speed in zip(GAMMAS, speeds, strict=True):
        acting = block(gamma, angle=angle, frequency=frequency, friction=friction)
        found = mean_speed(acting, skip=20, cycles=20)
        if not 1.0 < gamma < 3.0:
            assert abs(found - speed / 100.0) <= STEP * acting.ax * acting.omega, gamma


@pytest.mark.parametrize(
    ("conditions", "gamma", "printed"),
    [((16.0, 60.0, 0.4), 1.5, 5.5656), ((16.0, 30.0, 0.2), 2.0, 5.6983)],
)
def test_the_table_does_not_fly_below_two_g(
    conditions: tuple[float, float, float], gamma: float, printed: float
) -> None:
    """Fails when the same steps, with a fall of g dt^2/2 in the first of a flight, do not lead from the table to here.

    The table's steps are semi-implicit: a block that lifts off falls g dt^2 in its first step, the base by half of its deceleration, so
    that the block lands at once until that exceeds 2 g. Below, it slides where it should fly: 5.57 instead of 6.56 cm/s.
    """
    frequency, angle, friction = conditions
    acting = block(gamma, angle=angle, frequency=frequency, friction=friction)
    found, peak = mean_speed(acting, skip=20, cycles=20), acting.ax * acting.omega
    assert abs(_by_steps(acting, implicit=True) - printed / 100.0) <= 2e-6
    assert abs(_by_steps(acting, implicit=False) - found) <= STEP * peak
    assert found - printed / 100.0 > 20 * STEP * peak


def _by_steps(acting: BedForces, implicit: bool, cycles: int = 40, n: int = 1500) -> float:
    """The table's own way: mean speed [m/s] of the last 20 cycles."""
    omega, mu = acting.omega, acting.friction
    dt, ax, ay = TURN / omega / n, acting.ax, acting.ay
    x = begun = y = v = 0.0
    u, flying = ax * omega, False
    for i in range(cycles * n):
        s, c = math.sin(omega * i * dt), math.cos(omega * i * dt)
        base, a, normal = ax * omega * c, -ax * omega**2 * s, GRAVITY - ay * omega**2 * s
        if i == (cycles - 20) * n:
            begun = x
        if not flying and normal < 0.0:
            flying, v, y = True, ay * omega * c, ay * s
        if flying:
            y += v * dt - (1.0 if implicit else 0.5) * GRAVITY * dt**2
            v -= GRAVITY * dt
            after = omega * (i + 1) * dt
            if y < ay * math.sin(after):
                catch = mu * max(ay * omega * math.cos(after) - v, 0.0)
                u += min(max(ax * omega * math.cos(after) - u, -catch), catch)
                flying = False
        elif abs(u - base) < 1e-9 and abs(a) <= mu * normal:
            u = base + a * dt
        else:
            r = u - base
            sliding = u - mu * normal * math.copysign(1.0, r if abs(r) >= 1e-9 else -a) * dt
            meets = abs(r) >= 1e-9 and (sliding - base - a * dt) * r < 0.0 and abs(a) <= mu * normal
            u = base + a * dt if meets else sliding
        x += u * dt
    return (x - begun) / (20 * TURN / omega)
