"""Chemical formulas: the atoms in them, and what these weigh."""

from __future__ import annotations

import re
from collections.abc import Mapping

ATOMIC_WEIGHTS = {
    "H": 1.008, "He": 4.0026, "Li": 6.94, "Be": 9.0122, "B": 10.81, "C": 12.011, "N": 14.007, "O": 15.999, "F": 18.998,
    "Ne": 20.180, "Na": 22.990, "Mg": 24.305, "Al": 26.982, "Si": 28.085, "P": 30.974, "S": 32.06, "Cl": 35.45, "Ar": 39.95,
    "K": 39.098, "Ca": 40.078, "Sc": 44.956, "Ti": 47.867, "V": 50.942, "Cr": 51.996, "Mn": 54.938, "Fe": 55.845,
    "Co": 58.933, "Ni": 58.693, "Cu": 63.546, "Zn": 65.38, "Ga": 69.723, "Ge": 72.630, "As": 74.922, "Se": 78.971,
    "Br": 79.904, "Kr": 83.798, "Rb": 85.468, "Sr": 87.62, "Y": 88.906, "Zr": 91.224, "Nb": 92.906, "Mo": 95.95,
    "Ru": 101.07, "Rh": 102.91, "Pd": 106.42, "Ag": 107.87, "Cd": 112.41, "In": 114.82, "Sn": 118.71, "Sb": 121.76,
    "Te": 127.60, "I": 126.90, "Xe": 131.29, "Cs": 132.91, "Ba": 137.33, "La": 138.91, "Ce": 140.12, "Pr": 140.91,
    "Nd": 144.24, "Sm": 150.36, "Eu": 151.96, "Gd": 157.25, "Tb": 158.93, "Dy": 162.50, "Ho": 164.93, "Er": 167.26,
    "Tm": 168.93, "Yb": 173.05, "Lu": 174.97, "Hf": 178.49, "Ta": 180.95, "W": 183.84, "Re": 186.21, "Os": 190.23,
    "Ir": 192.22, "Pt": 195.08, "Au": 196.97, "Hg": 200.59, "Tl": 204.38, "Pb": 207.2, "Bi": 208.98, "Th": 232.04, "U": 238.03,
}  # fmt: skip
"""[g/mol]: IUPAC, abridged standard atomic weights of 2021, every element that has one outside the rarest."""


_GROUP = re.compile(r"([A-Z][a-z]?)(\d*)|\(|\)(\d*)")


def formula_mass(elements: Mapping[str, float]) -> float | None:
    """Molar mass [kg/mol] of what has these atoms; None without atoms, or with one that is no element of the table."""
    if not elements or not set(elements) <= set(ATOMIC_WEIGHTS):
        return None
    return sum(count * ATOMIC_WEIGHTS[element] for element, count in elements.items()) * 1e-3 or None


def parse_formula(formula: str) -> dict[str, float]:
    """Count the atoms of a formula such as `Al(CH3)3` or `OAl(CH3)2`; ValueError when it is none."""
    stack: list[dict[str, float]] = [{}]
    place = 0
    while place < len(formula):
        match = _GROUP.match(formula, place)
        if match is None:
            raise ValueError(f"{formula!r} is not a chemical formula")
        place = match.end()
        if match.group(1):
            element, count = match.group(1), float(match.group(2) or 1)
            stack[-1][element] = stack[-1].get(element, 0.0) + count
        elif match.group() == "(":
            stack.append({})
        else:
            if len(stack) == 1:
                raise ValueError(f"{formula!r} closes a bracket that it did not open")
            for element, count in stack.pop().items():
                stack[-1][element] = stack[-1].get(element, 0.0) + count * float(match.group(3) or 1)
    if len(stack) != 1:
        raise ValueError(f"{formula!r} leaves a bracket open")
    return stack[0]
