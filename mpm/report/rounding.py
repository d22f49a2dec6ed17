"""What of a number is rounding, and the number as people read it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mpm.report.quantities import quantity
from mpm.screen import number

ROUNDING = 1e-12
"""Share of its natural scale below which a number is printed as 0: species, sites and elements balance to about 1e-12, so nothing smaller
is known. docs/output.md names the scales; the files of a run keep all digits."""


def without_rounding(value: float, scale: float) -> float:
    """`value`, or 0 where it is rounding beside `scale`."""
    return 0.0 if abs(value) <= ROUNDING * scale else value


def shown(name: str, numbers: Mapping[str, float], steady: bool) -> str:
    """A number of a run as a screen has it: with its unit, and 0 for what is below rounding."""
    meant = quantity(name, steady)
    value = without_rounding(numbers[name], natural_scale(name, numbers))
    return f"{value:,.0f}" if not meant.unit else number(meant.of(value), meant.unit_shown)


def natural_scale(name: str, numbers: Mapping[str, float]) -> float:
    """What a number is large or small beside, in its own unit.

    Amounts [mol/m]: the largest feed of a species. Rates per volume: that feed per second, spread over a square metre of strip (none is as
    large). Growth per surface and thickness: 1 umol/m2, 1 nm. Flows, velocities and pressure drops of the gas: the largest of their kind.
    Shares, coverages and mole fractions: 1; shares of a CVD that is itself 0 mean nothing. Lengths: 1 m. Temperatures: 1 K.
    """
    kind, last = name.split(".")[0], name.split(".")[-1]
    feed = max((value for key, value in numbers.items() if _is_feed(key)), default=0.0)
    if kind == "cvd" and last.startswith("rate"):
        return feed / max(numbers.get("simulated_seconds", 1.0), 1.0)
    if kind == "cvd" and "share_in_zone" in name:
        rate = numbers.get("cvd.rate_mean", 0.0)
        return math.inf if rate <= ROUNDING * natural_scale("cvd.rate_mean", numbers) else 1.0
    if kind in ("species", "film", "cvd"):
        return {"per_area": 1e-6, "thickness": 1e-9}.get(last, feed)
    if kind == "energy":
        return max([abs(value) for key, value in numbers.items() if _is_heat(key)], default=0.0)
    if kind == "flow":
        unit = quantity(name).unit
        alike = (v for key, v in numbers.items() if key.startswith("flow.") and quantity(key).unit == unit)
        return max(map(abs, alike), default=0.0)
    return 1.0


def _is_feed(name: str) -> bool:
    return name.startswith("species.") and name.endswith(".fed")


def _is_heat(name: str) -> bool:
    return name.startswith("energy.") and not quantity(name).error
