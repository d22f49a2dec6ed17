"""Equations of reactions: how they are read and written."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from mpm.units import reject

ARROW = re.compile(
    r"<[-=]+>|[-=]+>|[\u2192\u27f6\u21d2\u27f9]|[\u21cc\u21cb\u2194\u21c4\u27f7\u21d4]|(?<=\s)=(?=\s)"
)
_ONE_WAY = re.compile(r"[-=]+>|[\u2192\u27f6\u21d2\u27f9]")
_COUNT = re.compile(r"(\d+/\d+|\d+\.?\d*|\.\d+)\s*(\S.*)")
_BOTH_WAYS = re.compile(r"<[-=]+>|[\u21cc\u21cb\u2194\u21c4\u27f7\u21d4]")
EQUATION = 'an equation "A + 2 B -> C": -> is the arrow, <=> that of a reaction that goes both ways; coefficients are 2, 0.5 or 1/2'


def parse_equation(equation: str, known: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, float]]:
    """Split `A + 2 B -> C` into the coefficients of its two sides; every name must be one of `known`.

    `=>` is read as `->`, `<->` as `<=>`, and so are the arrows of Unicode; blanks around + may be missing. `=` alone is refused: Cantera
    means both ways by it, others one. Raises the validator error that names the unknown species, with its nearest neighbour, or says how an
    equation is written.
    """
    arrows = ARROW.findall(equation)
    if len(arrows) != 1 or not (_ONE_WAY.fullmatch(arrows[0]) or _BOTH_WAYS.fullmatch(arrows[0])):
        found = f"{equation!r}, with " + (" and ".join(arrows) if arrows else "no arrow")
        raise reject(found, EQUATION, key="equation")
    left, right = equation.split(arrows[0])
    return _side(left, equation, known), _side(right, equation, known)


def is_reversible(equation: str) -> bool:
    """Whether the arrow of an equation goes both ways."""
    return _BOTH_WAYS.search(equation) is not None


def _side(side: str, equation: str, known: Mapping[str, Any]) -> dict[str, float]:
    terms: dict[str, float] = {}
    for text in side.split(" + "):
        whole = _term(text, known)
        for name, count in [whole] if whole[0] in known else [_term(part, known) for part in text.split("+")]:
            if not name or not 0.0 < count < math.inf:
                raise reject(repr(equation), EQUATION, key="equation")
            if name not in known:
                raise reject(
                    f"{name!r} in {equation!r}",
                    f"one of {', '.join(known)}",
                    key="equation",
                    given=name,
                    known=list(known),
                )
            terms[name] = terms.get(name, 0.0) + count
    return terms


def _term(text: str, known: Mapping[str, Any]) -> tuple[str, float]:
    """Name and coefficient of `2 B`, `2B`, `.5 B`, `1/2 B` or `B`."""
    text = text.strip()
    match = None if text in known else _COUNT.fullmatch(text)
    if match is None:
        return text, 1.0
    above, _, below = match.group(1).partition("/")
    return match.group(2), float(above) / float(below or 1) if float(below or 1) else math.inf


def write_equation(left: Mapping[str, float], right: Mapping[str, float], reversible: bool = False) -> str:
    """Compose `A + 2 B -> C`, or with `<=>`, from the coefficients of its two sides."""

    def side(terms: Mapping[str, float]) -> str:
        return " + ".join(name if count == 1.0 else f"{count:g} {name}" for name, count in terms.items())

    return f"{side(left)} {'<=>' if reversible else '->'} {side(right)}"
