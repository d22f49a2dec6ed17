"""Which page belongs to which directories, and where it is written."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path

from mpm.case.kinds import SWEEP_RUN, kind_of_directory
from mpm.files import file_name
from mpm.page.compare_page import compare_html, compare_page
from mpm.page.run_page import run_html, run_page
from mpm.page.sweep_page import sweep_html, sweep_page
from mpm.page.write import write_page

log = logging.getLogger("mpm")
NAME = "report.html"


def report(
    directories: str | Path | Sequence[str | Path],
    output: str | Path | None = None,
    say: Callable[[str], None] = log.warning,
) -> Path:
    """Write the page of a run, of several runs side by side, or of a sweep; returns its path.

    By default a run's and a sweep's page is `report.html` in its directory; that of several runs stands beside the first of them. Raises
    InputError for directories of another kind and where nothing can be written; what is damaged is named to `say` and left out.
    """
    paths = [Path(directories)] if isinstance(directories, str | Path) else [Path(one) for one in directories]
    if len(paths) == 1:
        where = paths[0] / NAME if output is None else Path(output)
        if kind_of_directory(paths[0]) is SWEEP_RUN:
            return write_page(where, sweep_html(sweep_page(paths[0], say)))
        return write_page(where, run_html(run_page(paths[0], say)))
    several = compare_page(paths, say)
    beside = paths[0].resolve().parent / f"report_{'_'.join(file_name(name) for name in several.names)}.html"
    return write_page(beside if output is None else Path(output), compare_html(several))
