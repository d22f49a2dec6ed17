"""The directory of a run: writing, reading back, tables and fields."""
