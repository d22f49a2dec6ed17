"""Finite-volume fluxes of a dilute species between cells and through ports.

    div(u C - D_eff grad C),   D_eff = eps D / tau^2 per direction

Between two cell centres the flux of the one-dimensional problem with constant velocity is exact (exponential fitting): second order where
diffusion dominates, upwind in the limit, and always an M-matrix. `mpm.transport.schemes` has it, and the cruder ones that a case may ask
for (`transport.scheme`). Fluxes are per metre of depth.

In gas that is not everywhere equally hot (`mpm.flow.state`) what is carried and what diffuses is the mole fraction x_i,

    div(n u x_i - n D_eff grad x_i),   n u = m/M,

so that a uniform x_i stays uniform whatever the temperature does. With n over that of `[gas]`, nu, it is the same with u the mass flux over
the case's density, nu D_eff in place of D_eff, and C/nu in place of C: the coefficients of C are divided by nu of its cell.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.flow.fields import FaceFlow, inlet_share
from mpm.mesh.strip import Strip
from mpm.parallel import any_rank
from mpm.physics.porous import DiffusionLaw, bosanquet, effective_diffusivity, knudsen_diffusivity
from mpm.transport.schemes import two_point_flux

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.ports import Inlet, Outlet


def cell_diffusivity(
    strip: Strip,
    diffusivity: float | Floats,
    molar_mass: float = 0.0,
    temperature: float | Floats = 0.0,
    law: DiffusionLaw = "effective",
) -> Floats:
    """D_eff along x and y in every local cell, (2, cells) [m2/s], of a gas with this `diffusivity` [m2/s], one value or one per cell.

    `law`: what pores leave of it (`porous.diffusion`). Where a solid has a pore_diameter, a gas of this `molar_mass` [kg/mol] meets its
    walls, too (Bosanquet), at the `temperature` [K]; one without `molar_mass` does not.
    """
    grid = strip.grid
    along_x = grid.per_row(lambda solid: solid.tortuosity_factor[0], gas=1.0)[strip.row]
    along_y = grid.per_row(lambda solid: solid.tortuosity_factor[1], gas=1.0)[strip.row]
    if molar_mass and any(solid is not None and solid.pore_diameter for solid in grid.materials):
        width = grid.per_row(lambda solid: solid.pore_diameter or 0.0, gas=0.0)[strip.row]
        free = np.broadcast_to(np.asarray(diffusivity, dtype=float), width.shape)
        hot = np.broadcast_to(np.asarray(temperature, dtype=float), width.shape)
        diffusivity = free.copy()
        narrow = (width > 0.0) & (free > 0.0)
        walls = knudsen_diffusivity(width[narrow], molar_mass, hot[narrow])
        diffusivity[narrow] = bosanquet(free[narrow], walls)
    return np.stack(
        [effective_diffusivity(diffusivity, strip.porosity, factor, law) for factor in (along_x, along_y)]
    )


def face_conductance(strip: Strip, diffusivity: Floats) -> Floats:
    """1 / (h_1 / (2 D_1) + h_2 / (2 D_2)) for each face of `strip.faces` [m/s], from D_eff (2, local cells) [m2/s]."""
    faces = strip.faces
    along_x, along_y = diffusivity

    def half(cells: Ints) -> Floats:
        """Conductance from the cell's centre to the face."""
        across = np.where(
            faces.vertical_flow, along_y[cells] / strip.height[cells], along_x[cells] / strip.grid.dx
        )
        return np.asarray(2.0 * across)

    one, two = half(faces.behind), half(faces.ahead)
    whole = one + two
    return np.divide(one * two, whole, out=np.zeros_like(whole), where=whole > 0.0)


@dataclass(frozen=True, eq=False)
class PortFlux:
    """One port's exchange with its cells: species leave at `out` C_cell and enter at `into` C_port [m2/s each].

    `area` (n,) is the open length of each cell's facet [m], `volume_in` the gas flow in through it [m2/s], below 0 where it flows out.
    What an outlet draws back in is the mean of the cells `near` it: `weights` times their concentrations, summed up and over the sum of
    their `sizes` (of an inlet, which draws nothing, there are none). Volumes are those at the state of `[gas]`, and so is C_port.
    """

    cells: Ints
    out: Floats
    into: Floats
    area: Floats
    volume_in: Floats
    near: Ints
    weights: Floats
    sizes: Floats

    @property
    def volume_out(self) -> Floats:
        """Gas flow out through each facet [m2/s]."""
        return np.maximum(-self.volume_in, 0.0)


@dataclass(frozen=True, eq=False)
class FluxOperator:
    """Discrete div(u C - D grad C) for one velocity field and one diffusivity.

    The flux through a face is `from_behind` C_behind - `from_ahead` C_ahead, (faces,) [m2/s]; `inlets` and `outlets` by name; `outflow` is
    what leaves each own cell per concentration, through faces and ports, (own,) [m2/s]; `drawn_in` tells on every rank whether any outlet
    draws gas back in. No two operators of a process have the same `version`: matrices know by it what they hold.
    """

    from_behind: Floats
    from_ahead: Floats
    inlets: dict[str, PortFlux]
    outlets: dict[str, PortFlux]
    outflow: Floats
    drawn_in: bool
    version: int = field(default_factory=count().__next__)


class FluxAssembler:
    """Builds the flux operators of what diffuses with D_eff `diffusivity` (2, local cells) [m2/s] in many velocity fields.

    `relative` (local cells,) is nu, None where that is 1 everywhere; `diffusivity` is then nu D_eff. `drift` (faces,) [m/s] carries beside
    the gas.
    """

    def __init__(
        self,
        case: Case,
        strip: Strip,
        diffusivity: Floats,
        relative: Floats | None = None,
        drift: Floats | None = None,
    ):
        self.case, self.strip, self.diffusivity, self.relative = case, strip, diffusivity, relative
        self.conductance, self.drift = face_conductance(strip, diffusivity), drift

    def operator(self, flow: FaceFlow) -> FluxOperator:
        """The operator of one velocity field; collective."""
        inner = flow.inner if self.drift is None else flow.inner + self.drift
        from_behind, from_ahead = two_point_flux(inner, self.conductance, self.case.transport.scheme)
        if self.relative is not None:
            from_behind /= self.relative[self.strip.faces.behind]
            from_ahead /= self.relative[self.strip.faces.ahead]
        inlets = {inlet.name: self._inlet(inlet, flow) for inlet in self.case.geometry.inlets}
        outlets = {outlet.name: self._outlet(outlet, flow) for outlet in self.case.geometry.outlets}
        drawn = any(np.any(port.into > 0.0) for port in outlets.values())
        from_behind, from_ahead = from_behind * self.strip.face_length, from_ahead * self.strip.face_length
        outflow = self._outflow(from_behind, from_ahead, [*inlets.values(), *outlets.values()])
        return FluxOperator(
            from_behind, from_ahead, inlets, outlets, outflow, any_rank(self.strip.comm, drawn)
        )

    def diffusion(self, concentration: Floats) -> Floats:
        """Flux by diffusion alone through the faces inside (faces,) [mol/s per metre of depth], of local cells' concentrations."""
        carried = concentration if self.relative is None else concentration / self.relative
        behind, ahead = carried[self.strip.faces.behind], carried[self.strip.faces.ahead]
        flux = self.conductance * (behind - ahead)
        if self.drift is not None:
            flux = flux + self.drift * 0.5 * (behind + ahead)
        return np.asarray(flux * self.strip.face_length)

    def _outflow(self, from_behind: Floats, from_ahead: Floats, ports: list[PortFlux]) -> Floats:
        strip = self.strip
        # of a strip of one cell, which has no face, a bincount counts in integers
        outflow = np.bincount(strip.faces.behind, from_behind, len(strip.cell)).astype(float)
        outflow += np.bincount(strip.faces.ahead, from_ahead, len(strip.cell))
        for port in ports:
            np.add.at(outflow, port.cells, port.out)
        return np.array(outflow[: strip.owned])

    def _inlet(self, inlet: Inlet, flow: FaceFlow) -> PortFlux:
        """Diffuses as well, over half a cell, where the case lets it (`geometry.inlet_diffusion`)."""
        strip, grid = self.strip, self.strip.grid
        cells = strip.wall_cells(inlet.side)
        columns = strip.column[cells]
        overlap, part = grid.overlap(inlet)[columns], inlet_share(self.case, grid, inlet)[columns]
        mine = np.flatnonzero(overlap > 0.0)
        cells, area = cells[mine], overlap[mine]
        volume_in = flow.inward(inlet.side)[mine] * grid.dx * part[mine]
        conductance = np.zeros_like(area)
        if self.case.geometry.inlet_diffusion:
            conductance = 2.0 * self.diffusivity[1][cells] / strip.height[cells]
        into, out = two_point_flux(volume_in / area, conductance, self.case.transport.scheme)
        leaving = self._per_concentration(out * area, cells)
        return PortFlux(cells, leaving, into * area, area, volume_in, cells[:0], area[:0], area[:0])

    def _outlet(self, outlet: Outlet, flow: FaceFlow) -> PortFlux:
        """Convection alone: gas leaves with what its cell holds."""
        strip = self.strip
        cells = strip.wall_cells(outlet.side)
        mine = np.flatnonzero(strip.grid.opening(outlet)[strip.column[cells]])
        volume_in = flow.inward(outlet.side)[mine] * strip.grid.dx
        area = np.full(len(mine), strip.grid.dx)
        out, cells = np.maximum(-volume_in, 0.0), cells[mine]
        near = self._near(outlet)
        leaving, sizes = self._per_concentration(out, cells), strip.volume[near]
        weights = self._per_concentration(sizes, near)
        return PortFlux(cells, leaving, np.maximum(volume_in, 0.0), area, volume_in, near, weights, sizes)

    def _near(self, outlet: Outlet) -> Ints:
        """Own cells whose mean the outlet draws back in: the rows next to it (`transport.backflow_rows`)."""
        strip, own = self.strip, self.strip.owned
        deep = strip.row[:own] if outlet.side == "bottom" else strip.grid.rows - 1 - strip.row[:own]
        there = strip.grid.opening(outlet)[strip.column[:own]]
        return np.flatnonzero((deep < self.case.transport.backflow_rows) & there)

    def _per_concentration(self, coefficients: Floats, cells: Ints) -> Floats:
        """Coefficients of the concentrations of `cells`, from those of what is carried."""
        return coefficients if self.relative is None else coefficients / self.relative[cells]
