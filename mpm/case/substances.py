"""What reacts, from the tables of `[chemistry]`: names that can be told apart, atoms of formulas, what is known of enthalpy and entropy."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from mpm.case.chemistry import Chemistry, FilmTable, NasaTable, SiteTable, SolidTable, SpeciesTable
from mpm.physics.elements import parse_formula
from mpm.physics.equation import ARROW
from mpm.physics.substances import Site, Species
from mpm.physics.thermochemistry import Nasa
from mpm.units import reject

_NAME = re.compile(r"[^\s.]+")


RESERVED_SPECIES = {
    "default": "gas.diffusivity",
    "sites": "balance.sites of history.csv",
    "cvd": "map_cvd.png",
}
"""Names that a species would share with another entry of the case or the results, and where."""


def read_substances(chemistry: Chemistry) -> tuple[dict[str, Species], dict[str, Site], dict[str, Site]]:
    """Gas species, states of the surface sites and films, each by name."""
    species = {
        name: Species(
            name,
            table.molar_mass,
            _elements("species", name, table),
            table.enthalpy,
            table.heat_capacity,
            table.viscosity,
            table.entropy,
            _nasa("species", name, table),
        )
        for name, table in chemistry.species.items()
    }
    sites = {name: _solid("site", name, table) for name, table in chemistry.site.items()}
    films = {name: _solid("film", name, table) for name, table in chemistry.film.items()}
    _check_names({"species": species, "site": sites, "film": films})
    return species, sites, films


def _solid(kind: str, name: str, table: SiteTable | FilmTable) -> Site:
    """A site, which may hold several places, or a film, which may have a density."""
    return Site(
        name,
        _elements(kind, name, table),
        table.molar_mass,
        table.density if isinstance(table, FilmTable) else None,
        table.enthalpy,
        table.heat_capacity,
        table.entropy,
        _nasa(kind, name, table),
        table.sites if isinstance(table, SiteTable) else 1.0,
    )


def _nasa(kind: str, name: str, table: SpeciesTable | SolidTable) -> Nasa | None:
    """The polynomials of a substance; what they hold is not given a second time."""
    nasa: NasaTable | None = table.nasa
    if nasa is None:
        return None
    for key in ("enthalpy", "entropy", "heat_capacity"):
        if getattr(table, key) is not None:
            raise reject(
                f"{key} beside nasa, whose polynomials hold it",
                f"{key} or nasa",
                key=f"chemistry.{kind}.{name}.{key}",
            )
    lowest, middle, highest = nasa.temperatures
    if not lowest < middle < highest:
        raise reject(
            f"{list(nasa.temperatures)}",
            "three temperatures in K that rise, e.g. [200, 1000, 3500]",
            key=f"chemistry.{kind}.{name}.nasa.temperatures",
        )
    return Nasa(middle, nasa.low, nasa.high)


def _check_names(tables: Mapping[str, Iterable[str]]) -> None:
    """Names are one word, and of one thing only."""
    seen: dict[str, str] = {}
    for kind, names in tables.items():
        for name in names:
            if kind == "species" and name in RESERVED_SPECIES:
                raise reject(
                    f"{name!r}, which means something else in {RESERVED_SPECIES[name]}",
                    "another name; formula = ... says what it is made of",
                    key=f"chemistry.species.{name}",
                )
            if name in seen:
                raise reject(
                    f"{name!r}, which is a {seen[name]} too",
                    "a name that no other species, site or film has: results and equations call it by that",
                    key=f"chemistry.{kind}.{name}",
                )
            if not _NAME.fullmatch(name) or not name.isprintable() or ARROW.search(name):
                raise reject(
                    f"{name!r}",
                    "a name without blanks, dots and arrows",
                    key=f"chemistry.{kind}.{name}",
                )
            seen[name] = kind


def _elements(kind: str, name: str, table: SpeciesTable | SolidTable) -> dict[str, float]:
    if table.elements is not None:
        for element in table.elements:
            if not element.isalnum():
                raise reject(
                    repr(element),
                    "symbols of elements, e.g. elements = { Al = 1, C = 3, H = 9 }",
                    key=f"chemistry.{kind}.{name}.elements",
                )
        return dict(table.elements)
    try:
        return parse_formula(
            table.formula or name.strip("*")
        )  # * is a place on the surface, which has no atoms
    except ValueError as error:
        raise reject(
            str(error),
            'a formula, e.g. "Al(CH3)3", or elements = { Al = 1, C = 3, H = 9 }',
            key=f"chemistry.{kind}.{name}.formula",
        ) from None
