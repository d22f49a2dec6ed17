"""How warm does the powder get, and what does temperature do to the coating? What docs/temperature.md reports, measured.

    python scripts/temperature.py                     # all sections: what has not been run yet, then the tables in docs/temperature.md
    python scripts/temperature.py travel reaction     # these sections alone
    python scripts/temperature.py --coarse            # a twin in seconds on a coarse mesh: prints tables and writes no document

Every number is measured on two meshes of the same strip: `full`, that of the shipped cases (28,359 cells a zone), and `half`, with columns
and rows twice as wide. Runs are kept under results/temperature and not run again. Sections are in scripts/heat_sections.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from document import write_between
from heat_sections import cold_inlets, cost, headspace, rates, reaction, travel
from heat_sections.store import COARSE, MESHES

ROOT = Path(__file__).parents[1]
DOCUMENT = ROOT / "docs" / "temperature.md"
SECTIONS: dict[str, Callable[[tuple[str, ...]], str]] = {
    "travel": travel.table,
    "cold_inlets": cold_inlets.table,
    "headspace": headspace.table,
    "reaction": reaction.table,
    "rates": rates.table,
    "cost": cost.table,
}


def marks(section: str) -> tuple[str, str]:
    """Begin and end of what this script writes of a section."""
    return f"<!-- {section}: written by scripts/temperature.py -->", f"<!-- end of {section} -->"


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sections", nargs="*", default=[], metavar="SECTION", help=", ".join(SECTIONS))
    parser.add_argument(
        "--coarse", action="store_true", help="a coarse mesh and short runs; nothing is written"
    )
    chosen = parser.parse_args(arguments)
    unknown = set(chosen.sections) - set(SECTIONS)
    if unknown:
        parser.error(f"no section {', '.join(sorted(unknown))}; there are {', '.join(SECTIONS)}")
    for name in chosen.sections or SECTIONS:
        table = SECTIONS[name]((COARSE,) if chosen.coarse else MESHES)
        print(f"\n{name}\n\n{table}", flush=True)
        if not chosen.coarse:
            write_between(DOCUMENT, *marks(name), table)
    if not chosen.coarse and (not chosen.sections or "travel" in chosen.sections):
        travel.draw().savefig(ROOT / "docs" / "figures" / "temperature_travel.png", dpi=110)


if __name__ == "__main__":
    main()
