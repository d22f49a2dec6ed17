"""What a column of the document changes in every case of every row: conventions, one switch alone, or the geometry as printed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mpm.case.conventions import CLOSED_CODE

BOTTOM_PORTS = {"zone": ("purge", "tma"), "cycle": ("purge1", "tma", "purge2", "water")}
"""The inlets of the two base cases."""
REFERENCE = {"headspace": "12.7 mm", "pressure": "101325 Pa", "width": "4.0 mm"}
"""The geometry of cases/thesis, none of which the thesis prints for its domain."""


@dataclass(frozen=True)
class Setting:
    """Changes by dotted key under those of a row, and the geometry. `name` is where findings are kept.

    `geometry` holds some of `headspace`, `pressure` and `width`: with a width the rows of the cycle are measured at this one alone.
    """

    name: str
    keys: Mapping[str, Any] = field(default_factory=dict)
    geometry: Mapping[str, str] = field(default_factory=dict)

    def changes(self, base: str) -> dict[str, Any]:
        """Overrides of a case of `base` (zone or cycle) by dotted key."""
        found = dict(self.keys)
        if "headspace" in self.geometry:
            found["geometry.layer.headspace.height"] = self.geometry["headspace"]
        if "pressure" in self.geometry:
            found["gas.pressure"] = self.geometry["pressure"]
        if "width" in self.geometry:
            found |= {f"geometry.inlet.{port}.width": self.geometry["width"] for port in BOTTOM_PORTS[base]}
        return found


MPM = Setting("mpm")
"""The model's own conventions: no key is typed, so runs are those of the cases as they stand."""
CONVENTIONS = {"mpm": MPM, "closed-code": Setting("closed-code", {"conventions": "closed-code"})}


def alone() -> dict[str, Setting]:
    """Each switch of the closed code's preset alone, by its dotted key."""
    return {key: Setting(f"alone/{key}", {key: value}) for key, value in CLOSED_CODE.items()}


def without(own: Mapping[str, Any]) -> dict[str, Setting]:
    """The closed code's preset without one of its switches, by its dotted key; `own` has the model's value of each."""
    return {
        key: Setting(f"without/{key}", {"conventions": "closed-code", key: own[key]}) for key in CLOSED_CODE
    }
