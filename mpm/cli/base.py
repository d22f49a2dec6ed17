"""The application that the verbs register with, and the arguments that several of them take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpm.launcher import rank

app = typer.Typer(
    help="Moving porous media: vibrating powder reactors for atomic layer deposition.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

RunArgument = Annotated[
    Path, typer.Argument(metavar="DIR", help="the directory of a run, e.g. results/single_zone")
]
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
