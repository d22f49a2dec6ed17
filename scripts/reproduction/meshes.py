"""Resolutions of the rows: the same strip with fewer columns and rows."""

from __future__ import annotations

from typing import Any


def _mesh(cell_width: str, plenum: int, frit: int, bed: int, headspace: int) -> dict[str, Any]:
    return {
        "geometry.cell_width": cell_width,
        "geometry.layer.plenum.cells": plenum,
        "geometry.layer.frit.cells": frit,
        "geometry.layer.bed.cells": bed,
        "geometry.layer.headspace.cells": headspace,
    }


MESHES: dict[str, dict[str, Any]] = {
    "coarse": _mesh("2.33 mm", 4, 3, 4, 8),
    "light": _mesh("2 mm", 4, 3, 6, 10),
    "medium": _mesh("1 mm", 6, 4, 12, 14),
    "thesis": _mesh("0.34 mm", 26, 10, 18, 67),
}
"""Overrides by name. `thesis` has the 121 rows and 0.34 mm columns of figure 5.3: 49,731 cells a zone."""
