"""What an engineer works out on paper before running a case: each number one short function with its source.

SI units throughout; velocities of gas are superficial. Conveying limits and minimum fluidisation are those of
`mpm.physics`, which the DEM substudy uses as well. `mpm check` prints these numbers for a case.
"""

from __future__ import annotations

import math

from mpm.case.case import Case
from mpm.case.materials import Material
from mpm.constants import AVOGADRO
from mpm.mesh.grid import Grid
from mpm.motion.kinematics import Vibration
from mpm.motion.schedule import Schedule
from mpm.physics.porous import effective_diffusivity

STANDARD_TEMPERATURE, STANDARD_PRESSURE = 273.15, 101325.0
"""[K], [Pa]: what a standard cubic centimetre (sccm) of a mass flow controller refers to."""
MEMORY_OF_A_RANK = 0.11e9
"""Interpreter, PETSc and MPI before there is a mesh [bytes]."""
MEMORY_OF_A_CELL = 17.5e3
"""Flow factors, operators and fields [bytes]; measured, as the next one, at 28,000 and 99,000 cells."""
MEMORY_OF_A_CELL_AND_PHASE = 0.25e3
"""Operators of one phase of the cycle in the resolved fidelity [bytes]."""


def sites_per_square_nanometre(site_density: float) -> float:
    """Sites per nm2 of particle surface, n_s N_A / 1e18, of a site density [mol/m2]."""
    return site_density * AVOGADRO * 1e-18


def standard_flow(flow: float, *, temperature: float, pressure: float) -> float:
    """A flow [m2/s: m3/s per metre of depth] of an ideal gas at `temperature` and `pressure`, at standard conditions."""
    return flow * (STANDARD_TEMPERATURE / temperature) * (pressure / STANDARD_PRESSURE)


def per_minute(flow: float) -> float:
    """A standard flow [m2/s] in sccm per metre of depth."""
    return flow * 1e6 * 60.0


def reynolds(*, density: float, velocity: float, length: float, viscosity: float) -> float:
    """Re = rho u l / mu."""
    return density * velocity * length / viscosity


def peclet(*, velocity: float, length: float, diffusivity: float) -> float:
    """Pe = u l / D: convection over diffusion."""
    return velocity * length / diffusivity


def damkoehler_convection(
    *, surface_to_volume: float, rate_constant: float, length: float, velocity: float
) -> float:
    """Da_I = S k l / u: reaction on fresh surface over convection along `length`."""
    return surface_to_volume * rate_constant * length / velocity


def damkoehler_diffusion(
    *, surface_to_volume: float, rate_constant: float, length: float, diffusivity: float
) -> float:
    """Da_II = S k l^2 / D_eff: reaction on fresh surface over diffusion across `length`, the square of Thiele's modulus."""
    return surface_to_volume * rate_constant * length**2 / diffusivity


def front_thickness(*, surface_to_volume: float, rate_constant: float, diffusivity: float) -> float:
    """sqrt(D_eff/(S k)) [m]: distance over which diffusing gas reacts away on fresh surface."""
    return math.sqrt(diffusivity / (surface_to_volume * rate_constant))


def pore_diameter(material: Material) -> float:
    """Diameter [m] of the straight capillaries with the layer's permeability, d = sqrt(32 tau^2 K/eps), the narrower direction.

    Hagen and Poiseuille: K = eps d^2/(32 tau^2), with tau^2 the tortuosity factor.
    """
    return min(
        math.sqrt(32.0 * tortuosity * permeability / material.porosity)
        for tortuosity, permeability in zip(material.tortuosity_factor, material.permeability, strict=True)
    )


def knudsen(free_path: float, diameter: float) -> float:
    """Kn = l/d: mean free path over the diameter of a pore. Gas is a continuum below about 0.01."""
    return free_path / diameter


def courant(*, velocity: float, step: float, size: float) -> float:
    """u dt / dx: cells passed in a step; the flow treats convection explicitly and wants it below 1."""
    return abs(velocity) * step / size


def flow_courant(case: Case, grid: Grid) -> float:
    """Largest expected Courant number of the gas in a step of the vibration cycle.

    Along x the gas layers lag the reactor by up to its peak horizontal velocity; along y gas passes ports and outlets.
    """
    vibration, geometry = Vibration.from_motion(case.motion), case.geometry
    step = 1.0 / (case.motion.frequency * case.time.steps_per_cycle)
    flow = sum(inlet.velocity * inlet.width for inlet in geometry.inlets)
    out = flow / sum(outlet.width for outlet in geometry.outlets) if geometry.outlets else 0.0
    vertical = max([out, *(inlet.velocity for inlet in geometry.inlets)])
    across = [
        dy
        for dy, layer in zip(grid.dy, grid.row_layer, strict=True)
        if geometry.layers[layer].material is None
    ]
    return max(
        courant(velocity=vibration.ax * vibration.omega, step=step, size=grid.dx),
        courant(velocity=vertical, step=step, size=min(across)) if across else 0.0,
    )


def numerical_diffusion(case: Case, grid: Grid) -> float:
    """What the scheme adds to diffusion along x, as a share of the smallest diffusivity: (Pe/2) coth(Pe/2) - 1 with exponential fitting,
    Pe/2 with upwinding, nothing with central differences up to Pe = 2 and Pe/2 - 1 beyond.

    Pe = u dx / D_eff of a column, with the superficial velocity u at which gas may pass the columns of the mesh: with the bed, which takes
    its gas along, and at the reactor's peak velocity where every phase is resolved. About Pe^2/12 in fine meshes.
    """
    vibration, speed = Vibration.from_motion(case.motion), abs(case.conveying_velocity)
    if case.fidelity == "resolved":
        speed += vibration.ax * vibration.omega
    slowest = min(case.gas.diffusivity.values(), default=0.0)
    if slowest == 0.0 or speed == 0.0:
        return 0.0
    layer = case.geometry.moving_layer
    if layer is not None and layer.material is not None:
        porosity, tortuosity = layer.material.porosity, layer.material.tortuosity_factor[0]
        slowest = effective_diffusivity(slowest, porosity, tortuosity, case.porous.diffusion)
        speed *= porosity if case.motion.drag_reference == "pore" else 1.0
    half = 0.5 * peclet(velocity=speed, length=grid.dx, diffusivity=slowest)
    if case.transport.scheme == "upwind":
        return half
    if case.transport.scheme == "central":
        return max(half - 1.0, 0.0)
    return half / math.tanh(half) - 1.0


def expected_steps(case: Case) -> int:
    """Time steps of a run (`mpm.motion.schedule`); 0 in steady."""
    return 0 if case.fidelity == "steady" else Schedule.from_case(case).steps


def expected_memory(case: Case, cells: int, ranks: int = 1) -> float:
    """Peak memory [bytes] of a run over all ranks, from measurements on this program; good to a factor of 1.5."""
    phases = case.time.steps_per_cycle if case.fidelity == "resolved" else 0
    return ranks * MEMORY_OF_A_RANK + cells * (MEMORY_OF_A_CELL + phases * MEMORY_OF_A_CELL_AND_PHASE)
