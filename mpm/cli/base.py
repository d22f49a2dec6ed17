"""The application that the verbs register with, and the arguments that several of them take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpm.cli.complete import complete_case, complete_run, complete_setting
from mpm.help import HELP_NAMES, App, Verbs
from mpm.launcher import rank

app = App(
    cls=Verbs,
    context_settings=HELP_NAMES,
    help="""Moving porous media: vibrating powder reactors for atomic layer deposition.

    mpm new my.toml              a commented case to edit; mpm list: what is built in
    mpm check my.toml            what an engineer asks first about it
    mpm run my.toml              compute it, into results/my
    mpm help run                 a verb in full, with examples (or: mpm run -h)
    """,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

RunArgument = Annotated[
    Path,
    typer.Argument(
        metavar="DIR", help="the directory of a run, e.g. results/single_zone", autocompletion=complete_run
    ),
]
CaseArgument = Annotated[
    str,
    typer.Argument(
        metavar="CASE", help="a case file, or the name of a built-in case", autocompletion=complete_case
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="override a key, e.g. geometry.inlet.tma.velocity='4 cm/s'; may be given several times",
        autocompletion=complete_setting,
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
        from mpm.numerics.versions import versions
        from mpm.revision import revision

        found = {
            "revision": revision()
        } | versions()  # on every rank: it starts MPI, which waits for all of them
        if rank() == 0:
            for name, number in found.items():
                print(f"{name:<11}{number}")
    elif context.invoked_subcommand is None and rank() == 0:
        print(context.get_help())


@app.command(name="help", hidden=True)
def help_(
    context: typer.Context,
    verb: Annotated[str | None, typer.Argument(metavar="VERB", help="one of those that mpm -h lists")] = None,
) -> None:
    """Explain a verb.

    mpm help run        the same as mpm run -h
    """
    main = typer.main.get_command(app)
    main.main([verb, "--help"] if verb else ["--help"], prog_name="mpm", standalone_mode=False)
