"""Verbs that run a case many times: sweep, optimise."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpm.cli.base import CaseArgument, SetOption, app
from mpm.launcher import rank
from mpm.settings import parse_settings


@app.command()
def sweep(
    path: Annotated[Path, typer.Argument(metavar="SWEEP.toml", help="a sweep file")],
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

    mpm sweep cases/sweeps/dose.toml -j 4          four points at a time, into results/dose
    mpm sweep dose.toml --scheduler slurm          through Slurm, see docs/cluster.md

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
        float, typer.Option(help="wanted mean coverage at the exit of every dosed zone")
    ] = 0.99,
    weight: Annotated[float, typer.Option(help="moles of precursor that a mole of CVD is worth")] = 10.0,
    velocities: Annotated[bool, typer.Option("--velocities", help="choose port velocities too")] = False,
    limit: Annotated[int, typer.Option(help="steady states at most")] = 80,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="default: results/optimise/CASE")
    ] = None,
    settings: SetOption = None,
) -> None:
    """Find the doses that titrate the solids with the least precursor and CVD.

    mpm optimise single_cycle
    mpm optimise single_cycle --target 0.95 --velocities -o results/lean
    """
    from mpm.case import load_case

    loaded = load_case(case, parse_settings(settings))
    directory = output or Path("results") / "optimise" / Path(case).stem

    from mpi4py import MPI

    from mpm import optimise as search
    from mpm.parallel import on_root

    search.checked_doses(loaded, target, weight, velocities, limit)  # bad input leaves nothing behind
    on_root(MPI.COMM_WORLD, lambda: search.make_directory(directory))

    def say(point: search.Point) -> None:
        exits = ", ".join(f"{name} {value:.4f}" for name, value in point.exits.items())
        doses = ", ".join(
            f"{key.removeprefix('geometry.inlet.')} = {v:.4g}" for key, v in point.doses.items()
        )
        print(f"{doses}: exits {exits}; CVD {point.cvd:.3g} mol/m/s", flush=True)

    best, best_case, points = search.optimise(
        loaded, target, weight, velocities, limit, say if rank() == 0 else lambda point: None
    )
    if rank() == 0:
        search.write_search(directory, best_case, points)
        print("Best:")
        say(best)
        print(f"Results: {directory}")
