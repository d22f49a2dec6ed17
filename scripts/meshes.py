"""Meshes of the measurements: the same strips with fewer columns and rows. Overrides of a case by dotted key."""

from __future__ import annotations

from typing import Any


def rows(plenum: int, frit: int, bed: int, headspace: int) -> dict[str, Any]:
    """Rows of the four layers."""
    layers = {"plenum": plenum, "frit": frit, "bed": bed, "headspace": headspace}
    return {f"geometry.layer.{name}.cells": cells for name, cells in layers.items()}


COARSE = {"geometry.cell_width": "2.33 mm", **rows(4, 3, 4, 8)}
FINE_ROWS = rows(20, 12, 20, 69)
"""With the cases' columns of 0.34 mm 49,731 cells a zone; those of `cases/single_cycle.toml`."""
MESHES: dict[str, dict[str, Any]] = {
    "coarse": COARSE,
    "light": {"geometry.cell_width": "2 mm", **rows(4, 3, 6, 10)},
    "medium": {"geometry.cell_width": "1 mm", **rows(6, 4, 12, 14)},
    "thesis": {"geometry.cell_width": "0.34 mm", **rows(26, 10, 18, 67)},
}
"""By name for `scripts/reproduce.py`. `thesis` has the 121 rows and 0.34 mm columns of figure 5.3: 49,731 cells a zone."""
