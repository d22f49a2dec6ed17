"""Put a table that a script has measured between its two marks in a document; the text around it is written by hand."""

from __future__ import annotations

from pathlib import Path

from mpm.files import write_atomically


def write_between(document: Path, begin: str, end: str, table: str) -> None:
    """Replace what stands between the marks `begin` and `end`. Raises ValueError when the document lacks one."""
    text = document.read_text(encoding="utf-8")
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{document}: no {end if found else begin}")
    write_atomically(document, f"{before}{begin}\n\n{table}\n\n{end}{after}")
