"""Verbs that compute a case: run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpm.cli.base import CaseArgument, SetOption, app
from mpm.errors import InputError
from mpm.launcher import rank
from mpm.screen import screen
from mpm.settings import parse_settings


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

    from mpm.nextsteps import how_to_go_on, print_end
    from mpm.reactor import Reactor

    with how_to_go_on(directory):
        result = Reactor(loaded).run(output=directory, resume=resume, overwrite=overwrite, progress=not quiet)
    if rank() == 0 and not quiet:
        print_end(loaded, result.summary, directory, screen())
