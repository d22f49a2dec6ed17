"""Species that take no part in any reaction, in the steady state: one linear system per diffusivity.

    div(u C - D grad C) = s + sum_k e_k c_k,     c_k = mean of C in the cells next to outlet k

s is what inlets and reactions bring, e_k what outlet k draws back in [m2/s] where it does. The means belong to the unknown: with C_0 the
field of s alone and G_k that of e_k, C = C_0 + sum_k c_k G_k, and the means follow from a dense system of as many unknowns as outlets
draw in, (I - M G) c = M C_0 with M the mean next to each of them. Exact, however much of what leaves comes back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.numerics.linear import DirectSolver
from mpm.parallel import any_rank, total
from mpm.transport.cell_matrix import CellMatrix

if TYPE_CHECKING:
    from mpm.mesh.strip import Strip
    from mpm.transport.fluxes import FluxOperator, PortFlux


def steady_fields(strip: Strip, operators: list[FluxOperator], supply: Floats) -> Floats:
    """Concentrations (n, own cells) [mol/m3] under `supply` (n, own cells) [mol/m/s] from inlets and reactions; collective.

    `operators` are those of the n species. Raises ConvergenceError.
    """
    fields = np.zeros_like(supply)
    for operator in dict.fromkeys(operators):
        alike = [i for i, o in enumerate(operators) if o is operator]
        if any_rank(strip.comm, bool(np.any(supply[alike]))):  # without gas flow only 0 = 0 can be solved
            fields[alike] = _fields(strip, operator, supply[alike])
    return fields


def _fields(strip: Strip, operator: FluxOperator, supply: Floats) -> Floats:
    """Fields of species with the same operator."""
    cells = CellMatrix(strip, 1)
    cells.assemble(cells.set_fluxes([operator]))
    solution, right = cells.matrix.createVecs()
    solver = DirectSolver(cells.matrix, "steady species that do not react")

    def solve(rhs: Floats) -> Floats:
        right.array[:] = rhs
        solver.solve(right, solution)
        return np.array(solution.array)

    try:
        own = np.stack([solve(rhs) for rhs in supply])
        ports = list(operator.outlets.values()) if operator.drawn_in else []
        if not ports:
            return own
        returned = np.stack([solve(_drawn_in(port, supply.shape[1])) for port in ports])
    finally:
        solver.destroy()
    both, split = np.vstack([own, returned]), len(own)
    sums = total(strip.comm, [[*(both[:, p.near] @ p.weights), p.sizes.sum()] for p in ports])
    means = sums[:, :-1] / sums[:, -1:]
    drawn = np.linalg.solve(np.eye(len(ports)) - means[:, split:], means[:, :split])
    return own + drawn.T @ returned


def _drawn_in(port: PortFlux, cells: int) -> Floats:
    """Supply of own cells when a port draws in gas of unit concentration."""
    supply = np.zeros(cells)
    supply[port.cells] = port.into
    return supply
