"""Dispersion by vibration: the effective diffusivity that the oscillating part of the velocity adds to its mean.

Split velocity and concentration into means over a cycle and the rest, u = U + u', c = <c> + c'. Where <c> varies over lengths far above
the vibration's amplitude, c' = chi . grad <c> with one corrector per direction,

    eps dchi_j/dt + div(U chi_j - D_eff grad chi_j) = -u'_j        periodic in time, no flux of chi through walls,

and the mean flux gains <u' c'> = -K grad <c> with K_ij = -<u'_i chi_j> [m2/s]. Left out is the transport of chi by u' itself, of the
order of amplitude over layer height, and reaction. The equation is linear with coefficients constant in time: each harmonic of the cycle
is one complex system. In a channel between walls that vibrate along it, the mean of K over the height is the oscillatory dispersion of
Watson (1983), J. Fluid Mech. 133, 233.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.flow.cycle import periodic_flow
from mpm.flow.fields import FlowField, face_flow, mean_field
from mpm.flow.problem import FlowProblem
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion
from mpm.numerics.linear import DirectSolver
from mpm.parallel import total
from mpm.transport.cell_matrix import CellMatrix
from mpm.transport.fluxes import FluxAssembler, cell_diffusivity

if TYPE_CHECKING:
    from mpm.case.case import Case

NEGLIGIBLE = 1e-8  # share of the oscillation's energy below which a harmonic is left out
LEAST = 0.1  # of D_eff: what a locally negative K leaves of it


def vibrational_dispersion(
    case: Case,
    strip: Strip,
    bed_motion: BedMotion,
    diffusivities: Sequence[float],
    watch: Callable[[int, float], None] | None = None,
) -> Floats:
    """K_xx and K_yy of gases with these `diffusivities` [m2/s] in all local cells, (diffusivities, 2, local cells) [m2/s].

    Finds the periodic cycle of the flow with the case's steps per cycle first. Zero without vibration. Raises ConvergenceError.
    """
    if case.motion.gamma == 0.0:
        return np.zeros((len(diffusivities), 2, strip.local))
    phases = case.time.steps_per_cycle
    problem = FlowProblem(case, strip, bed_motion.vibration.period / phases)
    fields = periodic_flow(problem, bed_motion, phases, watch)
    result = np.empty((len(diffusivities), 2, strip.local))
    for k, diffusivity in enumerate(diffusivities):
        tensor = dispersion_tensor(case, strip, fields, bed_motion.vibration.period, diffusivity)
        whole = strip.scatter.to_all(np.stack([tensor[0, 0], tensor[1, 1]]))[:, strip.cell]
        result[k] = np.maximum(
            whole, (LEAST - 1.0) * cell_diffusivity(strip, diffusivity, law=case.porous.diffusion)
        )
    return result


def dispersion_tensor(
    case: Case, strip: Strip, fields: Sequence[FlowField], period: float, diffusivity: float
) -> Floats:
    """K (2, 2, own cells) [m2/s] from one stored cycle of the flow lasting `period` [s]; collective."""
    own, volume = strip.owned, strip.volume[: strip.owned]
    phases = len(fields)
    velocity = np.stack([field.in_cells(own) for field in fields])  # (phases, 2, own)
    harmonics = np.fft.rfft(velocity, axis=0) / phases
    energy = total(strip.comm, (np.abs(harmonics) ** 2 * volume).sum(axis=(1, 2)))
    flow = face_flow(strip, mean_field(list(fields)).velocities)
    effective = cell_diffusivity(strip, diffusivity, law=case.porous.diffusion)
    operator = FluxAssembler(case, strip, effective).operator(flow)
    cells = CellMatrix(strip, 2)  # real and imaginary part
    diagonal = cells.set_fluxes([operator, operator])
    storage = strip.gas_volume[:own]
    x, y = cells.matrix.createVecs()
    solver = DirectSolver(cells.matrix, "dispersion by vibration")
    tensor = np.zeros((2, 2, own))
    for n in range(1, len(harmonics)):
        if energy[n] <= NEGLIGIBLE * energy[1:].sum():
            continue
        turning = 2.0 * np.pi * n / period * storage
        blocks = np.zeros((own, 2, 2))
        blocks[:, 0, 0], blocks[:, 1, 1] = diagonal
        blocks[:, 0, 1], blocks[:, 1, 0] = -turning, turning
        cells.assemble(blocks)
        twice = 1.0 if 2 * n == phases else 2.0  # a harmonic and its conjugate
        for j in range(2):
            drive = -harmonics[n, j] * volume
            y.array[:] = np.column_stack([drive.real, drive.imag]).ravel()
            solver.solve(y, x)
            real, imaginary = x.array.reshape(own, 2).T
            tensor[:, j] -= twice * (harmonics[n].conj() * (real + 1j * imaginary)).real
    return tensor
