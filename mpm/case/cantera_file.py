"""Mechanisms in Cantera's YAML, read through the package `cantera` (the extra `chemistry`) into the tables of `[chemistry]`.

Only what takes part in the reactions of the phase is taken over. Its species are the sites, the one with the largest coverage in the
phase's state first (the first listed of several): the fresh surface. Gases of an adjacent phase are species, solids of one kind are films.
Amounts are in kmol there. A one-way reaction obeys mass action in Cantera, so its orders are written wherever they are not 1. Constants
are written per site, which is what Cantera means; they meet the site density of the case's materials.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

from mpm.case.cantera_rates import Kinds, Refused, reaction_table
from mpm.case.merging import Table
from mpm.errors import InputError
from mpm.files import is_file
from mpm.physics.thermochemistry import STANDARD_TEMPERATURE

ENDINGS = (".yaml", ".yml")


def is_cantera(mechanism: str) -> bool:
    """Whether the name of a mechanism is that of a file of Cantera."""
    return mechanism.lower().endswith(ENDINGS)


def cantera_tables(chemistry: Table, folder: Path, source: str, heats: bool) -> Table:
    """The tables of the mechanism that `[chemistry]` names; with `heats` all that is known of enthalpies, else what equilibria need."""
    path = _find(chemistry["mechanism"], folder, source)
    phase = chemistry.get("phase") or _only_surface(path, source)
    gas_reactions = chemistry.get("gas_reactions", True)
    if not isinstance(gas_reactions, bool):
        raise InputError.at(source, "chemistry.gas_reactions", f"{gas_reactions!r}", "true or false")
    try:
        return deepcopy(_read(path, path.stat().st_mtime_ns, str(phase), gas_reactions, heats))
    except Refused as error:
        raise InputError.at(source, f"chemistry.{error.key}", error.found, error.accepted) from None
    except _cantera(
        path.name, source
    ).CanteraError as error:  # a frame of asterisks around what is wrong and where
        named = "where 'name' =" in str(error)
        key = "phase" if named else "mechanism"
        found = f"{phase!r}, no phase of {path.name}" if named else f"{path.name} ({_one_line(error)})"
        accepted = f"one of {', '.join(_phases(path))}" if named else "a file that Cantera reads"
        raise InputError.at(source, f"chemistry.{key}", found, accepted) from None


def cantera_site_density(chemistry: Table, folder: Path) -> float | None:
    """Places per area [mol/m2] that the file gives its phase; None where the mechanism is none of Cantera or has no surface."""
    if not is_cantera(str(chemistry.get("mechanism", ""))):
        return None
    path = _find(chemistry["mechanism"], folder, "")
    phase = _load(path, path.stat().st_mtime_ns, str(chemistry.get("phase") or _only_surface(path, "")))
    return None if phase.thermo_model == "ideal-gas" else float(phase.site_density) * 1e3


def _cantera(name: str, source: str) -> Any:
    """The package, or the line that says how to get it."""
    try:
        import cantera
    except ImportError:
        found = f"{name!r}, a file of Cantera, and the package cantera is not installed"
        raise InputError.at(
            source, "chemistry.mechanism", found, "pip install 'mpm[chemistry]', or a mechanism in TOML"
        ) from None
    return cantera


def _find(name: str, folder: Path, source: str) -> Path:
    """A file beside the case, or one that Cantera has."""
    ct = _cantera(name, source)
    for place in (folder, *map(Path, ct.get_data_directories()[1:])):
        if is_file(place / name):
            return (place / name).resolve()
    raise InputError.at(
        source,
        "chemistry.mechanism",
        f"{name!r}, no such file",
        "a path, or a file that Cantera has, e.g. ptcombust.yaml",
    )


def _phases(path: Path) -> dict[str, str]:
    """Names of the phases in a file, and what each is."""
    from ruamel.yaml import YAML, YAMLError

    try:
        data = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
        return {str(phase["name"]): str(phase.get("thermo", "")) for phase in data["phases"]}
    except (YAMLError, OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def _only_surface(path: Path, source: str) -> str:
    """The phase that is meant where none is named: the one with a surface."""
    phases = _phases(path)
    if not phases:
        return ""  # Cantera says what is wrong with the file
    surfaces = [name for name, thermo in phases.items() if thermo == "ideal-surface"]
    if len(surfaces) == 1:
        return surfaces[0]
    found = f"nothing, and {len(surfaces) or 'no'} surface phases in {path.name}"
    raise InputError.at(source, "chemistry.phase", found, f"one of {', '.join(surfaces or phases)}")


def _one_line(error: Exception) -> str:
    """What Cantera says without the frame, the place in its code and the lines of the file."""
    said = [line.strip() for line in str(error).splitlines()]
    kept = [
        line
        for line in said
        if line and line[0] not in "*|>" and "thrown by" not in line and set(line) != {"^"}
    ]
    return " ".join(kept[: 4 if kept[1:] and kept[1].endswith(":") else 2]) or type(error).__name__


@lru_cache(maxsize=8)
def _load(path: Path, _changed: int, phase: str) -> Any:
    """The phase with those beside it."""
    ct = _cantera(path.name, "")
    ct.suppress_thermo_warnings()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        alone = ct.Solution(str(path), phase)
        if alone.thermo_model == "ideal-gas":
            return alone
        if alone.thermo_model != "ideal-surface":
            raise Refused(
                f"{phase!r}, whose thermo is {alone.thermo_model}",
                "a phase with thermo ideal-surface, or ideal-gas for reactions in the gas alone",
                "phase",
            )
        return ct.Interface(str(path), phase)


@lru_cache(maxsize=8)
def _read(path: Path, changed: int, phase: str, gas_reactions: bool, heats: bool) -> Table:
    """The tables of `[chemistry]`."""
    main = _load(path, changed, phase)
    kinds, substances = _kinds(main)
    reactions: Table = {}
    taking_part: dict[str, None] = {}
    equilibrated: set[str] = set()
    for name, number, reaction in _reactions(main, gas_reactions):
        try:
            table, parts = reaction_table(reaction, f"reaction {number} of {name}", kinds)
        except Refused as error:
            advice = "" if name == main.name else "; gas_reactions = false leaves those of the gas out"
            raise Refused(error.found, f"{error.accepted}{advice}") from None
        key = (
            reaction.ID
            if _is_key(reaction.ID) and reaction.ID not in reactions
            else f"{'G' if name in kinds.gas_phases else 'R'}{number}"
        )
        reactions[key] = table
        taking_part |= dict.fromkeys(parts)
        if reaction.reversible:
            equilibrated |= {*reaction.reactants, *reaction.products}
    tables: Table = {"species": {}, "site": {}, "film": {}, "reaction": reactions}
    pressures = set()
    for name, (kind, phase_of, substance) in substances.items():
        if name not in taking_part:
            continue
        table = _substance(kind, phase_of, substance)
        if heats or name in equilibrated:
            thermo = _thermochemistry(substance, needed=name in equilibrated)
            table |= thermo
            if kind == "species" and thermo:
                pressures.add(float(substance.thermo.reference_pressure))
        tables[kind][name] = table
    if len(pressures) > 1:
        raise Refused(
            f"gases with several reference pressures ({', '.join(f'{p:g} Pa' for p in sorted(pressures))})",
            "one",
        )
    if pressures:
        tables["reference_pressure"] = f"{pressures.pop()!r} Pa"
    return tables


def _is_key(name: str) -> bool:
    """Whether a reaction's own id can be its key."""
    return bool(name) and all(character.isalnum() or character in "_-" for character in name)


def _reactions(main: Any, gas_reactions: bool) -> Iterator[tuple[str, int, Any]]:
    """Name of the phase, number in it, and reaction: those of the surface, and those of the gas beside it if they are wanted."""
    phases = [main]
    if gas_reactions and main.thermo_model == "ideal-surface":
        phases += [beside for beside in main.adjacent.values() if beside.thermo_model == "ideal-gas"]
    for phase in phases:
        for number, reaction in enumerate(phase.reactions(), 1):
            yield phase.name, number, reaction


def _kinds(main: Any) -> tuple[Kinds, dict[str, tuple[str, Any, Any]]]:
    """Which names are gases, sites and films; and of each substance its kind, its phase and what Cantera knows of it."""
    substances: dict[str, tuple[str, Any, Any]] = {}
    gas_phases: list[str] = []
    if main.thermo_model == "ideal-surface":
        own = list(main.species())
        first = max(range(len(own)), key=lambda place: (main.coverages[place], -place))
        for place in (first, *(place for place in range(len(own)) if place != first)):
            substances[own[place].name] = ("site", main, own[place])
    for beside in [main] if main.thermo_model == "ideal-gas" else main.adjacent.values():
        gaseous = beside.thermo_model == "ideal-gas"
        if gaseous:
            gas_phases.append(beside.name)
        for one in beside.species():
            kind = "species" if gaseous else "film" if beside.n_species == 1 else "solution"
            substances.setdefault(one.name, (kind, beside, one))
    of = {
        kind: tuple(n for n, (k, _, _) in substances.items() if k == kind)
        for kind in ("species", "site", "film")
    }
    return Kinds(of["species"], of["site"], of["film"], tuple(gas_phases)), substances


def _substance(kind: str, phase: Any, substance: Any) -> Table:
    """Molar mass, atoms and, of a site, places."""
    if substance.charge:
        raise Refused(f"{substance.name} of {phase.name}, which has a charge", "species without charge")
    table: Table = {
        "elements": {name: float(count) for name, count in substance.composition.items() if count}
    }
    if kind != "site":
        table["molar_mass"] = f"{substance.molecular_weight * 1e-3!r} kg/mol"
    elif substance.size != 1.0:
        table["sites"] = float(substance.size)
    if kind == "film" and "equation-of-state" in substance.input_data:
        table["density"] = f"{float(phase.density)!r} kg/m^3"
    return table


def _thermochemistry(substance: Any, needed: bool) -> Table:
    """Polynomials, or enthalpy and entropy at 298.15 K; nothing of other kinds, which is refused where an equilibrium needs it."""
    thermo = substance.thermo
    kind = type(thermo).__name__ if thermo is not None else "no thermo"
    if kind == "NasaPoly2" and len(thermo.coeffs) == 15:
        middle, *a = (float(value) for value in thermo.coeffs)
        temperatures = [float(thermo.min_temp), middle, float(thermo.max_temp)]
        if not temperatures[0] < middle < temperatures[2]:  # one range, which Cantera holds twice
            temperatures[1] = 0.5 * (temperatures[0] + temperatures[2])
        return {"nasa": {"temperatures": temperatures, "low": a[7:], "high": a[:7]}}
    if kind == "ConstantCp":
        T, h, s, c = (float(value) for value in thermo.coeffs)
        table = {
            "enthalpy": f"{(h + c * (STANDARD_TEMPERATURE - T)) * 1e-3!r} J/mol",
            "entropy": f"{(s + c * math.log(STANDARD_TEMPERATURE / T)) * 1e-3!r} J/mol/K",
        }
        return {**table, "heat_capacity": f"{c * 1e-3!r} J/mol/K"} if c else table
    if needed:
        model = substance.input_data.get("thermo", {}).get("model", kind)
        raise Refused(
            f"{substance.name} with thermo {model}, and a reversible reaction whose way back follows from it",
            "NASA7 or constant-cp",
        )
    return {}
