"""Verbs about a case before it runs: check, mesh, schema."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from mpm.case.settings import parse_settings
from mpm.cli.base import CaseArgument, SetOption, app
from mpm.launcher import rank
from mpm.screen import screen


@app.command()
def mesh(
    case: CaseArgument,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE.msh", help="default: CASE.msh")
    ] = None,
    settings: SetOption = None,
) -> None:
    """Write the gmsh mesh of a case or of a shared geometry, and list its zones, ports and cells.

    mpm mesh single_zone                           writes single_zone.msh
    mpm mesh wide.toml -o fine.msh --set geometry.cell_width='1 mm'
    """
    from mpm.case.case import load_case
    from mpm.case.names import case_or_geometry

    loaded = load_case(case_or_geometry(case), parse_settings(settings))
    if rank() != 0:
        return
    from mpm.mesh.msh import write_msh
    from mpm.report.tables import print_mesh

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
    full: Annotated[
        bool,
        typer.Option("--full", help="every key of the resolved case with its unit and where it comes from"),
    ] = False,
    settings: SetOption = None,
) -> None:
    """Validate a case and print what an engineer asks first: a sketch, what is default, doses, warnings.

    mpm check single_zone
    mpm check wide.toml --set motion.gamma=0.4
    mpm check wide.toml --full                     every key with its unit and where its value comes from
    mpm check wide.toml --json                     for a program
    """
    from mpm.advice.checks import check_case
    from mpm.case.case import load_case

    loaded = load_case(case, parse_settings(settings))
    report = check_case(loaded)
    if rank() != 0:
        return
    if as_json:
        import json

        print(json.dumps({**report, "case": loaded.to_dict()}, indent=2, allow_nan=False))
        return
    from mpm.advice.screen import print_report
    from mpm.case.marks import print_full
    from mpm.screen import print_steps

    if full:
        print_full(loaded, screen())
        return
    print_report(loaded, report, screen())
    options = [part for setting in settings or [] for part in ("--set", setting)]
    screen().print()
    print_steps([(shlex.join(["mpm", "run", case, *options]), "results/, with a report")], screen())


@app.command()
def schema(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help="case (default), sweep, powder or mechanism")
    ] = "case",
) -> None:
    """Print the JSON Schema of case files, or of others, for editors.

    mpm schema > mpm-case.schema.json              complete and check cases: "#:schema ./mpm-case.schema.json" on top of one
    mpm schema sweep > mpm-sweep.schema.json       the same for sweep files
    """
    import json

    made = _schema(kind)
    if rank() == 0:
        print(json.dumps(made, indent=2))


def _schema(kind: str) -> dict[str, Any]:
    if kind == "case":
        from mpm.case import case

        return case.case_schema()
    if kind == "sweep":
        from mpm.sweep.schema import sweep_schema

        return sweep_schema()
    if kind == "powder":
        from mpm.dem.case import powder_schema

        return powder_schema()
    if kind == "mechanism":
        from mpm.case.chemistry import mechanism_schema

        return mechanism_schema()
    from mpm.errors import InputError

    kinds = ("case", "sweep", "powder", "mechanism")
    raise InputError.at("mpm schema", "", repr(kind), ", ".join(kinds), given=kind, known=kinds)
