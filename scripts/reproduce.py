"""Compare the model with the statements of the thesis (chapter 5.4.2), rows R1 to R23.

    python scripts/reproduce.py                             # all rows, then docs/reproduction.md with its pictures
    python scripts/reproduce.py R9 R10                      # some rows
    python scripts/reproduce.py --conventions closed-code   # all rows as the thesis' solver is taken to compute
    python scripts/reproduce.py --switches R8               # each switch of those conventions alone; without rows those that turn
    python scripts/reproduce.py --without R8                # those conventions without each of their switches
    python scripts/reproduce.py --finest R6 R8              # at the thesis' columns
    python scripts/reproduce.py --geometry                  # over headspace, pressure and port width
    python scripts/reproduce.py --coarse R9                 # on the coarsest mesh, in seconds
    python scripts/reproduce.py --list

Runs are kept under results/reproduce by the content of their case: what has been run is not run again, and what was stopped goes on.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from reproduction import ROWS, Lab, geometry
from reproduction.report import DOCUMENT, FINE, columns_of, left_out, write_report
from reproduction.row import Finding, Row
from reproduction.settings import CONVENTIONS, Setting, alone
from reproduction.store import ROOT
from reproduction.thesis_mesh import AT_THESIS_COLUMNS


def arguments_of(arguments: list[str] | None) -> argparse.Namespace:
    """What is asked for; a row that does not exist is refused."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("rows", nargs="*", help="R1 ... R23; all by default")
    parser.add_argument("--list", action="store_true", help="print the rows and stop")
    parser.add_argument(
        "--conventions", choices=tuple(CONVENTIONS), default="mpm", help="of every case; mpm by default"
    )
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument(
        "--switches",
        action="store_true",
        help="with each switch of closed-code alone; without rows those whose verdicts differ",
    )
    kind.add_argument(
        "--without", action="store_true", help="with closed-code without each of its switches; rows as above"
    )
    kind.add_argument(
        "--geometry",
        action="store_true",
        help="rows R13, R16, R17, R18, R20, R21 over headspace, pressure and port width",
    )
    kind.add_argument(
        "--finest",
        action="store_true",
        help="rows R9, R10, R13 to R21, R23 on the thesis' own mesh, R6 and R8 there beside the rows (hours)",
    )
    parser.add_argument(
        "--coarse", action="store_true", help="everything on the coarsest mesh; the document is not written"
    )
    parser.add_argument(
        "--stored", action="store_true", help="run nothing: rows from the runs there are, as far as they are"
    )
    parser.add_argument(
        "--report",
        action="store_true",
        help="write the document from what has been measured, measure nothing",
    )
    parser.add_argument("--pictures", action="store_true", help="draw the pictures of the document anew")
    parser.add_argument(
        "-o", "--output", type=Path, default=ROOT / "results" / "reproduce", help="where runs are kept"
    )
    parser.add_argument("--document", type=Path, default=DOCUMENT, help="where the document is written")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.rows if name not in ROWS]
    if unknown:
        parser.error(f"no row {', '.join(unknown)}; there are {', '.join(ROWS)}")
    return options


def measure(lab: Lab, name: str, kept_as: str, findings: Callable[[Lab], Iterator[Finding]]) -> None:
    """Measure a row, keep and print each finding of it."""
    started = time.monotonic()
    lab.begin()
    try:
        for finding in findings(lab):
            lab.keep(kept_as, {"id": name, **asdict(finding), "used": lab.meshes()})
            print(
                f"{name:4} [{lab.setting.name}] {finding.verdict}\n     {finding.measured}   [{time.monotonic() - started:.0f} s]",
                flush=True,
            )
    except FileNotFoundError as error:
        if not lab.only_stored:
            raise
        print(f"{name:4} [{lab.setting.name}] {error}", flush=True)


def once(one: Row) -> Callable[[Lab], Iterator[Finding]]:
    """The one finding of a row."""

    def findings(lab: Lab) -> Iterator[Finding]:
        yield one.measure(lab)

    return findings


def measure_switches(lab: Lab, rows: list[str], settings: dict[str, Setting]) -> None:
    """Rows with each switch alone, or without it; by default those whose verdicts differ between the conventions."""
    for name in rows or columns_of(lab).turned:
        for setting in settings.values():
            measure(replace(lab, setting=setting), name, name, once(ROWS[name]))


def measure_geometry(lab: Lab, rows: list[str]) -> None:
    """The sweep over headspace, pressure and port width."""
    for setting in geometry.settings().values():
        there = replace(lab, setting=setting, mesh=geometry.MESH)
        for name in [name for name in geometry.ROW_NAMES if name in rows or not rows]:
            measure(there, name, name, once(ROWS[name]))


def measure_rows(lab: Lab, rows: list[str]) -> None:
    """Rows under the conventions of the lab, R6 and R8 at the thesis' columns where the finest mesh is asked for."""
    for name in rows or ROWS:
        if lab.finest and name in AT_THESIS_COLUMNS:
            measure(lab, name, f"{name} {FINE}", AT_THESIS_COLUMNS[name])
        else:
            measure(lab, name, name, once(ROWS[name]))


def main(arguments: list[str] | None = None) -> int:
    """Measure the rows asked for; returns the exit status."""
    options = arguments_of(arguments)
    if options.list:
        for one in [ROWS[name] for name in options.rows or ROWS]:
            print(f"{one.id:4} {one.figure:9} {one.statement}\n{'':14} expected: {one.expected}")
        return 0
    lab = Lab(
        options.output / ("coarse" if options.coarse else "full"),
        coarse=options.coarse,
        finest=options.finest,
        only_stored=options.stored,
        setting=CONVENTIONS[options.conventions],
    )
    if not (options.report or options.pictures):
        if options.switches:
            measure_switches(lab, options.rows, alone())
        elif options.without:
            measure_switches(lab, options.rows, left_out(lab))
        elif options.geometry:
            measure_geometry(lab, options.rows)
        else:
            measure_rows(lab, options.rows)
    if not options.coarse:
        special = (
            options.rows
            or options.report
            or options.switches
            or options.without
            or options.geometry
            or options.finest
        )
        anew = not special and options.conventions == "mpm"
        write_report(lab, pictures=options.pictures or anew, document=options.document)
    return 0


if __name__ == "__main__":
    sys.exit(main())
