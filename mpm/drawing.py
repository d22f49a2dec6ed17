"""What `mpm plot` draws: the standard pictures of a run, a field of choice, a movie, runs beside each other, a sweep's pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib import style

from mpm import units
from mpm.case.kinds import DEM_RUN, SWEEP_RUN, kind_of_directory
from mpm.errors import InputError
from mpm.files import file_name, write_picture
from mpm.output.results import Run, load_run
from mpm.output.vtu import Snapshot
from mpm.pictures.beside import beside_figure, same_grid
from mpm.pictures.maps import map_figure, when
from mpm.pictures.movie import KINDS, write_movie
from mpm.pictures.standard import STYLE, at_time, chosen_limits, plot_run, plots_folder, snapshot_at
from mpm.report.dosing import made_sites
from mpm.report.fieldnames import Limits, field_name

PICTURES = (".png", ".pdf", ".svg")
Say = Callable[[str], None]


@dataclass(frozen=True)
class Wish:
    """What was asked for beyond the directories. `time` [s]; `clim` in the unit of the colour bar; `output` names the file."""

    field: str | None = None
    time: float | None = None
    clim: tuple[float, float] | None = None
    streamlines: bool = False
    movie: bool = False
    output: Path | None = None

    @property
    def one_field(self) -> bool:
        """Whether a picture of a single field is meant."""
        return self.movie or self.field is not None or self.streamlines


def draw(directories: Sequence[Path], wish: Wish, say: Say) -> dict[Path, str]:
    """Draw, and return the path of each picture and what it shows; what is missing or damaged is told to `say`.

    Raises InputError for anything that cannot be drawn or does not go together.
    """
    check(directories, wish)
    if len(directories) > 1:
        return _beside([load_run(directory, say) for directory in directories], wish, say)
    (directory,) = directories
    kind = kind_of_directory(directory)
    if kind is SWEEP_RUN:
        return _sweep(directory, wish)
    if kind is DEM_RUN:
        return _particles(directory)
    if not wish.one_field:
        return plot_run(directory, say, wish.time)
    run = load_run(directory, say)
    return _movie(run, wish) if wish.movie else _field(run, wish)


def check(directories: Sequence[Path], wish: Wish) -> None:
    """Refuse options that do not go together, and an output file of another kind."""
    single = len(directories) == 1
    if wish.movie and not single:
        raise InputError.at("plot", "--movie", f"{len(directories)} directories", "one run")
    if wish.movie and wish.time is not None:
        raise InputError.at("plot", "--movie", "--time as well", "one of them: a movie shows all times")
    for option, value in (("--clim", wish.clim), ("-o", wish.output)):
        if value is not None and single and not wish.one_field:
            raise InputError.at("plot", option, "no --field", f"{option} with --field NAME, for one picture")
    kinds = KINDS if wish.movie else PICTURES
    if wish.output is not None and wish.output.suffix.lower() not in kinds:
        what = "a movie" if wish.movie else "a picture"
        raise InputError.at(
            "plot", "-o", str(wish.output), f"for {what} a name that ends in {', '.join(kinds)}"
        )


def _particles(directory: Path) -> dict[Path, str]:
    """The pictures that `mpm dem` has drawn. Raises InputError when it has not come to that."""
    found = sorted((directory / "plots").glob("*.png"))
    if not found:
        raise InputError.at(
            directory, "", "what `mpm dem` wrote, without pictures yet", "a run that has come to its end"
        )
    return {path: f"drawn by `mpm dem`: {path.stem.replace('_', ' ')}" for path in found}


def _sweep(directory: Path, wish: Wish) -> dict[Path, str]:
    """A sweep's own pictures again; its points are runs of their own."""
    if wish != Wish():
        point = directory / "points" / "POINT"
        raise InputError(
            f"{directory}: a sweep; pictures of one field are of its runs: mpm plot {point} --field NAME"
        )
    from mpm.sweep import pictures

    return pictures.draw(directory)


def _default_field(run: Run, wish: Wish) -> str:
    """The field of a picture that was asked for without one: the gas for streamlines, else what is coated, else the gas."""
    sites = made_sites(run.case)
    return "velocity" if wish.streamlines or not sites else f"theta_{sites[0]}"


def _limits(field: str, wish: Wish) -> Limits | None:
    return None if wish.clim is None else chosen_limits(field, wish.clim)


def _instant(run: Run, wish: Wish) -> tuple[Snapshot, str]:
    """The snapshot that was asked for, and in words which it is."""
    snapshot = snapshot_at(run, wish.time)
    asked = snapshot.time if wish.time is None or run.case.fidelity == "steady" else wish.time
    exact = math.isclose(snapshot.time, asked, rel_tol=1e-3)
    return snapshot, when(run, snapshot) + ("" if exact else f" (stored nearest to {asked:.4g} s)")


def _words(field: str, wish: Wish) -> str:
    return field_name(field).label + (" with streamlines" if wish.streamlines else "")


def _field(run: Run, wish: Wish) -> dict[Path, str]:
    field = wish.field or _default_field(run, wish)
    snapshot, words = _instant(run, wish)
    with style.context(STYLE):
        figure = map_figure(run, snapshot, field, _limits(field, wish), wish.streamlines)
        ending = ("_streamlines" if wish.streamlines else "") + (
            at_time(run, snapshot) if wish.time is not None else ""
        )
        path = wish.output or plots_folder(run) / f"{file_name(field + ending)}.png"
        write_picture(path, figure)
    return {path: f"{_words(field, wish)}, {words}"}


def _movie(run: Run, wish: Wish) -> dict[Path, str]:
    field = wish.field or _default_field(run, wish)
    path = wish.output or plots_folder(run) / f"{file_name(field)}.gif"
    count = write_movie(run, field, path, _limits(field, wish), wish.streamlines)
    return {
        path: f"{_words(field, wish)}, movie of {count} stored times from {run.times[0]:.4g} to {run.times[-1]:.4g} s"
    }


def _beside(runs: Sequence[Run], wish: Wish, say: Say) -> dict[Path, str]:
    field = wish.field or _default_field(runs[0], wish)
    instants = [_instant(run, wish) for run in runs]
    shown = [(run, snapshot) for run, (snapshot, _) in zip(runs, instants, strict=True)]
    names = [run.directory.path.resolve().name for run in runs]
    with style.context(STYLE):
        figure = beside_figure(shown, field, _limits(field, wish), wish.streamlines)
        path = (
            wish.output or plots_folder(runs[0]) / f"{file_name('_'.join([field, 'beside', *names[1:]]))}.png"
        )
        write_picture(path, figure)
    if len(runs) == 2 and not same_grid(runs[0].grid, runs[1].grid):
        say(f"{names[0]} and {names[1]} have different grids: no map of the difference")
    told = [f"{name} ({words})" for name, (_, words) in zip(names, instants, strict=True)]
    return {path: f"{_words(field, wish)}: {' beside '.join(told)}"}


def parse_time(text: str) -> float:
    """A time [s], as a bare number of seconds or with its unit. Raises InputError."""
    try:
        seconds = float(text)
    except ValueError:
        try:
            seconds = units.parse(text, "s")
        except ValueError as error:
            raise InputError.at(
                "plot", "--time", f"{text!r} ({error})", "a time such as 1.5 or '250 ms'"
            ) from None
    if not math.isfinite(seconds):
        raise InputError.at("plot", "--time", repr(text), "a time such as 1.5 or '250 ms'")
    return seconds


def parse_clim(text: str) -> tuple[float, float]:
    """Two numbers LO,HI that rise. Raises InputError."""
    accepted = "LO,HI: two numbers that rise, in the unit of the colour bar, such as 0,3.5"
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError.at("plot", "--clim", repr(text), accepted) from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError.at("plot", "--clim", repr(text), accepted)
    return low, high
