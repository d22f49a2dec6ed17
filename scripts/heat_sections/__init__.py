"""The sections of docs/temperature.md, each of which measures its table: see `scripts/temperature.py`."""
