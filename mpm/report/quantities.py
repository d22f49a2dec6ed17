"""What each reported number is called in words, its unit, and what it means: one table for screens, the report page and sweeps.

Names are those of summary.json and history.csv (`titration.tma.exit_mean`). The functions that compute the numbers define them in full;
here is the sentence that a reader needs beside the value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

from mpm import units

RATIO = "1"
"""Unit of a pure number."""


@dataclass(frozen=True)
class Quantity:
    """One kind of number. `name` is a dotted name in which <part> stands for a name of the case; `label` and `meaning` may use the {part}s.

    `unit` is SI (RATIO: a pure number, "": a count); `shown` the unit people read it in. `rate`: in a steady state per second.
    """

    name: str
    label: str
    unit: str
    meaning: str
    shown: str = ""
    rate: bool = False

    @property
    def factor(self) -> float:
        """What one unit of `shown` is in `unit`."""
        return units.parse(f"1 {self.shown}", self.unit) if self.shown else 1.0

    @property
    def unit_shown(self) -> str:
        """The unit to print beside `value / factor`; empty for pure numbers and counts."""
        return "" if self.unit == RATIO else self.shown or self.unit

    def of(self, value: float) -> float:
        """`value` [unit] as a number in the unit that is printed."""
        return value / self.factor


_AMOUNT = "mol/m"
_DEPTH = "per metre of depth of the reactor (the model is plane)"

QUANTITIES = (
    Quantity("time", "time", "s", "simulated time since the start"),
    Quantity("simulated_seconds", "simulated time", "s", "how much of the reactor's time has been computed"),
    Quantity("wall_seconds", "computing time", "s", "time on the clock, restarts included"),
    Quantity("cells", "cells", "", "cells of the mesh"),
    Quantity("steps", "steps", "", "time steps; in a steady run Newton steps"),
    Quantity("ranks", "processes", "", "MPI ranks that shared the mesh"),
    # what was dosed
    Quantity("excess_number.<inlet>", "molecules fed per surface site, {inlet}", RATIO,
        "molecules of precursor that {inlet} feeds per reactive site that passes it"),
    Quantity("dose_ratio.<inlet>", "dose over what saturation needs, {inlet}", RATIO,
        "excess number over the molecules that one site takes up: 1 is just enough if nothing is lost"),
    Quantity("utilisation.<inlet>", "share of the precursor used, {inlet}", RATIO,
        "precursor that reacted on surfaces in the inlet's own zone, over what {inlet} has fed"),
    # what came out coated
    Quantity("titration.<inlet>.exit_mean", "coverage where solids leave the zone of {inlet}, mean", RATIO,
        "share of the sites that this inlet's half-reaction has made, in the last column of its zone, mean over the height of the bed"),
    Quantity("titration.<inlet>.exit_min", "coverage where solids leave the zone of {inlet}, worst row", RATIO,
        "the same in the row of the bed that is coated least"),
    Quantity("titration.<inlet>.exit_std", "coverage where solids leave the zone of {inlet}, spread", RATIO,
        "standard deviation of the same over the height of the bed"),
    Quantity("titration.<inlet>.exit_profile.<row>", "coverage where solids leave the zone of {inlet}, row {row} from below", RATIO,
        "share of the sites that this inlet's half-reaction has made, in one row of the last column of its zone"),
    Quantity("titration.<inlet>.box_mean", "coverage in the bed before {inlet}, mean", RATIO,
        "share of the sites that this inlet's half-reaction has made, mean over the bed from the zone's entry to the inlet's centreline"),
    # the gas
    Quantity("flow.inflow", "gas fed by all inlets", "m^2/s", f"volume flow {_DEPTH}", "cm^2/s"),
    Quantity("flow.outflow", "gas let out by all outlets", "m^2/s", f"volume flow {_DEPTH}", "cm^2/s"),
    Quantity("flow.outlets.<outlet>", "gas let out by {outlet}", "m^2/s",
        f"volume flow {_DEPTH}, less what the outlet draws back in", "cm^2/s"),
    Quantity("flow.mass_error", "mismatch of inflow and outflow", RATIO, "difference of the two over the inflow"),
    Quantity("flow.bed_superficial_velocity.0", "superficial gas velocity in the bed, along", "m/s",
        "mean over the moving layer and the cycle, relative to the reactor", "cm/s"),
    Quantity("flow.bed_superficial_velocity.1", "superficial gas velocity in the bed, upwards", "m/s",
        "mean over the moving layer and the cycle, relative to the reactor", "cm/s"),
    Quantity("flow.bed_pressure_drop", "pressure drop of the bed", "Pa", "between the lower and the upper face of the moving layer"),
    Quantity("flow.frit_pressure_drop", "pressure drop of the frit", "Pa", "between the faces of the first porous layer at rest"),
    Quantity("flow.pressure_drop.<layer>", "pressure drop of {layer}", "Pa", "between the lower and the upper face of the layer"),
    Quantity("outlets.<outlet>.x.<species>", "mole fraction of {species} in {outlet}", RATIO,
        "flux-weighted mole fraction of what has left this outlet since the output before"),
    Quantity("outlets.<outlet>.backflow", "gas drawn back in through {outlet}", RATIO, "volume drawn back in over volume let out"),
    # balances of species
    Quantity("species.<species>.fed", "{species} fed", _AMOUNT, f"what the inlets have fed, {_DEPTH}", "umol/m", rate=True),
    Quantity("species.<species>.left", "{species} that left", _AMOUNT,
        f"what left through the outlets, less what they drew back in, {_DEPTH}", "umol/m", rate=True),
    Quantity("species.<species>.reacted", "{species} consumed", _AMOUNT, f"what reactions consumed, {_DEPTH}", "umol/m", rate=True),
    Quantity("species.<species>.produced", "{species} produced", _AMOUNT, f"what reactions produced, {_DEPTH}", "umol/m", rate=True),
    Quantity("species.<species>.stored", "{species} stored in the gas", _AMOUNT,
        f"what the gas holds at the end, less what it held at the start, {_DEPTH}", "umol/m", rate=True),
    Quantity("species.<species>.balance_error", "balance error of {species}", RATIO,
        "fed + produced - left - reacted - stored, over the largest of them"),
    Quantity("balance.<species>", "balance error of {species}", RATIO,
        "residual over the largest of the terms; `sites`: of the surface sites"),
    Quantity("sites.balance_error", "balance error of the surface sites", RATIO, "residual over the sites that took part"),
    Quantity("elements.<element>.balance_error", "balance error of the element {element}", RATIO,
        "residual over the largest of the terms, surface groups on the solids included"),
    # where it went wrong
    Quantity("cvd.rate_mean", "parasitic CVD, mean rate", "mol/m^3/s", "events of gas reactions now, mean over the volume of the strip"),
    Quantity("cvd.rate_max", "parasitic CVD, largest rate", "mol/m^3/s", "events of gas reactions now per total volume, in the worst cell"),
    Quantity("cvd.share_in_zone.<zone>", "share of the CVD in {zone}", RATIO, "of the events of gas reactions now, those in this zone"),
    Quantity("cvd.total", "parasitic CVD, total", _AMOUNT, f"events of gas reactions over the run, {_DEPTH}", "umol/m", rate=True),
    Quantity("cvd.total_in_zone.<zone>", "parasitic CVD in {zone}", _AMOUNT,
        f"events of gas reactions over the run, {_DEPTH}", "umol/m", rate=True),
    Quantity("contamination.<zone>.<species>", "share of the {species} that came over into {zone}", RATIO,
        "what has come over from other zones, over all of this species that has been fed"),
    Quantity("front.<inlet>.height", "height of the {inlet} front", "m",
        "y in the column of the inlet's centreline at which the precursor has fallen to half its feed (y = 0: top of the bed)", "mm"),
    Quantity("front.<inlet>.<layer>.upstream", "reach of {inlet} against the bed's way, {layer}", "m",
        "distance from the centreline at which the height-averaged concentration falls to half the feed", "mm"),
    Quantity("front.<inlet>.<layer>.downstream", "reach of {inlet} with the bed, {layer}", "m",
        "distance from the centreline at which the height-averaged concentration falls to half the feed", "mm"),
    Quantity("front.<inlet>.<layer>.upstream_width", "width of the {inlet} front, {layer}", "m",
        "distance between 90 and 10 per cent of the largest concentration, upstream of it", "mm"),
    Quantity("front.<inlet>.<layer>.coverage", "distance of the coverage front before {inlet}, {layer}", "m",
        "distance upstream of the centreline at which the height-averaged coverage passes one half; negative: downstream", "mm"),
    # what grew
    Quantity("film.<film>.amount", "{film} grown, total", _AMOUNT, f"on all surfaces since the start, {_DEPTH}", "umol/m", rate=True),
    Quantity("film.<film>.per_area", "{film} grown per surface", "mol/m^2",
        "on the particles of the moving layer, per particle surface that has been conveyed meanwhile", "umol/m^2"),
    Quantity("film.<film>.thickness", "thickness of the {film} film", "m", "growth per surface times molar mass over density", "nm"),
)  # fmt: skip


@cache
def _patterns() -> tuple[tuple[re.Pattern[str], Quantity], ...]:
    def pattern(name: str) -> re.Pattern[str]:
        parts = (f"(?P<{p[1:-1]}>[^.]+)" if p.startswith("<") else re.escape(p) for p in name.split("."))
        return re.compile(r"\.".join(parts))

    return tuple((pattern(quantity.name), quantity) for quantity in QUANTITIES)


def quantity(name: str, steady: bool = False) -> Quantity:
    """The entry for a dotted name, with the case's names put in; `steady`: amounts are per second.

    A name that is not in the table is a pure number whose label is the name itself.
    """
    for pattern, found in _patterns():
        match = pattern.fullmatch(name)
        if match:
            per = "/s" if steady and found.rate else ""
            return replace(
                found,
                name=name,
                label=found.label.format(**match.groupdict()),
                unit=found.unit + per,
                meaning=found.meaning.format(**match.groupdict()),
                shown=found.shown + per if found.shown else "",
            )
    return Quantity(name, name, RATIO, "")


def known(name: str) -> bool:
    """Whether the table has an entry for this dotted name."""
    return any(pattern.fullmatch(name) for pattern, _ in _patterns())


def unit_of(name: str, steady: bool = False) -> str:
    """SI unit of a reported number; RATIO for pure numbers and counts."""
    return quantity(name, steady).unit or RATIO


def flatten(tree: Mapping[str, object], prefix: str = "") -> dict[str, float]:
    """The numbers of a summary by dotted name; entries of lists by their index (`...exit_profile.0`)."""
    numbers: dict[str, float] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            numbers |= flatten(value, f"{name}.")
        elif isinstance(value, list):
            numbers |= flatten({str(index): item for index, item in enumerate(value)}, f"{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            numbers[name] = value
    return numbers
