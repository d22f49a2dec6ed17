"""A surface left alone with a gas: its coverages followed in time, whatever the rate laws.

    d theta_k/dt = (sigma_k/n_s) sum_r nu_kr (r_f - r_b),    taken_i = -(1/n_s) int sum_r nu_ir (r_f - r_b) dt

at one temperature and in a gas whose composition does not change: what reactions give off is swept away at once. LSODA follows it over
many decades of time (Petzold, SIAM J. Sci. Stat. Comput. 4, 136, 1983: Adams' formulae where rates are slow, Gear's where they are stiff).
Where what it sums up is but the rounding of fast ways there and back, implicit steps of `mpm.physics.general_kinetics` take its place,
which tell slow reactions from fast ones: each whole and in two halves, extrapolated to second order (Hairer and Wanner, Solving Ordinary
Differential Equations II, section IV.9).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.physics.general_kinetics import GeneralKinetics
from mpm.physics.surface_rates import SurfaceRates

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
_EFFORT = 5_000
"""Evaluations of all rates at most, ten times what it takes."""
_NOISE = 1e-3
"""Share of what is taken up of a gas, or of all places, that may be rounding."""
_FIRST, _GROWTH, _STEP = 1e-14, 4.0, 1e-3
"""Implicit steps: the first [s], the factor between two at most, and by how much a whole one and two halves may differ: of all places, and
of what has been taken."""
_LITTLE = 1e-3
"""Molecules per place below which that is counted from here."""


class _BeyondReach(Exception):
    """Following a surface takes too long."""


@dataclass(frozen=True, eq=False)
class Track:
    """States (sites + gases,), coverages and molecules taken per place, at any time: `at`; `times` between which they run smoothly."""

    times: Floats
    at: Callable[[float], Floats]


@dataclass(frozen=True, eq=False)
class Exposed:
    """A surface after HORIZON: its `coverage` by site species, and molecules per place that it has `taken` of each gas.

    A gas that is given off has been taken less than 0 times. `endless`: gases whose uptake has not stopped.
    """

    coverage: Mapping[str, float]
    taken: Mapping[str, float]
    endless: frozenset[str]
    _track: Track

    def time(self, species: str, share: float) -> float | None:
        """When it has taken `share` of all that it takes of a gas [s]; None where that never ends, or is nothing."""
        whole = self.taken[species]
        if species in self.endless or whole <= NOTHING:
            return None
        row = len(self.coverage) + list(self.taken).index(species)
        times, wanted = self._track.times, share * whole
        late = next((t for t in times if self._track.at(t)[row] >= wanted), None)
        if late is None or late == 0.0:
            return late
        early = times[np.searchsorted(times, late) - 1]
        for _ in range(60):
            middle = 0.5 * (early + late)
            early, late = (early, middle) if self._track.at(middle)[row] >= wanted else (middle, late)
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
    sites, places = len(names), float(start.sum())
    if places == 0.0:  # no surface
        return None
    track = _followed(rates, start)
    if track is None:
        track = _stepped(
            GeneralKinetics(mechanism, rates.species, np.array([site_density]), temperature),
            gas,
            rates,
            start,
        )
    if track is None:
        return None
    end, before = track.at(HORIZON), track.at(0.1 * HORIZON)
    taken = dict(zip(rates.species, map(float, end[sites:]), strict=True))
    late = dict(zip(rates.species, end[sites:] - before[sites:], strict=True))
    return Exposed(
        coverage=dict(zip(names, map(float, _whole(end[:sites].clip(0.0), places)), strict=True)),
        taken=taken,
        endless=frozenset(
            name for name, amount in late.items() if abs(amount) > max(ENDLESS * abs(taken[name]), NOTHING)
        ),
        _track=track,
    )


def _whole(theta: Floats, places: float) -> Floats:
    """Coverages that add up to all places again, whatever a solver has lost of them."""
    return np.asarray(theta * (places / theta.sum()))


def _followed(rates: SurfaceRates, start: Floats) -> Track | None:
    """From `start` to HORIZON by LSODA; None where it does not get there, loses places, or sums up rounding."""
    from scipy.integrate import solve_ivp  # which takes a while to load

    sites, whole, left = len(rates.sites), np.vstack([rates.change, rates.uptake]), iter(range(_EFFORT))
    places = float(start[:sites].sum())

    def change(_: float, state: Floats) -> Floats:
        if next(left, None) is None:
            raise _BeyondReach
        return np.asarray(whole @ rates(_whole(state[:sites], places)))

    def slopes(_: float, state: Floats) -> Floats:
        square = np.zeros((len(whole), len(whole)))
        square[:, :sites] = whole @ rates.slopes(state[:sites])
        return square

    options = {"jac": slopes, "rtol": _RELATIVE, "atol": _ABSOLUTE, "dense_output": True}
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # LSODA says there why it gives up
            solution: Any = solve_ivp(change, (0.0, HORIZON), start, method="LSODA", **options)
    except (_BeyondReach, ArithmeticError, ValueError):
        return None
    end = solution.y[:, -1]
    if not (solution.success and np.isfinite(end).all() and abs(end[:sites].sum() - places) < _LOST):
        return None
    rounding = HORIZON * np.finfo(float).eps * (np.abs(whole) @ np.abs(rates(end[:sites])))
    known = (rounding[:sites] <= _NOISE).all() and (rounding[sites:] <= _NOISE * np.abs(end[sites:])).all()
    return Track(solution.t, solution.sol) if known else None


def _stepped(
    kinetics: GeneralKinetics, gas: Mapping[str, float], rates: SurfaceRates, start: Floats
) -> Track | None:
    """The same by implicit steps; None where one is not found."""
    sites = len(rates.sites)
    concentration = np.array([[gas.get(name, 0.0)] for name in rates.species])
    uptake = np.array([[-r.nu_gas.get(name, 0.0) for name in rates.species] for r in kinetics.reactions])

    def step(theta: Floats, dt: float) -> tuple[Floats, Floats]:
        """Coverages and events per place after an implicit step."""
        events = dt / kinetics.sites * kinetics.rates(concentration, theta[:, None], dt)[0]
        return np.maximum(theta + kinetics.nu_places.T @ events[:, 0], 0.0), events[:, 0]

    theta, taken = start[:sites], start[sites:]
    time, dt = 0.0, _FIRST
    times, states = [time], [start]
    while time < HORIZON:
        dt = min(dt, HORIZON - time)
        whole, events = step(theta, dt)
        half, first = step(theta, 0.5 * dt)
        new, second = step(half, 0.5 * dt)
        apart = np.abs(uptake.T @ (first + second - events)) / np.maximum(_LITTLE, np.abs(taken))
        error = max(np.abs(new - whole).max(), apart.max(initial=0.0))
        if not np.isfinite(error) or dt < _FIRST * _STEP:
            return None
        if error <= _STEP:
            beyond = 2.0 * new - whole  # of second order, where it stays a coverage
            extrapolated = (beyond >= 0.0).all()
            theta = beyond if extrapolated else new
            taken = taken + uptake.T @ (2.0 * (first + second) - events if extrapolated else first + second)
            time += dt
            times.append(time)
            states.append(np.concatenate([theta, taken]))
        dt *= min(_GROWTH, 0.9 * np.sqrt(_STEP / max(error, _STEP**3)))
    over, at = np.array(times), np.array(states).T
    return Track(over, lambda t: np.array([np.interp(t, over, row) for row in at]))
