"""From the text of a quantity, "3.5 cm/s", to the float that counts a unit: in decimal arithmetic, so that "139.7 mm" becomes 0.1397 and
not its neighbour."""

from __future__ import annotations

import logging
import math
import re
from decimal import Decimal, localcontext
from functools import cache, lru_cache
from typing import Any

from mpm.metric import UNBOUNDED, in_metric, same_kind
from mpm.metric import in_base_units as in_metric_base_units
from mpm.spelling import advice

_NUMBER = re.compile(
    r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?inf|nan)(?![A-Za-z0-9_.])\s*(.*?)\s*$"
)
_JOINED = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(.*?)\s*$")
_LOOK_ALIKES = {
    "-": re.compile("\u2212"),  # minus sign
    "degC": re.compile(
        "\u2103|[\u00b0\u00ba\u02da\u2218]\\s*C\\b"
    ),  # degree sign, ordinal indicator, ring above, ring operator
    "degF": re.compile("\u2109|[\u00b0\u00ba\u02da\u2218]\\s*F\\b"),
    "deg": re.compile("[\u00ba\u02da\u2218]"),
}
"""Characters that keyboards and word processors put in place of the right ones, by what is meant."""
_ANGLES = {"radian", "degree", "turn", "arcminute", "arcsecond", "revolutions_per_minute", "grade"}


@cache
def _registry() -> Any:
    import pint

    logging.getLogger("pint.util").setLevel(logging.ERROR)  # what it may be in other letters is ours to say
    registry = pint.UnitRegistry(non_int_type=Decimal, cache_folder=None)
    registry.define("@alias torr = Torr")  # the symbol; pint has the name only
    return registry


@lru_cache(maxsize=4096)
def parse(text: str, unit: str) -> float:
    """Convert a number with its unit, such as `"3.5 cm/s"`, to the float that counts `unit`.

    Raises ValueError with a short reason: no number, no unit, unknown unit, another dimension.
    """
    number, symbol, written = _parts(text)
    if (metric := in_metric(number, symbol, unit)) is not None:
        return metric
    registry, wanted = _registry(), _registry().Unit(unit)
    try:
        given = registry.Unit(symbol)
    except Exception as error:  # pint raises many types here, down to tokenizer errors
        raise ValueError(f"unknown unit {symbol!r}{advice(written, wanted, registry)}") from error
    if given.dimensionality != wanted.dimensionality or _counts_angle(given) != _counts_angle(wanted):
        raise ValueError(f"{_dimension_text(given)}{advice(written, wanted, registry)}")
    if "inf" in number or "nan" in number:
        return float(number)
    if given == registry.degree:
        return math.radians(float(number))  # the float next to the true value; decimals of pi would miss it
    with localcontext(UNBOUNDED):
        return float(registry.Quantity(Decimal(number), given).to(wanted).magnitude)


_BASE = {
    "[length]": "m",
    "[mass]": "kg",
    "[time]": "s",
    "[substance]": "mol",
    "[temperature]": "K",
    "[current]": "A",
    "[luminosity]": "cd",
}


@lru_cache(maxsize=4096)
def in_base_units(text: str) -> tuple[float, dict[str, float]]:
    """A quantity of any dimension, powers that are no integers included, as the float that counts SI base units, and the powers of these.

    Raises ValueError with a short reason: no number, no unit, unknown unit.
    """
    number, symbol, written = _parts(text)
    if (metric := in_metric_base_units(number, symbol)) is not None:
        return metric[0], dict(metric[1])
    registry = _registry()
    try:
        given = registry.Unit(symbol)
        powers = {_BASE[name]: float(power) for name, power in given.dimensionality.items()}
        with localcontext(UNBOUNDED):
            return float(registry.Quantity(Decimal(number), given).to_base_units().magnitude), powers
    except Exception as error:  # pint raises many types here, down to tokenizer errors
        raise ValueError(f"unknown unit {written!r}") from error


def is_counted(text: str, unit: str) -> bool:
    """Whether `parse` accepts this. It does not say why not, which takes the whole list of units."""
    try:
        agree = same_kind(_parts(text)[1], unit)
        if agree is None:
            parse(text, unit)
    except ValueError:
        return False
    return agree is not False


def _parts(text: str) -> tuple[str, str, str]:
    """The number, its unit as pint writes it, and as it is written. Raises ValueError: no number, no unit."""
    text = _LOOK_ALIKES["-"].sub("-", text)
    match = _NUMBER.match(text) or _JOINED.match(text)
    if match is None:
        raise ValueError("no number with a unit")
    number, written = match.groups()
    if not written:
        raise ValueError("no unit")
    symbol = written
    for spelling in ("degC", "degF", "deg"):
        symbol = _LOOK_ALIKES[spelling].sub(spelling, symbol)
    return number, symbol, written


def _counts_angle(unit: Any) -> bool:
    """Pint calls an angle dimensionless; here "60" is not an angle and "960 rpm" is not a frequency."""
    return any(name.rpartition("_")[2] in _ANGLES or name in _ANGLES for name in unit._units)


def _dimension_text(unit: Any) -> str:
    if _counts_angle(unit):
        return "an angle or angular velocity"
    return f"dimension {unit.dimensionality}"
