"""Numbers of a run from sums and fields, and their words and units, for every screen, page and table."""
