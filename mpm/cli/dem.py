"""The verb dem, which has verbs of its own (mpm.dem.cli)."""

from __future__ import annotations

import typer

from mpm.cli.base import app


@app.command(
    add_help_option=False, context_settings={"allow_extra_args": True, "ignore_unknown_options": True}
)
def dem(context: typer.Context) -> None:
    """Simulate a vibrated powder bed with particles, for the motion of a case.

    mpm dem -h                                     its verbs
    """
    from mpm.dem.cli import app as dem_app

    status = typer.main.get_command(dem_app).main(context.args, prog_name="mpm dem", standalone_mode=False)
    raise typer.Exit(status if isinstance(status, int) else 0)
