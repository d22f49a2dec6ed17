"""Write the table of reported numbers in docs/output.md from what the program reports: python scripts/number_table.py"""

from __future__ import annotations

from pathlib import Path

from mpm.report.fieldnames import superscript
from mpm.report.quantities import QUANTITIES, files_of, quantity
from mpm.report.quantity import RATIO, Quantity

OUTPUT = Path(__file__).parents[1] / "docs" / "output.md"
BEGIN = "<!-- The table is written by scripts/number_table.py. -->\n"
END = "<!-- End of the table. -->\n"


def renewed(document: str) -> str:
    """The document with the table as it is now between the two marks."""
    before, _, rest = document.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{number_table()}\n{END}{after}"


def number_table() -> str:
    """A row for each kind of number, in the order of the files."""
    rows = [_row(number) for number in QUANTITIES]
    return "\n".join(["| number | unit | meaning | in |", "|---|---|---|---|", *rows, ""])


def _files(number: Quantity) -> str:
    files = files_of(number.name)
    return files[0] if len(files) == 1 else "both"


def _row(number: Quantity) -> str:
    words = quantity(number.name)
    unit = "" if number.unit == RATIO else superscript(number.unit)
    steady = (
        f"{unit} (steady: {superscript(quantity(number.name, steady=True).unit)})" if number.rate else unit
    )
    meaning = f"{words.label}: {words.meaning}".replace("|", "\\|").replace("<", "&lt;")
    return f"| `{number.name}` | {steady} | {meaning} | {_files(number)} |"


if __name__ == "__main__":
    OUTPUT.write_text(renewed(OUTPUT.read_text(encoding="utf-8")), encoding="utf-8")
