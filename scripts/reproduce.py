"""Compare the model with the statements of the thesis (chapter 5.4.2), rows R1 to R23.

    python scripts/reproduce.py               # all rows, then docs/reproduction.md with its pictures
    python scripts/reproduce.py R9 R10        # some rows
    python scripts/reproduce.py --coarse R9   # on the coarsest mesh, in seconds
    python scripts/reproduce.py --list

Runs are kept under results/reproduce by the content of their case: what has been run is not run again, and what was stopped goes on.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from reproduction import ROWS, Lab
from reproduction.report import write_report
from reproduction.store import ROOT


def main(arguments: list[str] | None = None) -> int:
    """Measure the rows asked for; returns the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("rows", nargs="*", help="R1 ... R23; all by default")
    parser.add_argument("--list", action="store_true", help="print the rows and stop")
    parser.add_argument(
        "--coarse", action="store_true", help="everything on the coarsest mesh; the document is not written"
    )
    parser.add_argument(
        "--finest", action="store_true", help="rows R9, R10, R13 to R21, R23 on the thesis' own mesh (hours)"
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
    options = parser.parse_args(arguments)
    unknown = [name for name in options.rows if name not in ROWS]
    if unknown:
        parser.error(f"no row {', '.join(unknown)}; there are {', '.join(ROWS)}")
    chosen = [ROWS[name] for name in options.rows] or list(ROWS.values())
    if options.list:
        for one in chosen:
            print(f"{one.id:4} {one.figure:9} {one.statement}\n{'':14} expected: {one.expected}")
        return 0
    lab = Lab(
        options.output / ("coarse" if options.coarse else "full"),
        coarse=options.coarse,
        finest=options.finest,
    )
    for one in [] if options.report or options.pictures else chosen:
        started = time.monotonic()
        lab.used.clear()
        finding = one.measure(lab)
        lab.keep(one.id, {"id": one.id, **asdict(finding), "used": lab.meshes()})
        print(
            f"{one.id:4} {finding.verdict}\n     {finding.measured}   [{time.monotonic() - started:.0f} s]",
            flush=True,
        )
    if not options.coarse:
        write_report(lab, pictures=options.pictures or not (options.rows or options.report))
    return 0


if __name__ == "__main__":
    sys.exit(main())
