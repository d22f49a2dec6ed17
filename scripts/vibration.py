"""How much does vibration disperse precursor in this reactor? What docs/vibration.md and docs/conventions.md report, measured.

    python scripts/vibration.py                     # all sections: what has not been run yet, then tables and the figure
    python scripts/vibration.py --table             # the zone at 6.5 s under the closed code's conventions, by Gamma
    python scripts/vibration.py columns --width 1   # this section, runs in columns of 1 mm alone
    python scripts/vibration.py --stored            # runs nothing: writes what has been measured
    python scripts/vibration.py --coarse            # a trial of everything in a minute: prints tables and writes no document

Runs are kept under results/vibration and not made again; what is missing is a dash. Sections are in scripts/vibration_sections.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

from document import write_between
from vibration_sections import columns, dispersion, figure, force, readings, switches
from vibration_sections.store import WIDTHS, Lab

ROOT = Path(__file__).parents[1]
ANSWER, CONVENTIONS = ROOT / "docs" / "vibration.md", ROOT / "docs" / "conventions.md"
PICTURE = ROOT / "docs" / "figures" / "vibration.png"
SECTIONS: dict[str, Callable[[Lab], str]] = {
    "readings": readings.table,
    "steps": readings.steps,
    "dispersion": dispersion.table,
    "added": dispersion.added,
    "columns": columns.table,
    "models": columns.models,
    "swing": dispersion.swing,
    "force": force.table,
    "switches": switches.table,
}


def document(section: str) -> Path:
    """Where a section's table stands."""
    return CONVENTIONS if section == "switches" else ANSWER


def marks(section: str) -> tuple[str, str]:
    """Begin and end of what this script writes of a section."""
    return f"<!-- {section}: written by scripts/vibration.py -->", f"<!-- end of {section} -->"


def trial(sections: list[str]) -> None:
    """Every run of these sections on a mesh of seconds, kept nowhere."""
    with tempfile.TemporaryDirectory() as folder:
        lab = Lab(Path(folder), coarse=True, say=lambda _: None)
        for name in sections:
            print(f"\n{name}\n\n{SECTIONS[name](lab)}", flush=True)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sections", nargs="*", default=[], metavar="SECTION", help=", ".join(SECTIONS))
    parser.add_argument("--table", action="store_true", help="the section readings")
    parser.add_argument("--width", type=float, nargs="*", default=WIDTHS, help="mm: columns to run")
    parser.add_argument("--stored", action="store_true", help="run nothing")
    parser.add_argument(
        "--coarse", action="store_true", help="a coarse mesh and short runs; nothing is written"
    )
    chosen = parser.parse_args(arguments)
    unknown = set(chosen.sections) - set(SECTIONS)
    if unknown:
        parser.error(f"no section {', '.join(sorted(unknown))}; there are {', '.join(SECTIONS)}")
    sections = [*chosen.sections, *(["readings"] if chosen.table else [])] or list(SECTIONS)
    if chosen.coarse:
        trial(sections)
        return
    lab = Lab(widths=chosen.width, only_stored=chosen.stored, say=lambda line: print(line, flush=True))
    for name in sections:
        table = SECTIONS[name](lab) + lab.footer()
        print(f"\n{name}\n\n{table}", flush=True)
        write_between(document(name), *marks(name), table)
    figure.draw(Lab(only_stored=True)).savefig(PICTURE, dpi=150)


if __name__ == "__main__":
    main()
