"""Values of an axis: what the sweep file says, the SI number for tables, and ranges in the file's own unit."""

import functools
import math
import re
from typing import Any

import numpy as np

from mpm import units
from mpm.case.ratetables import unit_text
from mpm.errors import InputError

DIGITS = 12
"""Significant digits of computed values. Fewer than a float has: 0.3 stays 0.3 however a range arrives at it,
and a point keeps its name when the range is refined."""

NUMBER = re.compile(r"\s*(?:[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?inf|nan)")


def tidy(value: float) -> float:
    """The float that `DIGITS` digits name."""
    return float(f"{value:.{DIGITS}g}")


@functools.cache
def si_units() -> tuple[str, ...]:
    """The SI unit of every kind of quantity that a case may hold, spelled as the case spells it."""
    kinds = [meta for item in vars(units).values() for meta in getattr(item, "__metadata__", ())]
    return tuple(
        dict.fromkeys(kind.unit for kind in kinds if isinstance(kind, units.Dimension) and kind.unit)
    )


@functools.lru_cache(maxsize=4096)
def _quantity(text: str) -> tuple[float, str] | None:
    """SI value and unit of "3.5 cm/s"; None for a word, or a dimension that no key of a case has.

    Rate and equilibrium constants have units that follow from the orders of their reaction: any of mol, m and 1/s.
    """
    for unit in si_units():
        try:
            return units.parse(text, unit), unit
        except ValueError:
            continue
    try:
        value, powers = units.in_base_units(text)
    except ValueError:
        return None
    is_constant = set(powers) <= {"mol", "m", "s"} and powers.get("s", 0.0) in (-1.0, 0.0)
    return (value, unit_text(powers)) if is_constant else None


def to_number(value: Any) -> tuple[float | str, str]:
    """SI value and SI unit of one value of a sweep file; words, booleans and lists come back as text without unit.

    "3.5 cm/s" -> (0.035, "m/s"); 2e-4 -> (2e-4, ""); "60 deg" -> (1.0472, "rad"); "thesis" -> ("thesis", "").
    """
    if isinstance(value, bool):
        return str(value).lower(), ""
    if isinstance(value, int | float) and abs(value) <= units.LARGEST:
        return float(value), ""
    if isinstance(value, str):
        return _quantity(value) or (value, "")
    return str(value), ""


def unit_as_written(value: Any) -> str:
    """The unit a person wrote ("cm/s"), for labels and ranges; empty for bare numbers and words.

    A unit with an offset (degC) is replaced by the SI unit: ratios and scales need a true zero.
    """
    _, si_unit = to_number(value)
    if not si_unit:
        return ""
    unit = NUMBER.sub("", value, count=1).strip()
    return unit if units.parse(f"0 {unit}", si_unit) == 0.0 else si_unit


def factor(unit: str) -> float:
    """What one `unit` (mm, cm/s, deg) is in SI units; 1 for the empty unit."""
    return to_number(f"1 {unit}")[0] if unit else 1.0  # type: ignore[return-value]


class Range:
    """From `start` to `stop`, evenly or in equal ratios, in the unit of `start`.

    Both are numbers, or quantities of one dimension. Raises InputError otherwise, and for a logarithmic range that
    touches zero.
    """

    def __init__(self, start: Any, stop: Any, logarithmic: bool) -> None:
        self.unit = unit_as_written(start)
        self.logarithmic = logarithmic
        (first, one), (last, other) = to_number(start), to_number(stop)
        if isinstance(first, str) or isinstance(last, str):
            raise InputError(
                f"start = {start!r} and stop = {stop!r}, accepted are two numbers or two quantities"
            )
        if not (math.isfinite(first) and math.isfinite(last)):
            raise InputError(f"start = {start!r} and stop = {stop!r}, accepted are two finite ends")
        if one != other:
            raise InputError(
                f"start = {start!r} and stop = {stop!r} differ in dimension ({one or '1'}, {other or '1'})"
            )
        scale = factor(self.unit)
        self.start, self.stop = tidy(first / scale), tidy(last / scale)
        if logarithmic and not (self.start > 0 and self.stop > 0):
            raise InputError(
                f"start = {start!r} and stop = {stop!r}, logspace takes the positive end values themselves, not exponents"
            )

    def at(self, fraction: float) -> Any:
        """The value at `fraction` of the way, as a sweep file would say it."""
        if self.logarithmic:
            value = float(np.exp((1 - fraction) * np.log(self.start) + fraction * np.log(self.stop)))
        else:
            value = (1 - fraction) * self.start + fraction * self.stop
        value = tidy(value)
        return f"{value!r} {self.unit}" if self.unit else value

    def levels(self, num: int) -> tuple[Any, ...]:
        """`num` values, both ends included."""
        return tuple(self.at(float(fraction)) for fraction in np.linspace(0.0, 1.0, num))
