"""Spellings that people use and that cannot be read, or mean something else: what to write instead, of units and in TOML."""

from __future__ import annotations

import re
from typing import Any

_ADVICE = (
    (re.compile(r"C"), 'C is the coulomb, degrees Celsius are "degC"'),
    (re.compile(r"deg(rees?)?\.? ?C"), 'degrees Celsius are "degC"'),
    (re.compile(r"k"), 'kelvins are "K"'),
    (re.compile(r"A"), 'A is the ampere, the angstrom is "angstrom"'),
    (re.compile(r"u|amu|Da"), 'molar masses are "g/mol"'),
    (re.compile(r"eV"), 'energies are those of a mole, "kJ/mol"; 1 eV is "96.485 kJ/mol"'),
    (
        re.compile(r"(sites?|1)/nm\^?2|nm\^?-2"),
        'sites are counted in moles; 1 per nm^2 is "1.6605e-6 mol/m^2"',
    ),
    (re.compile(r"/.*"), 'one over a unit is written "1/m"'),
    (re.compile(r"Pas"), 'a product is written "Pa s"'),
    (re.compile(r"F"), 'F is the farad, degrees Fahrenheit are "degF"'),
    (
        re.compile(r"sccm|sccs|slm|slpm|sLm|NL/min|Nl/min|(l|ml|cc|cm\^?3)/(min|s)", re.IGNORECASE),
        'a flow; a port has the velocity flow/(width depth), e.g. "3.5 cm/s", at the temperature and pressure of the reactor',
    ),
    (re.compile(r",\d.*"), "the decimal sign is a point"),
)
"""What is often written, and what to write."""
_POWER = re.compile(r"([A-Za-z\u00b5\u03bc])(-?\d)")


def advice(symbol: str, wanted: Any, registry: Any) -> str:
    """What to write instead of a unit that people use and that cannot be read, or means something else here."""
    known = next((text for pattern, text in _ADVICE if pattern.fullmatch(symbol)), None)
    if known is not None:
        return f"; {known}"
    powers = _POWER.sub(r"\1^\2", symbol)
    if powers != symbol:
        return f"; powers are written {powers}"
    try:
        small = registry.parse_units(symbol, case_sensitive=False)
    except Exception:  # of many types, as above
        return ""
    return f'; did you mean "{small:~C}"?' if small.dimensionality == wanted.dimensionality else ""


_LINE = re.compile(r"\(at line (\d+),")
_VALUE = re.compile(r"[^=#\[]+=\s*([^\s\"'\[{#][^\"'#]*?)\s*(?:#.*)?")


def quotes_advice(text: str, error: str) -> str:
    """What to write in the line that a TOML parser's `error` names, where only quotes (or small letters) are missing in it."""
    number = _LINE.search(error)
    lines = text.splitlines()
    a_value = error.startswith(("Expected newline", "Invalid value"))
    if number is None or not a_value or not 0 < int(number[1]) <= len(lines):
        return ""
    value = _VALUE.fullmatch(lines[int(number[1]) - 1])
    if value is None:
        return ""
    if value[1] in ("True", "False"):
        return f"; in line {number[1]} {value[1].lower()}, in small letters"
    return f'; in line {number[1]} text and quantities in quotes, "{value[1]}"'
