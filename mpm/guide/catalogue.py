"""`mpm list`: what comes with mpm (cases, geometries, materials, gases, mechanisms, sweeps, powders), and the runs under results/."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.case.chemistry import Chemistry
from mpm.case.kinds import RUN, kind_of_directory
from mpm.case.materials import BUILT_IN, SITE_DENSITIES
from mpm.case.names import POWDER_FILES, SWEEP_FILES
from mpm.case.reactions import build_mechanism
from mpm.case.schema import for_people, number_text
from mpm.case.sources import built_in_files, read_toml, shared_geometry
from mpm.errors import InputError
from mpm.physics.gases import CARRIERS
from mpm.report.quantities import quantity
from mpm.report.trees import flatten

RESULTS = Path("results")


@dataclass(frozen=True)
class Entry:
    """One thing that has a name, with what a person wants to know of it."""

    name: str
    facts: str


@dataclass(frozen=True)
class Section:
    """All things of one kind, and how their names are used."""

    title: str
    use: str
    entries: tuple[Entry, ...]


def sections(kind: str | None = None) -> list[Section]:
    """The sections of `mpm list`, all or one. Raises InputError for a kind that there is not."""
    if kind is not None and kind not in KINDS:
        raise InputError.at("mpm list", "", repr(kind), ", ".join(KINDS), given=kind, known=KINDS)
    found = []
    for name in KINDS if kind is None else (kind,):
        use, entries = KINDS[name]
        found.append(Section(name.capitalize(), use, tuple(entries())))
    return found


def _cases() -> Iterator[Entry]:
    for name, path in built_in_files("cases").items():
        data = read_toml(path)
        geometry = shared_geometry(data, {}, path.parent, name)
        ports = ", ".join(
            f"{inlet['name']} ({', '.join(inlet.get('mass_fractions', {})) or 'no precursor'})"
            for inlet in data["geometry"].get("inlet", ())
        )
        yield Entry(
            name, f"{data['title']}; {data['fidelity']}, {geometry.get('length', '')} long, inlets {ports}"
        )


def _geometries() -> Iterator[Entry]:
    for name, path in built_in_files("meshes").items():
        table = read_toml(path)["geometry"]
        names = {key: [entry["name"] for entry in table.get(key, ())] for key in ("layer", "inlet", "zone")}
        counted = ", ".join(
            f"{len(names[key])} {what}{'s' * (len(names[key]) != 1)} ({', '.join(names[key])})"
            for key, what in (("layer", "layer"), ("inlet", "inlet"), ("zone", "zone"))
        )
        yield Entry(name, f"{table['length']} long, {counted}")


def _materials() -> Iterator[Entry]:
    for name, table in BUILT_IN.items():
        particles = f", particles of {table['particle_diameter']}" if "particle_diameter" in table else ""
        yield Entry(
            name,
            f"porosity {table['porosity']}, permeability {table['permeability']}, tortuosity factor {_pair(table['tortuosity_factor'])}, "
            f"reactive surface {table['surface_to_volume']} with {for_people(SITE_DENSITIES['thesis'], 'mol/m^2')} of sites (default)"
            f"{particles}, solid of {table['density']}",
        )


def _pair(value: Any) -> str:
    return " / ".join(map(str, value)) if isinstance(value, list) else str(value)


def _gases() -> Iterator[Entry]:
    for name, gas in CARRIERS.items():
        yield Entry(
            name,
            f"{for_people(gas.molar_mass, 'kg/mol')}, viscosity {number_text(round(gas.viscosity(473.0), 8))} Pa s at 473 K",
        )


def _mechanisms() -> Iterator[Entry]:
    for name, path in built_in_files("mechanisms").items():
        mechanism = build_mechanism(Chemistry.model_validate(read_toml(path)))
        reactions = "; ".join(str(r) for r in (*mechanism.surface_reactions, *mechanism.gas_reactions))
        yield Entry(
            name,
            f"gas {', '.join(mechanism.species_names)}; surface sites {', '.join(mechanism.site_names)}; {reactions}",
        )


def _powders() -> Iterator[Entry]:
    for name, path in built_in_files(POWDER_FILES).items():
        data = read_toml(path)
        yield Entry(name, f"{data['title']}; powder {data['powder']}")


def _sweeps() -> Iterator[Entry]:
    for name, path in built_in_files(SWEEP_FILES).items():
        table = read_toml(path)["sweep"]
        axes = ", ".join(str(axis["key"]) for axis in table["axis"])
        yield Entry(name, f"{table['title']}; case {Path(table['case']).stem} over {axes}")


def _particles() -> Iterator[Entry]:
    from mpm.dem.powder import POWDERS

    for name, powder in POWDERS.items():
        spread = f" +- {powder.deviation * 1e6:g} um" if powder.deviation else ""
        yield Entry(
            name,
            f"{powder.diameter * 1e6:g} um{spread}, {powder.density:g} kg/m^3, sphericity {powder.sphericity:g}",
        )


def _runs() -> Iterator[Entry]:
    """Directories under results/ that a verb has written, newest first; the runs of a sweep are in its own table."""
    found = []
    for path in sorted(RESULTS.glob("**/")) if RESULTS.is_dir() else ():
        kind = kind_of_directory(path)
        if kind is not None and "points" not in path.relative_to(RESULTS).parts:
            found.append((max(file.stat().st_mtime for file in path.iterdir()), path, kind))
    for when, path, kind in sorted(found, key=lambda entry: entry[:2], reverse=True):
        date = time.strftime("%Y-%m-%d %H:%M", time.localtime(when))
        yield Entry(str(path), _run_facts(path, date) if kind is RUN else f"{kind.words}, {date}")


def _run_facts(run: Path, date: str) -> str:
    """Title, state, date and main number of a run; files that cannot be read count as missing."""
    try:
        summary: Mapping[str, Any] = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        summary = {}
    status = summary.get("status", f"not finished: mpm resume {run}")
    title = summary.get("title") or _title(run)
    numbers = [
        f"{quantity(name).label} {number_text(round(value, 4))}"
        for name, value in flatten(summary).items()
        if name.startswith("titration.") and name.endswith(".exit_mean")
    ]
    return "; ".join([*([title] if title else []), f"{status}, {date}", *numbers])


def _title(run: Path) -> str:
    try:
        return str(read_toml(run / "case.toml").get("title", ""))
    except InputError:
        return ""


KINDS: dict[str, tuple[str, Callable[[], Iterator[Entry]]]] = {
    "cases": ("mpm check NAME, mpm run NAME, mpm new FILE --from NAME", _cases),
    "geometries": ('[geometry] base = "NAME"; mpm mesh NAME', _geometries),
    "materials": ('[[geometry.layer]] material = "NAME"; of your own: a table [material.NAME]', _materials),
    "gases": ('[gas] carrier = "NAME"; any other with molar_mass and viscosity', _gases),
    "mechanisms": ('[chemistry] mechanism = "NAME", or the path of a file', _mechanisms),
    "sweeps": ("mpm sweep NAME", _sweeps),
    "powders": ("mpm dem NAME", _powders),
    "particles": ('powder = "NAME" in a powder file of mpm dem', _particles),
    "runs": ("mpm plot DIR, mpm report DIR, mpm resume DIR", _runs),
}
