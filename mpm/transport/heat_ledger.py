"""What heat has passed since the start of a run: through ports and walls, with solids, from heating and reactions."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats

if TYPE_CHECKING:
    from mpm.case.case import Case


@dataclass(frozen=True, eq=False)
class HeatPassed:
    """Heat into the strip, counted from the temperature of `[gas]` [J per metre of depth], the same on every rank.

    `inlets` (inlets,), `outlets` (outlets,) with the gas, what is drawn back in included; `walls` (walls,) by conduction; `solids` with
    those that enter less those that leave; `heating` electrical; `reaction` given off by reactions. `gas` is what came in of the gas itself
    less what left, at the density of the case [m2].
    """

    inlets: Floats
    outlets: Floats
    walls: Floats
    solids: float
    heating: float
    reaction: float
    gas: float


class HeatLedger:
    """The book of a run with heat; `passed` is replaced, never changed in place."""

    def __init__(self, case: Case):
        geometry = case.geometry
        self.passed = HeatPassed(
            inlets=np.zeros(len(geometry.inlets)),
            outlets=np.zeros(len(geometry.outlets)),
            walls=np.zeros(len(geometry.walls)),
            solids=0.0,
            heating=0.0,
            reaction=0.0,
            gas=0.0,
        )

    def add(self, **amounts: Any) -> None:
        """Enter amounts by name [J/m]."""
        before = self.passed
        self.passed = HeatPassed(
            **{f.name: getattr(before, f.name) + amounts.get(f.name, 0.0) for f in fields(HeatPassed)}
        )

    def restore(self, stored: dict[str, Any]) -> None:
        """The book of a restart state."""
        values: dict[str, Any] = {f.name: stored[f.name] for f in fields(HeatPassed)}
        single = {name: float(values[name]) for name in ("solids", "heating", "reaction", "gas")}
        self.passed = HeatPassed(**{**values, **single})
