"""Names of people's own making where a writer would read more into them: in pictures, in XML."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

from mpm.errors import printable


def literal(text: str) -> str:
    """`text` as matplotlib shows it letter by letter, on one line: a dollar sign begins no formula."""
    return printable(text).replace("$", r"\$")


def xml_attribute(text: str) -> str:
    """`text` as the quoted value of an attribute, quotes included."""
    return quoteattr(text, {'"': "&quot;"})
