"""Fluxes of heat in one flow of the gas: with the gas, by conduction, to walls and, in the steady state, with the bed.

They are those of a species (`mpm.transport.fluxes`) once everything is divided by rho_ref c_p of the gas, `unit` [J/m3/K]: temperature in
place of a concentration, k_eff/unit in place of D.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.flow.fields import FaceFlow, FlowField, face_flow
from mpm.flow.state import GasState
from mpm.mesh.strip import Strip
from mpm.parallel import total
from mpm.transport.conduction import cell_conductivity, cut_faces, solid_capacity, wall_contacts
from mpm.transport.fluxes import FluxAssembler, FluxOperator

if TYPE_CHECKING:
    from mpm.case.case import Case


@dataclass(frozen=True, eq=False)
class HeatOperator:
    """Fluxes of heat over rho_ref c_p in one flow: those of gas and conduction, with what goes to walls in the diagonal; `walls` are the
    conductances [m2/s] of each wall's cells, `velocity` and `conductance` (faces,) [m/s] what the fluxes inside are made of."""

    fluxes: FluxOperator
    walls: list[Floats]
    velocity: Floats
    conductance: Floats


@dataclass(frozen=True, eq=False)
class Diffusing:
    """A species that diffuses with `flux` through the faces inside (faces,) [mol/s/m], and its `capacity` over the carrier's [J/mol/K]."""

    capacity: float
    flux: Floats


class HeatFluxes:
    """What builds the fluxes of heat of a strip.

    Temperatures count from `reference`, that of `[gas]` [K]: `feeds` (inlets,) are those of what inlets blow, `entering` that of solids
    that come in [K]. `solid` (own,) is the heat capacity of the solids over `unit` [m2], `heating` (own,) what is heated electrically
    [W/m].
    """

    def __init__(self, case: Case, strip: Strip):
        own = slice(0, strip.owned)
        self.case, self.strip, self.reference = case, strip, case.gas.temperature
        self.unit = case.gas.density * case.gas.heat_capacity
        self._capacity = solid_capacity(strip.grid)[strip.row]
        self.solid = (self._capacity * strip.volume)[own] / self.unit
        self.walls = wall_contacts(case, strip)
        self._cut = cut_faces(case, strip)
        heating = np.array([layer.heating for layer in case.geometry.layers])
        self.heating = (heating[strip.grid.row_layer[strip.row]] * strip.volume)[own]
        self.feeds = np.array([case.inlet_temperature(i) - self.reference for i in case.geometry.inlets])
        self.entering = case.bed_temperature - self.reference
        self.periodic = case.geometry.bed_inflow == "periodic"

    def operator(self, flow: FlowField, gas: GasState, solids: float = 0.0) -> HeatOperator:
        """The fluxes in one flow; collective.

        `solids` [m/s]: the velocity of the bed where its heat goes with a stream (steady state), upwind, and not with its columns.
        """
        conductivity = cell_conductivity(self.case, self.strip, gas.temperature)
        assembler = FluxAssembler(self.case, self.strip, np.stack([conductivity] * 2) / self.unit)
        assembler.conductance[self._cut] = 0.0
        faces = face_flow(self.strip, flow.velocities)
        if solids:
            faces = FaceFlow(faces.inner + self._stream(solids), faces.bottom, faces.top)
        bare = assembler.operator(faces)
        walls = [wall.conductance(conductivity) / self.unit for wall in self.walls]
        outflow = bare.outflow.copy()
        for wall, conductance in zip(self.walls, walls, strict=True):
            np.add.at(outflow, wall.cells, conductance)
        if solids:
            cells, stream = self.leaving(solids)
            outflow[cells] += stream
        fluxes = FluxOperator(
            bare.from_behind, bare.from_ahead, bare.inlets, bare.outlets, outflow, bare.drawn_in
        )
        return HeatOperator(fluxes, walls, faces.inner, assembler.conductance)

    def _stream(self, solids: float) -> Floats:
        """Velocity over the faces inside [m/s] at which gas would carry as much heat as the bed does; none over a seam with fresh
        solids."""
        strip, faces = self.strip, self.strip.faces
        along = ~faces.vertical_flow & strip.grid.moving[strip.row[faces.behind]]
        seam = (strip.column[faces.ahead] == 0) & (strip.column[faces.behind] == strip.grid.columns - 1)
        if not self.periodic:
            along &= ~seam
        return np.where(along, solids * self._capacity[faces.behind] / self.unit, 0.0)

    def leaving(self, solids: float, entering: bool = False) -> tuple[Ints, Floats]:
        """Own cells from which the bed leaves the strip (or where it enters), and what it carries there per kelvin over `unit` [m2/s]."""
        strip, own = self.strip, self.strip.owned
        last = (solids > 0.0) != entering
        at = strip.grid.columns - 1 if last else 0
        there = (strip.column[:own] == at) & strip.grid.moving[strip.row[:own]]
        cells = np.flatnonzero(there & (not self.periodic))
        return cells, abs(solids) * self._capacity[cells] * strip.height[cells] / self.unit

    def diffusing(self, carried: Sequence[Diffusing], excess: Floats) -> Floats:
        """Heat that diffusing species bring into own cells (own,) [W/m], -sum_i (c_i - c) div(J_i h); collective.

        Each takes along what its heat capacity c_i [J/mol/K] has more than that of the carrier, c, in whose place it goes.
        """
        strip, faces = self.strip, self.strip.faces
        gained = np.zeros(strip.local)
        if carried:
            warmth = strip.scatter.to_all(excess)[strip.cell]
            flow = sum(one.capacity * one.flux for one in carried)
            flow = flow * 0.5 * (warmth[faces.behind] + warmth[faces.ahead])
            gained += np.bincount(faces.ahead, flow, strip.local) - np.bincount(
                faces.behind, flow, strip.local
            )
        return gained[: strip.owned]

    def supply(self, operator: HeatOperator, drawn: dict[str, Floats]) -> Floats:
        """What enters own cells through inlets, outlets that draw back in, walls and heating, over `unit` (own,) [K m2/s]."""
        supply = self.heating / self.unit
        for feed, port in zip(self.feeds, operator.fluxes.inlets.values(), strict=True):
            np.add.at(supply, port.cells, port.into * feed)
        for name, mean in drawn.items():
            port = operator.fluxes.outlets[name]
            np.add.at(supply, port.cells, port.into * mean[0])
        for wall, conductance in zip(self.walls, operator.walls, strict=True):
            np.add.at(
                supply, wall.cells, conductance * (wall.outside - self.reference) + wall.flow / self.unit
            )
        return supply

    def steady_supply(
        self, operator: HeatOperator, solids: float, made: Floats, drawn: dict[str, Floats]
    ) -> Floats:
        """The same with what the bed brings in at `solids` [m/s] and reactions give off, `made` (own,) [W/m]."""
        supply = self.supply(operator, drawn) + made / self.unit
        cells, stream = self.leaving(solids, entering=True)
        supply[cells] += stream * self.entering
        return supply

    def outlet_means(self, operator: HeatOperator, excess: Floats) -> dict[str, Floats]:
        """Mean next to each outlet, (1,) [K], where any outlet draws in (else nothing); collective."""
        if not operator.fluxes.drawn_in:
            return {}
        ports = operator.fluxes.outlets
        sums = total(
            self.strip.comm,
            [[float(excess[p.near] @ p.weights), float(p.sizes.sum())] for p in ports.values()],
        )
        return {name: row[:1] / row[1] for name, row in zip(ports, sums, strict=True)}
