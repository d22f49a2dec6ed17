"""What `mpm.check`, `mpm.plot` and the `plot` of a run give to a session: objects that print as the verbs do and show in notebooks."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from mpm import notebook
from mpm.case import Case, load_case
from mpm.checks import check_case
from mpm.errors import InputError
from mpm.screen import Listing, screen

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mpm.results import Run

PAGE = 80
"""Columns of a report where there is no terminal to go by."""
FIRST_OF = {"theta": "the coverage", "x": "the mole fraction", "C": "the concentration"}
"""Kinds of field that stand for the first of their kind."""


class Check(Mapping[str, Any]):
    """What `mpm check` finds of a case: a mapping of its numbers (as `--json` has them), readable when it is printed."""

    def __init__(self, case: Case):
        self.case = case
        self.numbers = check_case(case)

    def __getitem__(self, key: str) -> Any:
        return self.numbers[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    def __repr__(self) -> str:
        from mpm.checkscreen import print_report

        terminal, page = screen(), io.StringIO()
        width = terminal.width if terminal.is_terminal else PAGE
        plain: dict[str, Any] = {"force_terminal": False, "force_jupyter": False, "color_system": None}
        console = Console(file=page, width=width, markup=False, emoji=False, highlight=False, **plain)
        print_report(self.case, self.numbers, console)
        return page.getvalue().rstrip()

    def _repr_html_(self) -> str:
        from mpm.checkscreen import case_sheet
        from mpm.marks import Marked
        from mpm.sketch import sketch

        parts = [notebook.paragraph(self.case.title or "case", bold=True)]
        parts.append(f"<pre>{notebook.escape(chr(10).join(sketch(self.case, PAGE)))}</pre>")
        for heading, rows in case_sheet(self.case, self.numbers, Marked(self.case)).groups:
            pairs = [row for row in rows if not isinstance(row, Listing)]
            parts.append(notebook.table(pairs, heading))
            parts += [notebook.columns(row) for row in rows if isinstance(row, Listing)]
        for key, heading in (
            ("notes", "To know"),
            ("without_effect", "Without effect in this case"),
            ("warnings", "Warnings"),
        ):
            parts.append(notebook.items(self.numbers.get(key, []), heading))
        return "".join(parts)


def check(case: Case | str | Path | Mapping[str, Any], overrides: Mapping[str, Any] | None = None) -> Check:
    """What an engineer asks first about a case, a file, a built-in name or tables. Raises InputError as `load_case` does."""
    if isinstance(case, Case):
        return Check(case.with_(overrides) if overrides else case)
    return Check(load_case(case, overrides))


class Pictures(Mapping[Path, str]):
    """Paths of pictures and what each shows; a notebook shows the pictures."""

    def __init__(self, drawn: Mapping[Path, str]):
        self.drawn = dict(drawn)

    def __getitem__(self, key: Path) -> str:
        return self.drawn[key]

    def __iter__(self) -> Iterator[Path]:
        return iter(self.drawn)

    def __len__(self) -> int:
        return len(self.drawn)

    def __repr__(self) -> str:
        return "\n".join(f"{path}: {words}" for path, words in self.drawn.items()) or "no pictures"

    def _repr_html_(self) -> str:
        return "".join(notebook.paragraph(words) + _picture(path) for path, words in self.drawn.items())


_KINDS = {".png": "image/png", ".gif": "image/gif", ".svg": "image/svg+xml"}


def _picture(path: Path) -> str:
    """The picture itself, in the page; of other kinds (a film) the name."""
    kind = _KINDS.get(path.suffix.lower())
    if kind is None or not path.exists():
        return notebook.paragraph(str(path))
    content = base64.b64encode(path.read_bytes()).decode()
    return (
        f'<img src="data:{kind};base64,{content}" alt="{notebook.text(path.name)}" style="max-width: 100%"/>'
    )


def plot(
    *directories: str | Path,
    field: str | None = None,
    time: float | str | None = None,
    clim: tuple[float, float] | None = None,
    streamlines: bool = False,
    movie: bool = False,
    output: str | Path | None = None,
) -> Pictures:
    """What `mpm plot` does, with its options: draw a run into its plots/, runs beside each other, or a sweep. `time` in s or with a unit.

    Raises InputError for anything that cannot be drawn.
    """
    from mpm.drawing import Wish, draw, parse_time

    if not directories:
        raise InputError.at("plot", "", "no directory", "one of a run or a sweep, or several of runs")
    wish = Wish(
        field=field,
        time=None if time is None else parse_time(str(time)),
        clim=clim,
        streamlines=streamlines,
        movie=movie,
        output=None if output is None else Path(output),
    )
    return Pictures(draw([Path(directory) for directory in directories], wish, warnings.warn))


def figure_of(run: Run, name: str | None, **options: Any) -> Figure:
    """A picture of a run by name: a field (`options` as for `draw_field`), a standard picture of `mpm plot`, or a column of the history.

    `theta`, `x` and `C` alone are the first coverage that is made, the first precursor's mole fraction and concentration; a species or a
    site alone is its mole fraction or coverage. Raises InputError for another name, with the nearest.
    """
    from matplotlib import style

    from mpm.fieldnames import drawable
    from mpm.pictures import STYLE, Fields, draw_field, pictures

    name = field_called(run, name)
    fields = drawable(run.snapshot().cell_data) if run.times else []
    if name in fields:
        return showable(draw_field(run, name, **options))
    standard = {picture.name: picture for picture in pictures(run, Fields(run), lambda line: None)}
    columns = [column for column in run.history if column != "time"]
    if name not in (*standard, *columns):
        accepted = (
            f"a field ({', '.join(fields)}), a picture ({', '.join(standard)}), or a column of history.csv"
        )
        known = [*fields, *standard, *columns]
        raise InputError.at(run.directory.path, "plot", repr(name), accepted, known=known, given=name)
    if options:
        raise InputError.at(None, "plot", f"{', '.join(options)} with {name}", "options with a field alone")
    if name in columns:
        return showable(_curve(run, name))
    with style.context(STYLE):
        return showable(standard[name].draw())


def field_called(run: Run, name: str | None) -> str:
    """The full name of what is meant."""
    from mpm.results import fed_species, made_sites

    sites, species = made_sites(run.case), fed_species(run.case)
    if name is None:
        return f"theta_{sites[0]}" if sites else "velocity"
    if name in FIRST_OF:
        firsts = sites if name == "theta" else species
        if not firsts:
            raise InputError.at(
                None,
                "plot",
                repr(name),
                f"the name of a field: no inlet feeds anything that makes {FIRST_OF[name]}",
            )
        return f"{name}_{firsts[0]}"
    if name in run.case.mechanism.site_names:
        return f"theta_{name}"
    if name in (*run.case.mechanism.species_names, run.case.gas.carrier):
        return f"x_{name}"
    return {"speed": "velocity", "cvd": "cvd_rate"}.get(name, name)


def _curve(run: Run, name: str) -> Figure:
    """A number of the history over time."""
    from matplotlib import style
    from matplotlib.figure import Figure

    from mpm.fieldnames import superscript
    from mpm.labels import literal
    from mpm.maps import name_of
    from mpm.pictures import STYLE
    from mpm.quantities import quantity

    meant = quantity(name)
    with style.context(STYLE):
        figure = Figure(figsize=(7.0, 3.2), layout="constrained")
        axes = figure.subplots()
        axes.plot(run.history["time"], run.history[name] / meant.factor)
        axes.set(xlabel="time [s]", ylabel=f"[{superscript(meant.unit_shown)}]" if meant.unit_shown else "")
        axes.set_title(literal(meant.label), fontsize=9)
        axes.grid(alpha=0.25)
        figure.suptitle(name_of(run), fontsize=10)
    return figure


def showable(figure: Figure) -> Figure:
    """`figure`, which a notebook shows also where nobody has loaded pyplot."""
    setattr(figure, "_repr_png_", partial(_png, figure))  # noqa: B010 (matplotlib has no such name)
    return figure


def _png(figure: Figure) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=100)
    return content.getvalue()
