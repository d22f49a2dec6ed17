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


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow) if name in ("travel", "headspace", "cost") else name
        for name in temperature.SECTIONS
    ],
)
def test_a_section_measures_its_table(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a run of the page no longer works, or its table has other columns and rows than the page."""
    monkeypatch.setattr(store, "KEPT", tmp_path)
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
    travel, plate = rows_of("travel"), "plate, mean of the bed, cm"
    by_model = {name: number(travel[f"`{name}`"][plate]) for name in ("parallel", "zehner_bauer_schluender")}
    warmer = [1e-3 * number(row[5]) for row in tables(section("reaction"))[0][1:]]  # K
    cvd = rows_of("headspace", 2)
    cold = rows_of("cold_inlets")["TMA at 298 K, 3.5 cm/s"]
    as_it_is = travel["`parallel`"]
    words: list[tuple[str, float, Any]] = [
        (r"\*\*([\d.]+) K in a zone", number(as_it_is["as it is: gain in a zone, K"]), 0.5),
        (r"travel \*\*([\d.]+) m\*\*", number(as_it_is["as it is: zone after zone, m"]), 0.5),
        (r"\*\*([\d.]+) cm\*\* with `parallel`", by_model["parallel"], 0.5),
        (r"\*\*([\d.]+) cm\*\* with `zehner", by_model["zehner_bauer_schluender"], 0.5),
        (r"blows ([\d.]+) times as many moles", number(cold["TMA fed"]), 0.01),
        (r"by ([\d.]+) mK in a zone of TMA", 1e3 * warmer[0], 0.05),
        (r"and ([\d.]+) mK in a cycle", 1e3 * warmer[3], 0.5),
        (r"by ([\d.]+) and [\d.]+ K with one site", warmer[2], 0.005),
        (r"by [\d.]+ and ([\d.]+) K with one site", warmer[5], 0.005),
        (
            r"CVD is (\w+) times as large",
            number(cvd["yes"]["CVD, 1e-12 mol/m³/s"]) / number(cvd["no"]["CVD, 1e-12 mol/m³/s"]),
            0.5,
        ),
    ]
    text = re.sub(r"\s+", " ", TEXT)
    for pattern, measured, within in words:
        said = re.search(pattern, text)
        assert said is not None, pattern
        value = {"four": 4.0}.get(said[1]) or float(said[1])
        assert value == pytest.approx(measured, abs=within), pattern
