"""A surface left alone with a gas: its coverages followed in time, whatever the rate laws.

    d theta_k/dt = (sigma_k/n_s) sum_r nu_kr (r_f - r_b),    taken_i = -(1/n_s) int sum_r nu_ir (r_f - r_b) dt

at one temperature and in a gas whose composition does not change: what reactions give off is swept away at once. LSODA follows it over
many decades of time (Petzold, SIAM J. Sci. Stat. Comput. 4, 136, 1983: Adams' formulae where rates are slow, Gear's where they are stiff),
where it fails Radau's method of fifth order (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GAS_CONSTANT

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpm.physics.mechanism import Mechanism

HORIZON = 1e4
"""[s] for which a surface is followed: longer than powder stays in a reactor."""
ENDLESS = 1e-3
"""Share of all that a surface has taken, taken in the last nine tenths of HORIZON, from which its uptake counts as never ending."""
NOTHING = 1e-9
"""Molecules per place, below which a surface takes none."""
_RELATIVE, _ABSOLUTE = 1e-7, 1e-11
"""Tolerances of a step."""
_LOST = 1e-2
"""Share of the places that may be lost by rounding over many turnovers; rates are those of all places all the same."""
_EFFORT = 20_000
"""Evaluations of all rates at most, some tens of times what it takes."""
_LEAST = 1e-7
"""Coverage below which powers of it are bent into a line through zero: half an order has no slope there."""


class _BeyondReach(Exception):
    """Following a surface takes too long."""


class SurfaceRates:
    """Rates of the surface reactions in a gas of these concentrations [mol/m3], at `temperature` [K] with n_s [mol/m2] places.

    Each way of a reaction is k prod theta^mu exp(e . theta): `constant` (ways,) with the gas in it, `orders`, `exponents` (ways, sites),
    `taking` which coverages count; `change` (sites, ways) and `uptake` (gases of `species`, ways) per place and second.
    """

    def __init__(
        self, mechanism: Mechanism, gas: Mapping[str, float], temperature: float, site_density: float
    ) -> None:
        self.sites, self.species = mechanism.site_names, mechanism.species_names
        names = self.sites
        constant, orders, taking = [], [], []
        exponents, change, uptake = [], [], []
        for reaction in mechanism.surface_reactions:
            constants = mechanism.rate_constants(reaction, temperature, site_density)
            for k, (sign, law) in zip(constants, reaction.ways, strict=False):
                amounts = [(gas.get(name, 0.0), order) for name, order in law.gas_orders.items()]
                if any(amount <= 0.0 for amount, _ in amounts):
                    continue  # whatever its order: none of it reacts
                bends = [law.coverage.get(name) for name in names]
                constant.append(float(k) * np.prod([amount**order for amount, order in amounts]))
                powers = [b.m if b else 0.0 for b in bends]
                orders.append([law.site_orders.get(n, 0.0) + m for n, m in zip(names, powers, strict=True)])
                taking.append([n in law.site_orders or m != 0.0 for n, m in zip(names, powers, strict=True)])
                exponents.append(
                    [b.a * np.log(10.0) - b.E / (GAS_CONSTANT * temperature) if b else 0.0 for b in bends]
                )
                change.append([sign * reaction.nu_site.get(n, 0.0) for n in names])
                uptake.append([-sign * reaction.nu_gas.get(n, 0.0) for n in self.species])
        count = len(constant)
        self.constant = np.array(constant).reshape(count)
        self.orders = np.array(orders).reshape(count, len(names))
        self.taking = np.array(taking, dtype=bool).reshape(count, len(names))
        self.exponents = np.array(exponents).reshape(count, len(names))
        self.change = (np.array(change).reshape(count, len(names)) * mechanism.places).T / site_density
        self.uptake = np.array(uptake).reshape(count, len(self.species)).T / site_density

    def __call__(self, theta: Floats) -> Floats:
        """Events of every way [mol/m2/s] at coverages (sites,)."""
        return np.asarray(self.constant * np.prod(self._powers(theta), axis=1) * self._bent(theta))

    def taken(self, coverage: Mapping[str, float]) -> dict[str, float]:
        """Molecules of each gas per place and second, net, that a surface of this coverage takes up."""
        theta = np.array([coverage.get(name, 0.0) for name in self.sites])
        return dict(zip(self.species, map(float, self.uptake @ self(theta)), strict=True))

    def slopes(self, theta: Floats) -> Floats:
        """Their derivatives by the coverages, (ways, sites)."""
        powers, size = self._powers(theta), np.hypot(theta, _LEAST)
        steepness = (
            self.taking * (1.0 + (self.orders - 1.0) * (theta / size) ** 2) * size ** (self.orders - 1.0)
        )
        whole = self.constant * self._bent(theta)
        others = np.stack([np.prod(np.delete(powers, k, axis=1), axis=1) for k in range(len(theta))], axis=1)
        return np.asarray(
            whole[:, None] * (steepness * others + np.prod(powers, axis=1)[:, None] * self.exponents)
        )

    def _powers(self, theta: Floats) -> Floats:
        """theta^mu (ways, sites), smooth through zero and negative beyond it, as a solver's errors want it."""
        return np.where(self.taking, theta * np.hypot(theta, _LEAST) ** (self.orders - 1.0), 1.0)

    def _bent(self, theta: Floats) -> Floats:
        return np.asarray(np.exp(self.exponents @ theta))


@dataclass(frozen=True, eq=False)
class Exposed:
    """A surface after HORIZON: its `coverage` by site species, and molecules per place that it has `taken` of each gas.

    A gas that is given off has been taken less than 0 times. `endless`: gases whose uptake has not stopped. `_at`: the state at any time.
    """

    coverage: Mapping[str, float]
    taken: Mapping[str, float]
    endless: frozenset[str]
    _times: Floats
    _taken_at: Callable[[str, float], float]

    def time(self, species: str, share: float) -> float | None:
        """When it has taken `share` of all that it takes of a gas [s]; None where that never ends, or is nothing."""
        whole = self.taken[species]
        if species in self.endless or whole <= NOTHING:
            return None
        late = next((t for t in self._times if self._taken_at(species, t) >= share * whole), None)
        if late is None or late == 0.0:
            return late
        early = self._times[np.searchsorted(self._times, late) - 1]
        for _ in range(60):
            middle = 0.5 * (early + late)
            if self._taken_at(species, middle) >= share * whole:
                late = middle
            else:
                early = middle
        return float(late)


def expose(
    mechanism: Mechanism,
    gas: Mapping[str, float],
    coverage: Mapping[str, float],
    temperature: float,
    site_density: float,
) -> Exposed | None:
    """Follow a surface of this `coverage` and `site_density` [mol/m2] in a gas of these concentrations [mol/m3] at `temperature` [K].

    Where reactions go back, what it takes depends on the concentrations. None where rates are beyond what can be followed.
    """
    names = mechanism.site_names
    rates = SurfaceRates(mechanism, gas, temperature, site_density)
    start = np.array([*(coverage.get(name, 0.0) for name in names), *(0.0 for _ in rates.species)])
    sites = len(names)
    if not start.any():  # no surface
        return None
    solution = next(filter(None, (_followed(rates, start, method) for method in ("LSODA", "Radau"))), None)
    if solution is None:
        return None

    def taken_at(species: str, time: float) -> float:
        return float(solution.sol(time)[sites + rates.species.index(species)])

    end, before = solution.y[:, -1], solution.sol(0.1 * HORIZON)
    taken = dict(zip(rates.species, map(float, end[sites:]), strict=True))
    late = dict(zip(rates.species, end[sites:] - before[sites:], strict=True))
    return Exposed(
        coverage=dict(
            zip(names, map(float, _whole(end[:sites].clip(0.0), start[:sites].sum())), strict=True)
        ),
        taken=taken,
        endless=frozenset(
            name for name, amount in late.items() if abs(amount) > max(ENDLESS * abs(taken[name]), NOTHING)
        ),
        _times=solution.t,
        _taken_at=taken_at,
    )


def _whole(theta: Floats, places: float) -> Floats:
    """Coverages that add up to all places again, whatever a solver has lost of them."""
    return np.asarray(theta * (places / theta.sum()))


def _followed(rates: SurfaceRates, start: Floats, method: str) -> Any:
    """Coverages and amounts taken (sites + gases,) from `start` to HORIZON by a method of scipy; None where it does not get there, or
    loses places on its way by rounding."""
    from scipy.integrate import solve_ivp  # which takes a while to load

    sites, whole, left = len(rates.sites), np.vstack([rates.change, rates.uptake]), iter(range(_EFFORT))

    def change(_: float, state: Floats) -> Floats:
        if next(left, None) is None:
            raise _BeyondReach
        return np.asarray(whole @ rates(_whole(state[:sites], places)))

    def slopes(_: float, state: Floats) -> Floats:
        square = np.zeros((len(whole), len(whole)))
        square[:, :sites] = whole @ rates.slopes(state[:sites])
        return square

    places = float(start[:sites].sum())
    options = {"jac": slopes, "rtol": _RELATIVE, "atol": _ABSOLUTE, "dense_output": True}
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # LSODA says there why it gives up
            solution: Any = solve_ivp(change, (0.0, HORIZON), start, method=method, **options)
    except (_BeyondReach, ArithmeticError, ValueError):
        return None
    end = solution.y[:, -1]
    kept = abs(end[:sites].sum() - places) < _LOST
    return solution if solution.success and np.isfinite(end).all() and kept else None
