"""Heat of a reactor with `[energy]`, and the order in which temperature, density, flow, species and reactions follow each other.

In a step the bed slides with its heat; the density follows the temperature and the flow what that gives off; species react at that
temperature; what they give off, conduction and flow then make the new temperature. Everything that is carried meets the same flow and the
same density, so species, gas and heat balance to rounding in every step; density and rates are those of the beginning of the step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.flow.cycle import mean_motion
from mpm.flow.heated import HeatedCycle
from mpm.flow.heated_march import HeatedMarch
from mpm.flow.sequence import Watch
from mpm.flow.state import GasState, gas_amount
from mpm.motion.schedule import Schedule, Step
from mpm.parallel import largest
from mpm.physics.mixture import Fractions
from mpm.reactor.steady.overturning import Overturning
from mpm.report.records import HeatTotals
from mpm.transport.heat import Heat, HeatMemento
from mpm.transport.heat_flux import Diffusing, HeatOperator
from mpm.transport.plausible import plausible, require_plausible

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.flow.fields import FlowField
    from mpm.mesh.strip import Strip
    from mpm.motion.kinematics import BedMotion
    from mpm.transport.species import Transport

HeatedFlow = HeatedCycle | HeatedMarch
STEPS = 100  # Newton's, on the way to the steady flow and temperature
SETTLED = 1e-3  # K, largest change of a temperature in the last step; the next would be smaller by 10 or more
FIRST, NEVER = 1.0, 1e12  # s, pseudo-time of the first step, and one that no longer counts
# K: temperatures that are given and lie closer than the first say nothing of the spread there will be
LITTLE, UNKNOWN = 1.0, 50.0
# of the spread of temperatures: steps that change more are taken back; below the others pseudo-time lengthens, or is no longer needed
FAR, STEEP, CLOSE = 2.0, 0.2, 0.02
STALLED = 0.7  # of the change of the step before
LONGER, SHORTER = 4.0, 0.25


@dataclass(frozen=True, eq=False)
class ThermalMemento:
    """Heat, state of the gas and events at one instant, to go back to."""

    heat: HeatMemento
    gas: GasState


class Thermal:
    """The `heat` of a strip and the `flow` of its gas, with the reactions of `transport` as a source."""

    def __init__(self, case: Case, strip: Strip, motion: BedMotion, schedule: Schedule, transport: Transport):
        self.case, self.strip, self.motion, self.schedule = case, strip, motion, schedule
        self.transport = transport
        self.heat = Heat(case, strip)
        self.flow: HeatedFlow = self._new_flow()
        self._operators: dict[FlowField, HeatOperator] = {}
        # of reactions and species when they were last in a steady state, in own cells [W/m]
        self._steady_heat = np.zeros(strip.owned)
        gas = case.gas.temperature
        reactions, mechanism = transport.reactions, case.mechanism
        self._surface_heat = [-mechanism.heat_of_reaction(r, gas) for r in reactions.surface.reactions]
        self._gas_heat = [-mechanism.heat_of_reaction(r, gas) for r in reactions.gas.reactions]
        self.count_from_here()
        transport.follow(self.gas)

    def _new_flow(self) -> HeatedFlow:
        parts = self.case, self.strip, self.motion, self.schedule, self.heat.temperature
        marched = self.case.fidelity == "resolved" and self.case.motion.startup == "impulsive"
        return HeatedMarch(*parts) if marched else HeatedCycle(*parts)

    @property
    def gas(self) -> GasState:
        """The gas as the last step met it."""
        return self.flow.gas

    def count_from_here(self) -> None:
        """Let balances count from the present contents."""
        self._stored_initially = self.heat.content(self.gas)
        self._gas_initially = gas_amount(self.strip, self.gas.relative)

    def find_flow(self, watch: Watch | None = None) -> None:
        """Find the flow in the present state; in the steady one the temperatures that go with it, too. Raises ConvergenceError."""
        if isinstance(self.flow, HeatedCycle):
            if self.case.fidelity == "steady":
                self.flow.density.take(self.heat.temperature, self._fractions())
            self.flow.find(watch)
            if self.case.fidelity == "steady":
                self._settle_flow(self.flow)
                self.transport.follow(self.gas)

    # --- the steady state ---

    def _settle_flow(self, flow: HeatedCycle) -> None:
        """Newton's steps on temperature and flow until neither changes; those that go too far are taken back and shortened."""
        heat, newton, change = self.heat, Overturning(self.heat, self.strip), np.inf
        given = self.case.temperatures[-1] - self.case.temperatures[0]
        spread = given if given > LITTLE else UNKNOWN
        motion, bed, time, last = mean_motion(self.motion), self.case.conveying_velocity, FIRST, np.inf
        for _ in range(STEPS):
            problem, operator = flow.problem, self._steady_operator()
            drawn = heat.fluxes.outlet_means(operator, heat.excess)
            supply = heat.fluxes.steady_supply(operator, bed, self._steady_heat, drawn)
            psi, warmer = newton.step(problem, self.gas, motion, operator, supply, time)
            change = float(largest(self.strip.comm, [np.abs(warmer).max(initial=0.0)])[0])
            if not change < FAR * spread or not plausible(self.case, self.strip, heat.temperature + warmer):
                time *= SHORTER
                continue
            problem.change(psi)
            heat.excess = heat.excess + warmer
            flow.density.take(heat.temperature, self._fractions())
            flow.adopt(problem.field(), motion)
            if change < SETTLED:
                return
            if time == NEVER and change > STALLED * last:
                self._draw_in(flow, spread)
            last = change
            time = NEVER if change < CLOSE * spread else time * (LONGER if change < STEEP * spread else 1.0)
        require_plausible(self.case, self.strip, heat.temperature + warmer)
        raise ConvergenceError(
            f"steady state: temperatures still change by {change:.3g} K after {STEPS} steps of flow and heat; the gas may have no steady "
            "flow where it is heated from below, or nothing may take away what heats it: try fidelity averaged"
        )

    def _draw_in(self, flow: HeatedCycle, spread: float) -> None:
        """Take the temperatures that are steady in the present flow, unless that is more than a `spread` of them [K]; collective.

        What an outlet draws back in is what has just left it, and lags behind by a Newton step: gas that turns over there would cool by a
        kelvin in each.
        """
        before, operator = self.heat.excess, self._steady_operator()
        if operator.fluxes.drawn_in:
            try:
                change = self.heat.settle(operator, self.case.conveying_velocity, self._steady_heat)
            except ConvergenceError:
                change = np.inf
            if not change < spread:
                self.heat.excess = before
            flow.density.take(self.heat.temperature, self._fractions())

    def settle(self) -> float:
        """Take the temperatures that are steady in the present flow, with what reactions have given off in the second that is booked.

        Returns the largest change [K]; collective. Raises ConvergenceError.
        """
        self._steady_heat = self._given()
        return self.heat.settle(self._steady_operator(), self.case.conveying_velocity, self._steady_heat)

    def book_second(self) -> None:
        """Enter one second of the steady state; collective."""
        self.heat.book_second(self._steady_operator(), self.case.conveying_velocity, self._booked())

    def _steady_operator(self) -> HeatOperator:
        return self.heat.fluxes.operator(self.flow.mean(), self.gas, self.case.conveying_velocity)

    def _booked(self) -> Floats:
        """Heat of all reactions that are booked, in own cells [J/m]."""
        ledger = self.transport.ledger
        return self._heat_of(ledger.surface, ledger.gas)

    def _given(self) -> Floats:
        """That and what diffusing species bring along, in own cells [W/m]; collective."""
        return self._booked() + self.heat.fluxes.diffusing(self._carried(), self.heat.excess)

    # --- one step ---

    def begin(self, step: Step, columns: int) -> FlowField:
        """The bed has slid by so many `columns`: let density, flow and rates follow; the field of the step. Raises ConvergenceError."""
        self.heat.slide(columns, self.gas)
        self._before = self.gas
        self.flow.follow(self.heat.temperature, self._fractions(), step)
        if self.gas is not self._before:
            self.transport.follow(self.gas)
        if self.flow.changed:
            self._operators.clear()
        ledger = self.transport.ledger
        self._events = ledger.surface, ledger.gas
        return self.flow.at(step)

    def finish(self, field: FlowField, dt: float) -> None:
        """Heat over `dt` [s] in the flow of the step, with what its reactions have given off.

        Raises ConvergenceError.
        """
        if field not in self._operators:
            self._operators[field] = self.heat.fluxes.operator(field, self.gas)
        made, carried = self._given_off(), self._carried()
        self.heat.advance(self._operators[field], self._before, self.gas, dt, made, carried)

    def _fractions(self) -> Fractions:
        """Mole fractions of the species in own cells, at present."""
        whole = self.case.gas.molar_density * self.gas.relative[: self.strip.owned]
        return dict(zip(self.transport.names, self.transport.concentration / whole, strict=True))

    def unmixed(self) -> float:
        """How far the steady flow is from one of the present composition: the largest relative change of the density; collective."""
        mixed = GasState.of(
            self.case, self.strip, self.heat.temperature, self._fractions() if self.case.gas.mixture else {}
        )
        change = np.abs(mixed.mass / self.gas.mass - 1.0).max(initial=0.0)
        return float(largest(self.strip.comm, [change])[0])

    def _carried(self) -> list[Diffusing]:
        """The species whose heat capacity is known, as they diffuse now; collective."""
        gas, transport = self.case.gas, self.transport
        found = []
        for name in transport.names:
            own = self.case.mechanism.get(name).heat_capacity
            if own is not None:
                found.append(Diffusing(own - gas.heat_capacity * gas.molar_mass, transport.diffusion(name)))
        return found

    def _given_off(self) -> Floats:
        """Heat of the reactions since `begin` in own cells [J/m]."""
        ledger, (surface, gas) = self.transport.ledger, self._events
        return self._heat_of(ledger.surface - surface, ledger.gas - gas)

    def _heat_of(self, surface: Floats, gas: Floats) -> Floats:
        """Of events (reactions, reactive cells) and (reactions, own cells) [mol/m], in own cells [J/m]."""
        made = np.asarray(self._gas_heat) @ gas if self._gas_heat else np.zeros(self.strip.owned)
        if self._surface_heat:
            made[self.transport.coverage.cells] += np.asarray(self._surface_heat) @ surface
        return np.asarray(made)

    def memento(self) -> ThermalMemento:
        """The present state of heat and gas."""
        return ThermalMemento(self.heat.memento(), self.gas)

    def recall(self, memento: ThermalMemento) -> None:
        """Go back to a state of this run; the flow stays."""
        self.heat.recall(memento.heat)
        self.flow.density.gas = memento.gas
        self.transport.follow(memento.gas)

    # --- looking ---

    def totals(self) -> HeatTotals:
        """What has passed and what there is; collective."""
        passed = self.heat.ledger.passed
        return HeatTotals(
            inlets=passed.inlets,
            outlets=passed.outlets,
            walls=passed.walls,
            solids=passed.solids,
            heating=passed.heating,
            reaction=passed.reaction,
            stored=self.heat.content(self.gas),
            stored_initially=self._stored_initially,
            gas_passed=passed.gas,
            gas=gas_amount(self.strip, self.gas.relative),
            gas_initially=self._gas_initially,
        )

    # --- restart ---

    def stored(self) -> dict[str, dict[str, Any]]:
        """Arrays of a restart state by part; collective."""
        counts = {"heat": self._stored_initially, "gas": self._gas_initially}
        return {"heat": self.heat.stored(), "heated": self.flow.stored(), "heat_initially": counts}

    def restore(self, parts: dict[str, dict[str, Any]], steps: int) -> None:
        """The inverse of `stored`, on every rank, after `steps`."""
        self.heat.restore(parts["heat"])
        self.flow.restore(parts["heated"], steps)
        self._stored_initially = float(parts["heat_initially"]["heat"])
        self._gas_initially = float(parts["heat_initially"]["gas"])
        self._operators.clear()
        self.transport.follow(self.gas)
