"""Finite-volume fluxes of a dilute species between cells and through ports.

    div(u C - D_eff grad C),   D_eff = eps D / tau^2 per direction

Between two cell centres the flux of the one-dimensional problem with constant velocity is exact (Scharfetter-Gummel, exponential
fitting): F = g (B(-Pe) C_behind - B(Pe) C_ahead), B(z) = z / (exp z - 1), Pe = u / g, where 1/g is the sum of the half-cell
resistances h / (2 D_eff). It is second order where diffusion dominates, upwind in the limit, and always gives an M-matrix:
concentrations stay positive and within bounds. Fluxes are per metre of depth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpm.flow.problem import FaceFlow, inlet_share
from mpm.mesh.strip import Strip
from mpm.parallel import any_rank
from mpm.physics.exponentials import bernoulli

if TYPE_CHECKING:
    from mpm.case.case import Case, Inlet, Outlet

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def exponential_flux(velocity: Floats, conductance: Floats) -> tuple[Floats, Floats]:
    """Coefficients (a, b) [m/s] of the flux a C_behind - b C_ahead for a face velocity [m/s] and conductance g [m/s].

    g = 0 is legal and gives pure upwind; a - b = velocity always, and neither is negative, not even by rounding.
    """
    velocity, conductance = np.broadcast_arrays(np.asarray(velocity, float), np.asarray(conductance, float))
    diffusing = conductance > 1e-12 * np.abs(velocity)
    g = np.where(diffusing, conductance, 1.0)
    b = np.where(diffusing, g * bernoulli(velocity / g), np.maximum(-velocity, 0.0))
    return np.maximum(b + velocity, 0.0), b


def effective_diffusivity(case: Case, strip: Strip, diffusivity: float) -> tuple[Floats, Floats]:
    """eps D / tau^2 along x and y in every local cell [m2/s], with tau^2 the tortuosity factor (TauFactor's, table 5.4 of the thesis).

    The thesis prints D eps/tau with tau a ratio of lengths (5-6) and leaves the flux in its porous zones unreduced (5-12, 5-13):
    docs/source.md says what either changes.
    """
    rows_x, rows_y = [], []
    for index in strip.grid.row_layer:
        material = case.geometry.layers[index].material
        eps, tau = (material.porosity, material.tortuosity_factor) if material else (1.0, (1.0, 1.0))
        rows_x.append(eps * diffusivity / tau[0])
        rows_y.append(eps * diffusivity / tau[1])
    return np.asarray(rows_x)[strip.row], np.asarray(rows_y)[strip.row]


def face_conductance(strip: Strip, along_x: Floats, along_y: Floats) -> Floats:
    """1 / (h_1 / (2 D_1) + h_2 / (2 D_2)) for each face of `strip.faces` [m/s]."""
    faces = strip.faces

    def half(cells: Ints) -> Floats:
        """Conductance from the cell's centre to the face."""
        across = np.where(
            faces.vertical_flow, along_y[cells] / strip.height[cells], along_x[cells] / strip.grid.dx
        )
        return 2.0 * across

    one, two = half(faces.behind), half(faces.ahead)
    whole = one + two
    return np.divide(one * two, whole, out=np.zeros_like(whole), where=whole > 0.0)


@dataclass(frozen=True, eq=False)
class PortFlux:
    """One port's exchange with its cells: species leave at `out` C_cell and enter at `into` C_port [m2/s each].

    `area` (n,) is the open length of each cell's facet [m], `volume_out` the gas flow out through it [m2/s].
    """

    cells: Ints
    out: Floats
    into: Floats
    area: Floats
    volume_out: Floats


@dataclass(frozen=True, eq=False)
class FluxOperator:
    """Discrete div(u C - D grad C) for one velocity field and one diffusivity.

    `a`, `b` (faces,) face coefficients times face length [m2/s], `inlets` and `outlets` by name; `drawn_in` tells on every rank whether
    any outlet draws gas back in.
    """

    a: Floats
    b: Floats
    inlets: dict[str, PortFlux]
    outlets: dict[str, PortFlux]
    drawn_in: bool


class FluxAssembler:
    """Builds flux operators of one diffusivity [m2/s] for many velocity fields."""

    def __init__(
        self, case: Case, strip: Strip, diffusivity: float, dispersion: tuple[Floats, Floats] | None = None
    ):
        self.case, self.strip = case, strip
        self.along_x, self.along_y = effective_diffusivity(case, strip, diffusivity)
        if dispersion is not None:
            self.along_x, self.along_y = self.along_x + dispersion[0], self.along_y + dispersion[1]
        self.conductance = face_conductance(strip, self.along_x, self.along_y)
        faces = strip.faces
        self.length = np.where(faces.vertical_flow, strip.grid.dx, strip.height[faces.behind])

    def operator(self, flow: FaceFlow) -> FluxOperator:
        a, b = exponential_flux(flow.inner, self.conductance)
        inlets = {inlet.name: self._inlet(inlet, flow) for inlet in self.case.geometry.inlets}
        outlets = {outlet.name: self._outlet(outlet, flow) for outlet in self.case.geometry.outlets}
        drawn = any(np.any(port.into > 0.0) for port in outlets.values())
        return FluxOperator(
            a * self.length, b * self.length, inlets, outlets, any_rank(self.strip.comm, drawn)
        )

    def _wall(self, side: str, flow: FaceFlow) -> tuple[Ints, Ints, Floats]:
        """Cells along a wall, their columns, and the velocity into the strip through it."""
        cells = self.strip.wall_cells(side)
        return cells, self.strip.column[cells], flow.bottom if side == "bottom" else -flow.top

    def _inlet(self, inlet: Inlet, flow: FaceFlow) -> PortFlux:
        cells, columns, inward = self._wall(inlet.side, flow)
        grid = self.strip.grid
        overlap = grid.overlap(inlet)[columns]
        part = inlet_share(self.case, grid, inlet)[columns]
        mine = np.flatnonzero(overlap > 0.0)
        cells, area = cells[mine], overlap[mine]
        volume_in = inward[mine] * grid.dx * part[mine]
        conductance = np.zeros_like(area)
        if self.case.geometry.inlet_diffusion:
            conductance = 2.0 * self.along_y[cells] / self.strip.height[cells]
        into, out = exponential_flux(volume_in / area, conductance)
        return PortFlux(cells, out * area, into * area, area, np.maximum(-volume_in, 0.0))

    def _outlet(self, outlet: Outlet, flow: FaceFlow) -> PortFlux:
        cells, columns, inward = self._wall(outlet.side, flow)
        mine = np.flatnonzero(self.strip.grid.opening(outlet)[columns])
        volume_in = inward[mine] * self.strip.grid.dx
        area = np.full(len(mine), self.strip.grid.dx)
        out = np.maximum(-volume_in, 0.0)
        return PortFlux(cells[mine], out, np.maximum(volume_in, 0.0), area, out)
