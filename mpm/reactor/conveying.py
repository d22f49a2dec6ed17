"""Carry the solids along the bed at given concentrations: the coverages of the steady state that follow from those."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from mpm.reactor.steady_system import SteadySystem

Floats = NDArray[np.float64]


def carry(system: SteadySystem, step: float) -> None:
    """Set the system's coverages to those at its present concentrations: theta_out of every cell from the one before it.

    In every cell theta_out = M theta_in with a stochastic M, so the coverage stays within [0, 1]. Periodic solids come in as they
    left: the fixed point of the product of all M.
    """
    if not system.conveys:
        return
    bed, surface, k = system.bed, system.transport.surface, system.kinds
    chosen = bed.cells[system.moving]
    span = 1.0 / (1.0 / step + 1.0 / system.residence)
    share = span / system.residence
    part = surface.part(system.moving)
    c = system.concentration[:, chosen]
    columns = [
        part.conveyed(c, np.repeat(e[:, None], len(system.moving), axis=1), span).out for e in np.eye(k)
    ]
    local = np.zeros((k * k + k, len(bed.cells)))
    local[: k * k, system.moving] = np.concatenate(columns)  # column by column
    local[k * k :, system.moving] = system.old[1][:, system.moving]
    whole = bed.scatter.to_all(local).reshape(len(local), len(bed.rows), bed.columns)[:, bed.moving_rows]
    m = np.moveaxis(
        whole[: k * k].reshape(k, k, *whole.shape[1:]), (0, 1, 2, 3), (3, 2, 1, 0)
    )  # (columns, rows, out, in)
    aged = (1.0 - share) * np.moveaxis(whole[k * k :], (0, 1, 2), (2, 1, 0))  # (columns, rows, sites)
    incoming = bed.fresh[:, bed.moving_rows].T
    theta = np.empty_like(aged)
    way = system.direction  # columns in the order in which solids meet them
    m, aged = m[::way], aged[::way]
    if system.periodic:
        incoming = _fixed_point(m, aged, share, incoming)
    for j in range(len(m)):
        incoming = np.einsum("roi,ri->ro", m[j], share * incoming + aged[j])
        incoming = np.maximum(incoming, 0.0)
        incoming = theta[j] = incoming / incoming.sum(
            axis=1, keepdims=True
        )  # rounding would add up along the bed
    result = np.zeros((k, len(bed.rows), bed.columns))
    result[:, bed.moving_rows] = np.moveaxis(theta[::way], (0, 1, 2), (2, 1, 0))
    new = system.theta.copy()
    new[:, system.moving] = bed.scatter.to_local(result.reshape(k, -1))[:, system.moving]
    system.theta = new


def _fixed_point(m: Floats, aged: Floats, share: float, start: Floats) -> Floats:
    """Coverage (rows, sites) that the solids bring back after one turn: theta = A theta + c of all columns together."""
    k = m.shape[-1]
    a = np.broadcast_to(np.eye(k), m.shape[1:]).copy()
    c = np.zeros(m.shape[1:3])
    for j in range(len(m)):
        a = share * m[j] @ a
        c = np.einsum("roi,ri->ro", m[j], share * c + aged[j])
    theta = start
    for row in range(len(a)):
        gap = np.eye(k) - a[row]
        theta[row] = np.linalg.lstsq(np.vstack([gap, np.ones(k)]), np.append(c[row], 1.0))[0]
    return theta
