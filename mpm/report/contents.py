"""What stands in summary.json and in a row of history.csv: a walk over the table of reported numbers (`mpm.report.quantities`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mpm.report.quantities import SECTIONS, quantity
from mpm.report.quantity import Section
from mpm.report.records import Records
from mpm.report.trees import nest, numbers


def summary_of(records: Records) -> dict[str, Any]:
    """The whole of summary.json, nested tables; sections that have nothing to tell are left out."""
    tree: dict[str, Any] = {}
    for section in SECTIONS:
        if section.summary:
            tree |= _placed(section, _at_the_end(section, records))
    return {key: value for key, value in tree.items() if value != {}}


def row_of(records: Records) -> dict[str, float]:
    """One row of history.csv, flat dotted names."""
    tree: dict[str, Any] = {}
    for section in SECTIONS:
        if section.history:
            tree |= _placed(section, section.gives(records))
    return {name: value for name, value in numbers(tree) if not quantity(name).profile}


def _placed(section: Section, numbers: Mapping[str, Any]) -> dict[str, Any]:
    return {section.name: numbers} if section.name else dict(numbers)


def _at_the_end(section: Section, records: Records) -> Mapping[str, Any]:
    """What a section tells of a run that has ended: of what passes between two outputs the last row of the history."""
    if not section.since_output or not records.latest:
        return section.gives(records)
    last = {name: value for name, value in records.latest.items() if name.startswith(f"{section.name}.")}
    found: Mapping[str, Any] = nest(last).get(section.name, {})
    return found
