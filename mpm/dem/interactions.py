"""What LAMMPS is told of the forces in a box: contact and cohesion of particles with each other and with the base."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from . import cohesion
from .spec import BoxSpec

SKIN = 0.15
"""Of the smallest diameter: how far beyond contact neighbours are listed; the list is renewed when one has moved half of it."""
KEYWORD = "COHESION"
"""The name of the section in a table file."""


@dataclass(frozen=True)
class Interactions:
    """`commands` for LAMMPS, and the texts of the cohesion `tables` that they read, by path."""

    commands: list[str]
    tables: Mapping[Path, str]


def interactions(spec: BoxSpec, folder: Path) -> Interactions:
    """Pair and wall styles of a box, with its tables in `folder`."""
    styles, contacts = _contacts(spec)
    pairs = _pair_cohesion(spec, folder, styles)
    base = _wall(spec, folder) if spec.base.flat else Interactions(["fix frozen frit freeze"], {})
    smallest = float(spec.diameters.min())
    commands = [
        f"neighbor {SKIN * smallest:.16g} bin",
        "neigh_modify delay 0 every 5 check yes",
        f"neigh_modify exclude type {spec.frit_type} {spec.frit_type}",
        f"pair_style hybrid/overlay {' '.join(styles)}",
        *contacts,
        *pairs.commands,
        *base.commands,
    ]
    return Interactions(commands, {**pairs.tables, **base.tables})


def _contacts(spec: BoxSpec) -> tuple[list[str], list[str]]:
    """Styles of the contacts, and their coefficients."""
    n, frit = len(spec.diameters), spec.frit_type
    if spec.equal_sizes:
        mass = float(spec.masses()[0])
        # against frozen particles the effective mass is the particle's own
        styles = [
            f"gran/hooke/history {spec.pair_contact.hooke_history(mass / 2.0)}",
            f"gran/hooke/history {spec.wall_contact.hooke_history(mass)}",
        ]
        contacts = ["pair_coeff 1 1 gran/hooke/history 1", "pair_coeff 1 2 gran/hooke/history 2"]
    else:
        styles = ["granular"]
        contacts = [
            f"pair_coeff {i} {j} granular {spec.pair_contact.granular()}"
            for i in range(1, n + 1)
            for j in range(i, n + 1)
        ]
        contacts += [
            f"pair_coeff {i} {frit} granular {spec.wall_contact.granular()}" for i in range(1, n + 1)
        ]
    return styles, [*contacts, f"pair_coeff {frit} {frit} none"]


def _pair_cohesion(spec: BoxSpec, folder: Path, styles: list[str]) -> Interactions:
    """Tables of the pairs that attract each other, whose style is added to the `styles`."""
    if not (spec.hamaker(False) > 0.0 or (spec.hamaker(True) > 0.0 and not spec.base.flat)):
        return Interactions([], {})
    n, radii = len(spec.diameters), spec.diameters / 2.0
    pairs = [(i, j, radii[i], radii[j], False) for i in range(n) for j in range(i, n)]
    if not spec.base.flat:
        pairs += [(i, n, radii[i], spec.base.diameter / 2.0, True) for i in range(n)]
    points = max(cohesion.table_points(a + b) for _, _, a, b, _ in pairs)
    styles.append(f"table linear {points}")
    commands, tables = [], {}
    for i, j, a, b, wall in pairs:
        path = folder / f"pair_{i}_{j}.table"
        tables[path] = cohesion.table_text(
            KEYWORD,
            contact=a + b,
            points=points,
            hamaker=spec.hamaker(wall),
            radius=a * b / (a + b),
            asperity=spec.powder.asperity,
        )
        cutoff = a + b + cohesion.OUTER_CUTOFF
        commands.append(f'pair_coeff {i + 1} {j + 1} table "{path}" {KEYWORD} {cutoff:.17g}')
    return Interactions(commands, tables)


def _wall(spec: BoxSpec, folder: Path) -> Interactions:
    """Contact and cohesion with a flat base."""
    commands = [f"fix wall bed wall/gran granular {spec.wall_contact.granular()} zplane 0.0 NULL"]
    tables: dict[Path, str] = {}
    if spec.hamaker(True) == 0.0:
        return Interactions(commands, tables)
    for i, radius in enumerate((spec.diameters / 2.0).tolist(), 1):
        path = folder / f"wall_{i}.table"
        points = cohesion.table_points(radius, cohesion.TABLE_SPACING / 2.0)
        tables[path] = cohesion.table_text(
            KEYWORD,
            contact=radius,
            points=points,
            hamaker=spec.hamaker(True),
            radius=radius,
            asperity=spec.powder.asperity,
            wall=True,
        )
        commands += [
            f"group class{i} type {i}",
            f"fix stick{i} class{i} wall/table linear {points} zlo 0.0 "
            f'"{path}" {KEYWORD} {radius + cohesion.OUTER_CUTOFF:.17g}',
        ]
    return Interactions(commands, tables)
