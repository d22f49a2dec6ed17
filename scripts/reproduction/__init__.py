"""The statements R1 to R23 of the thesis (chapter 5.4.2) as rows that measure themselves: see `scripts/reproduce.py`."""

from reproduction import cycle_rows, flow_rows, outlet_rows, zone_rows
from reproduction.row import ROWS
from reproduction.store import Lab

__all__ = ["ROWS", "Lab", "cycle_rows", "flow_rows", "outlet_rows", "zone_rows"]
