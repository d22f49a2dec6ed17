"""Bed velocity over one cycle as a table: the CSV file that `mpm dem` writes and `motion.profile` names.

Header `phase_deg,u_x_m/s,u_y_m/s,contact`: phase of the vibration [deg], velocity of the bed in the frame of the
laboratory [m/s], share of the time in contact. The first two columns are required; lines that start with # are
comments.
"""

from __future__ import annotations

import csv
import math
from itertools import pairwise
from pathlib import Path

from mpm.units import reject

REQUIRED = ("phase_deg", "u_x_m/s")
COLUMNS = (*REQUIRED, "u_y_m/s", "contact")


def check_profile(path: Path, key: str) -> None:
    """Check that a profile can be used; raises the validator error for `key` that says what is wrong with it."""

    def wrong(found: str, accepted: str, **context: object) -> Exception:
        return reject(f"{path}: {found}", accepted, key=key, **context)

    try:
        lines = [
            line for line in path.read_text(encoding="utf-8").splitlines() if line.strip() and line[0] != "#"
        ]
    except FileNotFoundError:
        raise wrong(
            "no such file",
            "thesis, phases, or a CSV file from mpm dem",
            given=path.name,
            known=["thesis", "phases"],
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise wrong(f"unreadable ({error})", "a CSV file from mpm dem") from None
    rows = list(csv.reader(lines))
    header = [name.strip() for name in rows[0]] if rows else []
    if not set(REQUIRED) <= set(header):
        raise wrong(f"columns {', '.join(header) or 'none'}", f"columns {', '.join(COLUMNS)}")
    phases = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            values = [float(text) for text in row]
        except ValueError:
            values = []
        if len(values) != len(header) or not all(math.isfinite(value) for value in values):
            raise wrong(f"row {number} is {','.join(row)}", f"{len(header)} finite numbers in every row")
        phases.append(values[header.index("phase_deg")])
    if len(phases) < 4:
        raise wrong(f"{len(phases)} rows", "at least 4 rows")
    rising = all(a < b for a, b in pairwise(phases))
    if not rising or phases[0] < 0.0 or phases[-1] > 360.0:
        raise wrong("phases that do not rise from 0 to 360", "phase_deg that rises within 0 to 360 deg")
