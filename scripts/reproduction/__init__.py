"""The statements R1 to R23 of the thesis (chapter 5.4.2) as rows that measure themselves: see `scripts/reproduce.py`."""

from reproduction import cycle_rows, flow_rows, outlet_rows, vibration_rows, zone_rows
from reproduction.row import ROWS as _FOUND
from reproduction.store import Lab

ROWS = {name: _FOUND[name] for name in sorted(_FOUND, key=lambda name: int(name[1:]))}

__all__ = ["ROWS", "Lab", "cycle_rows", "flow_rows", "outlet_rows", "vibration_rows", "zone_rows"]
