"""The verb about reactions: mechanism."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from mpm.case.settings import parse_settings
from mpm.cli.base import SetOption, app
from mpm.cli.complete import complete_mechanism
from mpm.launcher import rank
from mpm.screen import screen


@app.command()
def mechanism(
    source: Annotated[
        str,
        typer.Argument(
            metavar="CASE|FILE",
            help="a case, a built-in mechanism, a mechanism file (TOML), or a file of Cantera (YAML)",
            autocompletion=complete_mechanism,
        ),
    ],
    temperature: Annotated[
        str | None,
        typer.Option(
            "--temperature",
            metavar="T",
            help="e.g. '473 K' or '150 degC'; default: gas.temperature of the case",
        ),
    ] = None,
    phase: Annotated[
        str | None, typer.Option("--phase", metavar="NAME", help="the surface phase of a file of Cantera")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object with SI numbers")] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE.toml", help="write it as a mechanism file of mpm, instead"
        ),
    ] = None,
    settings: SetOption = None,
) -> None:
    """Print the species, sites and reactions of a mechanism, with all constants at a temperature.

    Rate constants are per area, with coverages as shares, and per site, as Chemkin and Cantera mean them. Of a case it also says what
    saturation takes.

    mpm mechanism alumina                          one that is built in
    mpm mechanism single_cycle --temperature '150 degC'
    mpm mechanism mine.toml --json                 for a program
    mpm mechanism ptcombust.yaml --phase Pt_surf -o pt.toml
    """
    from mpm.guide.mechanism import case_with, mechanism_sheet, write_mechanism
    from mpm.plain import plain
    from mpm.report.chemistry import mechanism_report

    case = case_with(source, parse_settings(settings), phase, temperature)
    report = plain(mechanism_report(case))
    if rank() != 0:
        return
    if output is not None:
        write_mechanism(case, output)
        print(f"Mechanism: {output}")
        return
    if as_json:
        print(json.dumps(report, indent=2, allow_nan=False))
        return
    mechanism_sheet(report).print(screen())
