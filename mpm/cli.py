"""The command line, `mpm` or `python -m mpm`, serially or under mpirun.

Exit status: 0 done, 2 bad input, 3 numerical failure or a full disk, 130 interrupted; 1 for a defect of mpm, with a traceback.
Input is checked by every rank before MPI is loaded, so that bad input ends all of them alike; only one speaks.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated, Any, NoReturn

import typer

from mpm.errors import InputError, Interrupted, MpmError, printable, storage_error
from mpm.launcher import rank
from mpm.screen import screen, spell_out
from mpm.settings import parse_settings

_PATIENCE = 30.0
"""Seconds that a failing rank waits for the others to fail as well before it ends the whole job."""

app = typer.Typer(
    help="Moving porous media: vibrating powder reactors for atomic layer deposition.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

CaseArgument = Annotated[
    str, typer.Argument(metavar="CASE", help="a case file, or the name of a built-in case")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="override a key, e.g. geometry.inlet.tma.velocity='4 cm/s'"
    ),
]


@app.callback(invoke_without_command=True)
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="versions of all that matters, and exit")
    ] = False,
) -> None:
    if version:
        from mpm.versions import versions

        found = versions()  # on every rank: it starts MPI, which waits for all of them
        if rank() == 0:
            for name, number in found.items():
                print(f"{name:<11}{number}")
    elif context.invoked_subcommand is None and rank() == 0:
        print(context.get_help())


@app.command()
def run(
    case: CaseArgument,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="default: results/CASE")
    ] = None,
    settings: SetOption = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on from the restart state in DIR")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an earlier run in DIR")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="no progress line and no summary")] = False,
) -> None:
    """Run a case."""
    from mpm.case import load_case

    if resume and overwrite:
        raise InputError.at("run", "--resume", "--overwrite as well", "one of them", given="")
    loaded = load_case(case, parse_settings(settings))
    directory = output or Path("results") / Path(case).stem

    from mpm.reactor import Reactor

    result = Reactor(loaded).run(output=directory, resume=resume, overwrite=overwrite, progress=not quiet)
    if rank() == 0 and not quiet:
        from mpm.tables import print_summary

        print_summary(result.summary, screen())
        print(f"Results: {directory}")


@app.command()
def mesh(
    case: CaseArgument,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.msh", help="default: CASE.msh")
    ] = None,
    settings: SetOption = None,
) -> None:
    """Write the gmsh mesh of a case or of a shared geometry, and list its zones, ports and cells."""
    from mpm.case import load_case

    loaded = load_case(case, parse_settings(settings))
    if rank() != 0:
        return
    from mpm.mesh import write_msh
    from mpm.tables import print_mesh

    path = output or Path(f"{Path(case).stem}.msh")
    write_msh(loaded, path)
    print_mesh(loaded, screen())
    print(f"Mesh: {path}")


@app.command()
def check(
    case: CaseArgument,
    as_json: Annotated[
        bool, typer.Option("--json", help="one JSON object with SI numbers and the resolved case")
    ] = False,
    settings: SetOption = None,
) -> None:
    """Validate a case and print what an engineer asks first."""
    from mpm.case import load_case
    from mpm.check import check_case

    loaded = load_case(case, parse_settings(settings))
    report = check_case(loaded)
    if rank() != 0:
        return
    if as_json:
        import json

        print(json.dumps({**report, "case": loaded.to_dict()}, indent=2, allow_nan=False))
        return
    from mpm.tables import print_report

    print_report(loaded, report, screen())


@app.command()
def plot(directory: Annotated[Path, typer.Argument(metavar="DIR", help="the directory of a run")]) -> None:
    """Draw the pictures of a run into its plots/."""
    if rank() != 0:
        return
    from mpm.plot import plot_run

    paths = plot_run(directory, lambda line: print(line, file=sys.stderr))
    for path in paths:
        print(path)
    if not paths:
        print(
            f"{directory}: holds nothing that is drawn: no fields of species or coverage, no history",
            file=sys.stderr,
        )


@app.command()
def schema() -> None:
    """Print the JSON Schema of case files, for editors."""
    import json

    from mpm.case import case_schema

    if rank() == 0:
        print(json.dumps(case_schema(), indent=2))


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
    """Run, or go on with, a parameter sweep."""
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
    """Find the doses that titrate the solids with the least precursor and CVD."""
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


@app.command(
    add_help_option=False, context_settings={"allow_extra_args": True, "ignore_unknown_options": True}
)
def dem(context: typer.Context) -> None:
    """Simulate a vibrated powder bed and write its velocity profile (see mpm dem --help)."""
    from mpm.dem.cli import app as dem_app

    status = typer.main.get_command(dem_app).main(context.args, prog_name="mpm dem", standalone_mode=False)
    raise typer.Exit(status if isinstance(status, int) else 0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status; no MpmError leaves a traceback."""
    spell_out()
    logging.getLogger("matplotlib").setLevel(
        logging.ERROR
    )  # a read-only home is said by us, where it matters
    with _terminable():
        try:
            result = typer.main.get_command(app).main(
                list(sys.argv[1:] if arguments is None else arguments), prog_name="mpm", standalone_mode=False
            )
            if result == Interrupted.exit_status:  # typer makes this of a KeyboardInterrupt
                return _end(Interrupted.exit_status, "interrupted")
            return result if isinstance(result, int) else 0
        except MpmError as error:
            return _end(error.exit_status, str(error))
        except (KeyboardInterrupt, typer.Abort):
            return _end(Interrupted.exit_status, "interrupted")
        except _USAGE_ERROR as error:
            return _end(
                InputError.exit_status, f"mpm: {error.format_message()} (mpm --help lists what there is)"
            )
        except BrokenPipeError:  # the reader of our output has gone; let nothing more reach the pipe
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except Exception as error:
            said = storage_error(error) if isinstance(error, OSError) else None
            if said is None:
                _crash()
            return _end(said.exit_status, str(said))


_USAGE_ERROR: Any = typer.BadParameter.__base__


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM end the program in the same orderly way as Ctrl-C."""

    def interrupt(number: int, frame: FrameType | None) -> NoReturn:
        raise Interrupted("interrupted")

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _end(status: int, line: str) -> int:
    """Say `line` once, wait for the other ranks to fail too, and return the status."""
    if rank() == 0:
        print(printable(line), file=sys.stderr, flush=True)
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is None or not mpi.Is_initialized() or mpi.Is_finalized() or mpi.COMM_WORLD.size == 1:
        return status
    arrived = mpi.COMM_WORLD.Ibarrier()
    deadline = time.monotonic() + _PATIENCE
    while not arrived.Test():
        if time.monotonic() > deadline:  # the others are in a call that this rank will never join
            if rank() != 0:
                print(f"[rank {rank()}] {line}", file=sys.stderr, flush=True)
            mpi.COMM_WORLD.Abort(status)
        time.sleep(0.01)
    return status


def _crash() -> NoReturn:
    """A defect: show where, and take the other ranks down instead of leaving them in a call."""
    traceback.print_exc()
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None and mpi.Is_initialized() and not mpi.Is_finalized() and mpi.COMM_WORLD.size > 1:
        sys.stderr.flush()
        mpi.COMM_WORLD.Abort(1)
    raise SystemExit(1)
