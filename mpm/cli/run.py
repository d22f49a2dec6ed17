"""Verbs that compute a case: run, resume, watch."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mpm.case.settings import parse_settings
from mpm.cli.base import CaseArgument, RunArgument, SetOption, app
from mpm.errors import InputError, MpmError
from mpm.launcher import rank
from mpm.screen import screen

if TYPE_CHECKING:
    from mpm.case.case import Case

QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="no progress line and no summary")]
ReportOption = Annotated[bool, typer.Option("--no-report", help="do not write DIR/report.html at the end")]


@app.command()
def run(
    case: CaseArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="where results go (default: results/CASE)"),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="results/NAME instead; auto: results/CASE-001, -002, ..., the next that is free",
        ),
    ] = None,
    settings: SetOption = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on from the restart state in DIR")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an earlier run in DIR")] = False,
    no_report: ReportOption = False,
    quiet: QuietOption = False,
) -> None:
    """Run a case and write its results into a directory.

    mpm run single_zone                            a built-in case, into results/single_zone
    mpm run wide.toml --name auto                  your own, into results/wide-001
    mpm run wide.toml -o slow --set motion.bed_velocity='8 mm/s'
    mpirun -n 4 python -m mpm run wide.toml        on four processes

    Ctrl-C stops cleanly; mpm resume DIR goes on.
    """
    from mpm.case.case import load_case
    from mpm.output.rundirs import AUTO, directory_named, make_numbered

    if resume and (overwrite or name == AUTO):
        other = "--overwrite" if overwrite else f"--name {AUTO}"
        raise InputError.at("run", "--resume", f"{other} as well", "one of them")
    if output is not None and name is not None:
        raise InputError.at("run", "--name", "--output as well", "one of them")
    loaded = load_case(case, parse_settings(settings))
    directory = output or directory_named(Path(case).stem if name is None else name)
    if name == AUTO:
        import mpm.numerics.fem  # noqa: F401
        from mpm.parallel import on_root

        from mpi4py import MPI  # isort: skip  (after fem)

        directory = on_root(MPI.COMM_WORLD, lambda: make_numbered(Path(case).stem))
    summary = _compute(loaded, directory, resume=resume, overwrite=overwrite, quiet=quiet)
    _show(loaded, summary, directory, report=not no_report, quiet=quiet)


@app.command()
def resume(
    directory: RunArgument,
    end: Annotated[
        str | None, typer.Option(metavar="TIME", help="a later end than that of the case, e.g. '40 s'")
    ] = None,
    no_report: ReportOption = False,
    quiet: QuietOption = False,
) -> None:
    """Go on with a run that was stopped, killed or has failed, or that is to run longer.

    mpm resume results/wide                        to the end of its case
    mpm resume results/wide --end '40 s'           further

    The case is the one in DIR/case.toml; nothing else is needed.
    """
    from mpm.case.case import load_case
    from mpm.output.rundirs import require_run

    require_run(directory)
    case = load_case(directory / "case.toml", {} if end is None else {"time.end": end})
    if end is not None and case.fidelity == "steady":
        raise InputError.at("resume", "--end", repr(end), "nothing: a steady state has no end")
    summary = _compute(case, directory, resume=True, overwrite=False, quiet=quiet)
    _show(case, summary, directory, report=not no_report, quiet=quiet)


@app.command()
def watch(
    directory: RunArgument,
    once: Annotated[bool, typer.Option("--once", help="say how far it is, and leave")] = False,
) -> None:
    """Follow a run that is at work in another terminal or on another machine, to its end.

    mpm watch results/wide
    mpm watch results/wide --once                  for a script: one look

    Ctrl-C ends the watching, not the run. Exit status: that of the run (0 done, 3 failed, 130 stopped), 0 while it goes on.
    """
    from mpm.output.rundirs import require_run

    require_run(directory, "nothing to watch")
    if rank() == 0:
        from mpm.cli.watch import watch_run

        watch_run(directory, once, screen())


def _compute(case: Case, directory: Path, *, resume: bool, overwrite: bool, quiet: bool) -> dict[str, Any]:
    """Run `case` in `directory`, or go on there; returns the summary."""
    from mpm.cli.nextsteps import how_to_go_on
    from mpm.output.rundirs import can_resume
    from mpm.reactor.reactor import Reactor

    if resume and not can_resume(directory, case) and rank() == 0:
        print(f"{directory}: no restart state yet, so the run begins anew", file=sys.stderr)
    with how_to_go_on(directory):
        return (
            Reactor(case)
            .run(output=directory, resume=resume, overwrite=overwrite, progress=not quiet)
            .summary
        )


def _show(case: Case, summary: dict[str, Any], directory: Path, *, report: bool, quiet: bool) -> None:
    """Print what has come out, and write the page; a page that cannot be written is no failure of the run."""
    if rank() != 0:
        return
    from mpm.cli.nextsteps import print_end

    if not quiet:
        print_end(case, summary, directory, screen(), report)
    if report:
        from mpm.page import report as write

        try:
            page = write(directory, say=lambda line: print(line, file=sys.stderr))
        except (MpmError, OSError) as error:
            words = f"{error.filename}: {error.strerror}" if isinstance(error, OSError) else error
            print(f"no report: {words}", file=sys.stderr)
            return
        if not quiet:
            print(f"Report: {page}")
