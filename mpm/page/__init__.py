"""The report page: one self-contained HTML file for a run, for several runs side by side, and for a sweep."""

from mpm.page.report import report as report

__all__ = ["report"]
