"""`mpm mechanism`: a mechanism for people, be it that of a case, a built-in one, a mechanism file or a phase of a Cantera file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mpm.case.cantera_file import cantera_site_density, is_cantera
from mpm.case.case import Case, build_case, load_case
from mpm.case.kinds import MECHANISM, kind_of_tables
from mpm.case.names import case_file
from mpm.case.sources import built_in_files, read_toml, write_toml
from mpm.errors import InputError
from mpm.files import is_file, write_atomically
from mpm.screen import Listing, Sheet, figure, number, together
from mpm.units import parse

BARE = {
    "length": "10 mm",
    "cell_width": "2 mm",
    "layer": [{"name": "powder", "height": "1 mm", "cells": 1, "material": "glass_beads"}],
}
"""Geometry of the case that a mechanism alone stands in: solids on which its places are counted."""
OWN = ("species", "site", "film", "reaction", "reference_pressure", "gas_reactions")
"""Keys of a mechanism, which may be typed here without the table [chemistry] in front."""


def case_with(source: str, settings: Mapping[str, Any], phase: str | None, temperature: str | None) -> Case:
    """The case that is meant, or one around a mechanism alone, whose solids are the built-in glass beads. Raises InputError.

    They have as many places as a file of Cantera gives its phase.
    """
    overrides = dict(settings)
    if phase is not None:
        overrides["chemistry.phase"] = phase
    if temperature is not None:
        overrides["gas.temperature"] = _checked_temperature(temperature)
    if not _is_mechanism(source):
        if source not in built_in_files("cases") and not Path(source).exists():
            known = [*built_in_files("mechanisms"), *built_in_files("cases")]
            accepted = f"a case, a mechanism ({', '.join(built_in_files('mechanisms'))}), or the path of a file of either"
            raise InputError.at(source, "", "no such file", accepted, given=source, known=known)
        return load_case(source, overrides)
    overrides = {
        f"chemistry.{key}" if key.split(".")[0] in OWN else key: value for key, value in overrides.items()
    }
    still = {"gamma": 0.0, "bed_velocity": "0 m/s"}
    chemistry = {"mechanism": source, **({} if phase is None else {"phase": phase})}
    data: dict[str, Any] = {"geometry": BARE, "motion": still, "chemistry": chemistry}
    if is_cantera(source):
        data["energy"] = {}  # whose heats are read then: such a file has those of all
    case = build_case(data, overrides, Path.cwd(), source)
    density = cantera_site_density(chemistry, Path.cwd())
    if density is None or "site_density" in case.typed("material.glass_beads"):
        return case
    return case.with_({"material.glass_beads.site_density": f"{density!r} mol/m^2"})


def _checked_temperature(text: str) -> str:
    """The option --temperature, if it is one."""
    try:
        if not 0.0 < parse(text, "K") < math.inf:
            raise ValueError("not above 0 K")
    except ValueError as error:
        found = f"{text!r} ({error})"
        raise InputError.at(
            "mpm mechanism", "--temperature", found, 'a temperature above 0 K with its unit, e.g. "473 K"'
        ) from None
    return text


def _is_mechanism(source: str) -> bool:
    path = Path(source)
    if is_cantera(source):
        return True  # a path, or a file that Cantera has
    if not is_file(path):
        return source in built_in_files("mechanisms")
    return path.suffix == ".toml" and kind_of_tables(read_toml(case_file(source))) is MECHANISM


def write_mechanism(case: Case, path: Path) -> None:
    """Write the reactions of a case as a mechanism file, complete in itself. Raises InputError where there is a file already."""
    if path.exists():
        raise InputError.at(
            path, "", "a file that is there already", "a new one: mpm mechanism writes over nothing"
        )
    tables = case.chemistry.model_dump(mode="json", by_alias=True, exclude_none=True)
    kept = {key: value for key, value in tables.items() if key not in ("mechanism", "phase", "gas_reactions")}
    try:
        write_atomically(path, write_toml(kept))
    except OSError as error:
        raise InputError.at(
            path, "", f"a file that cannot be written ({error.strerror})", "another one"
        ) from None


def mechanism_sheet(report: Mapping[str, Any]) -> Sheet:
    """The numbers of `mpm.report.chemistry.mechanism_report` in groups."""
    sheet = Sheet(room=30)
    sheet.group(f"{report['mechanism']} at {figure(report['temperature'], 'K', 6)}")
    if "site_density" in report:
        sheet.add(
            "places on the surface", f"{number(report['site_density'], 'mol/m^2')} on {report['layer']}"
        )
    _parts(sheet, "Gas species", report["species"])
    _parts(sheet, "Surface sites", report["sites"])
    _parts(sheet, "Films", report["films"])
    for key, reaction in report["reactions"].items():
        _reaction(sheet, key, reaction)
    _checked(sheet, report["reactions"])
    for inlet, numbers in report.get("precursors", {}).items():
        _precursor(sheet, inlet, numbers)
    return sheet


def _parts(sheet: Sheet, heading: str, parts: Mapping[str, Any]) -> None:
    if not parts:
        return
    sheet.group(heading)
    listing = Listing("name", "molar mass [g/mol]", "places", "elements")
    for name, part in parts.items():
        mass = part.get("molar_mass")
        atoms = " ".join(f"{e}{count:g}" if count != 1.0 else e for e, count in part["elements"].items())
        listing.add_row(
            name,
            None if mass is None else f"{mass * 1e3:.6g}",
            f"{part['places']:g}" if part.get("places", 1.0) != 1.0 else None,
            atoms or "none",
        )
    sheet.list(listing)


def _reaction(sheet: Sheet, key: str, reaction: Mapping[str, Any]) -> None:
    sheet.group(f"Reaction {key} ({'in the gas' if reaction['kind'] == 'gas' else 'on the surface'})")
    sheet.add("equation", reaction["equation"])
    back = reaction.get("backward")
    for way, law in (("there", reaction["forward"]), ("back", back)):
        if law is None:
            continue
        label = "rate constant" if back is None else f"rate constant {way}"
        sheet.add(label, _constant(law))
        if "per_site" in law:
            sheet.add("per site", number(law["per_site"], law["per_site_unit"]), part=True)
        sheet.add("order", together(_orders(law["orders"])), part=True)
        for name, bend in law.get("coverage", {}).items():
            sheet.add(f"with the coverage of {name}", _bend(bend), part=True)
    if "equilibrium_constant" in reaction:
        value = number(reaction["equilibrium_constant"], reaction["equilibrium_constant_unit"])
        sheet.add(
            "equilibrium constant",
            f"{value}, from {reaction['equilibrium_from']}".replace("from given", "given"),
        )
    if "sticking_coefficient" in reaction:
        sheet.add("sticking coefficient", number(reaction["sticking_coefficient"]))
    sheet.add(
        "heat of reaction", number(reaction["heat"] / 1e3, "kJ/mol") if "heat" in reaction else "not known"
    )


def _constant(law: Mapping[str, Any]) -> str:
    kind = "in_gas" if "in_gas" in law else "per_area"
    if kind not in law:
        return "beyond floats"
    return number(law[kind], law[f"{kind}_unit"])


def _orders(orders: Mapping[str, float]) -> str:
    """`1 in TMA and OH, 0.5 in *`."""
    by_order: dict[float, list[str]] = {}
    for name, order in orders.items():
        by_order.setdefault(order, []).append(name)
    return ", ".join(f"{order:g} in {' and '.join(names)}" for order, names in by_order.items()) or "0"


def _bend(bend: Mapping[str, float]) -> str:
    """The factor 10^(a theta) theta^m exp(-E theta/(R T)) without what is 1."""
    factors = [f"10^({bend['a']:g} theta)"] if bend["a"] else []
    factors += [f"theta^{bend['m']:g}"] if bend["m"] else []
    sign = "-" if bend["E"] > 0.0 else ""
    factors += [f"exp({sign}{number(abs(bend['E']) / 1e3, 'kJ/mol')} theta/(R T))"] if bend["E"] else []
    return "times " + " ".join(factors) if factors else "unchanged"


def _checked(sheet: Sheet, reactions: Mapping[str, Any]) -> None:
    """Whether elements and places balance."""
    sheet.group("Checked")
    wrong = {key: r["missing"] for key, r in reactions.items() if r["missing"]}
    if not wrong:
        sheet.add(
            "elements and places",
            "balance in every reaction" if reactions else "no reactions",
        )
    for key, missing in wrong.items():
        found = ", ".join(f"{amount:+g} {name}" for name, amount in missing.items())
        sheet.add(f"{key} does not balance", found)


def _precursor(sheet: Sheet, inlet: str, numbers: Mapping[str, Any]) -> None:
    species = numbers["species"]
    sheet.group(f"{species} of inlet {inlet}, until nothing changes")
    sheet.add("fed at", number(numbers["concentration"], "mol/m^3"))
    if numbers.get("beside"):
        sheet.add("together with", ", ".join(numbers["beside"]))
    if not numbers["coverage_met"]:
        sheet.add("finds", "nothing that it reacts with")
        return
    sheet.add("finds coverages of", _shares(numbers["coverage_met"]))
    if "uptake_speed" in numbers:
        sheet.add("is taken up at first at", number(numbers["uptake_speed"], "m/s"))
    if numbers["endless"]:
        sheet.add("saturation", "never: it is taken up without end")
        return
    if "molecules_per_place" in numbers:
        sheet.add("takes", f"{number(numbers['molecules_per_place'])} molecules per place")
    if "coverage_left" in numbers:
        sheet.add("leaves coverages of", _shares(numbers["coverage_left"]))
    if "seconds" in numbers:
        sheet.add("99 % of it after", _time(numbers["seconds"]))


def _shares(coverage: Mapping[str, float]) -> str:
    return ", ".join(together(f"{share:.4g} {name}") for name, share in coverage.items())


def _time(seconds: float) -> str:
    for unit, size in (("us", 1e-6), ("ms", 1e-3)):
        if seconds < 1e3 * size:
            return number(seconds / size, unit)
    return number(seconds, "s")
