"""What the theory of oscillatory dispersion says of the strip: closed forms in its gas layers, and all layers together.

In a strip that is the same everywhere along x gas moves along x alone, in every layer as its walls make it move:

    gas layers      du/dt = nu d2u/dy2 - X'',  u = velocity of the solids at the walls (plenum: 0 and 0; headspace: v_s and 0)
    bed, frit       u = eps v_s and 0: gas is locked to the solid (a Brinkman layer is 2 um thick)

and c' = chi d<c>/dx with eps dchi/dt = d/dy(D_eff dchi/dy) - u', so that diffusion along x grows by K = -<u' chi>. Watson (1983), J. Fluid
Mech. 133, 233, has K between two walls without flux through them; here each harmonic of the bed's motion is one such problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from mpm import Case
from mpm.arrays import Floats
from mpm.motion.kinematics import BedMotion

Complex = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]
PHASES, HARMONICS, ROWS = 4096, 48, 240
"""Phases of a cycle, harmonics of the bed's motion, rows of each layer: K to five digits."""
NODES = 400
"""Gauss points across a channel; its Stokes layers are some percent of it."""


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One layer with `harmonics` (n, rows) of u along x [m/s] in the reactor's frame, their `mean` (rows,) and storage `eps`."""

    name: str
    height: float
    eps: float
    along: float
    across: float
    mean: Floats
    harmonics: Complex

    @property
    def dy(self) -> float:
        return self.height / ROWS

    def velocity(self) -> Floats:
        """u (phases, rows) [m/s] at 256 phases of a cycle."""
        phase = 2.0 * np.pi * np.arange(256) / 256
        turn = np.exp(1j * np.outer(phase, np.arange(1, HARMONICS + 1)))
        return np.asarray(self.mean + (turn @ self.harmonics).real)


def signals(case: Case) -> tuple[Complex, Complex, float]:
    """Harmonics of the bed's velocity relative to the reactor and of the reactor's own [m/s], and the bed's mean velocity [m/s]."""
    bed = BedMotion(case.motion)
    vibration = bed.vibration
    times = vibration.period * np.arange(PHASES + 1) / PHASES
    slid = np.diff([bed.at(t) for t in times]) / (vibration.period / PHASES)
    middle = 0.5 * (times[1:] + times[:-1])
    frame = np.array([vibration.velocity(t)[0] for t in middle])
    # phases count from the middle of the first step; the same turn for both leaves K and |u| as they are
    solid, moved = (
        np.asarray(2.0 * np.fft.rfft(v)[1 : HARMONICS + 1] / PHASES, dtype=np.complex128)
        for v in (slid, frame)
    )
    return solid, moved, float(slid.mean())


def between_walls(floor: complex, roof: complex, rate: complex, height: float, y: Floats) -> Complex:
    """[floor sinh(l(H - y)) + roof sinh(l y)]/sinh(l H) with l^2 = `rate` [1/m2], without overflow: gas between walls that move."""
    root = np.sqrt(rate)
    whole = 1.0 - np.exp(-2.0 * root * height)

    def sinh(a: Floats, b: Floats) -> Complex:
        """sinh(l (H - y))/sinh(l H) for y = a, H - y = b."""
        return np.asarray((np.exp(-root * a) - np.exp(-root * (height + b))) / whole)

    return np.asarray(floor * sinh(y, height - y) + roof * sinh(height - y, y))


def watson(
    floor: Complex, roof: Complex, *, omega: float, viscosity: float, diffusivity: float, height: float
) -> float:
    """K/D between walls a `height` apart [m] that move along themselves with harmonics `floor` and `roof` [m/s] of `omega` [1/s].

    i w c + u - <u> = D c'' with c' = 0 at both walls; with l^2 = i w/nu and s^2 = i w/D

        c = <u>/(i w) + u/(D l^2 - i w) + a cosh(s (H - y)) + b cosh(s y),   K = -1/2 Re< conj(u - <u>) c >
    """
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    y, weights = 0.5 * height * (1.0 + nodes), 0.5 * weights
    found = 0.0
    for n, (below, above) in enumerate(zip(floor, roof, strict=True), start=1):
        turn = 1j * n * omega
        flow, gas = np.sqrt(turn / viscosity), np.sqrt(turn / diffusivity)
        u = between_walls(below, above, turn / viscosity, height, y)
        mean = weights @ u
        share = 1.0 / (diffusivity * flow**2 - turn)
        # slopes of u at the walls: l [roof - floor cosh(l H)]/sinh(l H), and the mirror of it
        cosh, sinh = 1.0 / np.tanh(flow * height), 1.0 / np.sinh(flow * height)
        low, high = flow * (above * sinh - below * cosh), flow * (above * cosh - below * sinh)
        # cosh(s (H - y))/sinh(s H) has slope -s at y = 0 and none at H
        end = 1.0 - np.exp(-2.0 * gas * height)
        left = (np.exp(-gas * y) + np.exp(-gas * (2.0 * height - y))) / end
        right = (np.exp(-gas * (height - y)) + np.exp(-gas * (height + y))) / end
        c = mean / turn + share * u + share * (low * left - high * right) / gas
        found -= 0.5 * float((weights @ (np.conj(u - mean) * c)).real)
    return found / diffusivity


def layers(case: Case, *, drag: str = "pore", free: bool = False) -> list[Layer]:
    """The strip's layers, with gas in the bed at eps v_s (`drag` "pore") or at v_s ("superficial"), D not reduced by pores if `free`."""
    solid, moved, mean = signals(case)
    omega, viscosity = BedMotion(case.motion).vibration.omega, case.gas.viscosity / case.gas.density
    diffusivity = case.gas.diffusivity["TMA"]
    still = np.zeros_like(solid)
    stack = case.geometry.layers
    found = []
    for i, layer in enumerate(stack):
        y = layer.height * (np.arange(ROWS) + 0.5) / ROWS
        material = layer.material
        if material is not None:
            share = (material.porosity if drag == "pore" else 1.0) if layer.moving else 0.0
            along, across = (
                1.0 if free else material.porosity / material.tortuosity_factor[k] for k in (0, 1)
            )
            eps, steady = material.porosity, np.full(ROWS, share * mean)
            harmonics = np.outer(share * solid, np.ones(ROWS))
        else:
            eps, along, across = 1.0, 1.0, 1.0
            below = i > 0 and stack[i - 1].moving
            above = i + 1 < len(stack) and stack[i + 1].moving
            floor, roof = (moved + (solid if touches else still) for touches in (below, above))
            walls = zip(floor, roof, strict=True)
            lab = [
                between_walls(a, b, 1j * n * omega / viscosity, layer.height, y)
                for n, (a, b) in enumerate(walls, start=1)
            ]
            harmonics = np.array(lab) - moved[:, None]
            steady = mean * (below * (1.0 - y / layer.height) + above * y / layer.height)
        found.append(
            Layer(
                name=layer.name,
                height=layer.height,
                eps=eps,
                along=along * diffusivity,
                across=across * diffusivity,
                mean=steady,
                harmonics=harmonics,
            )
        )
    return found


def stack_dispersion(strip: list[Layer], omega: float) -> dict[str, float]:
    """K over D_eff along x of each layer, from the corrector of all layers together; `omega` [1/s]."""
    dy = np.concatenate([np.full(ROWS, layer.dy) for layer in strip])
    eps = np.concatenate([np.full(ROWS, layer.eps) for layer in strip])
    resistance = dy / (2.0 * np.concatenate([np.full(ROWS, layer.across) for layer in strip]))
    conductance = np.concatenate([[0.0], 1.0 / (resistance[1:] + resistance[:-1]), [0.0]])
    u = np.concatenate([layer.harmonics for layer in strip], axis=1)
    k = np.zeros(len(dy))
    for n, drive in enumerate(u, start=1):
        bands = np.zeros((3, len(dy)), dtype=complex)
        bands[0, 1:], bands[2, :-1] = -conductance[1:-1], -conductance[1:-1]
        bands[1] = conductance[1:] + conductance[:-1] + 1j * n * omega * eps * dy
        chi = solve_banded((1, 1), bands, -drive * dy)
        k -= 0.5 * (np.conj(drive) * chi).real
    of_layers = k.reshape(len(strip), ROWS).mean(axis=1)
    return {layer.name: float(x) / layer.along for layer, x in zip(strip, of_layers, strict=True)}


def added_by_scheme(layer: Layer, width: float, scheme: str) -> float:
    """What a scheme adds to diffusion along x in columns of `width` [m] over D_eff, mean over a cycle and the layer.

    upwind: |u| h/(2 D_eff); fitted: z coth z - 1 with z = |u| h/(2 D_eff), about z^2/3.
    """
    z = np.abs(layer.velocity()) * width / (2.0 * layer.along)
    if scheme == "upwind":
        return float(z.mean())
    small = z < 1e-4
    z = np.where(small, 1.0, z)
    return float(np.where(small, 0.0, z / np.tanh(z) - 1.0).mean())


def added_by_steps(layer: Layer, step: float) -> float:
    """What backward Euler with this `step` [s] adds to diffusion along x over D_eff, mean over a cycle and the layer.

    u^2 dt/(2 eps D_eff).
    """
    return float((layer.velocity() ** 2).mean() * step / (2.0 * layer.eps * layer.along))
