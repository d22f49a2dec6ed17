"""Forces on a bed that a vibrated base carries or throws, and one stretch of its motion after the other, in closed form.

Per area, with m = rho_s (1 - eps) h [kg/m2], R = mu h/K [Pa s/m] and X(t) = (A_x, A_y) sin(w t) the base's displacement:

    contact   N = m (g + a_y) - R U(t) >= -sigma
              it rides along while m |a_x| <= mu_f (N + sigma), else it slides: m u' = -+ mu_f (N + sigma)
    flight    m v' = -m (g + a_y) + R (U(t) - v),   gap' = v,   u constant
    landing   plastic: v becomes 0, and friction on the impulse m |v| changes the horizontal difference by at most mu_f |v|

v is the bed's vertical velocity relative to the base, u its horizontal one in the lab's frame, U(t) = U - c V_y(t) the superficial velocity
of the gas relative to the base: c = 0 where the gas column rides with the reactor (closed strip), 1 where it rests in the lab (open floor).
Gas and bed are rigid plugs: the gap fills with gas at once, the bed keeps its porosity, and buoyancy in the gas (rho/rho_s) is left out.

For a block without gas this is the theory of vibratory conveyors: Gaberson, J. Eng. Ind. 94 (1972) 497; Winkler, Int. J. Mech. Sci. 20
(1978) 561; Sloot and Kruyt, Powder Technol. 87 (1996) 203. For a bed in gas, with Darcy's law in place of the Kozeny-Carman friction of a
piston, that of Kroll, Chem. Ing. Tech. 27 (1955) 33.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from mpm.constants import TURN
from mpm.physics.bed_forces import BedForces, Carried
from mpm.physics.waves import NEXT, Wave, root

Kind = Literal["stick", "slide", "flight"]
LONGEST_FLIGHT = 100
"""Cycles of a flight beyond which a bed counts as carried."""
SHORT = 1e-4
"""Phase [rad] of a slide so slow that rounding hides it."""


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """The bed's motion from phase `begin` to `end` [rad]: `kind`, with velocity `speed` [m/s] at `begin`; it slides ahead of the base
    (`way` 1) or behind it (-1), or will when it no longer sticks.

    `thrown`: it lifts off at the end. `landing` is the vertical velocity at the end of a flight, `gap` the largest gap in it [m].
    """

    forces: BedForces
    kind: Kind
    begin: float
    end: float
    speed: float
    way: int = 0
    thrown: bool = False
    landing: float = 0.0
    gap: float = 0.0

    def velocity(self, phase: float) -> float:
        """Horizontal velocity in the lab's frame [m/s]."""
        forces = self.forces
        if self.kind == "flight":
            return self.speed
        if self.kind == "stick":
            return forces.base_speed(phase)
        held, begin = forces.held, self.begin
        impulse = (
            held.c * (phase - begin)
            - held.a * (math.cos(phase) - math.cos(begin))
            + held.b * (math.sin(phase) - math.sin(begin))
        )
        return self.speed - self.way * forces.friction * impulse / (forces.mass * forces.omega)

    def travel(self, start: float, stop: float) -> float:
        """Distance in the lab's frame between two phases of it [m]: the integral of `velocity`."""
        return self._reached(stop) - self._reached(start)

    def _reached(self, phase: float) -> float:
        """Distance since `begin` [m]."""
        forces, begin = self.forces, self.begin
        turned = phase - begin
        if self.kind == "stick":
            return forces.ax * (math.sin(phase) - math.sin(begin))
        if self.kind == "flight":
            return self.speed * turned / forces.omega
        held = forces.held
        braked = (
            0.5 * held.c * turned**2
            - held.a * (math.sin(phase) - math.sin(begin) - turned * math.cos(begin))
            + held.b * (math.cos(begin) - math.cos(phase) - turned * math.sin(begin))
        )
        return self.speed * turned / forces.omega - self.way * forces.friction * braked / (
            forces.mass * forces.omega**2
        )

    def rising(self, phase: float) -> float:
        """Vertical velocity relative to the base [m/s]; 0 in contact."""
        return _Flight(self.forces, self.begin).velocity(phase) if self.kind == "flight" else 0.0

    def height(self, phase: float) -> float:
        """Gap below the bed [m]; 0 in contact."""
        return _Flight(self.forces, self.begin).gap(phase) if self.kind == "flight" else 0.0


class _Flight:
    """Vertical flight that begins at rest on the base at phase `begin`: v' + k v = f(phase) with f = -N/m, k = R/m, solved.

    v = f_0 (1 - exp(-k t))/k + w(phase) - w(begin) exp(-k t), where w is the periodic answer to the sinusoid in f.
    """

    def __init__(self, forces: BedForces, begin: float):
        self.begin, self.omega = begin, forces.omega
        self.k = k = forces.resistance / forces.mass
        contact, mass = forces.contact, forces.mass
        self.push = Wave(-contact.c / mass, -contact.a / mass, -contact.b / mass)
        s, c, scale = self.push.a, self.push.b, k * k + self.omega**2
        self.answer = Wave(0.0, (k * s + self.omega * c) / scale, (k * c - self.omega * s) / scale)
        self.first = self.answer.at(begin)

    def velocity(self, phase: float) -> float:
        """v(phase) [m/s]."""
        t = (phase - self.begin) / self.omega
        return (
            self.push.c * t * _phi1(self.k * t) + self.answer.at(phase) - self.first * math.exp(-self.k * t)
        )

    def gap(self, phase: float) -> float:
        """Integral of v since `begin` [m]."""
        t, answer, begin = (phase - self.begin) / self.omega, self.answer, self.begin
        swing = answer.b * (math.sin(phase) - math.sin(begin)) - answer.a * (
            math.cos(phase) - math.cos(begin)
        )
        x = self.k * t
        return self.push.c * t * t * _phi2(x) + swing / self.omega - self.first * t * _phi1(x)

    def landing(self) -> tuple[float, float]:
        """Phase of the landing and largest gap.

        v exp(k t) rises and falls with the sign of f, so that v passes zero at most once between two zeros of f, and the gap is monotone
        between those of v: every bracket holds one root.
        """
        push, highest = self.push, 0.0
        before, up = push.fall(self.begin), True  # f > 0 until then, and so is v
        if self.velocity(before) <= 0.0:  # a flight of no length: rounding
            return before, 0.0
        while before - self.begin < LONGEST_FLIGHT * TURN:
            after = push.crossing(before)
            turns = (self.velocity(after) > 0.0) != up
            stop = root(self.velocity, before, after) if turns else after
            if not up and self.gap(stop) <= 0.0:
                return root(self.gap, before, stop), highest
            if turns:
                if up:
                    highest = max(highest, self.gap(stop))
                    if highest <= 0.0:
                        return stop, 0.0
                up = not up
                if not up and self.gap(after) <= 0.0:
                    return root(self.gap, stop, after), highest
            before = after
        raise Carried(f"a flight of more than {LONGEST_FLIGHT} cycles")


def _phi1(x: float) -> float:
    """(1 - exp(-x))/x."""
    return -math.expm1(-x) / x if x else 1.0


def _phi2(x: float) -> float:
    """(1 - phi1(x))/x, by its series where that cancels."""
    if x > 0.02:
        return (x + math.expm1(-x)) / (x * x)
    return 0.5 - x / 6.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0 * (1.0 - x / 7.0))))


def at_rest(forces: BedForces) -> Stretch:
    """The bed at phase 0, where it moves with the base: how a calculation begins. Raises Carried where gas carries it."""
    if forces.is_carried:
        raise Carried("gas carries the weight")
    return in_contact(forces, 0.0, forces.base_speed(0.0))


def successor(stretch: Stretch) -> Stretch:
    """What comes at the end of a stretch."""
    forces, phase = stretch.forces, stretch.end
    speed = stretch.velocity(phase)
    if stretch.kind == "flight":
        base, catch = forces.base_speed(phase), forces.friction * abs(stretch.landing)
        speed = base if abs(base - speed) <= catch else speed + math.copysign(catch, base - speed)
        return in_contact(forces, phase, speed)
    if stretch.thrown:
        return _flying(forces, phase, speed)
    if stretch.kind == "stick":
        return _sliding(forces, phase, speed, stretch.way)
    return in_contact(forces, phase, forces.base_speed(phase))


def in_contact(forces: BedForces, phase: float, speed: float) -> Stretch:
    """The bed on the base with velocity `speed`: thrown again at once, riding along or sliding."""
    if forces.held.negative(phase):
        return _flying(forces, phase, speed)
    difference = speed - forces.base_speed(phase)
    if difference != 0.0:
        return _sliding(forces, phase, speed, 1 if difference > 0.0 else -1)
    for way in (1, -1):
        if forces.grip(way).negative(phase):
            return _sliding(forces, phase, speed, way)
    liftoff = forces.held.fall(phase)
    slips, way = min((forces.grip(way).fall(phase), way) for way in (1, -1))
    end = min(slips, liftoff)
    thrown = math.isfinite(end) and liftoff - end <= NEXT
    return Stretch(forces=forces, kind="stick", begin=phase, end=end, speed=speed, way=way, thrown=thrown)


def _flying(forces: BedForces, phase: float, speed: float) -> Stretch:
    flight = _Flight(forces, phase)
    end, gap = flight.landing()
    return Stretch(
        forces=forces, kind="flight", begin=phase, end=end, speed=speed, landing=flight.velocity(end), gap=gap
    )


def _sliding(forces: BedForces, phase: float, speed: float, way: int) -> Stretch:
    """Sliding ahead of the base (`way` 1) or behind it until the velocities meet or the bed lifts off.

    The difference rises while the grip is negative and falls while it is positive, so that it vanishes at most once between two zeros.
    """
    forever = Stretch(forces=forces, kind="slide", begin=phase, end=math.inf, speed=speed, way=way)

    def ahead(phase: float) -> float:
        return way * (forever.velocity(phase) - forces.base_speed(phase))

    grip, liftoff, before = forces.grip(way), forces.held.fall(phase - 2.0 * NEXT), phase
    if liftoff - phase <= NEXT:
        return _flying(forces, phase, speed)
    while True:
        after = min(grip.crossing(before), liftoff, before + TURN)
        if ahead(after) <= 0.0:
            at_once = before == phase and ahead(before) <= 0.0  # a slide of no length: rounding
            return replace(forever, end=min(after, phase + SHORT) if at_once else root(ahead, before, after))
        if after == liftoff:
            return replace(forever, end=liftoff, thrown=True)
        before = after
