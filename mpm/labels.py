"""Names of people's own making where a writer would read more into them: in pictures, in XML."""

from __future__ import annotations

from mpm.errors import printable

_QUOTE = {'"': "&quot;"}


def literal(text: str) -> str:
    """`text` as matplotlib shows it letter by letter, on one line: a dollar sign begins no formula."""
    return printable(text).replace("$", r"\$")


def xml_attribute(text: str) -> str:
    """`text` as the quoted value of an attribute, quotes included."""
    from xml.sax.saxutils import quoteattr  # which loads urllib: only where a file is written

    return quoteattr(text, _QUOTE)


def from_xml_attribute(text: str) -> str:
    """The text that `xml_attribute` has written between the quotes."""
    from xml.sax.saxutils import unescape

    return unescape(text, {entity: character for character, entity in _QUOTE.items()})
