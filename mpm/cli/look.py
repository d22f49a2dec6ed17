"""Verbs that look at what a run has left: report, plot, paraview, compare."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from mpm.cli.base import RunArgument, app
from mpm.cli.complete import complete_run
from mpm.launcher import rank
from mpm.screen import say, screen

FieldOption = Annotated[
    str | None,
    typer.Option(
        "--field", metavar="NAME", help="one field of fields.pvd, such as x_TMA, theta_OH, pressure"
    ),
]
TimeOption = Annotated[
    str | None,
    typer.Option(
        "--time", metavar="T", help="the stored time nearest to T, in s or with a unit (default: the last)"
    ),
]
LimitsOption = Annotated[
    str | None,
    typer.Option("--clim", metavar="LO,HI", help="ends of the colour scale, in the unit it shows"),
]


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
def plot(
    directories: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="a run, several runs to put beside each other, or a sweep"),
    ],
    field: FieldOption = None,
    time: TimeOption = None,
    clim: LimitsOption = None,
    streamlines: Annotated[
        bool, typer.Option("--streamlines", help="draw the gas's streamlines over the field")
    ] = False,
    movie: Annotated[
        bool, typer.Option("--movie", help="all stored times, as GIF; with -o FILE.mp4 as MP4")
    ] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="default: in plots/ of the run")
    ] = None,
) -> None:
    """Draw a run, runs beside each other, or a sweep.

    Without options the standard pictures of a run, into its plots/: coverage, precursors, gas, curves.

    \b
    mpm plot results/single_zone
    mpm plot results/single_zone --field velocity --streamlines
    mpm plot results/single_zone --field x_TMA --time 1.5 --clim 1e-6,1e-4
    mpm plot results/single_zone --movie
    mpm plot results/wide results/slow --field pressure
    """
    if rank() != 0:
        return
    from mpm.drawing import Wish, draw, parse_clim, parse_time

    wish = Wish(
        field=field,
        time=None if time is None else parse_time(time),
        clim=None if clim is None else parse_clim(clim),
        streamlines=streamlines,
        movie=movie,
        output=output,
    )
    drawn = draw(directories, wish, lambda line: print(line, file=sys.stderr))
    console = screen()
    for path, words in drawn.items():
        say(console, f"{path}: {words}")
    if not drawn:
        nothing = "holds nothing that is drawn: no fields of species or coverage, no history"
        print(f"{directories[0]}: {nothing}", file=sys.stderr)


@app.command()
def compare(
    first: Annotated[
        Path, typer.Argument(metavar="A", help="the directory of a run", autocompletion=complete_run)
    ],
    second: Annotated[
        Path, typer.Argument(metavar="B", help="the directory of another run", autocompletion=complete_run)
    ],
    everything: Annotated[
        bool, typer.Option("--all", help="all numbers, also those that are the same, and profiles row by row")
    ] = False,
) -> None:
    """Put two runs side by side: the keys in which their cases differ, and the numbers.

    mpm compare results/wide results/slow
    """
    if rank() != 0:
        return
    from mpm.output.compare import print_comparison
    from mpm.output.results import load_run

    print_comparison(load_run(first), load_run(second), everything, screen())


@app.command()
def paraview(
    directory: RunArgument,
    vibration: Annotated[
        bool, typer.Option("--vibration", help="with --open: the last cycle, phase by phase (output.phases)")
    ] = False,
    start: Annotated[bool, typer.Option("--open", help="start ParaView, which must be on the PATH")] = False,
) -> None:
    """Write scripts that open a run in ParaView as a picture.

    \b
    mpm paraview results/single_zone            say what to type
    mpm paraview results/single_zone --open     start ParaView at once

    The right fields, colours that hold for all times, heights stretched, a label of the time. Where the run has phases
    (output.phases) a second script plays the vibration.
    """
    if rank() != 0:
        return
    from mpm.pictures.paraview import open_script, write_scripts

    scripts = write_scripts(directory, lambda line: print(line, file=sys.stderr))
    if start:
        raise typer.Exit(open_script(scripts, vibration))
    console = screen()
    for script in scripts:
        say(console, script.shows)
        print(f"    {script.typed}")
