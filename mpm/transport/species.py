"""Species in the gas and coverage of the solids over one time step, solved together.

    eps dC_i/dt + div(u C_i - D_i^eff grad C_i) = eps R_i^gas + S sum_r nu_ir r_r

Backward Euler on the fluxes of `mpm.transport.fluxes`. The coverage is eliminated cell by cell (`mpm.physics.kinetics`), because a
site lives for microseconds and must never be split from the transport that feeds it; Newton's method then works on the concentrations of
the reacting species alone. Species that are only made follow afterwards, one linear system each.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.flow.fields import FlowField, face_flow
from mpm.flow.state import GasState
from mpm.mesh.strip import Strip
from mpm.parallel import Scatter
from mpm.physics.roles import Roles
from mpm.transport.closed_forms import local_terms
from mpm.transport.coverage import Coverage
from mpm.transport.diffusant import Diffusant
from mpm.transport.fluxes import FluxAssembler, FluxOperator
from mpm.transport.foresight import REMEMBERED, Past, possible
from mpm.transport.ledger import Entries, Ledger
from mpm.transport.local_terms import LocalTerms, StepEquations
from mpm.transport.newton import RESIDUAL, NewtonSystem, forcing, quality
from mpm.transport.ports import Ports
from mpm.transport.reactions import Events, Reactions
from mpm.transport.step_matrix import FALL, FALL_HEATED, StepMatrix

if TYPE_CHECKING:
    from mpm.case.case import Case

Operators = list[FluxOperator]  # of one velocity field, one per species
NEWTON_LIMIT = 30
HALVINGS = 6
# residual below which steps need no balanced cells; of general rate laws, which take long in a cell, the first balance has most of the gain
BALANCED = 1e-2


@dataclass(frozen=True, eq=False)
class TransportMemento:
    """What the gas holds and held, and the accounts, at one instant."""

    concentration: Floats
    past: Past
    ledger: Entries


class Transport:
    """Concentrations of all species that can appear, and the solvers that advance them.

    `names` are those species, the first `coupled` of them react; `concentration` (species, own cells) [mol/m3] is an array that is
    replaced, never changed in place, `past` what it was before. `diffusivities` [m2/s] are those that differ.
    """

    def __init__(self, case: Case, strip: Strip, coverage: Coverage):
        self.case, self.strip, self.coverage = case, strip, coverage
        self.roles = Roles.of(case.mechanism, set(case.fed_species))
        self.names = (*self.roles.coupled, *self.roles.products)
        self.coupled = len(self.roles.coupled)
        self.reactions = Reactions(case, strip, coverage, self.roles)
        self.ports = Ports(case, strip, self.names)
        self.ledger = Ledger(self.ports, self.reactions)
        self.concentration = np.zeros((len(self.names), strip.owned))
        self.past = Past(REMEMBERED[case.fidelity])
        diffusants = [Diffusant.of(case, name) for name in self.names]
        self._diffusants = sorted(set(diffusants))
        self.diffusivities = [one.diffusivity for one in self._diffusants]
        self._group = [self._diffusants.index(one) for one in diffusants]
        self._dispersion: Floats | None = None
        self._gas: GasState | None = None
        self._assemble()
        residual, fall = self.ports.feed_rate * RESIDUAL, FALL if case.energy is None else FALL_HEATED
        self._linear = [
            StepMatrix(strip, f"species with D = {d:g} m2/s", residual, fall) for d in self.diffusivities
        ]

    @cached_property
    def _newton(self) -> NewtonSystem:
        """Of steps alone: a steady state takes none."""
        return NewtonSystem(self.reactions)

    @cached_property
    def _terms(self) -> LocalTerms:
        return local_terms(self.reactions, self._newton.blocks)

    def _assemble(self) -> None:
        """What builds operators, of a reactor at rest and in motion, in the present state of the gas."""
        self._at_rest = self._in_motion = self._assemblers(np.zeros(len(self.diffusivities)))
        if self._dispersion is not None:
            self._in_motion = self._assemblers(self._dispersion)

    def _assemblers(self, dispersion: Floats) -> list[FluxAssembler]:
        """Those of the diffusivities in the pores, each with its `dispersion` added."""
        return [
            one.assembler(self.case, self.strip, self._gas, added)
            for one, added in zip(self._diffusants, dispersion, strict=True)
        ]

    def disperse(self, dispersion: Floats) -> None:
        """Add `dispersion` (diffusivities, 2, local cells) [m2/s] to diffusion while the reactor vibrates, where the mean of the flow
        stands for its cycle."""
        self._dispersion = dispersion
        self._assemble()

    def follow(self, gas: GasState) -> None:
        """Let species diffuse and react in another state of the gas."""
        self._gas = gas
        self._assemble()
        self.reactions.heat_to(gas.temperature[: self.strip.owned])

    def operators(self, flow: FlowField, at_rest: bool = False) -> Operators:
        """The operator of each species in a velocity field, that of a reactor `at_rest` or in motion; collective."""
        faces = face_flow(self.strip, flow.velocities)
        different = [
            assembler.operator(faces) for assembler in (self._at_rest if at_rest else self._in_motion)
        ]
        return [different[group] for group in self._group]

    # --- without a time step ---

    def flux_product(self, operators: Operators, concentration: Floats) -> Floats:
        """div(u C - D grad C) integrated over own cells for each species, (species, own) [mol/m/s]; nothing enters through ports."""
        matrices = self._matrices(operators, np.inf)
        return self._products(matrices, concentration)

    def _matrices(self, operators: Operators, dt: float) -> list[StepMatrix]:
        """gas_volume/dt + fluxes of the first species, as many as `operators`, up to date for these and this step."""
        matrices = [self._linear[self._group[i]] for i in range(len(operators))]
        for matrix, operator in zip(matrices, operators, strict=True):
            matrix.update(operator, dt)
        return matrices

    def _products(self, matrices: list[StepMatrix], concentration: Floats) -> Floats:
        result = np.empty(concentration.shape)
        for matrix, c, made in zip(matrices, concentration, result, strict=True):
            matrix.multiply(c, made)
        return result

    def diffusion(self, name: str, at_rest: bool = False) -> Floats:
        """Flux of a species through the faces inside by diffusion alone (faces,) [mol/s per metre of depth], -n D_eff grad x;
        collective."""
        i = self.names.index(name)
        assembler = (self._at_rest if at_rest else self._in_motion)[self._group[i]]
        return assembler.diffusion(self.strip.scatter.to_all(self.concentration[i])[self.strip.cell])

    # --- restart ---

    def stored(self, scatter: Scatter) -> dict[str, Any]:
        """Arrays of a restart state, in grid order on rank 0 (None elsewhere); collective."""
        all_states = scatter.to_root(np.stack([self.concentration, *self.past.states]))
        return {
            "concentration": None if all_states is None else all_states[0],
            "past": None if all_states is None else all_states[1:],
            "last_step": self.past.dt,
        }

    def restore(self, scatter: Scatter, stored: dict[str, Any]) -> None:
        """The inverse of `stored`, on every rank."""
        self.concentration = scatter.to_local(stored["concentration"])
        states = tuple(scatter.to_local(stored["past"]))
        self.past = Past(self.past.limit, states, float(stored["last_step"]))

    # --- one step ---

    def advance(self, operators: Operators, t0: float, dt: float, halvings: int = 0) -> None:
        """Advance concentrations, coverage and ledger from `t0` by `dt` [s] in the velocity field of `operators`; collective.

        A step whose Newton iteration fails is halved, up to HALVINGS times. Raises ConvergenceError after that.
        """
        before, covered = self.memento(), self.coverage.memento()
        try:
            self._advance(operators, t0, dt)
        except ConvergenceError as error:
            self.recall(before)
            self.coverage.recall(covered)
            if halvings == HALVINGS:
                raise ConvergenceError(f"t = {t0:.6g} s, step of {dt:.3g} s: {error}") from error
            try:
                self.advance(operators, t0, 0.5 * dt, halvings=halvings + 1)
                self.advance(operators, t0 + 0.5 * dt, 0.5 * dt, halvings=halvings + 1)
            except ConvergenceError:
                self.recall(before)
                self.coverage.recall(covered)
                raise

    def memento(self) -> TransportMemento:
        """Gas and accounts at present; cheap, because arrays are replaced and never changed in place."""
        return TransportMemento(self.concentration, self.past, self.ledger.memento())

    def recall(self, memento: TransportMemento) -> None:
        """Go back to gas and accounts of this run."""
        self.concentration, self.past = memento.concentration, memento.past
        self.ledger.recall(memento.ledger)

    def _advance(self, operators: Operators, t0: float, dt: float) -> None:
        old, coupled = np.ascontiguousarray(self.concentration), self.coupled
        drawn = self.ports.outlet_means(operators, old)
        shares = self.ports.shares(t0, dt)
        supply = self.ports.supply(operators, shares, drawn)
        new, events = old.copy(), self.reactions.none()
        foreseen = self.past.foreseen(old, dt)
        if coupled:
            new[:coupled], events = self._solve_coupled(
                operators[:coupled], dt, old[:coupled], supply[:coupled], foreseen[:coupled]
            )
        elif self.reactions.surface.reactions:
            events = self.reactions.without_gas(dt)
        if self.reactions.surface.reactions:
            self.coverage.react(self.reactions.surface, new[:coupled].take(self.coverage.cells, axis=1), dt)
        made = self.reactions.made(events, slice(coupled, None))
        # where more has reacted than was foreseen, more is made
        missed = self.reactions.tied @ (foreseen[:coupled] - new[:coupled])
        storage = self.reactions.gas_volume / dt
        for i in range(coupled, len(self.names)):
            matrix = self._linear[self._group[i]]
            matrix.update(operators[i], dt)
            rhs = storage * old[i] + supply[i] + made[i - coupled]
            guess = foreseen[i] + missed[i - coupled]
            new[i] = matrix.solve(rhs, possible(guess, old[i]))
        self.concentration, self.past = new, self.past.followed_by(old, dt)
        self.ledger.book(self.ports, operators, new, dt, shares, drawn, events)

    def _solve_coupled(
        self, operators: Operators, dt: float, old: Floats, supply: Floats, foreseen: Floats
    ) -> tuple[Floats, Events]:
        """Inexact Newton on the reacting species; returns their concentrations at the end of the step and the events of it."""
        matrices, newton, terms = self._matrices(operators, dt), self._newton, self._terms
        newton.set_fluxes(matrices)
        diagonal = np.stack([matrix.diagonal for matrix in matrices])
        rhs = self.reactions.gas_volume / dt * old + supply
        step = StepEquations(diagonal, rhs, np.ascontiguousarray(self.coverage.theta), dt)
        new, feed = np.ascontiguousarray(possible(foreseen, old)), self.ports.feed_rate
        terms.balance(step, new, self._products(matrices, new), feed)  # spares one iteration in four
        for _ in range(NEWTON_LIMIT):
            iterate = terms.weigh(step, new, self._products(matrices, new))
            at = quality(self.ports, iterate)
            if at.converged and at.positive:
                return new, iterate.events
            if not np.isfinite(at.worst):
                break
            if at.converged and not terms.closed:
                new = np.maximum(new, 0.0)  # rounding, as the residual is
                continue
            new = new - newton.solve(iterate.residual, forcing(at.worst), terms.mutual(), at.worst)
            if at.worst > BALANCED and terms.closed:
                terms.balance(step, new, self._products(matrices, new), feed)
        raise ConvergenceError(
            f"reacting species {', '.join(self.roles.coupled)}: Newton stopped after {NEWTON_LIMIT} iterations at a residual of "
            f"{at.worst:.3g} of the feed, lowest concentration {at.lowest:.3g} mol/m3"
        )
