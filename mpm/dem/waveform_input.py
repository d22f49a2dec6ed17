"""The waveform of a powder file: `[waveform]` with its `kind`."""

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from mpm.case.model import Frozen
from mpm.constants import GRAVITY
from mpm.units import Angle, Dimension, Frequency, Positive, worked_out

from .accelerometer import fit_record, read_record
from .waveform import Harmonic, HarmonicWaveform, Sawtooth, Waveform, from_table, seed_table_2_2, sine

Acceleration = Annotated[float, Dimension("m/s^2", "an acceleration", "10.581 m/s^2")]
Inclination = Annotated[float, Dimension("rad", "an angle", "60 deg", above=0.0, below=math.pi / 2)]


class SineInput(Frozen):
    """A pure sine of the vertical acceleration `gamma` g."""

    kind: Literal["sine"]
    """which waveform this is"""
    gamma: Positive
    """largest vertical acceleration over g"""
    frequency: Frequency
    """frequency of the vibration"""
    angle: Inclination = math.pi / 3
    """direction of the vibration, counted from angle_from"""
    angle_from: Literal["horizontal", "vertical"] = "horizontal"
    """what the angle is counted from"""

    def build(self, directory: Path) -> Waveform:
        return sine(gamma=self.gamma, frequency=self.frequency, angle=self.angle, angle_from=self.angle_from)


class SawtoothInput(Frozen):
    """The pseudo-sawtooth with the displacement of a sine of the vertical acceleration `gamma` g."""

    kind: Literal["sawtooth"]
    """which waveform this is"""
    gamma: Positive
    """largest vertical acceleration, over g, of the sine of the same displacement"""
    frequency: Frequency
    """frequency of the vibration"""
    angle: Inclination = math.pi / 4
    """direction of the vibration, counted from angle_from"""
    angle_from: Literal["horizontal", "vertical"] = "horizontal"
    """what the angle is counted from"""
    extension_ratio: Annotated[float, Dimension("", "f_a/f_1", "0.6667", above=0.5, below=1.0)] = 2.0 / 3.0
    """frequency of the slow half sine out over that of the cycle, f_a / f_1"""

    def build(self, directory: Path) -> Waveform:
        like = sine(gamma=self.gamma, frequency=self.frequency, angle=self.angle, angle_from=self.angle_from)
        x, z = (
            h[0].amplitude / (2.0 * math.pi * self.frequency) ** 2 for h in (like.horizontal, like.vertical)
        )
        return Sawtooth(horizontal=x, vertical=z, frequency=self.frequency, ratio=self.extension_ratio)


class SeedInput(Frozen):
    """The seed's table 2.2: the first `harmonics` of each direction, scaled to the fundamental `gamma` g."""

    kind: Literal["seed"]
    """which waveform this is"""
    harmonics: Annotated[int, Field(ge=1, le=3)] = 3
    """how many harmonics of each direction"""
    gamma: Positive | None = worked_out("as measured", None)
    """vertical acceleration of the fundamental over g, to which all are scaled"""

    def build(self, directory: Path) -> Waveform:
        full = seed_table_2_2()
        cut = HarmonicWaveform(
            full.horizontal[: self.harmonics], full.vertical[: self.harmonics], full.frequency
        )
        return cut if self.gamma is None else cut.scaled(self.gamma * GRAVITY / full.vertical[0].amplitude)


class HarmonicInput(Frozen):
    """One harmonic of an acceleration."""

    amplitude: Acceleration
    """amplitude of the acceleration"""
    frequency: Frequency
    """frequency of the harmonic"""
    phase: Angle = -math.pi / 2
    """phase in A cos(2 pi f t - phase)"""


class HarmonicsInput(Frozen):
    """Lists of harmonics, `[[waveform.horizontal]]` and `[[waveform.vertical]]`; A cos(2 pi f t - phase)."""

    kind: Literal["harmonics"]
    """which waveform this is"""
    frequency: Frequency
    """frequency of the cycle"""
    horizontal: tuple[HarmonicInput, ...]
    """harmonics of the acceleration along the reactor"""
    vertical: tuple[HarmonicInput, ...]
    """harmonics of the vertical acceleration"""

    def build(self, directory: Path) -> Waveform:
        horizontal, vertical = (
            tuple(Harmonic(amplitude=h.amplitude, frequency=h.frequency, phase=h.phase) for h in row)
            for row in (self.horizontal, self.vertical)
        )
        return HarmonicWaveform(horizontal, vertical, self.frequency).aligned()


class MeasuredInput(Frozen):
    """Accelerations from a CSV file of t, a_x, a_z: one period (`table`) or a record to be fitted."""

    kind: Literal["table", "accelerometer"]
    """one period as a table, or a record of an accelerometer that harmonics are fitted to"""
    file: str
    """path of the CSV file, relative to this one: columns t [s], a_y, a_z (along, vertical)"""
    harmonics: Annotated[int, Field(ge=1, le=64)] | None = worked_out("16 of a table, 3 of a record", None)
    """how many harmonics of each direction are kept"""
    unit: Literal["m/s^2", "g"] = "m/s^2"
    """unit of the accelerations in the file"""

    def build(self, directory: Path) -> Waveform:
        record = read_record(directory / self.file, self.unit)
        if self.kind == "accelerometer":
            return fit_record(record, self.harmonics or 3)[0]
        return from_table(record.t, record.acceleration, harmonics=self.harmonics or 16)


WaveformInput = Annotated[
    SineInput | SawtoothInput | SeedInput | HarmonicsInput | MeasuredInput, Field(discriminator="kind")
]
