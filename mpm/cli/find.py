"""Verbs with which a newcomer finds what there is: list, explain, new."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpm.cli.base import app
from mpm.cli.complete import complete_case, complete_key
from mpm.launcher import rank
from mpm.screen import say, screen


@app.command("list")
def list_(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="KIND",
            help="cases, geometries, materials, gases, mechanisms, sweeps, powders, particles or runs",
        ),
    ] = None,
) -> None:
    """List what has a name (cases, materials, gases and more), and your runs.

    mpm list                 everything
    mpm list materials       one kind
    """
    from mpm.guide.catalogue import sections

    found = sections(kind)
    if rank() != 0:
        return
    console = screen()
    for place, section in enumerate(found):
        if place:
            console.print()
        say(console, f"{section.title}: {section.use}")
        column = max((len(entry.name) for entry in section.entries), default=0) + 2
        for entry in section.entries:
            say(console, f"{entry.name:<{column}}{entry.facts}", 2, column)
        if not section.entries:
            say(console, "none", 2)


@app.command()
def explain(
    key: Annotated[
        str | None,
        typer.Argument(
            metavar="KEY",
            help="a key of a case file, a table, a reported number or a field",
            autocompletion=complete_key,
        ),
    ] = None,
) -> None:
    """Say what a key of a case, or a number in the results, means.

    Its unit, default, an example, and which fidelities read it.

    mpm explain                                    the names of all
    mpm explain motion                             a table and its keys
    mpm explain geometry.inlet.tma.velocity        a key; its last part is enough: velocity
    mpm explain titration.tma.exit_mean            a number of summary.json
    mpm explain x_TMA                              a field of fields.pvd
    """
    from mpm.guide.explain import explain as explained
    from mpm.guide.explain import overview

    lines = overview() if key is None else explained(key)
    if rank() == 0:
        console = screen()
        for indent, text, hang in lines:
            say(console, text, indent, hang) if text else console.print()


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="the case file to write, e.g. mine.toml")],
    start: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="CASE",
            help="a built-in case (mpm list cases), or a case file",
            autocompletion=complete_case,
        ),
    ] = "first_case",
) -> None:
    """Write a commented case file for you to edit.

    It has every key with its meaning, unit and default.

    mpm new mine.toml                              a small first case: one precursor and a purge
    mpm new mine.toml --from single_cycle          two precursors
    """
    if rank() != 0:
        return
    from mpm.guide.newcase import write_new_case
    from mpm.screen import print_steps

    path, schema = write_new_case(file, start)
    console = screen()
    say(console, f"Written: {path}, and {schema}, with which editors complete and check it")
    steps = [
        (f"mpm check {path}", "after your changes: what the case is, and what is odd"),
        (f"mpm run {path}", f"results, into results/{path.stem}"),
        ("mpm explain KEY", "what a key means"),
        ("mpm list", "names of materials, gases, geometries"),
    ]
    print_steps(steps, console)
