"""Columns of no width: what a number that is measured in columns of several widths tends to."""

from __future__ import annotations

from collections.abc import Sequence

LOWEST, HIGHEST = 0.25, 4.0
"""Orders between which the observed one is looked for."""
BISECTIONS = 60


def to_zero(widths: Sequence[float], values: Sequence[float | None]) -> tuple[float, float] | None:
    """(limit, order) of value(h) = limit + c h^order through the three narrowest columns that are measured.

    The order p solves (f1 - f2)/(f2 - f3) = (h1^p - h2^p)/(h2^p - h3^p) for widths h1 > h2 > h3, whose right side grows with p. None where
    fewer are measured, or where the three are not those of any order from 0.25 to 4 (they do not go one way, or are noise).
    """
    known = sorted(
        ((h, f) for h, f in zip(widths, values, strict=True) if f is not None), key=lambda pair: -pair[0]
    )
    if len(known) < 3:
        return None
    (h1, f1), (h2, f2), (h3, f3) = known[-3:]
    if f2 == f3:
        return None
    wanted = (f1 - f2) / (f2 - f3)

    def excess(p: float) -> float:
        return float((h1**p - h2**p) / (h2**p - h3**p) - wanted)

    low, high = LOWEST, HIGHEST
    if excess(low) > 0.0 or excess(high) < 0.0:
        return None
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    order = 0.5 * (low + high)
    slope = (f2 - f3) / (h2**order - h3**order)
    return float(f3 - slope * h3**order), float(order)


def tends(widths: Sequence[float], values: Sequence[float | None]) -> str:
    """Limit and order for a table, or a dash."""
    found = to_zero(widths, values)
    return "–" if found is None else f"{found[0]:+.4f} ({found[1]:.1f})"
