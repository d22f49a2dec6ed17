"""What each field of a run is called in words, the unit to show it in, and the colours that suit it: one table for pictures and report.

Names are those in `fields.pvd`, and `velocity_x`, `velocity_y` for the components of `velocity`, whose own picture is of the speed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mpm import units
from mpm.arrays import Floats
from mpm.errors import InputError
from mpm.report.quantity import RATIO

DECADES = 4
"""Range of a logarithmic scale below its maximum."""
ROUNDING = 1e-6
"""Relative difference of two values that counts as none: files hold single precision."""
NOTHING = 1e-15
"""Mole fraction up to which a species counts as absent: rounding of 0."""


@dataclass(frozen=True)
class FieldName:
    """One field. `words` may hold {}, for which the subject (a species, a site) stands.

    `unit` is SI (RATIO: a pure number, "": a number of something), `shown` what people read. `colours` is a colour map of matplotlib;
    `limits` are fixed ends of the scale [unit]; a `signed` field has 0 in the middle of its scale; a `porous` one exists on surfaces alone.
    What is nowhere above `nothing` [unit] is rounding of 0.
    """

    name: str
    words: str
    unit: str = RATIO
    shown: str = ""
    subject: str = ""
    scale: Literal["linear", "log"] = "linear"
    colours: str = "viridis"
    limits: tuple[float, float] | None = None
    signed: bool = False
    porous: bool = False
    nothing: float = 0.0

    @property
    def label(self) -> str:
        """In words, without the unit."""
        return self.words.format(self.subject)

    @cached_property
    def factor(self) -> float:
        """What one `unit_shown` is in `unit`."""
        return units.parse(f"1 {self.shown}", self.unit) if self.shown else 1.0

    @property
    def unit_shown(self) -> str:
        """The unit of `value / factor`, as people write it; empty for pure numbers."""
        return "" if self.unit == RATIO else superscript(self.shown or self.unit)


FIELDS = (
    FieldName("theta_<site>", "coverage of {}", colours="cividis", limits=(0.0, 1.0), porous=True),
    FieldName("x_<species>", "mole fraction of {}", scale="log", nothing=NOTHING),
    FieldName("C_<species>", "concentration of {}", "mol/m^3", scale="log", nothing=1e-14),
    FieldName("cvd_rate", "rate of parasitic CVD", "mol/m^3/s", scale="log", nothing=1e-14),
    FieldName("velocity", "speed of the gas (superficial, relative to the reactor)", "m/s", "cm/s"),
    FieldName("velocity_lab", "speed of the gas in the laboratory (superficial)", "m/s", "cm/s"),
    FieldName("bed_velocity", "speed of the bed relative to the reactor", "m/s", "cm/s"),
    FieldName("velocity_x", "gas velocity along x (superficial)", "m/s", "cm/s", colours="PuOr_r", signed=True),
    FieldName("velocity_y", "gas velocity upwards (superficial)", "m/s", "cm/s", colours="PuOr_r", signed=True),
    FieldName("pressure", "pressure of the gas above the outlets", "Pa"),
    FieldName("temperature", "temperature of gas and solids", "K", colours="inferno"),
    FieldName("density", "density of the gas", "kg/m^3"),
    FieldName("zone", "number of the zone (0: none)", ""),
    FieldName("layer", "number of the layer from the bottom", ""),
)  # fmt: skip


def field_name(name: str) -> FieldName:
    """The entry for a field; one that is not in the table is a pure number called by its name."""
    for entry in FIELDS:
        prefix, _, kind = entry.name.partition("<")
        if name == entry.name or (kind and name.startswith(prefix) and len(name) > len(prefix)):
            return replace(entry, name=name, subject=name.removeprefix(prefix))
    return FieldName(name, "{}", subject=name)


def drawable(cell_data: Mapping[str, Any]) -> list[str]:
    """Names of the fields that can be drawn, of those in a file; components of the velocity last."""
    return [*cell_data, *(f"velocity_{axis}" for axis in "xy" if "velocity" in cell_data)]


def field_values(cell_data: Mapping[str, NDArray[Any]], name: str, source: object = None) -> Floats:
    """The numbers to draw of a field, (cells,) in SI units: of a vector the length.

    Raises InputError, with the nearest name, for a field that `cell_data` does not hold; `source` is the file to blame.
    """
    known = drawable(cell_data)
    if name not in known:
        raise InputError.at(
            str(source) if source else None, "field", repr(name), ", ".join(known), known=known, given=name
        )
    if name in cell_data:
        values = cell_data[name].astype(float)
        return values if values.ndim == 1 else np.hypot(values[:, 0], values[:, 1])
    return cell_data["velocity"][:, "xy".index(name[-1])].astype(float)


@dataclass(frozen=True)
class Limits:
    """Ends of a colour scale [SI], and whether it is logarithmic. `constant`: the field has one value everywhere, which needs no scale."""

    low: float
    high: float
    log: bool = False
    constant: bool = False


def colour_limits(field: FieldName, low: float, high: float) -> Limits:
    """The scale for values between `low` and `high` (the least and the largest of all that share it).

    A logarithmic one ends `DECADES` below the largest value. It becomes linear where the values lie within half a decade, like those of a
    carrier, whose small differences it would hide. A linear one that nearly begins at 0 begins there.
    """
    if max(abs(low), abs(high)) <= field.nothing:
        return Limits(0.0, 0.0, constant=True)
    span = field.limits[1] - field.limits[0] if field.limits else max(abs(low), abs(high))
    if high - low <= ROUNDING * span:
        return Limits(low, high, constant=True)
    if field.limits is not None:
        return Limits(*field.limits)
    if field.signed:
        end = max(abs(low), abs(high))
        return Limits(-end, end)
    if field.scale == "log" and high > 0.0 and low < high / np.sqrt(10.0):
        return Limits(max(low, high * 10.0**-DECADES), high, log=True)
    return Limits(0.0 if 0.0 < low < 0.1 * high else low, high)


def superscript(unit: str) -> str:
    """mol/m^3/s -> mol/m\u00b3/s."""
    return re.sub(r"\^(-?\d+)", lambda power: power[1].translate(_RAISED), unit)


_RAISED = str.maketrans("-0123456789", "\u207b\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079")
