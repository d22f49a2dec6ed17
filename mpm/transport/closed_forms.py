"""The closed forms of `mpm.physics.kinetics` in C: one gas that meets one of two kinds of sites, and two gases that meet.

    theta' = (theta + gain)/(1 + a + c)        q_r = k_r C_g/n_s        events_r = k_r C_g theta'_s area

goes into the equations of a step cell after cell, without arrays for what is known in between. Numbers are those of LocalTerms but for
rounding, in a third of the time.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mpm.arrays import Floats
from mpm.numerics.compiled import Struct, compiled, pointer
from mpm.numerics.local_newton import LOWEST, SHRINK, TIGHT
from mpm.physics.kinetics import BENT, GasKinetics, SurfaceKinetics
from mpm.transport.local_terms import IDLE, TRIES, LocalTerms, StepEquations, Weighed
from mpm.transport.reactions import Events, Reactions

HEADER = Path(__file__).with_name("closed_forms.h")
SOURCE = HEADER.with_name("closed_forms.c")
KINDS = 2  # of sites that have a closed form
PAIR = 2  # unknowns of a cell whose mutual coupling C finds


def local_terms(reactions: Reactions, blocks: Floats) -> LocalTerms:
    """In C where the reactions have closed forms; collective."""
    surface, gas = reactions.surface, reactions.gas
    if not isinstance(surface, SurfaceKinetics) or not isinstance(gas, GasKinetics):
        return LocalTerms(reactions, blocks)
    if surface.nu_places.shape[1] != KINDS:
        return LocalTerms(reactions, blocks)
    return ClosedForms(reactions, surface, gas, blocks)


class ClosedForms(LocalTerms):
    """LocalTerms of reactions with closed forms."""

    def __init__(self, reactions: Reactions, surface: SurfaceKinetics, gas: GasKinetics, blocks: Floats):
        super().__init__(reactions, blocks)
        self._surface, self._gas = surface, gas
        shape = {
            "UNKNOWNS": reactions.coupled,
            "SURFACE": len(surface.reactions),
            "GAS": len(gas.reactions),
        }
        module = compiled(reactions.strip.comm, HEADER, SOURCE, **shape)
        self._c, self._struct = module.lib, Struct(module, "Reacting")
        known = self._struct.known
        known.own, known.reactive = reactions.strip.owned, len(surface.sites)
        self._limits = module.ffi.new("Limits *")
        self._limits.tries, self._limits.bent, self._limits.tight = TRIES, BENT, TIGHT
        self._limits.shrink, self._limits.lowest = SHRINK, LOWEST
        nu_surface, nu_gas = reactions.nu_coupled
        site = np.array(surface.site, np.int64)
        self._struct.lend(
            cells=reactions.coverage.cells,
            gas=np.array(surface.gas, np.int64),
            site=site,
            gain=surface.nu_places[np.arange(len(site)), 1 - site],
            pairs=np.array(gas.pairs, np.int64).reshape(-1, 2),
            made_on_area=np.ascontiguousarray(nu_surface),
            made_in_volume=np.ascontiguousarray(nu_gas),
            made=np.empty((reactions.coupled, len(surface.sites))),
            slope=np.empty((reactions.coupled, reactions.coupled, len(surface.sites))),
        )
        self._sums, self._mutual = np.zeros(5), 0.0
        self._heat: list[Floats] | None = None

    def _follow_heat(self) -> None:
        """Take the rate constants as they are now."""
        constants = [*self._surface.constant, *self._gas.constant]
        if self._heat is not None and all(a is b for a, b in zip(self._heat, constants, strict=True)):
            return
        area, sites, volume = (
            self.reactions.coverage.area,
            self._surface.sites,
            self.reactions.reacting_volume,
        )
        self._struct.lend(
            turnover=_table([k / sites for k in self._surface.constant], len(sites)),
            on_area=_table([k * area for k in self._surface.constant], len(sites)),
            in_volume=_table([k * volume for k in self._gas.constant], len(volume)),
        )
        self._heat = constants

    def weigh(self, step: StepEquations, new: Floats, flux: Floats) -> Weighed:
        """As LocalTerms.weigh, in one go; the residual takes the place of `flux`."""
        self._follow_heat()
        events = Events(
            np.empty((len(self._surface.reactions), len(self._surface.sites))),
            np.empty((len(self._gas.reactions), self.reactions.strip.owned)),
        )
        given = (step.theta, new, step.diagonal, step.rhs, flux, self.blocks, events.surface, events.gas)
        self._c.weigh(self._struct.known, step.dt, *map(pointer, given), pointer(self._sums))
        missed, carried, lowest, largest, self._mutual = map(float, self._sums)
        return Weighed(events, flux, missed, carried, 0.0, lowest, largest)

    def mutual(self) -> float:
        """As LocalTerms.mutual; of two unknowns it has been found on the way."""
        return self._mutual if self.reactions.coupled == PAIR else super().mutual()

    def balance(self, step: StepEquations, new: Floats, flux: Floats, feed: float) -> None:
        """As LocalTerms.balance, some cells at a time."""
        self._follow_heat()
        self._limits.idle = IDLE * feed
        given = (step.theta, step.diagonal, step.rhs, flux, new)
        self._c.balance(self._struct.known, self._limits, step.dt, *map(pointer, given))


def _table(rows: list[Floats], cells: int) -> Floats:
    """(rows, cells), of no row as well."""
    return np.array(rows).reshape(len(rows), cells)
