"""A field of a run over all stored times, as GIF (any installation can write one) or MP4 (through ffmpeg)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib import animation, style
from rich.progress import track

from mpm.errors import InputError
from mpm.files import replacing
from mpm.output.results import Run
from mpm.pictures.maps import Map, limits_of
from mpm.pictures.standard import STYLE, Fields
from mpm.report.fieldnames import Limits
from mpm.screen import screen

SECONDS = 8.0
"""How long a movie is to last, if that gives a rate between those below."""
SLOWEST, FASTEST = 2, 12
"""Pictures per second."""
DPI = 110
KINDS = (".gif", ".mp4")


def write_movie(
    run: Run, name: str, path: Path, limits: Limits | None = None, streamlines: bool = False
) -> int:
    """Write the field `name` at all stored times, on one colour scale that holds them all; returns how many times there are.

    Raises InputError for a run with fewer than two stored times that can be read, an unknown field, and MP4 without ffmpeg.
    """
    if path.suffix == ".mp4" and not animation.FFMpegWriter.isAvailable():
        raise InputError(
            f"{path}: MP4 needs ffmpeg, which is not installed here; a GIF needs nothing more: -o {path.stem}.gif"
        )
    fields = Fields(run)
    indices = range(len(run.times))
    limits = limits or limits_of(run, fields.at(indices), name)
    readable = [index for index in indices if index not in fields.lost]
    if len(readable) < 2:
        raise InputError.at(
            run.directory.path,
            "--movie",
            f"{len(readable)} stored times that can be read",
            "a run with at least two",
        )
    with style.context(STYLE), replacing(path, f".tmp{path.suffix}") as temporary:
        _film(Map(run, name, limits, streamlines), fields, readable, temporary)
    return len(readable)


def _film(film: Map, fields: Fields, indices: Sequence[int], path: Path) -> None:
    """The pictures one after the other; the layout is that of the first, so that nothing jumps."""
    rate = min(max(round(len(indices) / SECONDS), SLOWEST), FASTEST)
    writer = animation.FFMpegWriter(fps=rate) if path.suffix == ".mp4" else animation.PillowWriter(fps=rate)
    figure = film.show(next(iter(fields.at(indices[:1]))))
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    console = screen(stderr=True)
    with writer.saving(figure, str(path), DPI):
        for snapshot in track(
            fields.at(indices),
            "movie",
            len(indices),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        ):
            film.show(snapshot)
            writer.grab_frame()
