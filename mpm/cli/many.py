"""Verbs that run a case many times: sweep, optimise."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mpm.case.settings import parse_settings
from mpm.cli.base import CaseArgument, SetOption, app
from mpm.launcher import rank
from mpm.screen import screen

if TYPE_CHECKING:
    from rich.console import Console

    from mpm.case.case import Case
    from mpm.optimise import Search


@app.command()
def sweep(
    path: Annotated[
        str,
        typer.Argument(metavar="SWEEP", help="a sweep file, or the name of a built-in one (mpm list sweeps)"),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="default: results/SWEEP")
    ] = None,
    jobs: Annotated[int | None, typer.Option("-j", "--jobs", metavar="N", help="points at a time")] = None,
    ranks: Annotated[int | None, typer.Option("--ranks", metavar="R", help="MPI ranks per point")] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="a Dask scheduler's address, or slurm"),
    ] = None,
) -> None:
    """Run, or go on with, a parameter sweep.

    mpm sweep dose -j 4                            a built-in one, four points at a time, into results/dose
    mpm sweep mine.toml --scheduler slurm          through Slurm, see docs/cluster.md

    The same command again goes on after an interruption and adds what an extended file asks for. The table is DIR/results.csv.
    """
    if rank() != 0:
        return
    from mpm.sweep import run_sweep

    raise typer.Exit(run_sweep(path, output, jobs, ranks, scheduler))


@app.command()
def optimise(
    case: CaseArgument,
    target: Annotated[
        float, typer.Option(metavar="SHARE", help="wanted mean coverage at the exit of every dosed zone")
    ] = 0.99,
    weight: Annotated[
        float, typer.Option(metavar="MOLES", help="moles of precursor that a mole of parasitic CVD is worth")
    ] = 10.0,
    velocities: Annotated[bool, typer.Option("--velocities", help="choose port velocities too")] = False,
    limit: Annotated[int, typer.Option(metavar="N", help="steady states at most")] = 80,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="default: results/optimise/CASE")
    ] = None,
    over: Annotated[
        str | None,
        typer.Option(metavar="KEY=VALUES", help="search at each value of a key, e.g. motion.gamma=0.3,0.6"),
    ] = None,
    settings: SetOption = None,
) -> None:
    """Find the doses that titrate the solids with the least precursor and CVD.

    mpm optimise single_cycle
    mpm optimise single_cycle --target 0.95 --velocities -o results/lean
    mpm optimise single_zone --over 'gas.pressure=626 torr,1 bar'

    The start are the mass fractions that would be just enough if nothing were lost; every further step is a steady state. DIR gets the
    case with the best doses (case.toml), all steady states (points.csv) and a picture of the search (plots/search.png). With --over a
    search at each of the values, in directories of their own, and their best doses side by side (over.csv).
    """
    from mpm.case.case import load_case

    loaded = load_case(case, parse_settings(settings))
    directory = output or Path("results") / "optimise" / Path(case).stem

    from mpm.advice.doses import check_numbers, checked_doses
    from mpm.cli.searchover import search_over, variants
    from mpm.optimise import Search, make_directory
    from mpm.parallel import on_root

    from mpi4py import MPI  # isort: skip  (after mpm.optimise, which loads the finite-element stack)

    console = screen() if rank() == 0 else None

    def search(at: Case, folder: Path) -> Search:
        doses = checked_doses(at, target, weight, velocities, limit)  # bad input leaves nothing behind
        on_root(MPI.COMM_WORLD, lambda: make_directory(folder))
        return _searched(Search(at, doses, target, weight), folder, limit, console)

    if over is None:
        search(loaded, directory)
        return
    check_numbers(target, weight, limit)  # what is wrong at every value is told once
    key, cases = variants(loaded, over, velocities)
    on_root(MPI.COMM_WORLD, lambda: make_directory(directory))
    search_over(key, cases, directory, search, console)


def _searched(search: Search, directory: Path, limit: int, console: Console | None) -> Search:
    """The search, run; what it has seen is written and told on the rank with a `console`, also where it is stopped or finds nothing."""
    if console is None:
        search.run(limit)
        search.found()
        return search
    from mpm.cli.searchscreen import draw_search, print_found, print_point, print_task
    from mpm.files import write_atomically
    from mpm.optimise import write_points

    print_task(search, limit, console)
    try:
        search.run(limit, lambda point: print_point(search, point, console))
    finally:
        if search.points:
            write_points(directory, search)
            draw_search(directory, search)
    write_atomically(directory / "case.toml", search.best_case().to_toml())
    print_found(search, directory, console)
    return search
