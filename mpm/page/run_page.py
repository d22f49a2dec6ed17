"""What the page of one run shows, gathered from the files in its directory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpm.advice.checks import check_case
from mpm.advice.sheet import case_sheet
from mpm.case.keys import values
from mpm.case.marks import MARKS, Marked
from mpm.output.following import look
from mpm.output.results import Run, load_run
from mpm.page.curves import Chart, curves
from mpm.page.numbers import Account, Row, accounts, errors, groups
from mpm.page.strip import Drawing, drawing
from mpm.page.viewer import BUDGET, viewer
from mpm.page.write import render
from mpm.report.verdict import verdict
from mpm.screen import HARD_SPACE, Listing, entry


@dataclass(frozen=True, kw_only=True)
class Input:
    """A value of the case; `origin` is empty where the run does not say."""

    key: str
    text: str
    meaning: str
    origin: str


@dataclass(frozen=True, eq=False)
class RunPage:
    """One run, ready for the template."""

    run: Run
    name: str
    verdict: str
    warnings: list[str]
    notes: list[str]
    idle: list[str]
    asked: list[tuple[str, list[tuple[str, str]]]]
    strip: Drawing
    groups: list[tuple[str, list[Row]]]
    accounts: list[Account]
    errors: list[Row]
    charts: list[Chart]
    viewer: dict[str, Any] | None
    reproduce: dict[str, Any]
    inputs: list[tuple[str, list[Input]]]

    @property
    def about(self) -> str:
        """The kind of model, and how far it went."""
        seconds = self.run.summary.get("simulated_seconds")
        return f"{self.run.case.fidelity} model" + (f", {seconds:.4g} s" if seconds else "")

    @property
    def note(self) -> str:
        """What the reader must know about the pictures."""
        if self.viewer is None:
            return ""
        parts = ["The colour range is that of all times. Drag in a map to zoom in, double click to go back."]
        if self.viewer["every"] > 1:
            parts.append(f"Of the stored times one in {self.viewer['every']} is here.")
        if self.viewer["joined"] > 1:
            parts.append(f"{self.viewer['joined']} x {self.viewer['joined']} cells are joined to one here.")
        return " ".join([*parts, "All of it is in fields.pvd, for ParaView."])


def run_page(
    directory: str | Path, say: Callable[[str], None] = lambda text: None, budget: int = BUDGET
) -> RunPage:
    """Read a run's directory. Raises InputError when it is not one; what is damaged is named to `say` and left out.

    The maps take `budget` bytes at most, and most of the time; with 0 they are left out.
    """
    run = load_run(directory, say)
    report = check_case(run.case)
    return RunPage(
        run=run,
        name=run.directory.path.resolve().name,
        verdict=verdict(run.case, run.summary) if run.summary else unfinished(run),
        warnings=list(report["warnings"]),
        notes=list(report["notes"]),
        idle=list(report["without_effect"]),
        asked=asked(run, report),
        strip=drawing(run.case),
        groups=groups(run.summary),
        accounts=accounts(run.summary),
        errors=errors(run.summary),
        charts=[*curves(run, say), *_warmth(run)],
        viewer=viewer(run, budget, say=say) if budget else None,
        reproduce=reproduce(run),
        inputs=inputs(run),
    )


def _warmth(run: Run) -> list[Chart]:
    """The curves of temperature, whose module loads matplotlib, of runs that have one."""
    if run.case.energy is None:
        return []
    from mpm.page.warmth import warmth

    return warmth(run)


TITLES = (
    ("Model and time", ("title", "fidelity", "conventions", "time.", "output.", "transport.", "porous.")),
    ("Geometry", ("geometry.",)),
    ("Motion", ("motion.",)),
    ("Materials", ("material.",)),
    ("Gas", ("gas.",)),
    ("Temperature", ("energy.",)),
    ("Chemistry", ("chemistry.",)),
)
"""Headings of the case's values, and the keys below them."""


def unfinished(run: Run) -> str:
    """What is known of a run without a summary: the last line of its log."""
    return f"This run has not reported its numbers yet. The last line of its log: {look(run.directory.path).line}."


def inputs(run: Run) -> list[tuple[str, list[Input]]]:
    """Every value of the case under a heading, with its meaning and where it came from when the run was started."""
    found = [
        Input(key=v.name, text=v.text, meaning=v.key.description, origin=run.origins.get(v.name, ""))
        for v in values(run.case)
    ]
    groups = [(title, [one for one in found if one.key.startswith(keys)]) for title, keys in TITLES]
    told = {one.key for _, rows in groups for one in rows}
    rest = [one for one in found if one.key not in told]
    return [(title, rows) for title, rows in (*groups, ("Other", rest)) if rows]


def asked(run: Run, report: dict[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """The groups of `mpm check`: the case and what an engineer asks first, rows of label and value."""
    groups = []
    for heading, rows in case_sheet(run.case, report, Marked(run.case, run.origins)).groups:
        lines: list[tuple[str, str]] = []
        for row in rows:
            if isinstance(row, Listing):
                lines += [(name, _pairs(row.headings[1:], cells)) for name, *cells in row.rows]
            else:
                lines.append((_spaced(row[0]), _spaced(row[1])))
        if lines:
            groups.append((heading, lines))
    return groups


def _pairs(headings: Sequence[str], cells: Sequence[str]) -> str:
    return _spaced(
        ", ".join(entry(heading, cell) for heading, cell in zip(headings, cells, strict=False) if cell)
    )


def _spaced(text: str) -> str:
    """As a browser breaks it: a screen keeps numbers and their units together with a space of its own."""
    return text.replace(HARD_SPACE, "\u00a0")


def reproduce(run: Run) -> dict[str, Any]:
    """What somebody needs to get the same numbers."""
    ranks = run.summary.get("ranks", 1)
    command = "mpm run case.toml -o again"
    return {
        "command": command if ranks == 1 else f"mpirun -n {ranks} python -m {command}",
        "case": (run.directory.path / "case.toml").read_text(encoding="utf-8"),
        "versions": run.summary.get("versions", {}),
        "revision": run.summary.get("revision", ""),
    }


def run_html(page: RunPage) -> str:
    """The page of one run as a file."""
    data = {
        "charts": {str(index): chart for index, chart in enumerate(page.charts)},
        "viewers": {"viewer": page.viewer} if page.viewer else {},
    }
    return render("run.html", page.run.case.title or page.name, data, page=page, marks=MARKS)
