"""Verbs that look at what a run has left: report, plot."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from mpm.cli.base import app
from mpm.launcher import rank


@app.command()
def report(
    directories: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="a run; several runs, to compare; or a sweep")
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.html", help="default: DIR/report.html")
    ] = None,
) -> None:
    """Write one page with everything about a run, several runs or a sweep.

    \b
    mpm report results/single_zone                 results/single_zone/report.html
    mpm report results/wide results/slow           both side by side, and their difference
    mpm report results/map                         a sweep, whose points open their runs' pages

    Open the file with a browser: it needs no network and can be sent as it is.
    """
    if rank() != 0:
        return
    from mpm.page import report as write

    print(write(directories, output, lambda line: print(line, file=sys.stderr)))


@app.command()
def plot(directory: Annotated[Path, typer.Argument(metavar="DIR", help="the directory of a run")]) -> None:
    """Draw the pictures of a run into its plots/.

    mpm plot results/single_zone
    """
    if rank() != 0:
        return
    from mpm.pictures import plot_run

    paths = plot_run(directory, lambda line: print(line, file=sys.stderr))
    for path in paths:
        print(path)
    if not paths:
        print(
            f"{directory}: holds nothing that is drawn: no fields of species or coverage, no history",
            file=sys.stderr,
        )
