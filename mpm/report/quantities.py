"""All numbers that a run reports: name, words, unit, meaning, the function that gives it, and the files that hold it, each said once.

history.csv and summary.json are a walk over this table (`mpm.report.contents`); screens, the report page, sweeps, `mpm explain` and
docs/output.md read it. The functions define the numbers in full; here is the sentence that a reader needs beside the value.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache, lru_cache

from mpm.report.balances import balance_errors, element_balances, site_balance, species_balances
from mpm.report.bed_motion import BED_MOTION, bed_motion
from mpm.report.coating import film, titration, utilisation
from mpm.report.dosing import dose_ratios, excess_numbers
from mpm.report.fronts import fronts
from mpm.report.gas import contamination, cvd, cvd_totals, outlet_gas
from mpm.report.heat import energy, flow_and_gas, heating_length, temperatures
from mpm.report.quantity import RATIO, Quantity, Section
from mpm.report.records import run_itself

_AMOUNT = "mol/m"
_HEAT = "J/m"
_PER_SECOND = {_HEAT: "W/m"}
"""Units that have a name of their own per second."""
_DEPTH = "per metre of depth of the reactor (the model is plane)"
_DOSED = "What was dosed, what was used"
_ASTRAY = "Parasitic growth and precursor astray"
COST = "Time and cost"
HEADINGS = (
    "What leaves coated", _DOSED, _ASTRAY, "Film", "Temperature", "Heat", "Motion of the bed", "Gas flow", "Gas in the outlets",
    "Fronts", COST
)  # fmt: skip
"""Of the sections, in the order in which people ask."""
FIRST = ("titration", "utilisation", "dose_ratio", "cvd", "film", "temperature.bed_exit", "heating")
"""Sections, or single numbers, that are offered before all others, or alone, where there is little room."""

SECTIONS = (
    Section("", "", lambda r: {"time": r.time}, (
        Quantity("time", "time", "s", "simulated time since the start"),
    ), summary=False),
    Section("", COST, run_itself, (
        Quantity("cells", "cells", "", "cells of the mesh"),
        Quantity("ranks", "processes", "", "MPI ranks that shared the mesh"),
        Quantity("steps", "steps", "", "time steps; in a steady run Newton steps"),
        Quantity("simulated_seconds", "simulated time", "s", "how much of the reactor's time has been computed"),
        Quantity("wall_seconds", "computing time", "s", "time on the clock, restarts included"),
    ), history=False),
    Section("species", "", lambda r: species_balances(r.case, r.totals), (
        Quantity("species.<species>.fed", "{species} fed", _AMOUNT, f"what the inlets have fed, {_DEPTH}", "umol/m", rate=True),
        Quantity("species.<species>.left", "{species} that left", _AMOUNT,
            f"what left through the outlets, less what they drew back in, {_DEPTH}", "umol/m", rate=True),
        Quantity("species.<species>.reacted", "{species} consumed", _AMOUNT, f"what reactions consumed, {_DEPTH}", "umol/m", rate=True),
        Quantity("species.<species>.stored", "{species} stored in the gas", _AMOUNT,
            f"what the gas holds at the end, less what it held at the start, {_DEPTH}", "umol/m", rate=True),
        Quantity("species.<species>.produced", "{species} produced", _AMOUNT, f"what reactions produced, {_DEPTH}", "umol/m", rate=True),
        Quantity("species.<species>.balance_error", "balance error of {species}", RATIO,
            "fed + produced - left - reacted - stored, over the largest of them", error=True),
    ), history=False),
    Section("sites", "", lambda r: {"balance_error": site_balance(r.case, r.totals)}, (
        Quantity("sites.balance_error", "balance error of the surface sites", RATIO, "residual over the sites that took part", error=True),
    ), history=False),
    Section("elements", "", lambda r: {e: {"balance_error": error} for e, error in element_balances(r.case, r.totals).items()}, (
        Quantity("elements.<element>.balance_error", "balance error of the element {element}", RATIO,
            "residual over the largest of the terms, surface groups on the solids included", error=True),
    ), history=False),
    Section("excess_number", _DOSED, lambda r: excess_numbers(r.case), (
        Quantity("excess_number.<inlet>", "molecules fed per surface site, {inlet}", RATIO,
            "molecules of precursor that {inlet} feeds per reactive site that passes it"),
    ), history=False),
    Section("dose_ratio", _DOSED, lambda r: dose_ratios(r.case), (
        Quantity("dose_ratio.<inlet>", "dose over what saturation needs, {inlet}", RATIO,
            "excess number over the molecules that one site takes up: 1 is just enough if nothing is lost"),
    ), history=False),
    Section("titration", "What leaves coated", lambda r: titration(r.case, r.grid, r.state), (
        Quantity("titration.<inlet>.exit_mean", "coverage where solids leave the zone of {inlet}, mean", RATIO,
            "share of the sites that this inlet's half-reaction has made, in the last column of its zone, mean over the height of the bed"),
        Quantity("titration.<inlet>.exit_min", "coverage where solids leave the zone of {inlet}, worst row", RATIO,
            "the same in the row of the bed that is coated least"),
        Quantity("titration.<inlet>.exit_profile.<row>", "coverage where solids leave the zone of {inlet}, row {row} from below", RATIO,
            "share of the sites that this inlet's half-reaction has made, in one row of the last column of its zone", profile=True),
        Quantity("titration.<inlet>.box_mean", "coverage in the bed before {inlet}, mean", RATIO,
            "share of the sites that this inlet's half-reaction has made, mean over the bed from the entry of its zone to its centreline"),
    )),
    Section("utilisation", _DOSED, lambda r: utilisation(r.case, r.grid, r.totals), (
        Quantity("utilisation.<inlet>", "share of the precursor used, {inlet}", RATIO,
            "precursor that reacted on surfaces in the inlet's own zone, over what {inlet} has fed"),
    )),
    Section("outlets", "Gas in the outlets", lambda r: outlet_gas(r.case, r.totals, r.before), (
        Quantity("outlets.<outlet>.x.<species>", "mole fraction of {species} in {outlet}", RATIO,
            "flux-weighted mole fraction of what has left this outlet since the output before"),
        Quantity("outlets.<outlet>.backflow", "gas drawn back in through {outlet}", RATIO, "volume drawn back in over volume let out"),
    ), since_output=True),
    Section("cvd", _ASTRAY, lambda r: cvd(r.case, r.grid, r.state) | cvd_totals(r.case, r.totals), (
        Quantity("cvd.rate_mean", "parasitic CVD, mean rate", "mol/m^3/s",
            "events of gas reactions now, mean over the volume of the strip"),
        Quantity("cvd.rate_max", "parasitic CVD, largest rate", "mol/m^3/s",
            "events of gas reactions now per total volume, in the worst cell"),
        Quantity("cvd.share_in_zone.<zone>", "share of the CVD in {zone}", RATIO, "of the events of gas reactions now, those in this zone"),
        Quantity("cvd.total", "parasitic CVD, total", _AMOUNT, f"events of gas reactions over the run, {_DEPTH}", "umol/m", rate=True),
        Quantity("cvd.total_in_zone.<zone>", "parasitic CVD in {zone}", _AMOUNT,
            f"events of gas reactions over the run, {_DEPTH}", "umol/m", rate=True),
        Quantity("cvd.used.<species>", "{species} lost to parasitic CVD", _AMOUNT,
            f"what gas reactions took of it over the run, where there are several, {_DEPTH}", "umol/m", rate=True),
    )),
    Section("front", "Fronts", lambda r: fronts(r.case, r.grid, r.state), (
        Quantity("front.<inlet>.<layer>.upstream", "reach of {inlet} against the bed's way, {layer}", "m",
            "distance from the centreline at which the height-averaged concentration falls to half the feed", "mm"),
        Quantity("front.<inlet>.<layer>.downstream", "reach of {inlet} with the bed, {layer}", "m",
            "distance from the centreline at which the height-averaged concentration falls to half the feed", "mm"),
        Quantity("front.<inlet>.<layer>.upstream_width", "width of the {inlet} front, {layer}", "m",
            "distance between 90 and 10 per cent of the largest concentration, upstream of it", "mm"),
        Quantity("front.<inlet>.<layer>.coverage", "distance of the coverage front before {inlet}, {layer}", "m",
            "distance upstream of the centreline at which the height-averaged coverage passes one half; negative: downstream", "mm"),
        Quantity("front.<inlet>.height", "height of the {inlet} front", "m",
            "y in the column of the inlet's centreline at which the precursor has fallen to half its feed (y = 0: top of the bed)", "mm"),
    )),
    Section("contamination", _ASTRAY, lambda r: contamination(r.case, r.grid, r.totals, r.state), (
        Quantity("contamination.<zone>.<species>", "share of the {species} that came over into {zone}", RATIO,
            "what has come over from other zones, over all of this species that has been fed"),
    )),
    Section("film", "Film", lambda r: film(r.case, r.grid, r.totals, r.before), (
        Quantity("film.<film>.amount", "{film} grown, total", _AMOUNT, f"on all surfaces since the start, {_DEPTH}", "umol/m", rate=True),
        Quantity("film.<film>.per_area", "{film} grown per surface", "mol/m^2",
            "on the particles of the moving layer, per particle surface that has been conveyed meanwhile", "umol/m^2"),
        Quantity("film.<film>.thickness", "thickness of the {film} film", "m", "growth per surface times molar mass over density", "nm"),
    ), since_output=True),
    Section("temperature", "Temperature", lambda r: temperatures(r.case, r.grid, r.state.temperature), (
        Quantity("temperature.bed_exit", "temperature of the powder that leaves", "K",
            "mean over the height of the moving layer, in the column at the end of the strip where solids leave it"),
        Quantity("temperature.<layer>.mean", "temperature of {layer}, mean", "K", "of gas and solids now, mean over its volume"),
        Quantity("temperature.<layer>.min", "temperature of {layer}, lowest", "K", "of gas and solids now, in the coldest cell"),
        Quantity("temperature.<layer>.max", "temperature of {layer}, highest", "K", "of gas and solids now, in the hottest cell"),
    )),
    Section("heating", "Temperature", lambda r: heating_length(r.case, r.grid, r.state.temperature), (
        Quantity("heating.length", "way of the powder until it is warm", "m",
            "distance from the end where solids enter to where the bed, mean over its height, has made 95 % of its way from the "
            "temperature at which it enters to that at which it leaves", "mm"),
    )),
    Section("energy", "Heat", lambda r: energy(r.case, r.totals.heat), (
        Quantity("energy.inlets", "heat from inlets", _HEAT,
            f"what the gas that is fed carries more than at gas.temperature; below 0: less, {_DEPTH}", rate=True),
        Quantity("energy.outlets", "heat from outlets", _HEAT,
            f"what the gas that they draw back in carries more than at gas.temperature, less what leaves; below 0: lost, {_DEPTH}",
            rate=True),
        Quantity("energy.walls", "heat from walls", _HEAT, f"by conduction through all walls; below 0: lost, {_DEPTH}", rate=True),
        Quantity("energy.solids", "heat from solids", _HEAT,
            f"what those that enter carry more than at gas.temperature, less what leaves with others; below 0: lost, {_DEPTH}",
            rate=True),
        Quantity("energy.reaction", "heat of reaction", _HEAT, f"what reactions gave off, {_DEPTH}", rate=True),
        Quantity("energy.heating", "electrical heat", _HEAT, f"what geometry.layer.<name>.heating gave, {_DEPTH}", rate=True),
        Quantity("energy.stored", "heat stored in gas and solids", _HEAT,
            f"what the strip holds at the end, less what it held at the start, {_DEPTH}", rate=True),
        Quantity("energy.balance_error", "balance error of heat", RATIO,
            "inlets + outlets + walls + solids + reaction + heating - stored, over the largest of them", error=True),
    )),
    Section("motion", "Motion of the bed", lambda r: bed_motion(r.case), BED_MOTION, history=False),
    Section("balance", "", lambda r: balance_errors(r.case, r.totals), (
        Quantity("balance.<species>", "balance error of {species}", RATIO,
            "residual over the largest of the terms; `sites`: of the surface sites; with `[energy]` also `energy` and `gas`", error=True),
    ), summary=False),
    Section("flow", "Gas flow", flow_and_gas, (  # mpm.flow.numbers
        Quantity("flow.inflow", "gas fed by all inlets", "m^2/s", f"volume flow {_DEPTH}", "cm^2/s"),
        Quantity("flow.outflow", "gas let out by all outlets", "m^2/s", f"volume flow {_DEPTH}", "cm^2/s"),
        Quantity("flow.outlets.<outlet>", "gas let out by {outlet}", "m^2/s",
            f"volume flow {_DEPTH}, less what the outlet draws back in", "cm^2/s"),
        Quantity("flow.mass_error", "mismatch of inflow and outflow", RATIO,
            "difference of the two over the inflow; with `[energy]` in a steady state only, since gas that warms leaves", error=True),
        Quantity("flow.gas_balance_error", "balance error of the gas", RATIO,
            "gas fed - left - stored, over what the strip holds or has let out, whichever is most; of cases with `[energy]`", error=True),
        Quantity("flow.bed_superficial_velocity.0", "superficial gas velocity in the bed, along", "m/s",
            "mean over the moving layer and the cycle, relative to the reactor", "cm/s"),
        Quantity("flow.bed_superficial_velocity.1", "superficial gas velocity in the bed, upwards", "m/s",
            "mean over the moving layer and the cycle, relative to the reactor", "cm/s"),
        Quantity("flow.bed_pressure_drop", "pressure drop of the bed", "Pa",
            "between the lower and the upper face of the moving layer", again=True),
        Quantity("flow.frit_pressure_drop", "pressure drop of the frit", "Pa",
            "between the faces of the first porous layer at rest", again=True),
        Quantity("flow.pressure_drop.<layer>", "pressure drop of {layer}", "Pa", "between the lower and the upper face of the layer"),
    ), history=False),
)  # fmt: skip
"""In the order of the files."""
QUANTITIES = tuple(number for section in SECTIONS for number in section.numbers)


def first(name: str) -> int | None:
    """The place of a dotted name in `FIRST`; None for what is not among them."""
    return next((i for i, begin in enumerate(FIRST) if f"{name}.".startswith(f"{begin}.")), None)


def headed(names: Iterable[str]) -> list[tuple[str, list[str]]]:
    """Dotted names of a summary under the headings of their sections, in the order of `HEADINGS`; headings that have none are left out.

    Without profiles and balance errors, and without what another of the names says again.
    """
    found: dict[str, list[str]] = {heading: [] for heading in HEADINGS}
    names = list(names)
    by_layer = any(name.startswith("flow.pressure_drop.") for name in names)
    for name in names:
        number, section = quantity(name), _section_of(name)
        told = number.profile or number.error or (number.again and by_layer)
        if section is not None and section.heading and not told:
            found[section.heading].append(name)
    return [(heading, inside) for heading, inside in found.items() if inside]


def _section_of(name: str) -> Section | None:
    found = entry(name)
    return next((section for section in SECTIONS if found in section.numbers), None)


def files_of(name: str) -> list[str]:
    """The files of a run that hold the number of this dotted name."""
    section = _section_of(name)
    if section is None:
        return []
    held = {"history.csv": section.history and not quantity(name).profile, "summary.json": section.summary}
    return [file for file, holds in held.items() if holds]


def worst_balance_error(numbers: Mapping[str, float]) -> str | None:
    """Name of the largest relative error of a balance among the numbers of a summary."""
    errors = [name for name in numbers if quantity(name).error]
    return max(errors, key=lambda name: abs(numbers[name]), default=None)


@cache
def _patterns() -> tuple[tuple[re.Pattern[str], Quantity], ...]:
    def pattern(name: str) -> re.Pattern[str]:
        parts = (f"(?P<{p[1:-1]}>[^.]+)" if p.startswith("<") else re.escape(p) for p in name.split("."))
        return re.compile(r"\.".join(parts))

    return tuple((pattern(quantity.name), quantity) for quantity in QUANTITIES)


@lru_cache(maxsize=4096)
def _match(name: str) -> tuple[Quantity, Mapping[str, str]] | None:
    """The entry for a dotted name, and what the case has put for its <part>s."""
    for pattern, found in _patterns():
        if match := pattern.fullmatch(name):
            return found, match.groupdict()
    return None


@lru_cache(maxsize=4096)
def quantity(name: str, steady: bool = False) -> Quantity:
    """The entry for a dotted name, with the case's names put in; `steady`: amounts are per second.

    A name that is not in the table is a pure number whose label is the name itself.
    """
    match = _match(name)
    if match is None:
        return Quantity(name, name, RATIO, "")
    found, parts = match
    rate = steady and found.rate
    return replace(
        found,
        name=name,
        label=found.label.format(**parts),
        unit=_per_second(found.unit) if rate else found.unit,
        meaning=found.meaning.format(**parts),
        shown=_per_second(found.shown) if rate and found.shown else found.shown,
    )


def _per_second(unit: str) -> str:
    return _PER_SECOND.get(unit, f"{unit}/s")


def entry(name: str) -> Quantity | None:
    """The entry for a dotted name as it stands in the table, or None."""
    found = _match(name)
    return None if found is None else found[0]


def known(name: str) -> bool:
    """Whether the table has an entry for this dotted name."""
    return _match(name) is not None


def unit_of(name: str, steady: bool = False) -> str:
    """SI unit of a reported number; RATIO for pure numbers and counts."""
    return quantity(name, steady).unit or RATIO
