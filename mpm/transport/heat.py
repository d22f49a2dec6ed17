"""Heat of gas and solids, which have one temperature.

    d(eps rho c_p h + C_s h)/dt + div(m c_p h) + C_s v_s . grad h
        = div(k_eff grad T) + q - sum_i (c_i - c) div(J_i h) + sum_r (-dH_r) R_r,    h = T - T_ref

C_s = (1 - eps) rho_s c_s, m the mass flux of the gas, q what is heated electrically, J_i the diffusion of species whose heat capacity
c_i is not that of the carrier, R_r the rates of the reactions [mol/m3/s] and dH_r
their heat [J/mol], T_ref the temperature of `[gas]`. Everything is divided by rho_ref c_p of the gas, so that its flux and conduction are
those of a species (`mpm.transport.fluxes`) with k_eff/(rho_ref c_p) in place of D. The heat of the bed moves with its columns, as its sites
do; the gas in its pores stays. Backward Euler; with the mass balance that the flow keeps (`mpm.flow.heated`) the matrix is an M-matrix and
heat is conserved to rounding: temperatures stay between those that come in, unless something heats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.flow.state import GasState
from mpm.mesh.strip import Strip
from mpm.parallel import largest, total
from mpm.transport.columns import Beyond, SlidingColumns
from mpm.transport.conduction import solid_capacity
from mpm.transport.heat_flux import Diffusing, HeatFluxes, HeatOperator
from mpm.transport.heat_ledger import HeatLedger, HeatPassed
from mpm.transport.plausible import require_plausible
from mpm.transport.step_matrix import StepMatrix
from mpm.transport.tracers import steady_fields

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

if TYPE_CHECKING:
    from mpm.case.case import Case


@dataclass(frozen=True, eq=False)
class HeatMemento:
    """Temperatures, columns beyond the ends and accounts at one instant, to go back to."""

    excess: Floats
    beyond: Beyond
    passed: HeatPassed


class Heat:
    """Temperatures of a strip: `excess` (own cells,) over that of `[gas]` [K], an array that is replaced, never changed in place.

    `unit` is rho_ref c_p [J/m3/K], `solid` (own,) C_s V over it [m2]; `fluxes` builds what carries heat, `ledger` counts what has passed.
    """

    def __init__(self, case: Case, strip: Strip):
        energy = case.energy
        if energy is None:
            raise ValueError("a case without [energy] has one temperature")
        self.strip, self.fluxes = strip, HeatFluxes(case, strip)
        self.reference, self.unit, self.solid = self.fluxes.reference, self.fluxes.unit, self.fluxes.solid
        self.excess = np.full(strip.owned, energy.initial_temperature - self.reference)
        self.ledger = HeatLedger(case)
        self._moving = np.flatnonzero(strip.grid.moving)
        fresh = np.full((1, len(self._moving)), self.fluxes.entering)
        self._columns = SlidingColumns(fresh, self.fluxes.periodic)
        self._matrix = StepMatrix(strip, "heat", 0.0)  # to FALL of each imbalance

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
        column = (solid_capacity(grid) * grid.dy * grid.dx)[self._moving]
        self.ledger.add(solids=-float(passed[0] @ column))

    def advance(
        self,
        operator: HeatOperator,
        before: GasState,
        after: GasState,
        dt: float,
        made: Floats,
        carried: Sequence[Diffusing] = (),
    ) -> None:
        """One step of `dt` [s] in which the density goes from `before` to `after` and reactions give off `made` (own,) [J/m]; collective.

        `carried` are the species that take heat along as they diffuse, at the temperatures before the step.
        Raises ConvergenceError, the temperatures kept.
        """
        own = slice(0, self.strip.owned)
        drawn = self.fluxes.outlet_means(operator, self.excess)
        held = self.capacity(after)
        self._matrix.update(operator.fluxes, dt, held)
        lost = (after.relative - before.relative)[own] * self.strip.gas_volume[own]
        given = made / dt + self.fluxes.diffusing(carried, self.excess)
        rhs = (held - lost) * self.excess / dt + self.fluxes.supply(operator, drawn) + given / self.unit
        # for the change: errors are relative to that, not to all that hot solids hold
        imbalance = rhs - self._matrix.multiply(self.excess)
        change = self._matrix.solve(imbalance, np.zeros_like(self.excess))
        require_plausible(self.fluxes.case, self.strip, self.temperature + change)
        self.excess = self.excess + change
        self.book(operator, drawn, dt, total_of(self.strip.comm, made))

    def settle(self, operator: HeatOperator, solids: float, made: Floats) -> float:
        """Take the temperatures of the steady state in the flow of `operator`, the bed passing at `solids` [m/s] and reactions giving off
        `made` (own,) [W/m]; returns the largest change of a temperature [K]. Collective. Raises ConvergenceError.
        """
        supply = self.fluxes.steady_supply(operator, solids, made, {})
        settled = steady_fields(self.strip, [operator.fluxes], supply[None])[0]
        require_plausible(self.fluxes.case, self.strip, self.reference + settled)
        before, self.excess = self.excess, settled
        return float(largest(self.strip.comm, [np.abs(self.excess - before).max(initial=0.0)])[0])

    def book_second(self, operator: HeatOperator, solids: float, made: Floats) -> None:
        """Enter one second of a steady state; collective."""
        self.book(
            operator, self.fluxes.outlet_means(operator, self.excess), 1.0, total_of(self.strip.comm, made)
        )
        _, into = self.fluxes.leaving(solids, entering=True)
        leaving, out = self.fluxes.leaving(solids)
        brought = into.sum() * self.fluxes.entering
        carried = total_of(self.strip.comm, np.array([brought, -(out @ self.excess[leaving])]))
        self.ledger.add(solids=self.unit * carried)

    def book(self, operator: HeatOperator, drawn: dict[str, Floats], dt: float, made: float) -> None:
        """Enter `dt` [s] at the present temperatures, in which reactions gave off `made` [J/m] in all; collective."""
        excess, fluxes = self.excess, operator.fluxes
        inlets = [
            port.into.sum() * feed - port.out @ excess[port.cells]
            for feed, port in zip(self.fluxes.feeds, fluxes.inlets.values(), strict=True)
        ]
        outlets = [
            (port.into.sum() * drawn[name][0] if name in drawn else 0.0) - port.out @ excess[port.cells]
            for name, port in fluxes.outlets.items()
        ]
        walls = [
            conductance @ (wall.outside - self.reference - excess[wall.cells]) + wall.flow.sum() / self.unit
            for wall, conductance in zip(self.fluxes.walls, operator.walls, strict=True)
        ]
        ports = [*fluxes.inlets.values(), *fluxes.outlets.values()]
        gas = sum(float(port.volume_in.sum()) for port in ports)  # not into - out: much may diffuse both ways
        parts = (
            total(self.strip.comm, [gas, *inlets, *outlets, *walls, self.fluxes.heating.sum() / self.unit])
            * dt
        )
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
