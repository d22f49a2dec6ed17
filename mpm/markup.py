"""Small HTML for notebooks: paragraphs, tables and lists without scripts or styles of their own.

Every text of a case goes through `escape`: names may hold any printable character.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from mpm.errors import printable
from mpm.screen import HARD_SPACE, Listing

LEFT = ' style="text-align: left"'
PART = ' style="text-align: left; padding-left: 2em; font-weight: normal"'


def text(words: str) -> str:
    """`words` for HTML, on one line."""
    return escape(" ".join(printable(part) for part in words.split(HARD_SPACE)))


def paragraph(words: str, bold: bool = False) -> str:
    inner = text(words)
    return f"<p>{f'<b>{inner}</b>' if bold else inner}</p>" if words else ""


def preformatted(lines: Iterable[str]) -> str:
    """Lines whose characters stand below each other."""
    return f"<pre>{escape(chr(10).join(lines))}</pre>"


def table(rows: Iterable[tuple[str, str]], heading: str = "") -> str:
    """Labels and values; nothing for no rows. A label that begins with a hard space is a part of the one above it."""
    lines = [
        f"<tr><th{PART if label.startswith(HARD_SPACE) else LEFT}>{text(label)}</th><td{LEFT}>{text(value)}</td></tr>"
        for label, value in rows
    ]
    if lines and heading:
        lines.insert(0, f'<tr><th colspan="2"{LEFT}>{text(heading)}</th></tr>')
    return f"<table>{''.join(lines)}</table>" if lines else ""


def columns(listing: Listing) -> str:
    """A table with a line of headings."""
    head = "".join(f"<th{LEFT}>{text(heading)}</th>" for heading in listing.headings)
    body = "".join(
        f"<tr>{''.join(f'<td{LEFT}>{text(cell)}</td>' for cell in row)}</tr>" for row in listing.rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def items(sentences: Sequence[str], heading: str) -> str:
    """A list of sentences; nothing for none."""
    if not sentences:
        return ""
    return paragraph(heading, bold=True) + f"<ul>{''.join(f'<li>{text(s)}</li>' for s in sentences)}</ul>"
