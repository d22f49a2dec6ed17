"""Bed velocity over one cycle as a table: the CSV file that `mpm dem` writes and `motion.profile` names.

Header `phase_deg,u_x_m/s,u_y_m/s,contact`: phase of the vibration [deg, 0 where the reactor passes its mean position upwards], velocity
of the bed in the frame of the laboratory [m/s], share of the time in contact. The first two columns are required; lines that start with
# are comments. One of them may say under which vibration the table was made, as `mpm dem` writes it:

    # conditions = { frequency = "16 Hz", gamma = 0.3, angle = "60 deg", waveform = "sine" }

with `gamma` the largest vertical acceleration over g and `angle` that of the displacement from the horizontal. A table without it can be
used with any vibration; nothing can then tell whether they belong together.
"""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from mpm.case.model import Frozen
from mpm.constants import TURN
from mpm.files import read_text
from mpm.units import Angle, Frequency, NonNegative, reject

PRESETS = ("thesis", "phases", "force_balance")
"""What `motion.profile` may be besides the path of a file."""
REQUIRED = ("phase_deg", "u_x_m/s")
COLUMNS = (*REQUIRED, "u_y_m/s", "contact")


class Conditions(Frozen):
    """The vibration that a profile belongs to: `frequency` [Hz], `gamma`, `angle` [rad from the horizontal], kind of `waveform`."""

    frequency: Frequency
    gamma: NonNegative
    angle: Angle
    waveform: str = "sine"

    def line(self) -> str:
        """The comment of a profile that `read_profile` understands, without its #."""
        return (
            f'conditions = {{ frequency = "{self.frequency:.9g} Hz", gamma = {self.gamma:.9g}, '
            f'angle = "{math.degrees(self.angle):.9g} deg", waveform = "{self.waveform}" }}'
        )


@dataclass(frozen=True)
class BedProfile:
    """Velocity u_x [m/s] of the bed in the lab's frame over one cycle, linear between phases [rad] that rise from 0 to 2 pi.

    The last point repeats the first one turn later. `conditions`: the vibration it was made under, if the file says so. `text`: the file.
    """

    phase: tuple[float, ...]
    velocity: tuple[float, ...]
    conditions: Conditions | None
    text: str

    @property
    def mean(self) -> float:
        """Cycle mean of u_x [m/s]: the trapezoidal rule, exact for the broken line."""
        u, phase = np.array(self.velocity), np.array(self.phase)
        return float((0.5 * np.diff(phase) * (u[1:] + u[:-1])).sum() / TURN)


def read_profile(path: Path) -> BedProfile:
    """Read and check a profile; raises the validator error for the key `profile` that says what is wrong with the file."""

    def wrong(found: str, accepted: str, **context: object) -> Exception:
        return reject(f"{path}: {found}", accepted, key="profile", **context)

    try:
        text = read_text(path)
    except FileNotFoundError:
        raise wrong(
            "no such file",
            f"{', '.join(PRESETS)}, or a CSV file from mpm dem",
            given=path.name,
            known=PRESETS,
        ) from None
    except (OSError, ValueError) as error:
        raise wrong(f"unreadable ({error})", "a CSV file from mpm dem") from None
    lines = [line for line in text.splitlines() if line.strip()]
    rows = list(csv.reader(line for line in lines if line[0] != "#"))
    header = [name.strip() for name in rows[0]] if rows else []
    if not set(REQUIRED) <= set(header):
        raise wrong(f"columns {', '.join(header) or 'none'}", f"columns {', '.join(COLUMNS)}")
    table = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            values = [float(cell) for cell in row]
        except ValueError:
            values = []
        if len(values) != len(header) or not all(math.isfinite(value) for value in values):
            raise wrong(f"row {number} is {','.join(row)}", f"{len(header)} finite numbers in every row")
        table.append(values)
    if len(table) < 4:
        raise wrong(f"{len(table)} rows", "at least 4 rows")
    phases, velocities = ([row[header.index(name)] for row in table] for name in REQUIRED)
    rising = all(a < b for a, b in pairwise(phases))
    if not rising or phases[0] < 0.0 or phases[-1] > 360.0:
        raise wrong("phases that do not rise from 0 to 360", "phase_deg that rises within 0 to 360 deg")
    conditions = _conditions([line for line in lines if line[0] == "#"], wrong)
    return BedProfile(*_closed(phases, velocities), conditions, text)


def _closed(
    phases: Sequence[float], velocities: Sequence[float]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Phases [deg] as [rad] from 0 to 2 pi with their velocities, so that linear interpolation closes the cycle."""
    phase, velocity = np.radians(phases), np.array(velocities)
    inside = phase < TURN * (1.0 - 1e-12)
    phase, velocity = phase[inside], velocity[inside]
    at_zero = float(np.interp(0.0, [phase[-1] - TURN, phase[0]], [velocity[-1], velocity[0]]))
    if phase[0] > 0.0:
        phase, velocity = np.insert(phase, 0, 0.0), np.insert(velocity, 0, at_zero)
    return (*phase.tolist(), TURN), (*velocity.tolist(), float(velocity[0]))


def _conditions(comments: Sequence[str], wrong: Callable[..., Exception]) -> Conditions | None:
    """The conditions among the comments of a file; None when it has none."""
    found = [line.lstrip("# ") for line in comments if line.lstrip("# ").startswith("conditions =")]
    if not found:
        return None
    accepted = f"one line such as # {Conditions(frequency='16 Hz', gamma=0.3, angle='60 deg').line()}"
    try:
        (line,) = found
        return Conditions.model_validate(tomllib.loads(line)["conditions"])
    except (ValueError, ValidationError):  # two lines, no TOML, or not these keys
        raise wrong(" and ".join(found), accepted) from None
