"""Heat of gas and solids, which have one temperature.

    d(eps rho c_p h + C_s h)/dt + div(m c_p h) + C_s v_s . grad h = div(k_eff grad T) + q + sum_r (-dH_r) R_r,    h = T - T_ref

C_s = (1 - eps) rho_s c_s, m the mass flux of the gas, q what is heated electrically, R_r the rates of the reactions [mol/m3/s] and dH_r
their heat [J/mol], T_ref the temperature of `[gas]`. Everything is divided by rho_ref c_p of the gas, so that its flux and conduction are
those of a species (`mpm.transport.fluxes`) with k_eff/(rho_ref c_p) in place of D. The heat of the bed moves with its columns, as its sites
do; the gas in its pores stays. Backward Euler; with the mass balance that the flow keeps (`mpm.flow.heated`) the matrix is an M-matrix and
heat is conserved to rounding: temperatures stay between those that come in, unless something heats.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.flow.fields import FaceFlow, FlowField, face_flow
from mpm.flow.state import GasState
from mpm.mesh.strip import Strip
from mpm.parallel import largest, total
from mpm.transport.cell_matrix import StepMatrix
from mpm.transport.columns import Beyond, SlidingColumns
from mpm.transport.conduction import cell_conductivity, cut_faces, solid_capacity, wall_contacts
from mpm.transport.fluxes import FluxAssembler, FluxOperator
from mpm.transport.heat_ledger import HeatLedger, HeatPassed
from mpm.transport.tracers import steady_fields

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

if TYPE_CHECKING:
    from mpm.case.case import Case

RESIDUAL = 1e-13  # of what the strip holds over its spread of temperatures, per second: the sum of |residual| that a step may leave
NO_SPREAD = 1e-6  # K, in place of a spread of nothing
FILL = 1


@dataclass(frozen=True, eq=False)
class HeatOperator:
    """Fluxes of heat over rho_ref c_p in one flow: those of gas and conduction, with what goes to walls in the diagonal; `walls` are the
    conductances [m2/s] of each wall's cells, `velocity` and `conductance` (faces,) [m/s] what the fluxes inside are made of."""

    fluxes: FluxOperator
    walls: list[Floats]
    velocity: Floats
    conductance: Floats


@dataclass(frozen=True, eq=False)
class HeatMemento:
    """Temperatures, columns beyond the ends and accounts at one instant, to go back to."""

    excess: Floats
    beyond: Beyond
    passed: HeatPassed


class Heat:
    """Temperatures of a strip: `excess` (own cells,) over that of `[gas]` [K], an array that is replaced, never changed in place.

    `unit` is rho_ref c_p [J/m3/K]; `solid` (own,) C_s V over it [m2], `feeds` (inlets,) the excess of what inlets blow [K]; `ledger` counts
    what has passed.
    """

    def __init__(self, case: Case, strip: Strip):
        energy, own = case.energy, slice(0, strip.owned)
        if energy is None:
            raise ValueError("a case without [energy] has one temperature")
        self.case, self.strip, self.reference = case, strip, case.gas.temperature
        self.unit = case.gas.density * case.gas.heat_capacity
        self._capacity = solid_capacity(strip)
        self.solid = (self._capacity * strip.volume)[own] / self.unit
        self.walls = wall_contacts(case, strip)
        self._cut = cut_faces(case, strip)
        heating = np.array([layer.heating for layer in case.geometry.layers])
        self.heating = (heating[strip.grid.row_layer[strip.row]] * strip.volume)[own]
        self.feeds = np.array([case.inlet_temperature(i) - self.reference for i in case.geometry.inlets])
        self.excess = np.full(strip.owned, energy.initial_temperature - self.reference)
        self.ledger = HeatLedger(case)
        self._moving = np.flatnonzero(strip.grid.moving)
        fresh = np.full((1, len(self._moving)), case.bed_temperature - self.reference)
        self._columns = SlidingColumns(fresh, case.geometry.bed_inflow == "periodic")
        spread = case.temperatures[-1] - case.temperatures[0]
        held = float(total(strip.comm, [(self.solid + strip.gas_volume[own]).sum()])[0])
        self._matrix = StepMatrix(strip, "heat", RESIDUAL * held * max(spread, NO_SPREAD), FILL)

    @property
    def temperature(self) -> Floats:
        """Of own cells [K]."""
        return self.reference + self.excess

    def capacity(self, gas: GasState) -> Floats:
        """Of gas and solids in own cells over `unit` [m2]."""
        own = slice(0, self.strip.owned)
        return np.asarray(gas.relative[own] * self.strip.gas_volume[own] + self.solid)

    def content(self, gas: GasState) -> float:
        """What the strip holds more than at the temperature of `[gas]` [J/m]; collective."""
        return self.unit * float(total(self.strip.comm, [self.capacity(gas) @ self.excess])[0])

    # --- fluxes ---

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
        if not self._columns.periodic:
            along &= ~seam
        return np.where(along, solids * self._capacity[faces.behind] / self.unit, 0.0)

    def leaving(self, solids: float, entering: bool = False) -> tuple[Ints, Floats]:
        """Own cells from which the bed leaves the strip (or where it enters), and what it carries there per kelvin over `unit` [m2/s]."""
        strip, own = self.strip, self.strip.owned
        last = (solids > 0.0) != entering
        at = strip.grid.columns - 1 if last else 0
        there = (strip.column[:own] == at) & strip.grid.moving[strip.row[:own]]
        cells = np.flatnonzero(there & (not self._columns.periodic))
        return cells, abs(solids) * self._capacity[cells] * strip.height[cells] / self.unit

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
        self, operator: HeatOperator, solids: float, made: Floats, drawn: dict[str, Floats] | None = None
    ) -> Floats:
        """The same with what the bed brings in at `solids` [m/s] and reactions give off, `made` (own,) [W/m]; collective.

        `drawn`: what outlets draw back in, that of the present temperatures unless it is given.
        """
        means = self.outlet_means(operator, self.excess) if drawn is None else drawn
        supply = self.supply(operator, means) + made / self.unit
        cells, stream = self.leaving(solids, entering=True)
        supply[cells] += stream * self._columns.fresh[0, 0] if len(cells) else 0.0
        return supply

    def outlet_means(self, operator: HeatOperator, excess: Floats) -> dict[str, Floats]:
        """Mean next to each outlet, (1,) [K], where any outlet draws in (else nothing); collective."""
        if not operator.fluxes.drawn_in:
            return {}
        ports = operator.fluxes.outlets
        sums = total(
            self.strip.comm,
            [[float(excess[p.cells] @ p.weights), float(p.area.sum())] for p in ports.values()],
        )
        return {name: row[:1] / row[1] for name, row in zip(ports, sums, strict=True)}

    # --- what changes it ---

    def slide(self, count: int, gas: GasState) -> None:
        """Move the bed by `count` columns; it takes its heat along and shares it with the gas that it meets. Collective."""
        if not count or not len(self._moving):
            return
        strip, own = self.strip, self.strip.owned
        grid = strip.grid
        whole = strip.scatter.to_all(self.excess).reshape(grid.rows, grid.columns)
        moved, passed = self._columns.shift(whole[None, self._moving], count)
        whole[self._moving] = moved[0]
        held = gas.relative[:own] * strip.gas_volume[:own]
        arrived = whole.ravel()[strip.cell[:own]]
        self.excess = (held * self.excess + self.solid * arrived) / (held + self.solid)
        column = (grid.per_row(lambda _: 0.0, gas=0.0) + self._row_capacity())[self._moving]
        self.ledger.add(solids=-float(passed[0] @ column))

    def _row_capacity(self) -> Floats:
        """Of the solids in one column of each row [J/m/K]."""
        grid = self.strip.grid
        per_volume = grid.per_row(
            lambda s: (1.0 - s.porosity) * (s.density or 0.0) * (s.heat_capacity or 0.0), gas=0.0
        )
        return np.asarray(per_volume * grid.dy * grid.dx)

    def advance(
        self,
        operator: HeatOperator,
        before: GasState,
        after: GasState,
        dt: float,
        made: Floats,
        recurs: bool = False,
    ) -> None:
        """One step of `dt` [s] in which the density goes from `before` to `after` and reactions give off `made` (own,) [J/m]; collective.

        Steps that `recur` are many with the same operator, density and `dt`. Raises ConvergenceError, the temperatures kept.
        """
        own = slice(0, self.strip.owned)
        drawn = self.outlet_means(operator, self.excess)
        held = self.capacity(after)
        self._matrix.update(operator.fluxes, dt, held)
        lost = (after.relative - before.relative)[own] * self.strip.gas_volume[own]
        rhs = (held - lost) * self.excess / dt + self.supply(operator, drawn) + made / self.unit / dt
        self.excess = self._matrix.solve(rhs, self.excess, recurs)
        self.book(operator, drawn, dt, total_of(self.strip.comm, made))

    def settle(self, operator: HeatOperator, solids: float, made: Floats) -> float:
        """Take the temperatures of the steady state in the flow of `operator`, the bed passing at `solids` [m/s] and reactions giving off
        `made` (own,) [W/m]; returns the largest change of a temperature [K]. Collective. Raises ConvergenceError.
        """
        supply = self.steady_supply(operator, solids, made, {})
        before, self.excess = self.excess, steady_fields(self.strip, [operator.fluxes], supply[None])[0]
        return float(largest(self.strip.comm, [np.abs(self.excess - before).max(initial=0.0)])[0])

    def book_second(self, operator: HeatOperator, solids: float, made: Floats) -> None:
        """Enter one second of a steady state; collective."""
        self.book(operator, self.outlet_means(operator, self.excess), 1.0, total_of(self.strip.comm, made))
        entering, into = self.leaving(solids, entering=True)
        leaving, out = self.leaving(solids)
        brought = into.sum() * self._columns.fresh[0, 0] if len(entering) else 0.0
        carried = total_of(self.strip.comm, np.array([brought, -(out @ self.excess[leaving])]))
        self.ledger.add(solids=self.unit * carried)

    def book(self, operator: HeatOperator, drawn: dict[str, Floats], dt: float, made: float) -> None:
        """Enter `dt` [s] at the present temperatures, in which reactions gave off `made` [J/m] in all; collective."""
        excess, fluxes = self.excess, operator.fluxes
        inlets = [
            port.into.sum() * feed - port.out @ excess[port.cells]
            for feed, port in zip(self.feeds, fluxes.inlets.values(), strict=True)
        ]
        outlets = [
            (port.into.sum() * drawn[name][0] if name in drawn else 0.0) - port.out @ excess[port.cells]
            for name, port in fluxes.outlets.items()
        ]
        walls = [
            conductance @ (wall.outside - self.reference - excess[wall.cells]) + wall.flow.sum() / self.unit
            for wall, conductance in zip(self.walls, operator.walls, strict=True)
        ]
        ports = [*fluxes.inlets.values(), *fluxes.outlets.values()]
        gas = sum(float(port.into.sum() - port.out.sum()) for port in ports)
        parts = total(self.strip.comm, [gas, *inlets, *outlets, *walls, self.heating.sum() / self.unit]) * dt
        gas, parts = float(parts[0]), self.unit * parts[1:]
        ends = np.cumsum([len(inlets), len(outlets), len(walls)])
        self.ledger.add(
            inlets=parts[: ends[0]],
            outlets=parts[ends[0] : ends[1]],
            walls=parts[ends[1] : ends[2]],
            heating=float(parts[-1]),
            reaction=made,
            gas=gas,
        )

    # --- going back ---

    def memento(self) -> HeatMemento:
        """The present state; cheap, because arrays are replaced and never changed in place."""
        return HeatMemento(self.excess, self._columns.memento(), self.ledger.passed)

    def recall(self, memento: HeatMemento) -> None:
        """Go back to a state of this run."""
        self.excess, self.ledger.passed = memento.excess, memento.passed
        self._columns.recall(memento.beyond)

    def stored(self) -> dict[str, Any]:
        """Arrays of a restart state, in grid order on rank 0 (None elsewhere for `excess`); collective."""
        return {
            "excess": self.strip.scatter.to_root(self.excess),
            **self._columns.stored(),
            **vars(self.ledger.passed),
        }

    def restore(self, stored: dict[str, Any]) -> None:
        """The inverse of `stored`, on every rank."""
        self.excess = self.strip.scatter.to_local(stored["excess"])
        self._columns.restore(stored)
        self.ledger.restore(stored)


def total_of(comm: MPI.Comm, values: Floats) -> float:
    """Sum over all values of all ranks."""
    return float(total(comm, [values.sum()])[0])
