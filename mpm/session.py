"""What a Python session uses: `mpm.check`, `mpm.plot`, `mpm.load_run`. Objects print as the verbs do and show themselves in notebooks."""

from __future__ import annotations

import base64
import io
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields as fields_of
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpm.advice.checks import check_case
from mpm.advice.sheet import case_sheet
from mpm.advice.sketch import PAGE, sketch
from mpm.case.case import Case, load_case
from mpm.case.marks import Marked
from mpm.errors import InputError
from mpm.markup import columns, items, paragraph, preformatted, table, text
from mpm.output import results
from mpm.screen import Listing, screen

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        from rich.console import Console

        from mpm.advice.screen import print_report

        terminal, page = screen(), io.StringIO()
        width = terminal.width if terminal.is_terminal else PAGE
        plain: dict[str, Any] = {"force_terminal": False, "force_jupyter": False, "color_system": None}
        console = Console(file=page, width=width, markup=False, emoji=False, highlight=False, **plain)
        print_report(self.case, self.numbers, console)
        return page.getvalue().rstrip()

    def _repr_html_(self) -> str:
        parts = [paragraph(self.case.title or "case", bold=True), preformatted(sketch(self.case, PAGE))]
        for heading, rows in case_sheet(self.case, self.numbers, Marked(self.case)).groups:
            pairs = [row for row in rows if not isinstance(row, Listing)]
            parts.append(table(pairs, heading))
            parts += [columns(row) for row in rows if isinstance(row, Listing)]
        for key, heading in (
            ("notes", "To know"),
            ("without_effect", "Without effect in this case"),
            ("warnings", "Warnings"),
        ):
            parts.append(items(self.numbers.get(key, []), heading))
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
        return "".join(paragraph(words) + _picture(path) for path, words in self.drawn.items())


_KINDS = {".png": "image/png", ".gif": "image/gif", ".svg": "image/svg+xml"}


def _picture(path: Path) -> str:
    """The picture itself, in the page; of other kinds (a film) the name."""
    kind = _KINDS.get(path.suffix.lower())
    if kind is None or not path.exists():
        return paragraph(str(path))
    content = base64.b64encode(path.read_bytes()).decode()
    return f'<img src="data:{kind};base64,{content}" alt="{text(path.name)}" style="max-width: 100%"/>'


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


class Run(results.Run):
    """A run read back from its directory, which draws, reports and shows itself."""

    def plot(self, name: str | None = None, **options: Any) -> Figure:
        """A picture: of a field at the last stored time or the one nearest to `time` [s] (with `clim`, `streamlines` as `mpm plot` has
        them), by default the coverage; one of the standard pictures (`history`, `outlets`, ...); or a number of the history over time.

        `theta`, `x`, `C` alone are those of the first dosing inlet. Raises InputError for another name, with the nearest.
        """
        from mpm.pictures.figures import figure_of

        return figure_of(self, name, **options)

    def report(self, output: str | Path | None = None) -> Path:
        """Write one page with everything about this run (`mpm report`), by default its `report.html`; returns its path."""
        from mpm.page import report

        return report(self.directory.path, output)

    def __repr__(self) -> str:
        from mpm.report.verdict import verdict

        said = verdict(self.case, self.summary) if self.summary else "not ended yet"
        return f"Run {self.directory.path}: {said}"

    def _repr_html_(self) -> str:
        from mpm.report.notebook import result_html

        return result_html(self.case, self.summary, str(self.directory.path))


def load_run(directory: str | Path, say: Callable[[str], None] | None = None) -> Run:
    """Read a run's directory. Raises InputError when it is not one, or a file in it is damaged.

    With `say`, a damaged file that the rest can do without is named to it and counts as missing.
    """
    found = results.load_run(directory, say)
    return Run(**{field.name: getattr(found, field.name) for field in fields_of(found)})
