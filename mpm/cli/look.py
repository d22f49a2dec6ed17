"""Verbs that look at what a run has left: plot."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from mpm.cli.base import app
from mpm.launcher import rank


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
