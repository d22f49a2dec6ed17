"""Quantities in metric units, which is what nearly every case file holds, converted in decimal arithmetic.

Loading pint and its list of units takes half a second of processor time, as long as all else that `mpm check` does. So `mpm.units` asks
here first, and pint about the rest: other units, brackets, whatever is wrong. `tests/test_units.py` holds this to pint's own numbers.
"""

from __future__ import annotations

import math
import re
from decimal import Context, Decimal
from functools import cache

Dimensions = dict[str, int]
_PREFIXES = {"": 0, "n": -9, "u": -6, "\u00b5": -6, "m": -3, "c": -2, "h": 2, "k": 3, "M": 6}
_SYMBOLS: dict[str, tuple[str, int, Dimensions]] = {
    "m": ("nu\u00b5mck", 0, {"m": 1}),
    "s": ("nu\u00b5m", 0, {"s": 1}),
    "g": ("u\u00b5mk", -3, {"kg": 1}),
    "mol": ("nu\u00b5mk", 0, {"mol": 1}),
    "K": ("m", 0, {"K": 1}),
    "rad": ("", 0, {"rad": 1}),
    "Hz": ("kM", 0, {"s": -1}),
    "N": ("u\u00b5m", 0, {"kg": 1, "m": 1, "s": -2}),
    "Pa": ("u\u00b5mhkM", 0, {"kg": 1, "m": -1, "s": -2}),
    "bar": ("m", 5, {"kg": 1, "m": -1, "s": -2}),
    "J": ("mkM", 0, {"kg": 1, "m": 2, "s": -2}),
    "W": ("mk", 0, {"kg": 1, "m": 2, "s": -3}),
}
"""Prefixes in use (not all: "hbar" is Planck's constant), power of ten over the base units, and the powers of those. An angle counts as
one: "60" is none, and "960 rad/s" no frequency."""
METRIC = {
    prefix + symbol: (tens + _PREFIXES[prefix], dimensions)
    for symbol, (prefixes, tens, dimensions) in _SYMBOLS.items()
    for prefix in ("", *prefixes)
}
_FACTOR = r"[A-Za-z\u00b5]+(?:\^-?[1-9])?"
_PRODUCT = re.compile(rf"(?:1/)?{_FACTOR}(?:/{_FACTOR})*|{_FACTOR}(?:[* ]{_FACTOR})*")
ZERO_CELSIUS = Decimal("273.15")  # [K]
UNBOUNDED = Context(
    traps=[]
)  # numbers of more digits in their power of ten than decimals have become infinite, as floats do


def in_metric(number: str, symbol: str, unit: str) -> float | None:
    """`number` in units of `symbol` as the float that counts `unit`; None where pint has to be asked."""
    if (symbol, unit) == ("deg", "rad"):
        return math.radians(float(number))
    if (symbol, unit) == ("degC", "K"):
        return float(UNBOUNDED.add(Decimal(number), ZERO_CELSIUS))
    given, wanted = _product(symbol), _product(unit)
    if given is None or wanted is None or given[1] != wanted[1]:
        return None
    return float(Decimal(number).scaleb(given[0] - wanted[0], UNBOUNDED))


def same_kind(symbol: str, unit: str) -> bool | None:
    """Whether both count the same; None where pint has to be asked."""
    given, wanted = _product(symbol), _product(unit)
    return None if given is None or wanted is None else given[1] == wanted[1]


def in_base_units(number: str, symbol: str) -> tuple[float, Dimensions] | None:
    """`number` in units of `symbol` as the float that counts SI base units, and the powers of these; None where pint has to be asked."""
    given = _product(symbol)
    return None if given is None else (float(Decimal(number).scaleb(given[0], UNBOUNDED)), given[1])


@cache
def _product(text: str) -> tuple[int, Dimensions] | None:
    """Power of ten and base units of a product such as "um^2", "m^3/kmol/s" or "Pa s"; None for another one."""
    if not _PRODUCT.fullmatch(text):
        return None
    tens = 0
    dimensions: Dimensions = {}
    for sign, name, power in re.findall(r"(/?)([A-Za-z\u00b5]+)(?:\^(-?[1-9]))?", text):
        if name not in METRIC:
            return None
        times = int(power or 1) * (-1 if sign else 1)
        more, base = METRIC[name]
        tens += times * more
        for dimension, exponent in base.items():
            dimensions[dimension] = dimensions.get(dimension, 0) + times * exponent
    return tens, {name: exponent for name, exponent in dimensions.items() if exponent}
