"""The doses that `mpm optimise` may choose: which keys of a case, where the search starts and what it stays within."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpm.errors import InputError
from mpm.report.dosing import inlet_excess

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.ports import Inlet

VERB = "optimise"
"""What a message begins with."""
RICHEST, LEANEST = 0.02, 1e-6
"""Mass fractions: dilute gas above, nothing happens below."""
NEAR = 0.02
"""Relative error of the mass fraction with which a search starts."""
VELOCITIES = 5.0
"""Factor by which a port velocity may fall or rise."""


@dataclass(frozen=True, kw_only=True)
class Dose:
    """One number to choose: `key` of the case, its `start`, `lowest` and `highest` value, and its unit in the file."""

    key: str
    start: float
    lowest: float
    highest: float
    unit: str = ""

    def setting(self, value: float) -> float | str:
        return f"{value!r} {self.unit}" if self.unit else value


def doses_of(case: Case, target: float, velocities: bool) -> list[Dose]:
    """Mass fraction (and port velocity) of every dosed inlet, starting where the dose ratio is `target`.

    Raises InputError for a case in which a steady dose has nothing to titrate, or more than one precursor could be meant.
    """
    doses = []
    for inlet in case.geometry.inlets:
        excess = inlet_excess(case, inlet)
        if excess is None:
            continue
        refuse_inlet(case, inlet)
        species = excess.species
        if excess.dose_ratio is None:
            found = f"inlet {inlet.name}, whose precursor {species} never saturates the surface"
            raise InputError.at(VERB, "", found, "reactions that end")
        key = f"geometry.inlet.{inlet.name}"
        dosed = f"{key}.mass_fractions.{species}"
        if case.mechanism.is_first_order:
            fraction = inlet.mass_fractions[species] * target / excess.dose_ratio
        else:
            fraction = _least_enough(case, inlet, dosed, target)
        start = min(max(fraction, 2.0 * LEANEST), 0.5 * RICHEST)
        doses.append(Dose(key=dosed, start=start, lowest=LEANEST, highest=RICHEST))
        if velocities:
            doses.append(
                Dose(
                    key=f"{key}.velocity",
                    start=inlet.velocity,
                    lowest=inlet.velocity / VELOCITIES,
                    highest=inlet.velocity * VELOCITIES,
                    unit="m/s",
                )
            )
    if not doses:
        if case.conveying_velocity == 0.0:
            found = "a bed that does not move"
        elif not case.mechanism.surface_reactions:
            found = "a mechanism without surface reactions"
        else:
            found = "no inlet that feeds a precursor of the surface reactions"
        raise InputError.at(VERB, "", found, "a bed that moves past one inlet or more that dose it")
    return doses


def _least_enough(case: Case, inlet: Inlet, key: str, target: float) -> float:
    """The smallest mass fraction whose dose ratio is `target` and which alone leaves that share of the sites titrated; else the richest.

    Where reactions go back, what stays on the solids depends on the concentration: one that is low leaves little, however long it flows.
    """

    def enough(fraction: float) -> bool:
        changed = case.with_({key: fraction})
        found = inlet_excess(changed, next(i for i in changed.geometry.inlets if i.name == inlet.name))
        if found is None or found.dose_ratio is None or found.dose_ratio < target:
            return False
        covered = sum(
            found.saturation.left.get(site, 0.0) for site in case.mechanism.titrated_sites(found.species)
        )
        return covered >= target

    low, high = math.log(LEANEST), math.log(RICHEST)
    while high - low > NEAR:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if enough(math.exp(middle)) else (middle, high)
    return math.exp(high)


def checked_doses(case: Case, target: float, weight: float, velocities: bool, limit: int) -> list[Dose]:
    """`doses_of` with the numbers of the command line checked, too. Raises InputError."""
    check_numbers(target, weight, limit)
    return doses_of(case, target, velocities)


def check_numbers(target: float, weight: float, limit: int) -> None:
    """Raise InputError for numbers of the command line with which no search can begin."""
    if not 0.0 < target <= 1.0:
        raise InputError.at(VERB, "--target", f"{target:g}", "above 0 and at most 1")
    if not 0.0 <= weight < math.inf:
        raise InputError.at(VERB, "--weight", f"{weight:g}", "a finite number from 0")
    if limit < 1:
        raise InputError.at(VERB, "--limit", f"{limit}", "a whole number from 1")


def refuse_inlet(case: Case, inlet: Inlet) -> None:
    """Raise InputError for a dosing inlet whose dose the search could not choose or whose effect it could not see."""
    key = f"geometry.inlet.{inlet.name}"
    fed = case.precursors(inlet)
    if inlet.velocity == 0.0:
        raise InputError.at(
            VERB, f"{key}.velocity", "0 m/s, a port that doses nothing", "a velocity above 0 m/s"
        )
    if len(fed) > 1:
        raise InputError.at(
            VERB, f"{key}.mass_fractions", f"the precursors {', '.join(fed)}", "one in each inlet"
        )
    if not inlet.stays_open:
        found = f"doses that end at {inlet.windows[-1][1]:g} s"
        raise InputError.at(VERB, key, found, "an inlet that doses without end, as in a steady state")
    if all(zone.inlet != inlet.name for zone in case.geometry.zones):
        found = "no zone that it doses, so that its exit is not known"
        raise InputError.at(VERB, key, found, f"a geometry.zone with inlet = {inlet.name!r}")
