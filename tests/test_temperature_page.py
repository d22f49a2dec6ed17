"""docs/temperature.md: its tables can be measured again, and its words tell the numbers of its tables."""

import re
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import temperature  # noqa: E402
from heat_sections import store  # noqa: E402

TEXT = (ROOT / "docs" / "temperature.md").read_text(encoding="utf-8")


def tables(text: str) -> list[list[list[str]]]:
    """Rows of the tables in Markdown, headings included, rules left out."""
    blocks = re.findall(r"(?:^\|.*\n?)+", text, re.MULTILINE)
    split = [
        [[c.strip() for c in line.strip("|\n ").split(" | ")] for line in b.splitlines()] for b in blocks
    ]
    return [[row for row in rows if set(row) != {"---"}] for rows in split]


def section(name: str) -> str:
    """What the script has written of a section."""
    begin, end = temperature.marks(name)
    return TEXT.split(begin)[1].split(end)[0]


def number(cell: str) -> float:
    """The number of the first mesh."""
    return float(cell.split(" (")[0])


@pytest.mark.parametrize("name", list(temperature.SECTIONS))
def test_a_section_measures_its_table(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a run of the page no longer works, or its table has other columns and rows than the page."""
    monkeypatch.setattr(store, "KEPT", tmp_path)
    if not tables(section(name)):
        pytest.skip("not measured yet")
    measured = tables(temperature.SECTIONS[name]((store.COARSE,)))
    shown = tables(section(name))
    assert [rows[0] for rows in measured] == [rows[0] for rows in shown]
    assert [len(rows) for rows in measured] == [len(rows) for rows in shown]
    assert all(len(row) == len(rows[0]) for rows in (*measured, *shown) for row in rows)
    assert not re.search(r"\b(nan|inf)\b", str(measured) + str(shown))


def rows_of(name: str, table: int = 0) -> dict[str, dict[str, str]]:
    """Rows of a table of the page by their first cell, each by the heading of its columns."""
    head, *rows = tables(section(name))[table]
    return {row[0]: dict(zip(head, row, strict=True)) for row in rows}


def test_the_answers_are_those_of_the_tables() -> None:
    """Fails when tables have been measured again and the words above them tell older numbers."""
    travel = rows_of("travel")
    words: list[tuple[str, float, Any]] = [
        (r"\*\*([\d.]+) K in a zone", number(travel["`parallel`"]["as it is: gain in a zone, K"]), 0.5),
        (r"travel \*\*([\d.]+) m\*\*", number(travel["`parallel`"]["as it is: zone after zone, m"]), 0.5),
        (
            r"\*\*([\d.]+) cm\*\* with\s+`parallel`",
            number(travel["`parallel`"]["plate, mean of the bed, cm"]),
            0.5,
        ),
        (
            r"\*\*([\d.]+) cm\*\* with\s+`zehner_bauer_schluender`",
            number(travel["`zehner_bauer_schluender`"]["plate, mean of the bed, cm"]),
            0.5,
        ),
    ]
    for pattern, measured, within in words:
        said = re.search(pattern, TEXT)
        assert said is not None and float(said[1]) == pytest.approx(measured, abs=within), pattern
