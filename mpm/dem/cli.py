"""`mpm dem POWDER.toml` and `mpm dem waveform DATA.csv`, a sub-command of `mpm` and also a program of its own."""

import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer

from mpm.case.kinds import DEM_RUN, kind_of_directory, what_it_is
from mpm.case.settings import parse_settings
from mpm.errors import InputError
from mpm.help import HELP_NAMES, App, Verbs
from mpm.launcher import rank
from mpm.screen import screen

from .accelerometer import fit_record, read_record
from .case import DemCase, load_case
from .idle import idle_keys


class RunByDefault(Verbs):
    """`mpm dem X ...` means `mpm dem run X ...` unless X is a command; `mpm dem` alone is its help, as `mpm` is."""

    groups: ClassVar[Mapping[str, Sequence[str]]] = {}

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in {*self.commands, "--help", "-h"}:
            args = ["run", *args]
        return super().parse_args(ctx, args or ["--help"])


app = App(
    cls=RunByDefault,
    name="dem",
    context_settings=HELP_NAMES,
    help="""Bed velocity from particle simulations.

    mpm dem demo                   simulate a powder file, the same as mpm dem run
    mpm dem waveform accelerometer.csv --unit g    a measured vibration as a section for one
    """,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.command()
def run(
    powder: Annotated[
        str,
        typer.Argument(metavar="POWDER", help="a powder file (docs/dem.md), or the name of a built-in one"),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="default: results/POWDER")
    ] = None,
    jobs: Annotated[int | None, typer.Option("-j", "--jobs", metavar="N", help="seeds at a time")] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="override a key, e.g. box.stiffness='3 N/m'"),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="go on after the last whole cycle of each seed")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an earlier run in DIR")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="no progress bar and no summary")] = False,
) -> None:
    """Simulate a vibrated powder bed; write profile.csv, summary.json, maps and pictures.

    mpm dem demo -o results/demo                   about a minute on two cores
    mpm dem demo -o results/demo --resume --set run.cycles=12

    A case reads the result: motion.profile = "results/demo/profile.csv".
    """
    if resume and overwrite:
        raise InputError("mpm dem: --resume and --overwrite exclude each other")
    case = load_case(powder, parse_settings(settings, "box.stiffness='3 N/m'"))
    case.build_waveform()  # a bad data file is bad input: say so before anything is written
    if jobs is not None and jobs < 1:
        raise InputError(f"mpm dem: --jobs: found {jobs}; accepted: a number from 1")
    directory = output or Path("results") / Path(powder).stem
    if resume and kind_of_directory(directory) is not DEM_RUN:
        raise InputError.at(directory, "", f"nothing to resume: {what_it_is(directory)}", DEM_RUN.words)
    if rank() == 0 and not quiet:
        for sentence in idle_keys(case):
            typer.echo(f"mpm dem: has no effect: {sentence}", err=True)
    _simulate(case, directory, jobs, resume=resume, overwrite=overwrite, quiet=quiet)


def _simulate(
    case: DemCase, directory: Path, jobs: int | None, *, resume: bool, overwrite: bool, quiet: bool
) -> None:
    """Run all seeds and say what has come out."""
    from .box import load_lammps

    load_lammps()
    from mpi4py import MPI

    from .run import interrupted, run_case
    from .screen import SeedsProgress, print_result, silent

    speaks = MPI.COMM_WORLD.rank == 0 and not quiet
    with SeedsProgress(case) if speaks else nullcontext(silent) as report:
        try:
            summary = run_case(
                case,
                directory,
                jobs=jobs or min(len(case.run.seeds), os.cpu_count() or 1),
                resume=resume,
                overwrite=overwrite,
                report=report,
            )
        except KeyboardInterrupt:
            raise interrupted(directory) from None
    if speaks:
        print_result(summary, directory, screen())


@app.command()
def waveform(
    data: Annotated[
        Path, typer.Argument(metavar="DATA.csv", help="columns t [s], a_y, a_z (along, vertical)")
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="default: results/DATA")
    ] = None,
    harmonics: Annotated[
        int, typer.Option("-n", "--harmonics", min=1, max=16, help="harmonics per direction")
    ] = 3,
    unit: Annotated[str, typer.Option(help="of the accelerations: m/s^2 or g")] = "m/s^2",
) -> None:
    """Fit the largest harmonics of accelerometer data; write waveform.json, waveform.toml and a plot.

    mpm dem waveform accelerometer.csv --unit g -n 5

    waveform.toml is a section for a powder file.
    """
    record = read_record(data, unit)
    fit = fit_record(record, harmonics)
    directory = output or Path("results") / data.stem
    directory.mkdir(parents=True, exist_ok=True)

    from .waveform_report import lines, write_fit

    write_fit(directory, record, fit)
    for line in lines(fit):
        typer.echo(line)
    typer.echo(f"written {directory / 'waveform.toml'} (for a powder file), waveform.json, waveform.png")
