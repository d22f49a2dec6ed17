"""What reactions make of the gas in each cell, and how that changes with the gas: the source of the species' balance.

    s_i = eps V sum_r nu_ir R_r^gas + S V sum_r nu_ir r_r        [mol/m/s], per metre of depth

Rates come from `mpm.physics.kinetics`; here they meet the cells: volumes of gas, reactive area and stoichiometry. One time step and the
steady state share it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.errors import ConvergenceError
from mpm.mesh.strip import Strip
from mpm.parallel import any_rank
from mpm.physics.rate_solvers import gas_kinetics, surface_kinetics
from mpm.physics.roles import Roles
from mpm.transport.coverage import Coverage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpm.case.case import Case
    from mpm.physics.reaction import GasReaction, SurfaceReaction

EXACT = 1e-9  # of the stoichiometric coefficients: sums that agree to this are equal


@dataclass(frozen=True, eq=False)
class Events:
    """How often reactions run [mol/m/s]: `surface` (reactions, reactive cells), `gas` (reactions, own cells)."""

    surface: Floats
    gas: Floats


class Reactions:
    """The reactions that run on the coverages and in the own cells of a strip, among the species of `roles`.

    `surface` and `gas` are their kinetics, `reacting_volume` (own,) [m2] what those of the gas run in (`porous.reaction_volume`); `species`
    the names of all species that run, reacting ones first. `tied` as in `_tied`.
    """

    def __init__(self, case: Case, strip: Strip, coverage: Coverage, roles: Roles):
        self.strip, self.coverage = strip, coverage
        self.species, self.coupled = (*roles.coupled, *roles.products), len(roles.coupled)
        temperature = case.gas.temperature
        self.surface = surface_kinetics(case.mechanism, roles.coupled, coverage.sites, temperature)
        self.gas = gas_kinetics(case.mechanism, roles.coupled, strip.owned, temperature)
        volume = strip.gas_volume if case.porous.reaction_volume == "gas" else strip.volume
        self.reacting_volume = np.asarray(volume[: strip.owned])
        self._nu_surface = self._stoichiometry(self.surface.reactions)
        self._nu_gas = self._stoichiometry(self.gas.reactions)
        self.tied = self._tied()

    def _stoichiometry(self, reactions: Sequence[SurfaceReaction | GasReaction]) -> Floats:
        """nu (reactions, species), per event."""
        rows = [[r.nu_gas.get(name, 0.0) for name in self.species] for r in reactions]
        return np.array(rows).reshape(len(reactions), len(self.species))

    def _tied(self) -> Floats:
        """lambda (products, coupled) for which no reaction changes C_i + sum_j lambda_ij C_j; none for products that have no such numbers.

        Where species diffuse alike, such a sum is carried like an inert gas.
        """
        nu = np.concatenate([self._nu_surface, self._nu_gas])
        used, made = nu[:, : self.coupled], nu[:, self.coupled :]
        tied = np.linalg.lstsq(used, -made, rcond=None)[0]
        return np.where(np.abs(used @ tied + made).max(axis=0, initial=0.0) < EXACT, tied, 0.0).T

    def heat_to(self, temperature: Floats) -> None:
        """Let all reactions run at the `temperature` of own cells [K]."""
        self.surface.heat_to(temperature[self.coverage.cells])
        self.gas.heat_to(temperature)

    @property
    def start_by_themselves(self) -> bool:
        """Whether one of them needs no gas: it happens where none is fed."""
        return any(not law.gas_orders for reaction in self.surface.reactions for law in reaction.laws)

    @property
    def nu_coupled(self) -> tuple[Floats, Floats]:
        """What an event makes of the coupled species, (reactions, coupled), on surfaces and in the gas."""
        return self._nu_surface[:, : self.coupled], self._nu_gas[:, : self.coupled]

    @property
    def gas_volume(self) -> Floats:
        """Volume of the gas in own cells [m2]."""
        return self.strip.gas_volume[: self.strip.owned]

    def none(self) -> Events:
        """No reaction anywhere."""
        return Events(
            np.zeros((len(self._nu_surface), len(self.coverage.cells))),
            np.zeros((len(self._nu_gas), self.strip.owned)),
        )

    def without_gas(self, dt: float) -> Events:
        """What happens in `dt` [s] where no gas has a say: sites turn into others, or let a gas go for good. Raises ConvergenceError;
        collective."""
        rates, _ = self.surface.rates(np.zeros((0, len(self.coverage.cells))), self.coverage.theta, dt)
        if any_rank(self.strip.comm, not np.isfinite(rates).all()):
            raise ConvergenceError("surface reactions: no coverage was found")
        return self.events(rates, self.none().gas)

    def events(self, surface_rates: Floats, gas_rates: Floats) -> Events:
        """From rates per area (reactions, reactive cells) [mol/m2/s] and per volume that they run in (reactions, own) [mol/m3/s]."""
        return Events(surface_rates * self.coverage.area, gas_rates * self.reacting_volume)

    def made(self, events: Events, species: slice = slice(None)) -> Floats:
        """What they make of every one of these species, (species, own) [mol/m/s]."""
        nu, cells = self._nu_gas[:, species], self.coverage.cells
        on_surfaces = self._nu_surface[:, species].T @ events.surface
        if len(nu):  # of one reaction thrice as fast as a product of matrices
            made = np.asarray(np.einsum("ri,rn->in", nu, events.gas))
        else:
            made = np.zeros((nu.shape[1], self.strip.owned))
        for one, more in zip(made, on_surfaces, strict=True):  # many times as fast as made[:, cells]
            one[cells] += more
        return made

    def slopes(self, surface_slopes: Floats, gas_slopes: Floats) -> Floats:
        """d `made` / dC of the coupled species, (own, coupled, coupled) [m2/s], from those of the rates (reactions, coupled, n)."""
        slopes = _slopes(self._nu_gas[:, : self.coupled], gas_slopes, self.reacting_volume)
        slopes[self.coverage.cells] += _slopes(
            self._nu_surface[:, : self.coupled], surface_slopes, self.coverage.area
        )
        return slopes

    def slopes_by_coverage(self, slopes: Floats, chosen: Ints) -> Floats:
        """d `made` / d theta in `chosen` reactive cells, (chosen, coupled, sites), from those of the rates (reactions, sites, chosen)."""
        return _slopes(self._nu_surface[:, : self.coupled], slopes, self.coverage.area[chosen])

    def on_surfaces(self, chosen: Ints, rates: Floats, slopes: Floats) -> tuple[Floats, Floats]:
        """What is made of coupled species in `chosen` reactive cells (coupled, n), and its derivatives (n, coupled, coupled)."""
        nu, area = self._nu_surface[:, : self.coupled], self.coverage.area[chosen]
        return nu.T @ rates * area, _slopes(nu, slopes, area)

    def in_cells(
        self, chosen: Ints, concentration: Floats, theta: Floats, dt: float
    ) -> tuple[Floats, Floats]:
        """What is made of coupled species in `chosen` reactive cells over a step of `dt` [s] from the coverages `theta` (sites, reactive
        cells) to these concentrations (coupled, n), (coupled, n) [mol/m/s], and its derivatives (n, coupled, coupled) [m2/s]."""
        rates = self.surface.part(chosen).rates(concentration, theta.take(chosen, axis=1), dt)
        made, slopes = self.on_surfaces(chosen, *rates)
        if not self.gas.reactions:
            return made, slopes
        in_gas = self.in_gas(self.coverage.cells[chosen], concentration)
        return made + in_gas[0], slopes + in_gas[1]

    def in_gas(self, cells: Ints, concentration: Floats) -> tuple[Floats, Floats]:
        """The same in the gas of own `cells` at these concentrations (coupled, n)."""
        nu, volume = self._nu_gas[:, : self.coupled], self.reacting_volume[cells]
        rates, slopes = self.gas.part(cells).rates(concentration)
        return nu.T @ rates * volume, _slopes(nu, slopes, volume)


def _slopes(nu: Floats, slopes: Floats, size: Floats) -> Floats:
    """sum_r nu_ri slopes_rj, per cell and times its size: (n, i, j) from (reactions, i) and (reactions, j, n)."""
    if not len(nu):
        return np.zeros((len(size), nu.shape[1], slopes.shape[1]))
    by_species = (nu.T @ slopes.reshape(len(nu), -1)).reshape(
        nu.shape[1], *slopes.shape[1:]
    )  # faster than einsum
    return np.asarray(np.moveaxis(by_species * size, -1, 0))
